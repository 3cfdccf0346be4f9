"""The cell: robot, controller, tools, frames and outputs, read from ``cell.toml`` over ``models/``.

A cell file may be partial; what it does not name comes from the default cell, the KR 300 R2500 ultra of
Hähn & Weigold 2020. Every key carries its unit; `sections` has the tables.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from gcode2krl import frames as fr
from gcode2krl import library
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.online_section import Online
from gcode2krl.sections import (
    Axis,
    Clearance,
    Compliance,
    Controller,
    EffectEntry,
    Frame,
    Frames,
    GuardInput,
    Home,
    Load,
    Material,
    Pilot,
    Program,
    ResultLimits,
    Robot,
    Section,
    Spindle,
    Stock,
    Table,
    Tool,
    Verified,
)
from gcode2krl.units import RAD_PER_DEG

DEFAULT_CELL = "kr300_demonstration"


class Cell(Section):
    """A resolved cell."""

    name: str = ""
    based_on: str = ""
    """The cell that this one takes over from: ``demonstration`` or another cell file."""
    verified: Verified | None = None
    robot: Robot
    controller: Controller
    tool: dict[int, Tool]
    mounted_tool: int | None = None
    """The tool in the spindle when the program starts without a T word."""
    frames: Frames
    work_offsets: dict[
        Literal["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"], Frame
    ] = Field(default_factory=dict)
    home: Home
    clearance: Clearance
    material: Material | None = None
    stock: Stock | None = None
    table: Table | None = None
    limits: ResultLimits = ResultLimits()
    load: Load
    compliance: Compliance = Compliance()
    pilot: Pilot = Pilot()
    online: Online = Online()
    spindle: Spindle
    effects: tuple[EffectEntry, ...] = ()
    guard_inputs: tuple[GuardInput, ...] = ()
    program: Program = Program()
    m_code: dict[str, str] = Field(default_factory=dict)
    """KRL (Jinja2) for each M-code, ``M3 = "…"``; what has no entry is refused."""
    tool_change: str = ""
    """KRL (Jinja2) that changes the tool on the clearance plane."""

    @property
    def clearance_z_mm(self) -> float | None:
        """Height of the clearance plane in ``$BASE``, None where the cell has none."""
        return None if self.clearance.z_mm == "none" else float(self.clearance.z_mm)

    def home_q_rad(self) -> NDArray[np.float64]:
        """Return HOME (6,) in radians."""
        return np.array(self.home.q_deg) * RAD_PER_DEG

    def base_matrix(self) -> NDArray[np.float64]:
        """Return ``$BASE`` in the robot root (4, 4)."""
        return self.frames.base.matrix()

    def tool_matrix(self, number: int) -> NDArray[np.float64]:
        """Return the tool frame (4, 4) in the flange whose z points from tip to holder.

        A tool of another length than ``frames.tool_length_mm`` has its tip shifted along that axis.
        """
        tool = self.tool[number]
        if tool.frame is not None:
            return tool.frame.matrix() @ controller_axes(tool.axis or "+z")
        longer_mm = 0.0 if tool.length_mm is None else tool.length_mm - self.frames.tool_length_mm
        shift = fr.transform([0.0, 0.0, -longer_mm], np.eye(3))
        return self.frames.tool.matrix() @ shift


def controller_axes(axis: Axis) -> NDArray[np.float64]:
    """Return Q (4, 4) that turns the inner tool frame (z = tip to holder) into the controller's axes.

    ``T_controller = T_inner · Q⁻¹``; Q maps z onto the controller's ``axis``.
    """
    turns = {
        "+z": (0, 0, 0),
        "-z": (0, 0, 180),
        "+x": (0, 90, 0),
        "-x": (0, -90, 0),
        "+y": (0, 0, -90),
        "-y": (0, 0, 90),
    }
    return fr.transform([0.0, 0.0, 0.0], np.round(fr.rotation_from_abc(np.array(turns[axis]) * RAD_PER_DEG)))


def load_cell(path: str | Path | None = None) -> Cell:
    """Read a cell file over the default cell; without a path, the default cell itself.

    Raises `NotUnderstoodError` that names file, key, what was found and what is allowed.
    """
    if path is None:
        return _default_cell()
    file = Path(path)
    return resolve_cell(library.read_toml(file), beside=file.parent, source=str(file))


def resolve_cell(data: dict[str, Any], beside: Path | None = None, source: str = "cell") -> Cell:
    """Lay ``data`` (a cell file as read) over the default cell, fill in the models, and check it."""
    merged = library.merge(library.read_model("cells", DEFAULT_CELL), data)
    merged.pop("model", None)
    for number, own in data.get("tool", {}).items():
        if isinstance(own, dict) and "model" in own:  # a new model replaces the default tool whole
            merged["tool"][number] = dict(own)
    own_material = data.get("material")
    if isinstance(own_material, dict) and own_material.keys() & {"model", "linear_edge", "kienzle"}:
        merged["material"] = dict(own_material)  # another material keeps nothing of the default one
    try:
        for section, kind in (("robot", "robots"), ("controller", "controllers"), ("material", "materials")):
            merged[section] = _fill_in(merged.get(section), kind, beside)
        _take_compliance_of_robot(merged)
        _find_file(merged.get("stock"), "mesh", beside)
        _find_file(merged.get("online"), "calibration", beside)
        tools = merged["tool"]
        merged["tool"] = {number: _fill_in(tool, "tools", beside) for number, tool in tools.items()}
        cell = Cell.model_validate(merged)
    except NotUnderstoodError as error:
        raise NotUnderstoodError(error.issues, source) from None
    except ValidationError as error:
        raise NotUnderstoodError(_validation_issues(error), source) from None
    return cell


def as_toml(cell: Cell) -> dict[str, Any]:
    """Return a resolved cell as plain tables; what is None is left out, as TOML has no null."""
    record = cell.model_dump(mode="json", exclude_none=True)
    record["tool"] = {str(number): tool for number, tool in record["tool"].items()}
    return record


def cell_from_resolved(record: dict[str, Any], source: str) -> Cell:
    """Return the cell that `as_toml` wrote, without laying it over anything."""
    try:
        return Cell.model_validate(record)
    except ValidationError as error:
        raise NotUnderstoodError(_validation_issues(error), source) from None


def cell_schema() -> dict[str, Any]:
    """Return the JSON schema of a cell file for editors; nothing is required, as a file may be partial."""
    schema = Cell.model_json_schema()
    _drop_required(schema)
    schema["title"] = "gcode2krl cell file"
    return schema


@lru_cache(maxsize=1)
def _default_cell() -> Cell:
    return resolve_cell({}, source="the default cell")


def _fill_in(section: Any, kind: str, beside: Path | None) -> Any:
    """Lay a section's own keys over the model it names."""
    if not isinstance(section, dict) or not isinstance(section.get("model"), str):
        return section
    found = library.read_model(kind, section["model"], beside)
    return {**library.merge(found, section), "model": found.get("model", section["model"])}


