"""The sections of a cell file: what each table holds, in which unit, and what is allowed."""

import datetime
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell.template_rules import external_problem
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.units import RAD_PER_DEG

Sure = Literal["verified", "checked", "memory", "assumption", "unknown"]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
YesNo = Annotated[bool, Field(strict=True)]
OneLine = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f\x85\u2028\u2029]*$")]
"""Text that goes into a line of the program: it cannot begin another line."""
SixFloats = Annotated[tuple[Finite, ...], Field(min_length=6, max_length=6)]
DataNumber = Annotated[int, Field(strict=True, ge=1, le=32)]
SignalNumber = Annotated[int, Field(strict=True, ge=1, le=8192)]


def missing(*keys: str) -> RefusedError:
    """Return the error of a stage that needs keys which the cell does not name."""
    return RefusedError([missing_key(key) for key in keys])


def missing_key(key: str, reason: str = "") -> Issue:
    """Return the finding that a key is needed and not stated."""
    text = f"the cell does not name {key}" + (f": {reason}" if reason else "")
    remedy = f'give {key} in the cell file, or say whose it is with based_on = "…"'
    return Issue("error", "cell-missing", 0, text, remedy)


class Section(BaseModel):
    """A table of the cell file: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Provenance(Section):
    """Where values come from and how sure they are."""

    source: str = ""
    sure: Sure = "assumption"


class Place(Section):
    """A place: position in mm and A, B, C in degrees (Rz·Ry·Rx); what is left out is 0."""

    x_mm: Finite = 0.0
    y_mm: Finite = 0.0
    z_mm: Finite = 0.0
    a_deg: Finite = 0.0
    b_deg: Finite = 0.0
    c_deg: Finite = 0.0

    def matrix(self) -> Floats:
        """Return the homogeneous transform (4, 4)."""
        abc = np.array([self.a_deg, self.b_deg, self.c_deg]) * RAD_PER_DEG
        return fr.transform([self.x_mm, self.y_mm, self.z_mm], fr.rotation_from_abc(abc))


class Frame(Place):
    """A KUKA frame of the cell, whole: a part of one would be completed by somebody else's."""

    @model_validator(mode="before")
    @classmethod
    def _all_six(cls, given: Any) -> Any:
        if isinstance(given, dict):
            lacking = [name for name in cls.model_fields if name not in given]
            unknown = [str(name)[:40] for name in given if name not in cls.model_fields][:6]
            words = f" (there is no such key: {', '.join(unknown)})" if unknown else ""
            if lacking:
                raise ValueError(
                    f"{', '.join(lacking)} missing: a frame states all six of x_mm to c_deg{words}"
                )
        return given


_ROUNDED_SHARE = 0.005
"""Share of the diameter by which the radius of a ball may be rounded: 1.58 for a ball of 3.175 mm."""
_LENGTHS = ("a1_mm", "a2_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm")


class Geometry(Provenance):
    """Lengths of an ortho-parallel arm with spherical wrist (b = 0), in mm: all six, or none is known."""

    a1_mm: Finite | None = None
    a2_mm: Finite | None = None
    c1_mm: Finite | None = None
    c2_mm: Positive | None = None
    c3_mm: Positive | None = None
    c4_mm: Positive | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        missing = [name for name in _LENGTHS if getattr(self, name) is None]
        if 0 < len(missing) < len(_LENGTHS):
            raise ValueError(f"{', '.join(missing)} missing: give all six lengths")
        return self

    @property
    def known(self) -> bool:
        """True where the lengths are stated."""
        return self.a1_mm is not None

    def array(self) -> Floats:
        """Return a1, a2, c1, c2, c3, c4 (6,) in mm; raises `RefusedError` where they are not stated."""
        if not self.known:
            raise missing("robot.model")
        return np.array([getattr(self, name) for name in _LENGTHS], dtype=float)


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


class Robot(Section):
    """One robot model; without geometry nothing is known of where its joints stand."""

    model: OneLine = ""
    trafo_name: Annotated[str, Field(pattern=r"^[A-Za-z0-9 #_./+\-]*$")] = ""
    """What ``$TRAFONAME[]`` of the controller must contain; empty: the guard does not look."""
    geometry: Geometry = Geometry()
    limits: Limits = Limits()
    speeds: Speeds = Speeds()
    payload: Payload = Payload()
    drives: Drives = Drives()
    note: str = ""


