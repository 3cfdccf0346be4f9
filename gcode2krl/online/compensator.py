"""The compensator of Haehn & Weigold 2020, fig. 2: from sensor, joints and announced knots to a correction.

    sensor -> weight and offset -> low-pass, moving average -> blend with the pilot -> compliance with the
    present joints -> projection normal to the feed -> (inverse kinematics) -> PID and limits -> correction

Every stage is a pure function ``(state, rows) -> (state, rows)``: `stream` takes a whole recording, `step`
one cycle of a running robot, and both give the same bits.
"""

import math
from dataclasses import dataclass, field, fields
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.cell.carried import require_still
from gcode2krl.cell.sections.online import Online
from gcode2krl.compiled.core import BOOLS, FLOAT, FLOATS, INT, OUT_BOOLS, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import shaped
from gcode2krl.compliance import assumed_stiffness, deflection_of
from gcode2krl.compliance.sensor import Calibration, compensate, transfer_to_tcp
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.online.feed import FeedState, feed_of, feed_start
from gcode2krl.online.limits import Bounds, LimitState, axis_bounds, cartesian_bounds, limit_start, limited
from gcode2krl.online.pilot_gate import Announced, GateState, PilotTable, estimate, gate_start, pilot_table
from gcode2krl.pilot import Knots, PilotHeader
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.kinematics import flange_pose, status_turn
from gcode2krl.units import RAD_PER_DEG

# The quasi-static part of a sensor's signal: low-pass, moving average (Haehn & Weigold 2020, section 2.2).
#
# A filter is one compiled loop over rows that carries its state from call to call, so that a whole stream
# and the same stream sample by sample give the same bits.

WIDTH = 6
"""Force x, y, z in N and moment x, y, z in N·mm."""

_filter = core_function(
    "online_filter",
    *(FLOATS, OUT_FLOATS, OUT_FLOATS, OUT_INTS),
    *(FLOAT, INT, FLOAT),
    *(OUT_FLOATS, OUT_BOOLS),
)


class FilterState(NamedTuple):
    """State of the filter."""

    low: Floats
    """(6,) output of the low-pass."""
    window: Floats
    """(k, 6) the last k outputs of the low-pass."""
    counts: Ints
    """(2,) samples so far; samples in a row that were not numbers."""


def filter_start(settings: Online) -> FilterState:
    """Return the state before the first sample, which then fills it: no transient at the start."""
    length = max(1, round(settings.average_s / settings.cycle_s))
    return FilterState(np.zeros(WIDTH), np.zeros((length, WIDTH)), np.zeros(2, dtype=np.int64))


def filtered(state: FilterState, load: Floats, settings: Online) -> tuple[FilterState, Floats, Bools]:
    """Return the filtered loads (n, 6), and (n,) True where the sensor is lost.

    First-order low-pass, exact for an input that is held over a cycle, then the mean of the last
    ``average_s``. A sample that is not a number, or above ``most_force_N``, leaves the output unchanged;
    more of them in a row than ``sensor_hold_s`` mean a lost sensor, and so does, at once, a force that is too
    large for a cut.
    """
    values = shaped("load", load, -1, WIDTH)
    after = FilterState(state.low.copy(), state.window.copy(), state.counts.copy())
    out, lost = np.empty(values.shape), np.zeros(len(values), dtype=np.bool_)
    share = -math.expm1(-2.0 * math.pi * settings.lowpass_hz * settings.cycle_s)
    allowed = round(settings.sensor_hold_s / settings.cycle_s)
    _filter(values, after.low, after.window, after.counts, share, allowed, settings.most_force_N, out, lost)
    return after, out, lost


# Blends the measured force with the pilot's estimate (Haehn & Weigold 2020, section 2.3).
#
# While both differ by less than a threshold the measurement is used: it includes wear and the real
# material. Beyond the threshold a change of direction or the cutter's exit is assumed, which the filtered
# measurement shows too late: the signal changes to the estimate linearly within the blend time, and back in
# the same way.
#
# Our choices where the paper is silent: the difference is the length of the vector; blending back takes the
# same time; and an estimate that stays beyond the threshold while it does not change is a wrong estimate,
# not an event. It is then not used until both agree again.

