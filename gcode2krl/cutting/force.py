"""Mean force, torque and peak force of a cutter from its arcs of engagement: Altintas' linear edge model.

The mean is over a spindle revolution, quasi-static (nothing faster can be compensated). On the tool: *feed*
along its motion normal to the axis, *normal* to the left of it seen from above, *axial* from the holder to
the tip.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.cutting.cutter import Shape, shape_of
from gcode2krl.cutting.law import linear_edge_law
from gcode2krl.cutting.slices import mean_rows, peak_rows
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.units import RAD_PER_DEG

_ROUNDING_RAD = 1e-9


@dataclass(frozen=True)
class ToolLoad:
    """Load on the tool, n samples."""

    force_N: Floats
    """(n, 3) feed, normal, axial; mean over a revolution."""
    torque_Nmm: Floats
    """(n,) mean about the axis, against the rotation."""
    peak_N: Floats
    """(n,) largest force within a revolution; NaN where it was not asked for."""


def mean_force(
    phi_rad: ArrayLike,
    a_p_mm: ArrayLike,
    f_z_mm: ArrayLike,
    teeth: int,
    diameter_mm: float,
    corner_radius_mm: float,
    coefficients: ArrayLike,
    ramp_rad: ArrayLike = 0.0,
) -> Floats:
    """Return the mean force on a right-hand end mill, revolution mean (n, 3): feed, normal, axial in N.

    Parameters
    ----------
    phi_rad : (n, 2k)
        Entry and exit pairs in rad from the feed normal; NaN pairs are no arc. Arcs apply to all edges
        below a_p; edges that have no chip on a ramp do not cut; (0, 2·pi) is full material.
    a_p_mm : (n,)
        Axial depth from the tip up in mm.
    f_z_mm : (n,)
        Feed per tooth along the velocity in mm.
    teeth, diameter_mm, corner_radius_mm
        Cutter; corner radius 0 is a flat mill, half the diameter a ball.
    coefficients : (6,)
        Ktc, Krc, Kac in N/mm² and Kte, Kre, Kae in N/mm.
    ramp_rad : (n,)
        Descent angle of the velocity, -pi/2 to pi/2, positive downwards. A flat bottom then cuts from the rim
        to the axis over the same arcs.

    Scalars and single rows are broadcast. Raises an input error that names the argument.

    Notes
    -----
    Altintas, Manufacturing Automation (2nd ed. 2012), ch. 2: dF_q = (K_qc·h + K_qe)·db in closed form over
    the arcs; a corner radius as edges of contact width db = dz/sin(kappa) along it. Valid where the
    coefficients were fitted, usually 0.02-0.2 mm a tooth, without run-out, chatter or dynamics.
    """
    diameter, corner = float(diameter_mm), float(corner_radius_mm)
    if not (math.isfinite(diameter) and diameter > 0.0):
        raise _wrong(f"diameter_mm: found {diameter_mm!r}, allowed: above 0")
    if not 0.0 <= corner <= diameter / 2.0 + 1e-9:
        raise _wrong(f"corner_radius_mm: found {corner_radius_mm!r}, allowed: 0 to {diameter / 2:g}, a ball")
    if teeth != int(teeth) or teeth < 1:
        raise _wrong(f"teeth: found {teeth!r}, allowed: a whole number from 1 on")
    shape = Shape(max(diameter / 2.0 - corner, 0.0), corner, math.pi / 2.0, math.inf, math.inf)
    law = linear_edge_law(coefficients)
    columns = _columns(phi_rad, a_p_mm, f_z_mm, ramp_rad)
    return _means(columns, int(teeth), shape, law)[:, :3]


def cutting_load(
    tool: Tool,
    law: Floats,
    phi_rad: ArrayLike,
    a_p_mm: ArrayLike,
    f_z_mm: ArrayLike,
    ramp_rad: ArrayLike = 0.0,
    *,
    peak: bool = True,
) -> ToolLoad:
    """Return mean force, torque and peak force (n) of any cutter of the library under a law of `law_array`.

    Arguments as in `mean_force`. Edges end at the flute length. The peak includes all teeth with their helix
    of constant lead, without run-out; it is within 3 % of the exact one (up-hill on a corner radius: 11 %).
    The thrust of a drill's chisel edge (up to about as much again) is not in the law: its axial force is a
    lower bound.
    """
    columns = _columns(phi_rad, a_p_mm, f_z_mm, ramp_rad)
    mean = _means(columns, tool.teeth, shape_of(tool), law)
    if not peak:
        return ToolLoad(mean[:, :3], mean[:, 3], np.full(len(mean), np.nan))
    # no mean exceeds its peak
    peaks = np.maximum(_peaks(columns, tool, law), np.linalg.norm(mean[:, :3], axis=1))
    return ToolLoad(mean[:, :3], mean[:, 3], peaks)


def peak_force(
    tool: Tool, law: Floats, phi_rad: ArrayLike, a_p_mm: ArrayLike, f_z_mm: ArrayLike, ramp_rad: ArrayLike
) -> Floats:
    """Return the peak force (n,) of `cutting_load`, which it raises to the mean where that is larger."""
    return _peaks(_columns(phi_rad, a_p_mm, f_z_mm, ramp_rad), tool, law)


def _peaks(columns: tuple[Floats, ...], tool: Tool, law: Floats) -> Floats:
    lag = 0.0 if tool.kind == "drill" else math.tan(tool.helix_deg * RAD_PER_DEG) * 2.0 / tool.diameter_mm
    shape, out = shape_of(tool), np.zeros(len(columns[0]))

    def fill(start: int, end: int) -> None:
        rows = slice(start, end)
        phi, a_p, f_z, ramp = (column[rows] for column in columns)
        peak_rows(phi, a_p, f_z, ramp, tool.teeth, lag, shape, law, out[rows])

    in_chunks(fill, chunk_borders(len(out)))
    return out


def _means(columns: tuple[Floats, ...], teeth: int, shape: Shape, law: Floats) -> Floats:
    out = np.zeros((len(columns[0]), 4))

    def fill(start: int, end: int) -> None:
        rows = slice(start, end)
        phi, a_p, f_z, ramp = (column[rows] for column in columns)
        mean_rows(phi, a_p, f_z, ramp, teeth, shape, law, out[rows])

    in_chunks(fill, chunk_borders(len(out)))
    return out


def _columns(
    phi_rad: ArrayLike, a_p_mm: ArrayLike, f_z_mm: ArrayLike, ramp_rad: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return arcs (n, 2k), depth, feed per tooth and ramp (n,), checked and of one length."""
    arcs = np.atleast_2d(_numbers("phi_rad", phi_rad))
    if arcs.ndim != 2 or arcs.shape[1] % 2 or arcs.shape[1] == 0:
        raise _wrong(
            f"phi_rad: found shape {arcs.shape}, allowed: (n, 2k), an entry and an exit angle an arc"
        )
    depth, feed = _numbers("a_p_mm", a_p_mm), _numbers("f_z_mm", f_z_mm)
    ramp = _numbers("ramp_rad", ramp_rad)
    for name, values in (("a_p_mm", depth), ("f_z_mm", feed), ("ramp_rad", ramp)):
        if values.ndim > 1:
            raise _wrong(f"{name}: found shape {values.shape}, allowed: (n,) or one number")
        _refuse(name, values, ~np.isfinite(values), "finite numbers")
    lengths = {len(v) for v in (arcs, *(np.atleast_1d(x) for x in (depth, feed, ramp)))} - {1}
    if len(lengths) > 1:
        raise _wrong(f"rows: found {sorted(lengths)}, allowed: the same number for all, or one")
    _refuse("a_p_mm", depth, depth < 0.0, "0 or more")
    _refuse("f_z_mm", feed, feed < 0.0, "0 or more")
    _refuse("ramp_rad", ramp, np.abs(ramp) > math.pi / 2 + _ROUNDING_RAD, "-pi/2 to pi/2")
    _check_arcs(arcs)
    count = lengths.pop() if lengths else 1
    ramp = np.clip(ramp, -math.pi / 2, math.pi / 2)
    return (
        _writable(arcs, (count, arcs.shape[1])),
        _writable(depth, (count,)),
        _writable(feed, (count,)),
        _writable(ramp, (count,)),
    )


