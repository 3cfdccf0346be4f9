"""The one table of finding codes, read from ``codes.toml``: what each means and what to do about it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

_FILE = Path(__file__).with_name("codes.toml")


@dataclass(frozen=True, slots=True)
class Code:
    """What is known of one finding code; the keys of ``codes.toml``, described at its head."""

    name: str
    severity: str
    why: str
    example: str
    remedy: str
    allow: str
    follows: tuple[str, ...] = ()
    """Codes of findings that may be the cause of this one; see `follows`."""


@cache
def all_codes() -> Mapping[str, Code]:
    """Return code name → entry, in alphabetical order."""
    return MappingProxyType(_entries(_text()))


@cache
def code_of(name: str) -> Code | None:
    """Return the entry of a code, None for an unknown one."""
    # a run tells a few findings: parsing their tables alone takes a hundredth of the time of the whole file
    _, head, behind = _text().partition(f"\n[{name}]\n")
    return _entries(head + behind.partition("\n[")[0])[name] if head else None


@cache
def _text() -> str:
    return _FILE.read_text(encoding="utf-8")


def _entries(text: str) -> dict[str, Code]:
    import tomllib

    return {
        name: Code(name, **{**entry, "follows": tuple(entry.get("follows", ()))})
        for name, entry in tomllib.loads(text).items()
    }


@cache
def follows(name: str) -> frozenset[str]:
    """Return the codes that may cause this one, over any number of steps; empty for an unknown code."""
    causes: set[str] = set()
    waiting = [name]
    while waiting:
        entry = code_of(waiting.pop())
        new = set(entry.follows) - causes if entry is not None else set()
        causes |= new
        waiting += new
    return frozenset(causes - {name})


def closest(name: str, known: Iterable[str]) -> str:
    """Return the known name that a mistyped one most likely means, empty where none is near."""
    import difflib

    near = difflib.get_close_matches(name, list(known), n=1)
    return near[0] if near else ""
