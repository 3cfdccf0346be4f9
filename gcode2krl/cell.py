"""The cell: robot, controller, tools, frames and outputs, read from ``cell.toml`` over ``models/``.

A cell file may be partial; what it does not name comes from the default cell, the KR 300 R2500 ultra of
Hähn & Weigold 2020. Every key carries its unit.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from gcode2krl import frames as fr
from gcode2krl import library
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.units import RAD_PER_DEG

DEFAULT_CELL = "kr300_demonstration"
Sure = Literal["verified", "checked", "memory", "assumption", "unknown"]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
SixFloats = Annotated[tuple[Finite, ...], Field(min_length=6, max_length=6)]
DataNumber = Annotated[int, Field(ge=1, le=32)]
SignalNumber = Annotated[int, Field(ge=1, le=8192)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Provenance(_Section):
    """Where values come from and how sure they are."""

    source: str = ""
    sure: Sure = "assumption"


class Frame(_Section):
    """A KUKA frame: position in mm and A, B, C in degrees (Rz·Ry·Rx)."""

    x_mm: Finite = 0.0
    y_mm: Finite = 0.0
    z_mm: Finite = 0.0
    a_deg: Finite = 0.0
    b_deg: Finite = 0.0
    c_deg: Finite = 0.0

    def matrix(self) -> NDArray[np.float64]:
        """Return the homogeneous transform (4, 4)."""
        abc = np.array([self.a_deg, self.b_deg, self.c_deg]) * RAD_PER_DEG
        return fr.transform([self.x_mm, self.y_mm, self.z_mm], fr.rotation_from_abc(abc))


class Geometry(Provenance):
    """Lengths of an ortho-parallel arm with spherical wrist (b = 0), in mm."""

    a1_mm: Finite
    a2_mm: Finite
    c1_mm: Finite
    c2_mm: Positive
    c3_mm: Positive
    c4_mm: Positive

    def array(self) -> NDArray[np.float64]:
        """Return a1, a2, c1, c2, c3, c4 (6,) in mm."""
        return np.array([self.a1_mm, self.a2_mm, self.c1_mm, self.c2_mm, self.c3_mm, self.c4_mm])


class Limits(Provenance):
    """Software limits of the joints, low and high, in degrees; None where no source is known."""

    q_deg: Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=6, max_length=6)] | None = None

    @field_validator("q_deg")
    @classmethod
    def _ordered(
        cls, pairs: tuple[tuple[float, float], ...] | None
    ) -> tuple[tuple[float, float], ...] | None:
        for number, (low, high) in enumerate(pairs or (), start=1):
            if low >= high:
                raise ValueError(f"A{number}: low {low} is not below high {high}")
        return pairs


class Speeds(Provenance):
    """Largest joint speeds in degrees per second; None where no source is known."""

    qd_deg_s: Annotated[tuple[Positive, ...], Field(min_length=6, max_length=6)] | None = None


class Payload(Provenance):
    """Rated payload and figures of the data sheet."""

    mass_kg: Positive | None = None
    reach_mm: Positive | None = None
    repeatability_mm: Positive | None = None


class Drives(Provenance):
    """Gears, motors and masses, A1 to A6."""

    gear_ratio: SixFloats | None = None
    motor_inertia_kgm2: SixFloats | None = None
    torque_constant_Nm_A: SixFloats | None = None
    link_mass_kg: SixFloats | None = None
    robot_mass_kg: Positive | None = None


class Robot(_Section):
    """One robot model."""

    model: str
    trafo_name: str = ""
    """What ``$TRAFONAME[]`` of the controller must contain; empty: the guard does not look."""
    geometry: Geometry
    limits: Limits = Limits()
    speeds: Speeds = Speeds()
    payload: Payload = Payload()
    drives: Drives = Drives()
    note: str = ""


class Controller(Provenance):
    """What the controller's planner is set to."""

    model: str
    k_s: NotNegative = 0.168
    cycle_s: Positive = 0.012
    advance: Annotated[int, Field(ge=0, le=5)] | Literal["unlimited"] = 3
    cdis_mm: NotNegative = 0.1
    tolerance_mm: Positive | None = None
    vel_cp_m_s: Positive = 2.0
    """Largest path speed the controller accepts ($VEL_MA.CP)."""
    acc_cp_m_s2: Positive = 2.0
    rapid_m_s: Positive = 0.2
    vel_ori_deg_s: Positive = 200.0
    acc_ori_deg_s2: Positive = 100.0
    ptp_percent: Annotated[int, Field(ge=1, le=100)] = 20
    law: Literal["averages", "trapezoid"] = "averages"