STEADY_SHARE = 0.2
"""An estimate is steady while it changes by less than this fraction of the threshold; our choice."""
WEIGHT, BEYOND_S, DISTRUSTED = 0, 1, 2
ANCHOR, LAST = 3, 6

_blend = core_function(
    "online_blend",
    *(FLOATS, FLOATS, BOOLS, OUT_FLOATS),
    *(FLOAT, FLOAT, FLOAT, FLOAT),
    *(OUT_FLOATS, OUT_FLOATS, OUT_BOOLS),
)


class BlendState(NamedTuple):
    """State of the blend."""

    values: Floats
    """(9,) weight of the estimate, time beyond the threshold in a steady cut, distrust; the estimate at the
    start of that time (3), and the last known estimate (3)."""


class Blend(NamedTuple):
    """The load to compensate, and how it was blended."""

    load: Floats
    """(n, 6)"""
    weight: Floats
    """(n,) weight of the estimate, 0 to 1."""
    distrusted: Bools
    """(n,) True while an estimate is not trusted."""


def blend_start() -> BlendState:
    """Return the state before the first sample: the measurement is used."""
    return BlendState(np.zeros(9))


def blended(
    state: BlendState, measured: Floats, estimate_N: Floats, known: Bools, settings: Online
) -> tuple[BlendState, Blend]:
    """Return the superposition of measured loads (n, 6) and estimated forces (n, 3).

    ``known`` (n,) is False where there is no estimate; the last one is then blended out as above.
    The estimate has no moment: its part of the load has none.
    """
    values = shaped("measured", measured, -1, 6)
    after = BlendState(state.values.copy())
    blend = Blend(np.empty(values.shape), np.empty(len(values)), np.zeros(len(values), dtype=np.bool_))
    patience_s = settings.pilot_lead_s + settings.blend_s + 2.0 * settings.filter_s
    estimate = shaped("estimate_N", estimate_N, len(values), 3)
    _blend(
        values,
        estimate,
        np.ascontiguousarray(known),
        after.values,
        settings.cycle_s,
        settings.threshold_N,
        settings.blend_s,
        patience_s,
        blend.load,
        blend.weight,
        blend.distrusted,
    )
    return after, blend


LoadFrame = Literal["base", "tcp", "sensor"]


@dataclass(frozen=True, kw_only=True)
class CycleInputs:
    """Inputs, a row for each cycle."""

    time_s: Floats
    """(n,) on the controller's clock."""
    load: Floats
    """(n, 6) force in N and moment in N·mm on the tool, as the sensor states them; NaN where it is silent."""
    q_rad: Floats
    """(n, 6) present joints."""
    q_command_rad: Floats
    """(n, 6) joints of the program, without correction."""
    position_mm: Floats
    """(n, 3) tip of the program in ``$BASE``, without correction."""
    announced: Announced
    """(n,) columns: what the controller reports of the pilot."""

    def __len__(self) -> int:
        return len(self.time_s)

    def rows(self, start: int, end: int) -> "CycleInputs":
        """Return some rows."""
        announced = Announced(*(column[start:end] for column in self.announced))
        columns = {f.name: getattr(self, f.name)[start:end] for f in fields(self) if f.name != "announced"}
        return CycleInputs(**columns, announced=announced)


@dataclass(frozen=True, kw_only=True)
class Corrections:
    """Outputs, a row for each cycle, with intermediate results."""

    correction: Floats
    """(n, 3) x, y, z in mm along ``$BASE``, or (n, 6) A1 to A6 in rad."""
    wanted_mm: Floats
    """(n, 3) before PID and limits."""
    load: Floats
    """(n, 6) load that is compensated, along ``$BASE``."""
    measured: Floats
    """(n, 6) filtered, along ``$BASE``."""
    estimate_N: Floats
    """(n, 3) the pilot's, along ``$BASE``; zero where unknown."""
    weight: Floats
    """(n,) weight of the estimate."""
    gate: Ints
    """(n,) `pilot_gate.Gate`: why the pilot is not used, 0 = it is."""
    distrusted: Bools
    """(n,) the estimate was wrong in a steady cut."""
    sensor_lost: Bools
    """(n,)"""
    blocked: Bools
    """(n,) held because a joint is near its limit, or the pose out of reach."""