def _take_compliance_of_robot(merged: dict[str, Any]) -> None:
    """Move a robot model's virtual joints below the cell's own, which hold sensor and spindle."""
    robot = merged["robot"]
    if not isinstance(robot, dict) or "compliance" not in robot:
        return
    robot = dict(robot)
    below = robot.pop("compliance")
    merged["robot"] = robot
    merged["compliance"] = library.merge(below, merged.get("compliance", {}))


def _find_file(section: Any, key: str, beside: Path | None) -> None:
    """Make the path of a file that a section names one that holds wherever the command runs."""
    if isinstance(section, dict) and isinstance(section.get(key), str) and beside is not None:
        section[key] = str((beside / section[key]).resolve())


def _validation_issues(error: ValidationError) -> Iterator[Issue]:
    """Turn pydantic's findings into lines that name the key, what was found and what is allowed."""
    not_keys = ("literal[", "constrained-", "function-", "float", "int", "tuple")
    for detail in error.errors(include_url=False):
        key = ".".join(str(step) for step in detail["loc"] if not str(step).startswith(not_keys))
        message = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        if detail["type"] == "missing":
            text = f"{key}: missing"
        elif detail["type"] == "extra_forbidden":
            text = f"{key}: there is no such key"
        elif detail["type"] == "value_error":
            text = f"{key}: {message}"
        else:
            text = f"{key}: found {_brief(detail['input'])}, allowed: {message}"
        yield Issue("error", "cell-key", 0, text, "docs/cell.md and `gcode2krl models schema` list the keys")


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def _drop_required(node: Any) -> None:
    if isinstance(node, dict):
        if isinstance(node.get("required"), list):
            del node["required"]
        for child in node.values():
            _drop_required(child)
    elif isinstance(node, list):
        for child in node:
            _drop_required(child)
