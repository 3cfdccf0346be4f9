"""A cell file over the cell that it is ``based_on`` and over the models that it names, checked as a whole."""

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gcode2krl.cell import library
from gcode2krl.cell.base import DEMONSTRATION, StatedCell, Taken, lay_over_base, stated_keys
from gcode2krl.cell.confirmation import unconfirmed_of
from gcode2krl.cell.definition import CODES_WITHOUT_SIGNALS, Cell
from gcode2krl.cell.descriptions import NOT_OF_A_FILE
from gcode2krl.cell.key_lines import with_lines
from gcode2krl.cell.wrong_keys import contradictions, key_issue, split_pair_issues, validation_issues
from gcode2krl.errors import NotUnderstoodError

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
