"""Sections of the machining: tools, spindle, material, stock, and when a result is doubtful."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.fields import (
    Axis,
    DataNumber,
    Finite,
    Frame,
    NotNegative,
    OneLine,
    Positive,
    Provenance,
    Section,
    SignalNumber,
    YesNo,
)
from gcode2krl.cell.sections.robot import Load
from gcode2krl.cell.sections.surroundings import SpindleBody

_ROUNDED_SHARE = 0.005
"""Fraction of the diameter by which the radius of a ball may be rounded: 1.58 for a ball of 3.175 mm."""


class Tool(Provenance):
    """A cutter in its holder."""

    name: OneLine = ""
    """What a program calls the tool by, ``T="MILL10"`` on a Sinumerik."""
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
    """Default: the cutter's diameter, so that the shank touches nothing that the edges have not cut."""
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
    load: Load | None = None
    """Everything on the flange with this tool; without it ``[load]`` of the cell."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._refuse_lengths()
        self._refuse_half_a_frame()
        if self.load is not None and self.load.mass_kg is None:
            raise ValueError("load needs mass_kg, that of everything on the flange with this tool")
        return self

    def _refuse_lengths(self) -> None:
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

    def _refuse_half_a_frame(self) -> None:
        if self.tool_data is not None and self.axis is None:
            raise ValueError('axis is required with tool_data: "+x", "-x", "+y", "-y", "+z" or "-z"')
        if self.tool_data is not None and self.frame is None:
            raise ValueError(
                "tool_data without frame: give frame too, the TCP as the controller has it, to be compared"
            )
        if self.axis not in (None, "+z") and self.frame is None:
            raise ValueError("axis other than +z needs frame, the TCP as the controller has it")

    def _is_half_of_diameter(self) -> bool:
        return abs(self.corner_radius_mm - self.diameter_mm / 2) <= _ROUNDED_SHARE * self.diameter_mm


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
    body: SpindleBody | None = None


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
    """Kienzle's law: F_t = kc11·b·h^(1 - mc); the radial and axial forces are fractions of it."""

    kc11: Positive
    """Specific cutting force at h = b = 1 mm in N/mm²."""
    mc: Annotated[float, Field(strict=True, ge=0, lt=1)]
    radial_ratio: NotNegative = 0.4
    axial_ratio: Finite = 0.2


_SOFT_N_MM2 = 150.0
"""Softer is not metal: hardwood has 53 N/mm², the softest metal of the library 244."""


WIDEST_BAND = 3.0
"""Wider is no statement about a force."""
_Range = tuple[Positive, Positive]


class Material(Provenance):
    """What is cut, and its force law: one of `linear_edge` and `kienzle`."""

    model: str = ""
    name: str = ""
    linear_edge: LinearEdge | None = None
    kienzle: Kienzle | None = None
    relative_band: Annotated[float, Field(strict=True, ge=0, le=WIDEST_BAND)] = 0.4
    """Half-width of the 90 % band of forces, relative; above 1 the force may be anything from 0 on."""
    measured_f_z_mm: _Range | None = None
    """Feeds per tooth between which the coefficients were measured, and their band holds."""
    measured_a_p_mm: _Range | None = None
    """Depths of cut between which the coefficients were measured."""
    note: str = ""

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        if self.linear_edge is not None and self.kienzle is not None:
            raise ValueError("give linear_edge or kienzle, not both")
        for key, pair in (
            ("measured_f_z_mm", self.measured_f_z_mm),
            ("measured_a_p_mm", self.measured_a_p_mm),
        ):
            if pair is not None and pair[0] > pair[1]:
                raise ValueError(f"{key}: from {pair[0]:g} is above {pair[1]:g}")
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
    """Over one interpolation cycle, corners included; reversing at 0.2 m/s within one cycle takes 33,333."""
    lost_time_share: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.5
    """Fraction of the time that short moves and stops cost; a sound drilling program has 0.35."""
