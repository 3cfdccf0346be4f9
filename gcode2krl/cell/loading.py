"""A cell file over the cell that it is ``based_on`` and over the models that it names, checked as a whole."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from gcode2krl.cell import carriers, library, ranges, switching
from gcode2krl.cell.base import DEMONSTRATION, StatedCell, Taken, lay_over_base, split_pairs, stated_keys
from gcode2krl.cell.confirmation import unconfirmed_of
from gcode2krl.cell.contradictions import contradictory
from gcode2krl.cell.definition import CODES_WITHOUT_SIGNALS, Cell, plain_view
from gcode2krl.cell.descriptions import NOT_OF_A_FILE, sections_in
from gcode2krl.cell.key_lines import with_lines
from gcode2krl.codes import closest
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.files.there import is_there

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
        if obstacle.mesh is not None and not is_there(obstacle.mesh):
            words = f"there is no file {Path(obstacle.mesh).name[:80]!r}"
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


_REACHING = ("controller", "machine", "frames", "load", "spindle", "program", "pilot", "online")
"""Sections with defaults that go into a program."""
_MODELS = (("robot", "robots"), ("controller", "controllers"), ("material", "materials"))
_CUTTER = ("kind", "diameter_mm", "teeth", "corner_radius_mm", "helix_deg", "taper_deg", "point_deg")


def load_cell(path: str | Path | None = None) -> Cell:
    """Read a cell file and the cell it is ``based_on``, if any; without a path, the demonstration cell.

    Raises `NotUnderstoodError` that names file, key, what was found and what is allowed.

    >>> from gcode2krl import load_cell
    >>> cell = load_cell("cell.toml")
    >>> cell.stock.box_mm[1][2]
    0.0
    """
    if path is None:
        return _default_cell()
    file = Path(path)
    text = library.read_text(file)
    data = library.parse_toml(text, str(file))
    try:
        return resolve_cell(data, folder=file.parent, source=str(file))
    except NotUnderstoodError as error:
        if error.source != str(file):
            raise
        raise NotUnderstoodError(with_lines(error.issues, text), error.source) from None


def resolve_cell(data: dict[str, Any], folder: Path | None = None, source: str = "cell") -> Cell:
    """Lay ``data`` (a cell file as read) over its base, fill in the models, and check it."""
    seen = (Path(source).resolve(),) if folder is not None else ()
    try:
        _refuse_keys_of_tools(data)
        stated = lay_over_base(data, folder, source, _is_confirmed, seen)
        cell = _filled_in(stated)
    except NotUnderstoodError as error:
        raise NotUnderstoodError(error.issues, error.source or source) from None
    except ValidationError as error:
        raise NotUnderstoodError(validation_issues(error), source) from None
    wrong = (*split_pair_issues(stated), *contradictions(cell, stated_keys(stated.data)))
    if wrong:
        raise NotUnderstoodError(wrong, source)
    return cell


def _filled_in(stated: StatedCell) -> Cell:
    """Return a cell with the models that it names, its defaults, and what of it is not as confirmed."""
    merged = dict(stated.data)
    known = stated_keys(merged)
    for section, kind in _MODELS:
        if section in merged:
            merged[section] = _fill_in(merged[section], kind)
    _take_compliance_of_robot(merged)
    if isinstance(merged.get("tool"), dict):
        merged["tool"] = {number: _fill_in_tool(tool) for number, tool in merged["tool"].items()}
    own_codes = merged.get("m_code", {})
    if isinstance(own_codes, dict):
        merged["m_code"] = {**CODES_WITHOUT_SIGNALS, **own_codes}
    merged["taken_over"] = [_record(taken) for taken in stated.taken]
    cell = Cell.model_validate(merged)
    whole = {"defaults": tuple(_defaults(cell, known)), "unconfirmed": unconfirmed_of(cell)}
    return cell.model_copy(update=whole)


def _is_confirmed(stated: StatedCell) -> bool:
    """Tell whether a base is as a person confirmed it; one that is no cell by itself is not."""
    try:
        return _filled_in(stated).is_confirmed
    except (NotUnderstoodError, ValidationError):
        return False


def cell_from_resolved(record: dict[str, Any], source: str) -> Cell:
    """Return the cell that `as_toml` wrote, without laying it over anything."""
    try:
        return Cell.model_validate(record)
    except ValidationError as error:
        raise NotUnderstoodError(validation_issues(error), source) from None


@lru_cache(maxsize=1)
def _default_cell() -> Cell:
    return resolve_cell(library.read_model("cells", DEMONSTRATION), source="the demonstration cell")


def _fill_in(section: Any, kind: str) -> Any:
    """Lay a section's own keys over the model it names."""
    if not isinstance(section, dict) or not isinstance(section.get("model"), str) or not section["model"]:
        return section
    model = library.read_model(kind, section["model"])
    if kind == "materials" and section.keys() & {"linear_edge", "kienzle"}:
        model = {key: value for key, value in model.items() if key not in ("linear_edge", "kienzle")}
    if "trafo_name" in section:  # its source is the cell file, not the library
        model = {key: value for key, value in model.items() if key not in ("trafo_source", "trafo_sure")}
    return {**library.merge(model, section), "model": model.get("model", section["model"])}