class Controller(Provenance):
    """What the controller's planner is set to; the defaults are those of the KRC4."""

    model: OneLine = "KRC4"
    k_s: NotNegative = 0.168
    cycle_s: Positive = 0.012
    advance: Annotated[int, Field(strict=True, ge=0, le=5)] | Literal["unlimited"] = 3
    cdis_mm: NotNegative = 0.1
    tolerance_mm: Positive | None = None
    vel_cp_m_s: Positive = 2.0
    """Largest path speed the controller accepts ($VEL_MA.CP)."""
    acc_cp_m_s2: Positive = 2.0
    rapid_m_s: Positive = 0.2
    vel_ori_deg_s: Positive = 200.0
    acc_ori_deg_s2: Positive = 100.0
    ptp_percent: Annotated[int, Field(strict=True, ge=1, le=100)] = 20
    law: Literal["averages", "trapezoid"] = "averages"


class Tool(Provenance):
    """A cutter in its holder."""

    model: str = ""
    kind: Literal["flat", "bull-nose", "ball", "tapered", "drill"] = "flat"
    diameter_mm: Positive
    """Largest diameter of the cutting part; of a tapered mill the one at the tip."""
    teeth: Annotated[int, Field(strict=True, ge=1, le=50)]
    corner_radius_mm: NotNegative = 0.0
    helix_deg: Annotated[float, Field(strict=True, ge=0, lt=90)] = 30.0
    length_mm: Positive | None = None
    """From the gauge line of the spindle to the tip."""
    flute_length_mm: Positive | None = None
    """Length of the cutting edges along the axis; above it is the shank."""
    taper_deg: Annotated[float, Field(strict=True, ge=0, lt=80)] = 0.0
    """Half angle of a tapered mill."""
    point_deg: Annotated[float, Field(strict=True, gt=10, lt=180)] | None = None
    """Full angle of a drill's point."""
    shank_diameter_mm: Positive | None = None
    """Default: the cutter's diameter, which then cannot touch more than the edges have cut."""
    stick_out_mm: Positive | None = None
    """From the tip to the face of the holder; None: the holder is not checked."""
    holder_diameter_mm: Positive | None = None
    centre_cutting: YesNo = True
    max_depth_mm: Positive | None = None
    """Largest axial depth of cut; default: the flute length."""
    max_force_N: Positive | None = None
    """Largest mean force on the tool."""
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
        stick_out_mm = self.stick_out_mm or 0.0
        if self.length_mm is not None and stick_out_mm > self.length_mm:
            raise ValueError(
                f"stick_out_mm {stick_out_mm:g} is more than length_mm {self.length_mm:g}, which counts from "
                "the spindle's gauge line to the tip"
            )
        if self.kind == "ball" and self.corner_radius_mm and not self._is_half_of_diameter():
            raise ValueError(
                f"corner_radius_mm {self.corner_radius_mm:g} of a ball is half its diameter, "
                f"{self.diameter_mm / 2:g}: correct it or leave it out"
            )
        if self.tool_data is not None and self.axis is None:
            raise ValueError('axis is required with tool_data: "+x", "-x", "+y", "-y", "+z" or "-z"')
        if self.tool_data is not None and self.frame is None:
            raise ValueError(
                "tool_data without frame: give frame too, the TCP as the controller has it, to be compared"
            )
        if self.axis not in (None, "+z") and self.frame is None:
            raise ValueError("axis other than +z needs frame, the TCP as the controller has it")
        return self

    def _is_half_of_diameter(self) -> bool:
        return abs(self.corner_radius_mm - self.diameter_mm / 2) <= _ROUNDED_SHARE * self.diameter_mm


class Frames(Provenance):
    """Where the work and the tool are."""

    base: Frame | None = None
    """``$BASE`` in ``$ROBROOT``."""
    base_data: DataNumber | None = None
    """Number of ``BASE_DATA`` on the controller; without it ``$BASE`` is written as a frame."""
    tool: Frame | None = None
    """TCP in the flange of a tool of ``tool_length_mm``; z points from tip to holder."""
    tool_length_mm: NotNegative | None = None
    spin: Annotated[float, Field(strict=True, ge=-360, le=360)] | Literal["auto", "stiffest"] = 0.0
    """Angle in degrees about the tool axis; ``auto`` keeps away from limits and singularities, ``stiffest``
    bends least under a load across the tool."""

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if self.base_data is not None and self.base is None:
            raise ValueError(
                "base_data without base: give base too, $BASE as the controller has it, to be compared"
            )
        return self


class Home(Section):
    """Where the program starts and ends."""

    q_deg: SixFloats | None = None


class Clearance(Section):
    """The plane above everything, in ``$BASE``; ``none`` where the cell has none."""

    z_mm: Finite | Literal["none"] | None = None


class Load(Provenance):
    """Payload on the flange: mass, centre and inertia in the flange frame."""

    mass_kg: NotNegative | None = None
    x_mm: Finite = 0.0
    y_mm: Finite = 0.0
    z_mm: Finite = 0.0
    jx_kgm2: NotNegative = 0.0
    jy_kgm2: NotNegative = 0.0
    jz_kgm2: NotNegative = 0.0


