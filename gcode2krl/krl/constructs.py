"""Which KRL and RSI our files have, and how far each construct is known: the table ``constructs.toml``."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

_FILE = Path(__file__).with_name("constructs.toml")


@dataclass(frozen=True)
class Construct:
    """A row of the table; the keys are described at the head of ``constructs.toml``."""

    name: str
    pattern: str
    relies: str
    source: tuple[str, ...]
    sure: str
    since: str
    look: str = ""

    @cached_property
    def form(self) -> re.Pattern[str]:
        """How it looks in a line."""
        return re.compile(self.pattern, re.IGNORECASE | re.MULTILINE)


@cache
def all_constructs() -> tuple[Construct, ...]:
    """Return the table."""
    rows = _table()["construct"]
    return tuple(Construct(**{**row, "source": tuple(row["source"])}) for row in rows)


@cache
def sources() -> Mapping[str, str]:
    """Return short name → what it is, of the sources that the table names."""
    return MappingProxyType(_table()["source"])


def assumed_in(texts: Iterable[str]) -> list[str]:
    """Return what to look at in T1, of the constructs in files that nothing public confirms."""
    known = [text.replace("\r", "") for text in texts]
    assumed = (each for each in all_constructs() if each.sure == "assumed")
    return [each.look for each in assumed if any(each.form.search(text) for text in known)]


@cache
def _table() -> dict[str, Any]:
    import tomllib

    with _FILE.open("rb") as stream:
        return tomllib.load(stream)