@dataclass(frozen=True)
class Compensator:
    """Constants of a compensator; made by `compensator`."""

    cell: Cell
    settings: Online
    tool: int
    load_frame: LoadFrame
    calibration: Calibration | None
    table: PilotTable
    pilot_frame: Literal["tcp", "base"]
    pilot_form: Literal["index", "values"]
    bounds: Bounds = field(repr=False)


class State(NamedTuple):
    """States of all stages."""

    filter: FilterState
    gate: GateState
    blend: BlendState
    feed: FeedState
    limit: LimitState


def build_compensator(
    cell: Cell,
    settings: Online,
    *,
    tool: int = 1,
    load_frame: LoadFrame = "sensor",
    calibration: Calibration | None = None,
    knots: Knots | None = None,
    header: PilotHeader | None = None,
) -> Compensator:
    """Return a compensator.

    Parameters
    ----------
    load_frame : axes along which the load is stated, and the point of its moment: ``sensor`` about the
        origin of the sensor (freed from weight and offset by ``calibration``), else about the tool tip.
    knots, header : sidecar of the program that will run; None = no pilot.

    Raises
    ------
    NotUnderstoodError
        Where the cell does not state the stiffness of every virtual joint, or has no such tool.
    """
    missing = assumed_stiffness(cell)
    if missing is not None:
        raise NotUnderstoodError(missing, cell.name)
    if tool not in cell.tool:
        known = ", ".join(str(number) for number in sorted(cell.tool))
        raise input_error("tool-unknown", f"tool {tool} is not in the cell", f"known are {known}")
    bounds = cartesian_bounds(settings) if settings.mode == "cartesian" else axis_bounds(settings)
    table = pilot_table(knots, header)
    frame, form = (header.frame, header.form) if header is not None else ("base", "index")
    return Compensator(cell, settings, tool, load_frame, calibration, table, frame, form, bounds)


def start(device: Compensator) -> State:
    """Return the state before the first cycle: no force known, no correction.

    Raises `RefusedError` where a table may turn: then forces would be along other axes than they seem to be.
    """
    require_still(device.cell, "the online compensation", rails=False)
    return State(
        filter_start(device.settings),
        gate_start(),
        blend_start(),
        feed_start(device.settings),
        limit_start(len(device.bounds.most)),
    )


def step(device: Compensator, state: State, sample: CycleInputs) -> tuple[State, Corrections]:
    """Return the state after one cycle, and its correction; `sample` has one row."""
    return stream(device, state, sample)


def stream(
    device: Compensator, state: State, samples: CycleInputs, held: Bools | None = None
) -> tuple[State, Corrections]:
    """Return the state after all rows, and their corrections; ``held`` rows (n,) repeat the last one.

    The result does not depend on how a recording is divided into calls.
    """
    cell, settings, tool = device.cell, device.settings, device.tool
    rotation = _tool_rotation(samples.q_rad, cell, tool)
    raw = _load_base(device, samples, rotation)
    filter_state, measured, lost = filtered(state.filter, raw, settings)
    gate_state, pilot_N, known, gate = estimate(
        state.gate, samples.time_s, samples.position_mm, samples.announced, device.table, settings
    )
    estimate_N = _pilot_base(device, pilot_N, rotation)
    blend_state, blend = blended(state.blend, measured, estimate_N, known, settings)
    feed_state, feed = feed_of(state.feed, samples.position_mm)
    force, moment = blend.load[:, :3], blend.load[:, 3:]
    _, wanted_mm = deflection_of(samples.q_rad, force, moment, feed, cell, tool, threads=1)
    joints = joints_at(samples.q_command_rad, wanted_mm, cell)
    blocked = _near_limit(joints, samples.q_command_rad, cell, settings)
    wanted = wanted_mm if settings.mode == "cartesian" else joints - samples.q_command_rad
    hold = lost | blocked if held is None else lost | blocked | held
    limit_state, correction = limited(state.limit, wanted, hold, device.bounds)
    after = State(filter_state, gate_state, blend_state, feed_state, limit_state)
    return after, Corrections(
        correction=correction,
        wanted_mm=wanted_mm,
        load=blend.load,
        measured=measured,
        estimate_N=estimate_N,
        weight=blend.weight,
        gate=gate,
        distrusted=blend.distrusted,
        sensor_lost=lost,
        blocked=blocked,
    )