class Spindle(Provenance):
    """The spindle and its signals; numbers are ``$OUT``, ``$IN`` and ``$ANOUT`` of the controller."""

    max_rpm: Positive | None = None
    run_cw_output: SignalNumber | None = None
    run_ccw_output: SignalNumber | None = None
    speed_analog_output: Annotated[int, Field(strict=True, ge=1, le=32)] | None = None
    at_speed_input: SignalNumber | None = None
    max_power_W: Positive | None = None
    max_torque_Nm: Positive | None = None
    start_s: NotNegative = 5.0
    """Waited after M3 where there is no at-speed input."""
    stop_s: NotNegative = 5.0
    flood_output: SignalNumber | None = None
    mist_output: SignalNumber | None = None


class GuardInput(Section):
    """A controller input that must have a value before the first motion."""

    number: SignalNumber
    value: YesNo = True
    meaning: OneLine


class LinearEdge(Section):
    """Linear-edge force coefficients: K_c in N/mm², K_e in N/mm; None where the source has none."""

    Ktc: Finite
    Krc: Finite
    Kac: Finite | None = None
    Kte: Finite
    Kre: Finite
    Kae: Finite | None = None

    def array(self) -> Floats:
        """Return Ktc, Krc, Kac, Kte, Kre, Kae (6,); what is not known is 0 (no axial force)."""
        values = (self.Ktc, self.Krc, self.Kac or 0.0, self.Kte, self.Kre, self.Kae or 0.0)
        return np.array(values)


class Kienzle(Section):
    """Kienzle's law: F_t = kc11·b·h^(1 - mc); the radial and axial forces are shares of it."""

    kc11: Positive
    """Specific cutting force at h = b = 1 mm in N/mm²."""
    mc: Annotated[float, Field(strict=True, ge=0, lt=1)]
    radial_ratio: NotNegative = 0.4
    axial_ratio: Finite = 0.2


_SOFT_N_MM2 = 150.0
"""Between hardwood, 53 N/mm², and the softest metal of the library, 244."""


class Material(Provenance):
    """What is cut, and its force law: one of `linear_edge` and `kienzle`."""

    model: str = ""
    name: str = ""
    linear_edge: LinearEdge | None = None
    kienzle: Kienzle | None = None
    relative_band: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.4
    """Half-width of the 90 % band of forces, relative."""
    note: str = ""

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        if self.linear_edge is not None and self.kienzle is not None:
            raise ValueError("give linear_edge or kienzle, not both")
        return self

    @property
    def is_soft(self) -> bool:
        """True for wood, foam and plastics, by the specific cutting force."""
        stated = (
            self.linear_edge.Ktc if self.linear_edge else None,
            self.kienzle.kc11 if self.kienzle else None,
        )
        return any(value is not None and value < _SOFT_N_MM2 for value in stated)


class Stock(Section):
    """The raw part in `$BASE`."""

    box_mm: tuple[tuple[Finite, Finite, Finite], tuple[Finite, Finite, Finite]] | None = None
    mesh: str | None = None
    """STL, PLY or 3MF in mm, relative to the cell file."""
    resolution_mm: Positive | None = None
    """Cell size of the material removal; default: from the smallest tool."""
    through_mm: NotNegative = 0.0
    """How far a cutter may go below the underside on purpose: there is a sacrificial board below."""

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if self.box_mm is not None and self.mesh is not None:
            raise ValueError("give box_mm or mesh, not both")
        if self.box_mm is not None:
            for axis, low, high in zip("xyz", *self.box_mm, strict=True):
                if low >= high:
                    raise ValueError(f"box_mm: {axis} from {low:g} is not below {high:g}")
        return self


class Table(Section):
    """What carries the work, in ``$BASE``: nothing of the tool may go below it."""

    z_mm: Finite


class ResultLimits(Section):
    """How large a predicted figure may become before a warning says that it is doubtful."""

    force_N: Positive = 2000.0
    """Mean cutting force on the tool."""
    torque_Nm: Positive = 50.0
    """Mean torque on the spindle."""
    deflection_mm: Positive = 5.0
    acceleration_mm_s2: Positive = 40000.0
    """Over one interpolation cycle, corners included; 0.2 m/s that turn back within a cycle are 33,333."""
    lost_time_share: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.5
    """Share of the time that short moves and stops cost; a sound program that drills comes to 0.35."""


class VirtualJoint(Section):
    """Stiffness of one elastic frame about its x, y and z axes (k_C, k_B, k_A) in N·mm/rad."""

    k_c: Positive
    k_b: Positive
    k_a: Positive


VIRTUAL_JOINTS = ("A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle")
VirtualJointName = Literal["A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle"]


