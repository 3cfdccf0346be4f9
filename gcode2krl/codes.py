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
    import tomllib

    with _FILE.open("rb") as stream:
        table = tomllib.load(stream)
    entries = (
        Code(name, **{**entry, "follows": tuple(entry.get("follows", ()))}) for name, entry in table.items()
    )
    return MappingProxyType({entry.name: entry for entry in entries})


@cache
def follows(name: str) -> frozenset[str]:
    """Return the codes that may cause this one, over any number of steps; empty for an unknown code."""
    known = all_codes()
    causes: set[str] = set()
    waiting = [name]
    while waiting:
        entry = known.get(waiting.pop())
        new = set(entry.follows) - causes if entry is not None else set()
        causes |= new
        waiting += new
    return frozenset(causes - {name})


def closest(name: str, known: Iterable[str]) -> str:
    """Return the known name that a mistyped one most likely means, empty where none is near."""
    import difflib

    near = difflib.get_close_matches(name, list(known), n=1)
    return near[0] if near else ""