def _check_arcs(arcs: Floats) -> None:
    start, end = arcs[:, 0::2], arcs[:, 1::2]
    nothing = np.isnan(start) & np.isnan(end)
    with np.errstate(invalid="ignore"):
        good = nothing | ((end >= start) & (end - start <= 2.0 * math.pi + _ROUNDING_RAD))
    bad = np.argwhere(~good)
    if len(bad):
        row, pair = bad[0]
        raise _wrong(
            f"phi_rad: row {row}, arc {pair}: found {start[row, pair]:g} to {end[row, pair]:g}, "
            "allowed: exit not before entry, at most one turn, or NaN for both"
        )


def _refuse(name: str, values: Floats, bad: Bools, allowed: str) -> None:
    if bad.any():
        row = int(np.argmax(bad))
        raise _wrong(f"{name}: row {row}: found {np.atleast_1d(values)[row]:g}, allowed: {allowed}")


def _numbers(name: str, values: ArrayLike) -> Floats:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise _wrong(f"{name}: found {type(values).__name__} that is not numbers, allowed: numbers") from None


def _writable(values: Floats, shape: tuple[int, ...]) -> Floats:
    """Return the values as compiled code takes them: of full shape, contiguous, writeable."""
    return np.require(np.broadcast_to(values, shape), requirements=["C", "W"])


def _wrong(message: str) -> NotUnderstoodError:
    return input_error("force-input", message)
