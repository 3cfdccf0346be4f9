"""Sections of the robot: geometry, limits, controller, frames, load, and the stiffness of its joints."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.external import ExternalName
from gcode2krl.cell.sections.fields import (
    DataNumber,
    Finite,
    Frame,
    NotNegative,
    OneLine,
    Positive,
    Provenance,
    Section,
    SixFloats,
    Sure,
    missing,
)
from gcode2krl.cell.sections.surroundings import RobotBody

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
    """One robot model; without geometry its joint angles are unknown."""

    model: OneLine = ""
    name: OneLine | None = None
    """Of an arm that is no model of the library."""
    trafo_name: Annotated[str, Field(pattern=r"^[A-Za-z0-9 #_./+\-]*$", max_length=32)] = ""
    """The robot's name in ``$TRAFONAME[]`` of the controller; empty: the guard does not check it."""
    trafo_source: str = ""
    trafo_sure: Sure = "memory"
    geometry: Geometry = Geometry.model_construct()
    limits: Limits = Limits.model_construct()
    speeds: Speeds = Speeds.model_construct()
    payload: Payload = Payload.model_construct()
    drives: Drives = Drives.model_construct()
    body: RobotBody = RobotBody.model_construct()
    note: str = ""

    @property
    def title(self) -> str:
        """What people call the arm; empty where the cell states none."""
        return self.model or self.name or ("unnamed robot" if self.geometry.known else "")

    def is_named(self, shown: str) -> bool:
        """Tell whether ``$TRAFONAME[]`` that reads ``shown`` is of this robot, as a program's guard does.

        The name begins it, after ``#`` or not, and a blank or nothing follows: KR60 is not of a KR600.
        """
        name = shown.strip().removeprefix("#").upper() + " "
        return bool(self.trafo_name) and name.startswith(f"{self.trafo_name.removeprefix('#').upper()} ")


RsiVersion = Literal["3", "4", "5"]
_RSI_OF_KSS: dict[str, RsiVersion] = {"8.3": "3", "8.5": "4", "8.6": "4", "8.7": "5"}
"""RSI 3.3, 4.0, 4.1 and 5.0: the headers that RSI Visual writes into its files, and ROS drivers' tables."""


class Controller(Provenance):
    """Settings of the controller's planner; the defaults are those of the KRC4."""

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
    circ: bool = False
    """Arcs of the G-code become CIRC."""
    spline: bool = False
    """Chains of short moves become SPLINE blocks, which KSS has from 8.3 on."""
    kss: Literal["8.3", "8.5", "8.6", "8.7", "iiqka"] | None = None
    """KUKA System Software; None: not known, 8.x is assumed."""
    rsi: Literal["3", "4", "5"] | None = None
    """KUKA.RobotSensorInterface; None: that of ``kss``, or 3 where both are unknown."""

    @model_validator(mode="after")
    def _versions_fit(self) -> Self:
        of_kss = _RSI_OF_KSS.get(self.kss or "")
        if self.rsi is not None and of_kss is not None and self.rsi != of_kss:
            raise ValueError(
                f"rsi {self.rsi} does not belong to KSS {self.kss}, whose RSI is {of_kss}: "
                "state what Help > Info shows"
            )
        return self

    @property
    def rsi_version(self) -> RsiVersion:
        """Return the RSI whose files are written."""
        return self.rsi or _RSI_OF_KSS.get(self.kss or "", "3")


class Frames(Provenance):
    """Where the work and the tool are."""

    robroot: Frame | None = None
    """``$ROBROOT`` in ``$WORLD``, of a robot that hangs or stands on a slope; None: zero."""
    base: Frame | None = None
    """``$BASE`` in ``$WORLD``, as the controller has it: in ``$ROBROOT`` where `robroot` is not stated."""
    base_on: ExternalName | None = None
    """The table that carries ``$BASE``; by default that of the highest number."""
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


class VirtualJoint(Section):
    """Stiffness of one elastic frame about its x, y and z axes (k_C, k_B, k_A) in N·mm/rad."""

    k_c: Positive
    k_b: Positive
    k_a: Positive


VIRTUAL_JOINTS = ("A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle")
VirtualJointName = Literal["A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle"]


class TapMode(Section):
    """A mode of a tool's tip that a tap test has found."""

    tool: Annotated[int, Field(strict=True, ge=1, le=99999)]
    direction: Literal["x", "y"]
    """Of ``$BASE``."""
    frequency_hz: Positive
    stiffness_N_mm: Positive
    damping: Annotated[float, Field(strict=True, gt=0, lt=0.5)]
    """Ratio, 1 = critical."""


class Compliance(Provenance):
    """The virtual joints of robot and end effector; without all of them no deflection is predicted."""

    virtual_joints: dict[VirtualJointName, VirtualJoint] = Field(default_factory=dict)
    sensor_height_mm: NotNegative | None = None
    """From the flange face to the mounting face of spindle and holder; the sensor's joint is half-way."""
    relative_band: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.1
    """Half-width of the 90 % band of the stiffness, relative."""
    modes_hz: tuple[Positive, ...] = ()
    """Structural modes that the spindle and tooth-passing frequencies should avoid."""
    tap_modes: tuple[TapMode, ...] = ()
    """Modes of tool tips, from tap tests; without them regenerative chatter is not judged."""
    robot_source: str = ""
    robot_sure: Sure = "unknown"

    def known_height_mm(self) -> float:
        """Return `sensor_height_mm`; raises `RefusedError` where it is not stated."""
        if self.sensor_height_mm is None:
            raise missing("compliance.sensor_height_mm")
        return self.sensor_height_mm