def _fill_in_tool(tool: Any) -> Any:
    """Lay a tool over its model; if its cutter differs from the model's, its name gets '(changed)'."""
    filled = _fill_in(tool, "tools")
    if filled is tool or not isinstance(filled, dict):
        return filled
    model = library.read_model("tools", tool["model"])
    if any(key in tool and tool[key] != model.get(key) for key in _CUTTER):
        filled["model"] = f"{filled['model']} (changed)"
    return filled


def _refuse_keys_of_tools(data: Mapping[str, Any]) -> None:
    """Raise where a key is one that only a resolved cell has, or a tool's number is not written plainly.

    ``[tool.01]`` beside ``[tool.1]`` would be the same tool twice, and one of them would be lost.
    """
    for key in NOT_OF_A_FILE:
        if key in data:
            raise NotUnderstoodError(key_issue(key, "there is no such key"))
    tools = data.get("tool")
    for number in tools if isinstance(tools, dict) else ():
        if not re.fullmatch(r"[1-9][0-9]{0,4}", str(number), re.ASCII):
            raise NotUnderstoodError(
                key_issue(f"tool.{number}"[:45], "not a tool number, allowed: 1 to 99999")
            )


def _defaults(cell: Cell, stated: frozenset[str]) -> Iterator[str]:
    """Yield the dotted keys of documented defaults, in the sections that a program depends on."""
    record = cell.model_dump(mode="json", include=set(_REACHING), exclude_none=True)
    for key in sorted(stated_keys(record)):
        value = key.rpartition(".")[2]
        whole = any(key.startswith(f"{name}.") for name in stated)  # a list or frame that is stated whole
        if key not in stated and not whole and value not in ("source", "sure", "model"):
            yield key
    yield from (f"m_code.{code}" for code in CODES_WITHOUT_SIGNALS if f"m_code.{code}" not in stated)
    for number, tool in cell.tool.items():
        if tool.frame is not None and tool.axis is None:
            yield f"tool.{number}.axis"
        if tool.frame is None and tool.length_mm is not None and f"tool.{number}.length_mm" not in stated:
            yield f"tool.{number}.length_mm"


def _record(taken: Taken) -> dict[str, Any]:
    return {"key": taken.key, "value": taken.value, "source": taken.source, "verified": taken.verified}


def _take_compliance_of_robot(merged: dict[str, Any]) -> None:
    """Move a robot model's virtual joints below the cell's own, which hold sensor and spindle."""
    robot = merged.get("robot")
    if not isinstance(robot, dict) or "compliance" not in robot:
        return
    robot = dict(robot)
    below = robot.pop("compliance")
    merged["robot"] = robot
    section = merged.get("compliance", {})
    if isinstance(below, dict) and isinstance(section, dict):
        merged["compliance"] = library.merge(below, section)
