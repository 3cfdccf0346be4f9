"""What a person confirmed of a cell, against what the cell says now.

The signature stands in the cell file, ``[verified]``: who confirmed which section when, the values that
the person was shown, hashes of the others, and a hash of each section over all of that. It guards against
careless edits; it keeps no secret, so it is no proof against somebody who computes it anew.
"""

import datetime
import hashlib
import json
import re
from collections.abc import Collection, Iterator
from typing import Any

from gcode2krl.cell.definition import Cell
from gcode2krl.cell.fingerprint import Values, section_of, values_by_section
from gcode2krl.cell.sections import SignedSection, Unconfirmed, Verified
from gcode2krl.errors import Issue

_NOT_SHOWN = re.compile(
    r"(?:robot\.(?:body|drives)|spindle\.body|compliance|material|effects|online(?!\.link))(?:\..*)?"
)
"""Long tables that no one compares number by number: a person is told of them, and their hashes are kept."""
_TIME_ZONES = datetime.timedelta(days=1)
"""In other time zones it may already be tomorrow."""
_ORDER = ("forged", "changed", "new", "removed", "unsigned")
_MOST_NAMED, _MOST_SIGNED = 8, 4
_MOST_OF_A_VALUE = 60
_BEFORE_DIFFERENCE = 20
_REMEDY = "if it is so at the cell: `gcode2krl models confirm CELL.toml`"
Digests = dict[str, str]
"""Dotted key → hash of its value."""


def is_shown(key: str) -> bool:
    """Tell whether a person confirms a key by its value, which the signature then repeats."""
    return _NOT_SHOWN.fullmatch(key) is None or " " in key or "," in key  # as the digests are separated


def unconfirmed_of(cell: Cell) -> tuple[Unconfirmed, ...] | None:
    """Return what of a cell differs from its signature, what weighs most first; None without a signature."""
    verified = cell.verified
    if verified is None or not verified.sections:
        return None
    values = values_by_section(cell)
    sections = sorted(values.keys() | verified.sections.keys())
    different = [one for section in sections for one in _differences(section, values, verified)]
    return tuple(sorted(different, key=lambda one: _ORDER.index(one.kind)))


def _differences(section: str, values: Values, verified: Verified) -> Iterator[Unconfirmed]:
    """Yield what of a section is not as it was confirmed."""
    signature, now = verified.sections.get(section), values.get(section, {})
    if signature is None:
        key = next(iter(now)) if len(now) == 1 else section
        yield Unconfirmed(key=key, kind="unsigned", now=_text(now[key]) if key in now else "")
        return
    who = {"by": signature.by or verified.by, "date": signature.date or verified.date}
    confirmed = confirmed_digests(section, verified)
    if signature.hash != _section_hash(section, who["by"], who["date"], confirmed):
        yield Unconfirmed(key=section, kind="forged", **who)
        return
    for key in sorted(confirmed.keys() | now.keys()):
        was = _text(verified.values[key]) if key in verified.values else ""
        if key not in now:
            yield Unconfirmed(key=key, kind="removed", was=was, **who)
        elif key not in confirmed:
            yield Unconfirmed(key=key, kind="new", now=_text(now[key]), **who)
        elif confirmed[key] != _digest(now[key]):
            yield Unconfirmed(key=key, kind="changed", now=_text(now[key]), was=was, **who)


def confirmed_digests(section: str, verified: Verified) -> Digests:
    """Return what a signature says of a section: the digest of each key."""
    listed = verified.digests.get(section, "")
    hidden = (pair.partition(" ") for pair in listed.split(", ") if listed)
    shown = {key: _digest(value) for key, value in verified.values.items() if section_of(key) == section}
    return {**{f"{section}.{key}": digest for key, _, digest in hidden}, **shown}


def signed(cell: Cell, by: str, date: str, sections: Collection[str]) -> Verified:
    """Return the signature of a cell of which a person confirmed ``sections``; other signatures stay.

    A section that the cell no longer has loses its signature: that it is gone was confirmed.
    """
    old = cell.verified if cell.verified is not None and cell.verified.sections else None
    values = values_by_section(cell)
    kept = {} if old is None else {name: sign for name, sign in old.sections.items() if name not in sections}
    keeps_first = old is not None and any(sign.by is None for sign in kept.values())
    first = (old.by, old.date) if old is not None and keeps_first else (by, date)
    listed = {} if old is None else {key: v for key, v in old.values.items() if section_of(key) in kept}
    hidden = {} if old is None else {name: text for name, text in old.digests.items() if name in kept}
    signatures: dict[str, SignedSection] = {}
    for name, sign in kept.items():
        signatures[name] = _by(sign.hash, (sign.by or first[0], sign.date or first[1]), first)
    for section in (name for name in sections if name in values):
        digests = {key: _digest(value) for key, value in values[section].items()}
        listed |= {key: value for key, value in values[section].items() if is_shown(key)}
        not_shown = [f"{key[len(section) + 1 :]} {digests[key]}" for key in digests if not is_shown(key)]
        if not_shown:
            hidden[section] = ", ".join(not_shown)
        signatures[section] = _by(_section_hash(section, by, date, digests), (by, date), first)
    return Verified(
        by=first[0],
        date=first[1],
        sections=dict(sorted(signatures.items())),
        values=dict(sorted(listed.items())),
        digests=dict(sorted(hidden.items())),
    )


