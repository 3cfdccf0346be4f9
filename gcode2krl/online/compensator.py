"""The compensator of Haehn & Weigold 2020, fig. 2: from sensor, joints and announced knots to a correction.

    sensor -> weight and offset -> low-pass, moving average -> blend with the pilot -> compliance with the
    present joints -> projection normal to the feed -> (inverse kinematics) -> PID and limits -> correction

Every stage is a pure function ``(state, rows) -> (state, rows)``: `stream` takes a whole recording, `step`
one cycle of a running robot, and both give the same bits.
"""

from dataclasses import dataclass, field, fields
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell, controller_axes
from gcode2krl.cell.carried import require_still
from gcode2krl.cell.sections.online import Online
from gcode2krl.compliance import deflection_of, missing_stiffness
from gcode2krl.compliance.sensor import Calibration, compensate, transfer_to_tcp
from gcode2krl.errors import NotUnderstoodError, input_error
from gcode2krl.online.blending import BlendState, blend_start, blended
from gcode2krl.online.feed import FeedState, feed_of, feed_start
from gcode2krl.online.filters import FilterState, filter_start, filtered
from gcode2krl.online.limits import Bounds, LimitState, axis_bounds, cartesian_bounds, limit_start, limited
from gcode2krl.online.pilot_gate import Announced, GateState, PilotTable, estimate, gate_start, pilot_table
from gcode2krl.pilot import Knots, PilotHeader
from gcode2krl.robot.inverse_kinematics import all_branches
from gcode2krl.robot.kinematics import flange_pose, status_turn
from gcode2krl.units import RAD_PER_DEG

LoadFrame = Literal["base", "tcp", "sensor"]


@dataclass(frozen=True, kw_only=True)
class Samples:
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
    told: Announced
    """(n,) columns: what the controller reports of the pilot."""

    def __len__(self) -> int:
        return len(self.time_s)

    def rows(self, start: int, end: int) -> "Samples":
        """Return some rows."""
        told = Announced(*(column[start:end] for column in self.told))
        own = {f.name: getattr(self, f.name)[start:end] for f in fields(self) if f.name != "told"}
        return Samples(**own, told=told)


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
    missing = missing_stiffness(cell)
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


def step(device: Compensator, state: State, sample: Samples) -> tuple[State, Corrections]:
    """Return the state after one cycle, and its correction; `sample` has one row."""
    return stream(device, state, sample)


def stream(
    device: Compensator, state: State, samples: Samples, held: Bools | None = None
) -> tuple[State, Corrections]:
    """Return the state after all rows, and their corrections; ``held`` rows (n,) repeat the last one.

    The result does not depend on how a recording is divided into calls.
    """
    cell, settings, tool = device.cell, device.settings, device.tool
    rotation = _tool_rotation(samples.q_rad, cell, tool)
    raw = _load_base(device, samples, rotation)
    filter_state, measured, lost = filtered(state.filter, raw, settings)
    gate_state, pilot_N, known, gate = estimate(
        state.gate, samples.time_s, samples.position_mm, samples.told, device.table, settings
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


def _load_base(device: Compensator, samples: Samples, rotation: Floats) -> Floats:
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
