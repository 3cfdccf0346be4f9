"""Radial run-out of the cutter: some teeth no longer cut."""

import math

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cutting import cutting_load
from gcode2krl.cutting.law import feed_per_tooth, law_array
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.effects.coefficients import edge_only
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import NO_TARGET, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV


class Runout(Effect):
    """The cutter's axis is off by ``runout_mm``: teeth that no longer cut drop their edge force.

    Tooth j of N has the radius R + r_j, r_j = runout·cos(2·pi·j/N + angle) (parallel offset; Kline and DeVor
    1983). With three teeth an angle of 60° is one tooth set back by 1.5·runout beside two equal ones.
    It cuts where its chip, min over k of k·f_z·sin(phi) + r_j - r_(j-k), is positive, that is where sin(phi)
    is above max over k of (r_(j-k) - r_j)/(k·f_z). What all teeth cut together in a turn is the same, so the
    mean of the chip's force stays, and the edge force of the idle ones is missing. Arcs and depth are those
    of the nominal cut; the moment about the tip stays the nominal one.
    """

    name = "runout"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE, Dependence.SPINDLE_SPEED})
    needs = frozenset({"cut"})
    parameters = (
        Parameter(
            name="runout_mm",
            unit="mm",
            low=0.0,
            high=0.1,
            nominal=0.0,
            start=0.02,
            minimum=0.0,
            source="10-30 µm of a milling spindle with collet",
        ),
        Parameter(
            name="angle_deg",
            unit="deg",
            low=0.0,
            high=180.0,
            nominal=None,
            start=0.0,
            grid=(0.0, 30.0, 60.0, 90.0),
            source="between the offset and a tooth: as the cutter happens to sit in its collet",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return (None,) where the material has edge coefficients."""
        has_edges = cell.material is not None and cell.material.linear_edge is not None
        return NO_TARGET if has_edges else ()

    def why_not(self, cell: Cell, target: Target) -> str:
        """Say that the material has no edge coefficients."""
        return "" if self.targets(cell) else "the material has no linear edge coefficients"

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load less the edge forces of idle teeth."""
        if applied["runout_mm"] == 0.0:
            return load
        force_N, moment_Nmm = np.array(load[0]), np.array(load[1])
        for number, rows in arm.tool_rows(inputs.tool):
            missing = _missing(number, np.arange(len(inputs))[rows], inputs, applied)
            force_N[rows] -= missing
        return force_N, moment_Nmm


def _missing(number: int, rows: Ints, inputs: Inputs, applied: Applied) -> Floats:
    """Return the edge force (n, 3) along ``$BASE`` that idle teeth do not bring."""
    forces, motion, material = inputs.forces, inputs.motion, inputs.cell.material
    missing = np.zeros((len(rows), 3))
    if forces is None or motion is None or material is None:
        return missing
    tool = inputs.cell.tool[number]
    f_z = feed_per_tooth(motion.speed_mm_s[rows], inputs.spindle_rad_s[rows], tool.teeth)
    law = law_array(edge_only(material))
    angle_rad = applied["angle_deg"] * RAD_PER_DEG
    for tooth in range(tool.teeth):
        sine = idle_below(tooth, tool.teeth, applied["runout_mm"], f_z, angle_rad)
        arcs = idle_arcs(forces.phi_rad[rows], sine)
        load = cutting_load(tool, law, arcs, forces.a_p_mm[rows], f_z, peak=False)
        missing += load.force_N / tool.teeth
    return along_base(missing, inputs, rows)


def idle_below(tooth: int, teeth: int, runout_mm: float, f_z_mm: Floats, angle_rad: float) -> Floats:
    """Return sin(phi) (n,) up to which a tooth does not cut; 1 where it never does."""
    radius = runout_mm * np.cos(RAD_PER_REV * np.arange(teeth) / teeth + angle_rad)
    back = np.arange(1, teeth + 1)
    higher = radius[(tooth - back) % teeth] - radius[tooth]  # after a whole turn the tooth meets itself: 0
    moving = f_z_mm > 0.0
    per_feed = (higher / back).max()
    return np.where(moving, np.clip(per_feed / np.where(moving, f_z_mm, 1.0), 0.0, 1.0), 0.0)


def idle_arcs(phi_rad: Floats, sine: Floats) -> Floats:
    """Return the parts of the arcs (n, 2k) with sin(phi) below ``sine`` (n,), as (n, 4k), NaN padded."""
    limit = np.arcsin(sine)[:, None]
    start, end = phi_rad[:, 0::2], phi_rad[:, 1::2]
    pieces = []
    for low, high in ((0.0 * limit, limit), (math.pi - limit, math.pi + 0.0 * limit)):
        a, b = np.maximum(start, low), np.minimum(end, high)
        there = b > a  # NaN compares as not there
        pieces += [np.where(there, a, np.nan), np.where(there, b, np.nan)]
    return np.ascontiguousarray(np.stack(pieces, axis=2).reshape(len(phi_rad), -1))


def along_base(force_N: Floats, inputs: Inputs, rows: Ints) -> Floats:
    """Return forces (n, 3) along feed, normal and axial of the commanded path as ones along ``$BASE``."""
    axis = inputs.tool_rotation[rows, :, 2]
    velocity = inputs.velocity_mm_s[rows]
    feed = velocity - np.sum(velocity * axis, axis=1, keepdims=True) * axis
    length = np.linalg.norm(feed, axis=1, keepdims=True)
    feed = feed / np.where(length > 0.0, length, 1.0)
    turned: Floats = force_N[:, :1] * feed + force_N[:, 1:2] * np.cross(axis, feed) - force_N[:, 2:] * axis
    return turned


EFFECT = Runout()