def _by(digest: str, who: tuple[str, str], first: tuple[str, str]) -> SignedSection:
    """Return the signature of a section; who confirmed the cell is not repeated."""
    return SignedSection(hash=digest) if who == first else SignedSection(hash=digest, by=who[0], date=who[1])


def confirmation_issues(cell: Cell) -> list[Issue]:
    """Return why a cell is not confirmed; empty where it is."""
    if cell.is_confirmed:
        return []
    if cell.unconfirmed is None and cell.verified is not None and not cell.verified.sections:
        text = f"`verified` of {cell.verified.by} names no values; it would outlive any edit"
        return [Issue("warning", "cell-unsigned", 0, text, _REMEDY, key="verified")]
    different = cell.unconfirmed or ()
    issues = [
        Issue("warning", _code(value), 0, sentence_of(value), _REMEDY, key=_place(value.key))
        for value in different[:_MOST_NAMED]
    ]
    if len(different) > _MOST_NAMED:
        text = f"{len(different) - _MOST_NAMED} more values are not as they were confirmed"
        issues.append(Issue("warning", "cell-changed", 0, text, _REMEDY))
    if issues:
        return issues
    text = "the cell has not been confirmed by a person"
    remedy = "`gcode2krl models check` lists what to confirm"
    if cell.unconfirmed == ():
        count = len(cell.taken_over)
        text = f"no confirmation covers the {count} values that the cell takes over from another"
        remedy = "state in the cell file what `gcode2krl models check` lists as taken over, and confirm it"
    return [Issue("note", "cell-not-verified", 0, f"{text}; the program begins with a HALT", remedy)]


def changed_lines(cell: Cell) -> list[str]:
    """Return what is not as it was confirmed, a line each, as the header of a program names it."""
    different = cell.unconfirmed or ()
    lines = [sentence_of(one) for one in different[:_MOST_NAMED]]
    return lines + ([f"and {len(different) - _MOST_NAMED} more"] if len(different) > _MOST_NAMED else [])


def sentence_of(diff: Unconfirmed) -> str:
    """Return ``frames.base.x_mm is 1610.0; 1600.0 was confirmed by N. N. on 2026-11-28``."""
    who = f"confirmed by {diff.by} on {diff.date}"
    if diff.kind == "forged":
        return f"the signature of {diff.key} does not fit what it signs: it was edited after it was {who}"
    if diff.kind == "unsigned":
        value = f" is {_around(diff.now, '')};" if diff.now else ":"
        return f"{diff.key}{value} nobody has confirmed it"
    if diff.kind == "new":
        return f"{diff.key} is {_around(diff.now, '')}; it was not there when the section was {who}"
    if diff.kind == "removed":
        return f"{diff.key} is gone; {_around(diff.was, '') or 'a value'} was {who}"
    is_now, was = _around(diff.now, diff.was), _around(diff.was, diff.now) or "another value"
    return f"{diff.key} is {is_now}; {was} was {who}"


def signers(verified: Verified) -> list[str]:
    """Return who confirmed what: the person of the cell, then those of single sections."""
    others: dict[str, list[str]] = {}
    for section, sign in verified.sections.items():
        if sign.by is not None:
            others.setdefault(f"{sign.by} on {sign.date or verified.date}", []).append(section)
    named = {
        who: ", ".join(sections[:_MOST_SIGNED]) + (", …" if len(sections) > _MOST_SIGNED else "")
        for who, sections in others.items()
    }
    return [f"{verified.by} on {verified.date}", *(f"{who} ({words})" for who, words in named.items())]


def future_confirmation(cell: Cell, today: datetime.date | None = None) -> tuple[Issue, ...]:
    """Return a warning where ``verified`` names a future day; ``today`` is by default the clock's.

    Only commands check this: no written file may depend on the date.
    """
    if cell.verified is None:
        return ()
    today = today if today is not None else datetime.datetime.now(datetime.UTC).date()
    days = [cell.verified.date, *(sign.date for sign in cell.verified.sections.values() if sign.date)]
    last = max(days)
    if datetime.date.fromisoformat(last) <= today + _TIME_ZONES:
        return ()
    text = f"verified.date = {last} is in the future (today is {today})"
    remedy = "write the day on which verified.by confirmed the cell, or set this computer's clock"
    return (Issue("warning", "verified-future", 0, text, remedy, key="verified.date"),)


def _place(key: str) -> str:
    """Return a key as `key_lines` has it, which counts the tables of a list from 0."""
    if key.startswith("tool."):
        return key
    return re.sub(r"(?<=\.)\d+(?=\.|$)", lambda number: str(int(number[0]) - 1), key)


def _code(unconfirmed: Unconfirmed) -> str:
    return "cell-unsigned" if unconfirmed.kind == "forged" else "cell-changed"


def _digest(value: Any) -> str:
    """Return the first 8 hexadecimal digits of the SHA-256 of a value as JSON."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:8]


def _section_hash(section: str, by: str, date: str, digests: Digests) -> str:
    content = json.dumps([section, by, date, digests], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:12]


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)


def _around(text: str, other: str) -> str:
    """Return a value on a short line: of a long one the place where it differs from another."""
    pairs = zip(text, other, strict=False)
    same = next((place for place, (one, another) in enumerate(pairs) if one != another), 0)
    start = max(0, same - _BEFORE_DIFFERENCE) if len(text) > _MOST_OF_A_VALUE else 0
    part = text[start : start + _MOST_OF_A_VALUE]
    return f"{'…' if start else ''}{part}{'…' if start + _MOST_OF_A_VALUE < len(text) else ''}"