def sensor_in_flange(cell: Cell) -> Floats:
    """Return the sensor frame (4, 4) in the flange: its axes, on the face that carries the end effector.

    An assumption: makers state the origin at the tool side.
    """
    return fr.transform([0.0, 0.0, cell.compliance.known_height_mm()], np.eye(3))


def _tool_rotation(q_rad: Floats, cell: Cell, tool: int) -> Floats:
    """Return the rotations (n, 3, 3) of the inner tool frame in ``$BASE``."""
    _, flange = flange_pose(q_rad, cell.robot.geometry.array())
    turned: Floats = cell.base_matrix()[:3, :3].T @ flange @ cell.tool_matrix(tool)[:3, :3]
    return turned


def _load_base(device: Compensator, samples: CycleInputs, rotation: Floats) -> Floats:
    """Return force and moment (n, 6) about the tip along ``$BASE``."""
    force, moment = samples.load[:, :3], samples.load[:, 3:]
    if device.load_frame == "base":
        return samples.load
    if device.load_frame == "sensor":
        cell = device.cell
        tool_frame = cell.tool_matrix(device.tool)
        if device.calibration is not None:
            flange = cell.base_matrix()[:3, :3] @ rotation @ tool_frame[:3, :3].T
            turned = fr.quaternion_from_rotation(flange)
            force, moment = compensate(force, moment, turned, device.calibration)
        force, moment = transfer_to_tcp(force, moment, fr.invert(sensor_in_flange(cell)) @ tool_frame)
    return np.concatenate([_turned(rotation, force), _turned(rotation, moment)], axis=1)


def _pilot_base(device: Compensator, pilot_N: Floats, rotation: Floats) -> Floats:
    """Return the estimate along ``$BASE``; knots state it along the controller's tool or base axes."""
    if device.pilot_frame == "base":
        return pilot_N
    axes = controller_axes(device.cell.tool[device.tool].axis or "+z")[:3, :3].T
    return _turned(rotation @ axes, pilot_N)


def _turned(rotation: Floats, vector: Floats) -> Floats:
    """Return R·v for each row; written out, because the rounding of a matrix product depends on the rows."""
    x, y, z = vector[:, :1], vector[:, 1:2], vector[:, 2:]
    turned: Floats = rotation[:, :, 0] * x + rotation[:, :, 1] * y + rotation[:, :, 2] * z
    return turned


def joints_at(q_rad: Floats, shift_mm: Floats, cell: Cell) -> Floats:
    """Return the joints (n, 6) that move the tip by a shift (n, 3) in mm along ``$BASE``, same orientation.

    Closed-form inverse kinematics on the branch that the joints ``q_rad`` (n, 6) are on; NaN out of reach.
    """
    geometry = cell.robot.geometry.array()
    position, rotation = flange_pose(q_rad, geometry)
    base = np.broadcast_to(cell.base_matrix()[:3, :3], rotation.shape)
    branches = all_branches(position + _turned(base, shift_mm), rotation, geometry)
    status, _ = status_turn(q_rad, geometry)
    q = branches[np.arange(len(branches)), status]
    nearest: Floats = q + np.rint((q_rad - q) / (2.0 * np.pi)) * (2.0 * np.pi)
    return nearest


def _near_limit(joints: Floats, q_rad: Floats, cell: Cell, settings: Online) -> Bools:
    """Return (n,) True where the corrected joints are too close to a limit, and closer than the program's."""
    if cell.robot.limits.q_deg is None:
        return np.isnan(joints[:, 0])
    low, high = np.array(cell.robot.limits.q_deg).T * RAD_PER_DEG
    margin = np.minimum(joints - low, high - joints)
    program_margin = np.minimum(q_rad - low, high - q_rad)
    least = settings.limit_margin_deg * RAD_PER_DEG
    near: Bools = ((margin < least) & (margin < program_margin)).any(axis=1) | np.isnan(joints[:, 0])
    return near
