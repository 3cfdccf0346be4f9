"""Nuisance: what normal mismatch does to a signal, as columns with the standard deviation of each."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Effect
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.signatures import Block, Signatures
from gcode2krl.units import DEG_PER_RAD

_JITTER_KNOTS_S = 1.0
_ROUGH = 1e3
"""Standard deviation of what is no finding whatever its size, in units of its bound."""


class Nuisance(NamedTuple):
    """Columns (k, n, c), already times their standard deviation."""

    name: str
    shared: bool
    """One value for all runs, or one for each."""
    columns: Floats


def nuisance_of(
    trace: Trace, library: Mapping[str, Effect], mismatch: Mismatch, known: Signatures,
    upstream: frozenset[str], clock: float = 1.0,
) -> list[Nuisance]:  # fmt: skip
    """Return what normal mismatch may do to a trace.

    ``upstream``: links that are not measured before it; ``clock``: mismatch of its clock over that of one.
    """
    found = _all(trace, library, mismatch, known, upstream, clock)
    return [each for each in found if np.any(each.columns)]


def _all(
    trace: Trace, library: Mapping[str, Effect], m: Mismatch, known: Signatures, upstream: frozenset[str],
    clock: float,
) -> Iterator[Nuisance]:  # fmt: skip
    def effect(
        name: str, target: str | None, parameter: str, bound: float, **shape: float
    ) -> Nuisance | None:
        if name not in library or target not in library[name].targets(trace.inputs.cell):
            return None
        one = library[name]
        apart = one.start(trace.inputs, target)[parameter] - one.nominal(trace.inputs, target)[parameter]
        # at the size that it may have: a lag of 15 ms has another shape than one of half a millisecond
        size = abs(bound / apart)
        columns = known.columns(Block(one, target, shape), trace, size)
        if columns.shape[2] == 0:
            return None
        words = " ".join([name, target or "", *(f"{value:g}" for value in shape.values())])
        return Nuisance(words, True, columns * (sigma(bound) / (size * apart)))

    def present(items: Sequence[Nuisance | None]) -> Iterator[Nuisance]:
        return (each for each in items if each is not None)

    joints = [f"A{number}" for number in range(1, 7)]
    behind_gear = trace.link.name == "gear" or (trace.link.name == "mechanics" and "gear" in upstream)
    if trace.link.name == "servo" or (trace.link.name == "mechanics" and "servo" in upstream):
        yield from present([effect("servo_lag", a, "tau_s", m.lag_s) for a in joints])
    if behind_gear:
        play_deg = m.play_rad * DEG_PER_RAD
        yield from present([effect("backlash", a, "gap_deg", play_deg) for a in joints])
        yield from present([
            effect("transmission", a, "amplitude_deg", play_deg, harmonic=h)
            for a in joints
            for h in (1.0, 2.0)
        ])  # fmt: skip
    if trace.link.name == "gear":
        yield Nuisance("encoder zero", False, _constants(trace) * m.joint_zero_rad * _ROUGH)
    if trace.link.name in ("force", "mechanics"):
        yield from present([
            effect("force_scale", way, "scale", m.coefficients) for way in ("tangential", "radial", "axial")
        ])  # fmt: skip
        yield from present([effect("edge_force", None, "scale", m.coefficients)])
    if trace.link.name == "force":
        yield Nuisance("force zero", False, _force_zero(trace) * sigma(m.force_zero_N))
        yield Nuisance("sensor gain", False, _diagonal(trace.nominal) * sigma(m.sensor_gain))
    if trace.link.name == "mechanics":
        yield from present([
            effect("stiffness", str(name), "scale", m.stiffness)
            for name in trace.inputs.cell.compliance.virtual_joints
        ])  # fmt: skip
        yield Nuisance("frame", False, _frame(trace, m))
    yield Nuisance("clock", False, -_stacked(trace.clock_rate)[:, :, None] * sigma(m.clock_s) * clock)
    if trace.link.name == "path" or (trace.link.name == "mechanics" and "path" in upstream):
        yield Nuisance("time law", False, _jitter(trace, _JITTER_KNOTS_S) * sigma(m.clock_s))


def _stacked(values: Floats) -> Floats:
    return np.ascontiguousarray(values.T)


def _constants(trace: Trace) -> Floats:
    n, k = trace.shape
    return np.repeat(np.eye(k)[:, None, :], n, axis=1)


def _diagonal(values: Floats) -> Floats:
    """Return (k, n, k): column j is component j alone."""
    n, k = values.shape
    columns = np.zeros((k, n, k))
    for j in range(k):
        columns[j, :, j] = values[:, j]
    return columns


def _force_zero(trace: Trace) -> Floats:
    """Return a unit force along each axis of the sensor, in the frame of the measured values."""
    if trace.in_sensor_frame or trace.in_tool_frame:
        return _constants(trace)
    turned = _rows(trace, trace.inputs.sensor_rotation)
    return np.ascontiguousarray(np.moveaxis(turned, 0, 1))


def _frame(trace: Trace, m: Mismatch) -> Floats:
    """Return a shift along and a small turn about each axis of ``$BASE``, about the path's middle."""
    position = trace.nominal
    turned = np.zeros((3, len(position), 6))
    for axis in range(3):
        turned[axis, :, axis] = sigma(m.frame_mm)
    arm = position - position.mean(axis=0)
    for axis in range(3):
        turn = np.cross(np.eye(3)[axis], arm)
        turned[:, :, 3 + axis] = turn.T * sigma(m.frame_rad)
    return turned


def _jitter(trace: Trace, knots_s: float) -> Floats:
    """Return the signal's rate times hats over time: a time law that is off by a little, here and there."""
    start, end = trace.time_s[0], trace.time_s[-1]
    knots = np.linspace(start, end, max(2, round((end - start) / knots_s) + 1))
    hats = np.maximum(0.0, 1.0 - np.abs(trace.time_s[:, None] - knots) / (knots[1] - knots[0]))
    columns: Floats = -_stacked(trace.rate)[:, :, None] * hats[None]
    return columns


def _rows(trace: Trace, rotations: Floats) -> Floats:
    from gcode2krl.gap.beside.interpolation import nearest_rows

    return rotations[nearest_rows(trace.inputs.time_s, trace.time_s)]
