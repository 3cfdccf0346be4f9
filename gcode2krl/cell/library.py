"""The model library: finds and reads the TOML files of ``models/``, from a checkout and from a wheel."""

import contextlib
import copy
import re
import tomllib
from collections.abc import Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from gcode2krl.errors import input_error

MOST_BYTES = 4_000_000
"""Largest file; a cell with 1,000 tools has 0.2 MB."""
MOST_LEVELS = 32
"""The deepest table of a cell has 5 levels; the time of `tomllib` grows with the square of a key's parts."""
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"]*+"|'[^']*+')"""
_MANY_DOTS = re.compile(rf"(?<![A-Za-z0-9_\-\"'])(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_LEVELS}}}")
_PLAIN_MODEL = re.compile(r'model = "([^"\\\x00-\x1f\x7f\ufffd]*)"\n')
"""A first line that TOML could not read otherwise."""
_LONGEST_LINE = 1000
_AT_LINE = re.compile(r"at line (\d{1,9}), (?=column \d+\)$)")
"""How `tomllib` says where it stopped."""
_REACH = re.compile(r"\bR\s*(\d{3,4})")
_PAYLOAD = re.compile(r"\bKR\s*(\d+)")
"""Numbers in a robot's name."""
KINDS = ("robots", "controllers", "tools", "materials", "cells")


@cache
def models_folder() -> Path:
    """Return the folder ``models/``: inside the installed package, else beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def names(kind: str) -> dict[str, Path]:
    """Return model name → file for one kind (one of `KINDS`)."""
    return dict(_names(models_folder() / kind))


@lru_cache(maxsize=len(KINDS))
def _names(folder: Path) -> dict[str, Path]:
    return {_model_of(file): file for file in sorted(folder.glob("*.toml"))}


def _model_of(file: Path) -> str:
    """Return the model that a file of the library is; it is parsed only if its first key does not say it."""
    first_line = ""
    with contextlib.suppress(OSError), file.open(encoding="utf-8", errors="replace") as stream:
        first_line = stream.readline(_LONGEST_LINE)
    stated = _PLAIN_MODEL.fullmatch(first_line)
    return stated[1] if stated else str(_of_library(file).get("model", file.stem))


@lru_cache(maxsize=256)
def _of_library(file: Path) -> dict[str, Any]:
    """Return a file of the library; it is read once, as it does not change while a command runs."""
    return read_toml(file)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises `NotUnderstoodError` naming the file and line where it cannot."""
    return parse_toml(read_text(path), str(path))


def read_text(path: Path) -> str:
    """Read a cell or model file as text; raises `NotUnderstoodError` naming the file where it cannot."""
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise input_error(
            "file-unreadable", f"cannot read: {why}", "name a file that is there", source=str(path)
        ) from None
    if len(data) > MOST_BYTES:
        raise input_error(
            "file-too-large",
            f"more than {MOST_BYTES // 1_000_000} MB: not a model or cell file",
            "name the right file",
            source=str(path),
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise input_error(
            "not-utf8", f"byte {error.start} is not UTF-8", "save it as UTF-8", source=str(path)
        ) from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Parse TOML in bounded time; raises `NotUnderstoodError` if it is not TOML or nested too deeply."""
    remedy = "see docs/cell.md for the format"
    for number, line in enumerate(text.split("\n"), start=1):
        if _MANY_DOTS.search(line):
            sentence = f"a key of more than {MOST_LEVELS} parts: nested too deeply"
            raise input_error("not-toml", sentence, remedy, line=number, source=source)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise input_error("not-toml", "nested too deeply", remedy, source=source) from None
    except ValueError as error:  # a TOMLDecodeError, or a number of thousands of digits
        place = _AT_LINE.search(str(error))
        sentence = _AT_LINE.sub("", str(error))[:200]
        raise input_error(
            "not-toml", sentence, remedy, line=int(place[1]) if place else 0, source=source
        ) from None
    if _levels(tables) > MOST_LEVELS:
        raise input_error("not-toml", f"more than {MOST_LEVELS} levels", remedy, source=source)
    return tables


def _levels(table: dict[str, Any]) -> int:
    """Return how deeply tables and lists are nested, counting stops just beyond the limit."""
    level = 0
    here: list[dict[str, Any] | list[Any]] = [table]
    while here and level <= MOST_LEVELS:
        level += 1
        inside = (part for one in here for part in (one.values() if isinstance(one, dict) else one))
        here = [part for part in inside if isinstance(part, dict | list)]
    return level


def read_model(kind: str, model: str, folder: Path | None = None) -> dict[str, Any]:
    """Read one model by its name, or by a path ending in ``.toml`` relative to the file that names it."""
    if model.endswith(".toml"):
        return read_toml((folder or Path()) / model)
    known = names(kind)
    by_folded_name = {_fold(name): file for name, file in known.items()}
    file = by_folded_name.get(_fold(model))
    if file is None:
        if kind == "robots":
            remedy = robot_meant(model, list(known))
        else:
            import difflib

            near = difflib.get_close_matches(_fold(model), by_folded_name, n=1, cutoff=0.0)
            meant = [name for name in known if _fold(name) in near]
            remedy = f"did you mean {meant[0]!r}?" if meant else "see the library"
        raise input_error(
            "model-unknown", f"{kind[:-1]}.model: found {model[:60]!r}, allowed: {', '.join(known)}", remedy
        )
    return copy.deepcopy(_of_library(file))


def robot_meant(model: str, known: Sequence[str]) -> str:
    """Return the remedy for a robot that is not in the library.

    Only arms of the stated reach and payload are offered: another arm's lengths would be a wrong program.
    """
    reach, payload = _REACH.search(model.upper()), _PAYLOAD.search(model.upper())

    def is_same(name: str) -> bool:
        its_reach, its_payload = _REACH.search(name.upper()), _PAYLOAD.search(name.upper())
        same_reach = reach is None or (its_reach is not None and its_reach[1] == reach[1])
        return same_reach and payload is not None and its_payload is not None and its_payload[1] == payload[1]

    meant = [name for name in known if is_same(name)]
    if len(meant) == 1 and reach is not None:
        return f"did you mean {meant[0]!r}?"
    if meant:
        return f"by its payload it may be one of {', '.join(meant)}: see the plate on the arm"
    if reach is None:
        import difflib

        of_no_reach = {_fold(name): name for name in known if not _REACH.search(name.upper())}
        for near in difflib.get_close_matches(_fold(model), of_no_reach, n=1, cutoff=0.8):
            return f"did you mean {of_no_reach[near]!r}?"
    return (
        "the arms of the library have other lengths: `gcode2krl init --controller arm.urdf`, or "
        '`gcode2krl init` with its data sheet, or model = "my.toml"'
    )


def merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``over`` laid on top, table by table."""
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        both_tables = isinstance(below, dict) and isinstance(value, dict)
        merged[key] = merge(below, value) if both_tables and isinstance(below, dict) else value
    return merged


def _fold(name: str) -> str:
    return "".join(name.split()).casefold()