class Compliance(Provenance):
    """The virtual joints of robot and end effector; without all of them no deflection is predicted."""

    virtual_joints: dict[VirtualJointName, VirtualJoint] = Field(default_factory=dict)
    sensor_height_mm: NotNegative | None = None
    """From the flange face to the mounting face of spindle and holder; the sensor's joint is half-way."""
    relative_band: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.1
    """Half-width of the 90 % band of the stiffness, relative."""
    modes_hz: tuple[Positive, ...] = ()
    """Structural modes that a spindle speed or tooth passing should keep away from."""
    robot_source: str = ""
    robot_sure: Sure = "unknown"

    def known_height_mm(self) -> float:
        """Return `sensor_height_mm`; raises `RefusedError` where it is not stated."""
        if self.sensor_height_mm is None:
            raise missing("compliance.sensor_height_mm")
        return self.sensor_height_mm


# Only variables of sensors, or the integrator's own: never one that the planner, a frame or an output has.
_OWN = r"[A-FH-Za-fh-z][A-Za-z0-9_]{0,23}"
_PILOT_VARIABLE = rf"^(\$SEN_PINT\[[0-9]{{1,2}}\]|{_OWN}(\[[0-9]{{1,3}}\])?)$"
_PILOT_ARRAY = rf"^(\$SEN_PREA|{_OWN})$"


class Pilot(Section):
    """How the program carries the pilot force."""

    form: Literal["index", "values", "none"] = "index"
    frame: Literal["tcp", "base"] = "tcp"
    """Frame in which knots state force and deflection."""
    lead_s: Positive = 0.040
    """Least time between the announcement of a knot and the knot."""
    tolerance_N: Positive | None = None
    """Largest error of the knots' polyline; default: the larger of 10 N and 3 % of the peak."""
    index_variable: Annotated[str, Field(pattern=_PILOT_VARIABLE)] = "$SEN_PINT[1]"
    hash_variable: Annotated[str, Field(pattern=_PILOT_VARIABLE)] = "$SEN_PINT[2]"
    value_variable: Annotated[str, Field(pattern=_PILOT_ARRAY)] = "$SEN_PREA"
    max_active: Annotated[int, Field(strict=True, ge=1, le=8)] = 8
    """Triggers that may wait at the same time."""


_EXTERNAL = r"^[A-Za-z][A-Za-z0-9_]{0,23} ?\([A-Za-z0-9_ :,\[\]]*\)$"


class Program(Section):
    """How the KRL text is laid out."""

    max_lines: Annotated[int, Field(strict=True, ge=100)] = 5000
    comment_every: Annotated[int, Field(strict=True, ge=0, le=10**9)] = 50
    """A comment with the G-code line every so many motions; 0 = only at events."""
    tool_length: Literal["g43", "from_table"] = "g43"
    """Who applies the length of a tool: ``g43`` in the G-code, or ``from_table`` of the cell while it is in
    the spindle, for posts that set lengths by touching off and never write G43."""
    warn_size_mb: Positive = 4.0
    externals: tuple[Annotated[str, Field(pattern=_EXTERNAL)], ...] = ()
    """Subprograms that templates call, as in KRL: ``SPINDLE_ON(INT :IN)``."""
    prologue: str = ""
    """KRL (Jinja2) between the guard and the first motion."""
    epilogue: str = ""
    """KRL (Jinja2) after the last motion."""
    memory_moves: Annotated[int, Field(strict=True, ge=1)] = 30000
    """LIN lines a controller surely holds."""

    @field_validator("externals")
    @classmethod
    def _subprograms(cls, externals: tuple[str, ...]) -> tuple[str, ...]:
        for problem in filter(None, map(external_problem, externals)):
            raise ValueError(problem)
        return externals


class Verified(Section):
    """Who confirmed that the cell file matches the real cell."""

    by: Annotated[OneLine, Field(min_length=1, max_length=100)]
    date: Annotated[str, Field(pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}$")]

    @field_validator("date")
    @classmethod
    def _day(cls, given: str) -> str:
        try:
            datetime.date.fromisoformat(given)
        except ValueError:
            raise ValueError(f"{given} is no day of the calendar (year-month-day)") from None
        return given


ToolNumber = Annotated[int, Field(ge=1, le=99999)]


class TakenOver(Section):
    """A value that a cell took over from the one it is based on."""

    key: str
    """Dotted, as in the file: ``frames.base``."""
    value: str
    source: str
    """The file, or ``demonstration``."""
    verified: bool
    """True where that file is verified."""


class EffectEntry(Section):
    """Something that the nominal model leaves out, as `gcode2krl diagnose --apply` writes it."""

    name: str
    target: str | None = None
    parameters: dict[str, Finite | tuple[Finite, ...]] = Field(default_factory=dict)
    source: str = ""
