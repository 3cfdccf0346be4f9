"""What can be wrong with a line of G-code: the rows of ``findings.toml``, numbered for the core.

The file says what its columns are. It is read when something is found, as a program without findings needs
none of it: ``findings.F`` and the other tables of numbers are made when they are first asked for.
"""

import tomllib
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

from gcode2krl.errors import Severity

_FILE: Final = Path(__file__).with_name("findings.toml")
TABLES: Final = ("F", "FC", "FO", "FP", "FM")
"""Tables of findings, whose numbers go on from one to the next; each is the prefix of its names in C."""
FAULTS: Final = "PF"
"""Prefix of the faults of expressions and O-words, each kind of which has numbers of its own."""
ANY_WORD: Final = r"[^\s/]"


class FindingKind(NamedTuple):
    """One kind of finding; `sentence` and `remedy` are filled in by `gcode2krl.gcode.sentences`."""

    name: str
    """Table and name, as F.NO_FEED."""
    code: str
    sentence: str
    remedy: str
    culprit: str = ANY_WORD
    severity: Severity = "error"
    column: bool = False


@cache
def read() -> dict[str, Any]:
    """Return the file as it stands."""
    return tomllib.loads(_FILE.read_text(encoding="utf-8"))


@cache
def all_findings() -> dict[int, FindingKind]:
    """Return number → finding."""
    rows = ((f"{table}.{name}", row) for table in TABLES for name, row in read()[table].items())
    return {number: FindingKind(name, **row) for number, (name, row) in enumerate(rows) if row}


def warnings() -> tuple[int, ...]:
    """Return the numbers of the findings that are no errors."""
    return tuple(number for number, finding in all_findings().items() if finding.severity != "error")


def __getattr__(name: str) -> SimpleNamespace:
    """Return the numbers of a table, by name: ``findings.F.NO_FEED``."""
    if name not in (*TABLES, FAULTS):
        raise AttributeError(name)
    return _numbers(name)


@cache
def _numbers(name: str) -> SimpleNamespace:
    if name == FAULTS:
        return SimpleNamespace(**{word: k for kind in read()[FAULTS].values() for k, word in enumerate(kind)})
    first = sum(len(read()[table]) for table in TABLES[: TABLES.index(name)])
    return SimpleNamespace(**{word: first + k for k, word in enumerate(read()[name])})


def fault(kind: str, number: int) -> tuple[str, str]:
    """Return what is wrong with an ``expression``, a ``value`` or an ``o_word``, and the remedy."""
    faults = list(read()[FAULTS][kind].values())
    sentence, remedy = faults[number if number in range(len(faults)) else 0]
    return sentence, remedy


def unsupported(letter: str, number: float) -> tuple[str, str]:
    """Return why a G- or M-code is not read, and the remedy; a reason holds up to the next one."""
    reasons = {float(code): reason for code, reason in read()[f"unsupported_{letter}"].items()}
    why, remedy = reasons[max(code for code in reasons if code <= number)]
    return why, remedy