class Tool(Provenance):
    """A cutter in its holder."""

    model: str = ""
    kind: Literal["flat", "bull-nose", "ball"] = "flat"
    diameter_mm: Positive
    teeth: Annotated[int, Field(ge=1, le=50)]
    corner_radius_mm: NotNegative = 0.0
    helix_deg: Annotated[float, Field(ge=0, lt=90)] = 30.0
    length_mm: Positive | None = None
    """From the gauge line of the spindle to the tip."""
    flute_length_mm: Positive | None = None
    centre_cutting: bool = True
    max_rpm: Positive | None = None
    tool_data: DataNumber | None = None
    """Number of ``TOOL_DATA`` on the controller; without it ``$TOOL`` is written as a frame."""
    frame: Frame | None = None
    """TCP in the flange as the controller has it; without it from ``frames.tool`` and the length."""
    axis: Axis | None = None
    """Which axis of the controller's tool frame points from tip to holder."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.corner_radius_mm > self.diameter_mm / 2 + 1e-9:
            raise ValueError("corner_radius_mm is larger than half the diameter")
        if (
            self.length_mm is not None
            and self.flute_length_mm is not None
            and self.length_mm < self.flute_length_mm
        ):
            raise ValueError(
                f"length_mm {self.length_mm:g} is shorter than the flutes, {self.flute_length_mm:g} mm"
            )
        if self.tool_data is not None and self.axis is None:
            raise ValueError('axis is required with tool_data: "+x", "-x", "+y", "-y", "+z" or "-z"')
        if self.axis not in (None, "+z") and self.frame is None:
            raise ValueError("axis other than +z needs frame, the TCP as the controller has it")
        return self


class Frames(Provenance):
    """Where the work and the tool are."""

    base: Frame = Frame()
    """``$BASE`` in ``$ROBROOT``."""
    base_data: DataNumber | None = None
    """Number of ``BASE_DATA`` on the controller; without it ``$BASE`` is written as a frame."""
    tool: Frame = Frame()
    """TCP in the flange of a tool of ``tool_length_mm``; z points from tip to holder."""
    tool_length_mm: NotNegative = 0.0
    spin: Annotated[float, Field(ge=-360, le=360)] | Literal["auto"] = 0.0
    """Angle in degrees about the tool axis, or ``auto``."""


class Home(_Section):
    """Where the program starts and ends."""

    q_deg: SixFloats


class Clearance(_Section):
    """The plane above everything, in ``$BASE``; ``none`` where the cell has none."""

    z_mm: Finite | Literal["none"]


class Load(Provenance):
    """Payload on the flange: mass, centre and inertia in the flange frame."""

    mass_kg: NotNegative
    x_mm: Finite = 0.0
    y_mm: Finite = 0.0
    z_mm: Finite = 0.0
    jx_kgm2: NotNegative = 0.0
    jy_kgm2: NotNegative = 0.0
    jz_kgm2: NotNegative = 0.0


class Spindle(Provenance):
    """The spindle and its signals; numbers are ``$OUT``, ``$IN`` and ``$ANOUT`` of the controller."""

    max_rpm: Positive
    run_cw_output: SignalNumber
    run_ccw_output: SignalNumber
    speed_analog_output: Annotated[int, Field(ge=1, le=32)]
    at_speed_input: SignalNumber | None = None
    start_s: NotNegative = 5.0
    """Waited after M3 where there is no at-speed input."""
    stop_s: NotNegative = 5.0
    flood_output: SignalNumber
    mist_output: SignalNumber


class GuardInput(_Section):
    """A controller input that must have a value before the first motion."""

    number: SignalNumber
    value: bool = True
    meaning: str


class LinearEdge(_Section):
    """Linear-edge force coefficients: K_c in N/mm², K_e in N/mm."""

    Ktc: Finite
    Krc: Finite
    Kac: Finite
    Kte: Finite
    Kre: Finite
    Kae: Finite


class Material(Provenance):
    """What is cut; carried along for the force model, not used by translation."""

    name: str = ""
    linear_edge: LinearEdge | None = None


class Stock(_Section):
    """The raw part in `$BASE`; carried along for material removal, not used by translation."""

    box_mm: tuple[tuple[Finite, Finite, Finite], tuple[Finite, Finite, Finite]] | None = None
    mesh: str | None = None


class Program(_Section):
    """How the KRL text is laid out."""

    max_lines: Annotated[int, Field(ge=100)] = 5000
    comment_every: Annotated[int, Field(ge=0)] = 50
    """A comment with the G-code line every so many motions; 0 = only at events."""
    warn_size_mb: Positive = 4.0
    externals: tuple[str, ...] = ()
    """Subprograms that templates call, as in KRL: ``SPINDLE_ON(INT :IN)``."""
    prologue: str = ""
    """KRL (Jinja2) between the guard and the first motion."""
    epilogue: str = ""
    """KRL (Jinja2) after the last motion."""
    memory_moves: Annotated[int, Field(ge=1)] = 30000
    """LIN lines a controller surely holds."""


class Verified(_Section):
    """Who confirmed that the cell file matches the real cell."""

    by: Annotated[str, Field(min_length=1)]
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]


class Cell(_Section):
    """A resolved cell."""

    name: str = ""
    verified: Verified | None = None
    robot: Robot
    controller: Controller
    tool: dict[int, Tool]
    mounted_tool: int | None = None
    """The tool in the spindle when the program starts without a T word."""
    frames: Frames
    work_offsets: dict[
        Literal["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"], Frame
    ] = {}
    home: Home
    clearance: Clearance
    material: Material | None = None
    stock: Stock | None = None
    load: Load
    spindle: Spindle
    guard_inputs: tuple[GuardInput, ...] = ()
    program: Program = Program()
    m_code: dict[str, str] = {}
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
    try:
        for section, kind in (("robot", "robots"), ("controller", "controllers")):
            merged[section] = _fill_in(merged[section], kind, beside)
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
