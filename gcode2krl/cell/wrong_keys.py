"""What is wrong in a cell file: keys and values that are not allowed, and what only several keys show."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from gcode2krl.cell import carriers, ranges, switching
from gcode2krl.cell.base import StatedCell, split_pairs
from gcode2krl.cell.contradictions import contradictory
from gcode2krl.cell.definition import Cell, plain_view
from gcode2krl.cell.descriptions import NOT_OF_A_FILE, sections_in
from gcode2krl.codes import closest
from gcode2krl.errors import Issue

# The key of a cell that a mistyped one most likely means: the closest key of its section.


def meant_key(cell: type[BaseModel], place: Sequence[str | int]) -> str:
    """Return the dotted key that an unknown key at ``place`` most likely means; empty if none is close."""
    *above, last = place
    kinds: list[type[BaseModel]] = [cell]
    written: list[str] = []
    for step in above:
        below = [kind.model_fields[str(step)].annotation for kind in kinds if str(step) in kind.model_fields]
        if below:  # else the number of a tool, an entry of a list or the name of a work offset
            kinds = [model for annotation in below for model in sections_in(annotation)]
        written.append(str(step))
    known = [name for kind in kinds for name in kind.model_fields if name not in NOT_OF_A_FILE]
    without_unit = [name for name in known if name.rpartition("_")[0] == str(last)]
    near = without_unit[0] if without_unit else closest(str(last), known)
    return ".".join([*written, near]) if near else ""


_MOST_ISSUES = 100
_KEYS_LISTED = "docs/cell.md and `gcode2krl models schema` list the keys"


def validation_issues(error: ValidationError) -> Iterator[Issue]:
    """Turn pydantic's findings into lines that name the key, what was found and what is allowed."""
    not_keys = ("literal[", "constrained-", "function-", "float", "int", "tuple", "[key]")
    for detail in error.errors(include_url=False)[:_MOST_ISSUES]:
        place = [step for step in detail["loc"] if not str(step).startswith(not_keys)]
        key = ".".join(str(step)[:80] for step in place)
        remedy = ""
        message = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        if detail["type"] == "missing":
            text = "missing"
        elif detail["type"] == "extra_forbidden":
            text = "there is no such key"
            remedy = _did_you_mean(place)
        elif detail["type"] == "value_error":
            text = message
        else:
            text = f"found {_brief(detail['input'])}, allowed: {message}"
        yield key_issue(key, text, remedy)


def contradictions(cell: Cell, stated: frozenset[str]) -> Iterator[Issue]:
    """Yield errors that only several keys together show: impossible sizes, half pairs, double meanings."""
    impossible = [issue for issue in ranges.range_issues(cell) if issue.severity == "error"]
    yield from impossible
    if cell.mounted_tool is not None and cell.mounted_tool not in cell.tool:
        number = cell.mounted_tool
        yield key_issue("mounted_tool", f"found {number}, and the cell has no [tool.{number}]")
    base_on = cell.frames.base_on
    if base_on is not None and (base_on not in cell.external or cell.external[base_on].is_rail):
        yield key_issue("frames.base_on", f"found {base_on}, and there is no table [external.{base_on}]")
    yield from (key_issue(*wrong) for wrong in carriers.contradictions(cell.external, base_on))
    yield from _obstacle_issues(cell)
    templates = cell.templates()
    view = {"cell": plain_view(cell), "spindle": cell.spindle.model_dump()} if templates else {}
    texts = switching.texts_without_words(templates, view)
    yield from (issue for issue in switching.pair_issues(templates, view) if issue.severity == "error")
    yield from switching.meaning_issues(texts, _named_outputs(cell, stated), _named_inputs(cell))
    if not impossible:  # such a value contradicts others as well
        yield from (issue for issue in contradictory(cell) if issue.severity == "error")


def split_pair_issues(stated: StatedCell) -> Iterator[Issue]:
    """Yield pairs of a frame and its number of which the file states one and its base the other."""
    whose = {taken.key: taken.source for taken in stated.taken}
    for number, frame in split_pairs(stated):
        stated_key, other = (number, frame) if number not in whose else (frame, number)
        yield Issue(
            "error",
            "frame-split",
            0,
            f"{stated_key} is stated here, and {other}, which belongs to it, comes from {whose[other]!r}",
            f"state {number} and {frame} in one file, as the controller has them",
            key=stated_key,
        )


def _obstacle_issues(cell: Cell) -> Iterator[Issue]:
    """Yield obstacles with the name of another one, and meshes that are not there."""
    names: set[str] = set()
    for number, obstacle in enumerate(cell.obstacle):
        if obstacle.name in names:
            yield key_issue(f"obstacle.{number}.name", f"{obstacle.name!r} names two obstacles")
        names.add(obstacle.name)
        if obstacle.mesh is not None and not Path(obstacle.mesh).is_file():
            words = f"there is no file {Path(obstacle.mesh).name!r}"
            yield key_issue(f"obstacle.{number}.mesh", words, "give its path relative to the cell file")


def _named_outputs(cell: Cell, stated: frozenset[str]) -> dict[str, int | None]:
    """Return key → output of all keys that name one; those of ``[online.link]`` only if it is stated."""
    spindle, link = cell.spindle, cell.online.link
    named = {
        f"spindle.{key}": getattr(spindle, key)
        for key in ("run_cw_output", "run_ccw_output", "flood_output", "mist_output")
    }
    return named | {
        f"online.link.{key}": getattr(link, key)
        for key in ("t1_output", "ready_output")
        if any(name.startswith("online.link.") for name in stated)
    }


def _named_inputs(cell: Cell) -> dict[str, int | None]:
    guards = {f"guard_inputs ({item.meaning})": item.number for item in cell.guard_inputs}
    return {"spindle.at_speed_input": cell.spindle.at_speed_input, **guards}


def _did_you_mean(place: list[str | int]) -> str:
    near = meant_key(Cell, place) if place else ""
    return f"did you mean {near}? {_KEYS_LISTED}" if near else ""


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def key_issue(key: str, text: str, remedy: str = "") -> Issue:
    """Return the finding of a key that is wrong."""
    return Issue("error", "cell-key", 0, f"{key}: {text}", remedy or _KEYS_LISTED, key=key)
