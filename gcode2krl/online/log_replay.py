"""The corrections that the compensator would have sent in a recorded run, and the error left.

The same stages as in the twin and on the robot; joints, commanded path and forces come from the run.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import require_still
from gcode2krl.cell.sections.online import Online
from gcode2krl.compliance import project_normal, tip_position
from gcode2krl.compliance.sensor import Calibration
from gcode2krl.errors import Issue, input_error
from gcode2krl.frames import invert
from gcode2krl.online.compensator import Corrections, CycleInputs, build_compensator, start, stream
from gcode2krl.online.pilot_gate import Announced, Gate
from gcode2krl.online.plant import reaction, tip_shift_mm
from gcode2krl.online.twin import World
from gcode2krl.pilot import Knots, PilotHeader
from gcode2krl.runs import Run
from gcode2krl.runs.measured import Measured

_GAP_S = 0.1
"""A sensor was silent between two samples further apart than this."""


@dataclass(frozen=True)
class Replay:
    """A recorded run with the corrections it did not have, n cycles."""

    time_s: Floats
    corrections: Corrections
    shift_mm: Floats
    """(n, 3) motion of a robot that follows them, along ``$BASE``."""
    before_mm: Floats | None
    """(n,) measured deviation normal to the feed; None without a tracker."""
    after_mm: Floats | None
    """(n,) deviation that would have been left."""
    issues: tuple[Issue, ...]


def replay(
    run: Run,
    cell: Cell,
    settings: Online,
    *,
    tool: int = 1,
    calibration: Calibration | None = None,
    knots: Knots | None = None,
    header: PilotHeader | None = None,
    world: World | None = None,
) -> Replay:
    """Return the corrections that the compensator would have sent in a run.

    Knots are assumed to be announced ``lead_s`` ahead of their predicted time, on the clock on which
    ``run.toml`` puts its tables. ``calibration`` is that of forces recorded in the sensor's axes. ``world``
    has the delays of the robot. An error is the tip minus its command.

    Raises `NotUnderstoodError` where the run has no forces, no joints, or ends at once, `RefusedError` where
    external axes of the cell may move.
    """
    require_still(cell, "a replay")
    controller, force = run.controller, run.force
    if controller is None or force is None:
        missing = "controller" if controller is None else "force"
        raise input_error("run-files", f"no {missing} table: nothing to replay", source=str(run.folder))
    q_rad = controller.q_act_rad if controller.q_act_rad is not None else controller.q_cmd_rad
    q_command = controller.q_cmd_rad if controller.q_cmd_rad is not None else q_rad
    if q_rad is None or q_command is None:
        raise input_error("trace-column", "no joints: the compliance needs them", source=controller.source)
    first = max(controller.time_s[0], force.time_s[0])
    last = min(controller.time_s[-1], force.time_s[-1])
    time_s = np.arange(first, last, settings.cycle_s)
    if len(time_s) < 2:
        raise input_error("run-clock", "controller and force do not overlap", source=str(run.folder))
    moment = force.moment_Nmm if force.moment_Nmm is not None else np.zeros((len(force), 3))
    command = _at(controller, q_command, time_s)
    samples = CycleInputs(
        time_s=time_s,
        load=_silent(force, _at(force, np.concatenate([force.force_N, moment], axis=1), time_s), time_s),
        q_rad=_at(controller, q_rad, time_s),
        q_command_rad=command,
        position_mm=_command_mm(run, command, time_s, cell, tool),
        announced=_announced(run, time_s, knots, header),
    )
    device = build_compensator(
        cell,
        settings,
        tool=tool,
        load_frame=run.head.frames.force,
        calibration=calibration,
        knots=knots,
        header=header,
    )
    _, corrections = stream(device, start(device), samples)
    world = world or World()
    moved = reaction(corrections.correction, time_s, world.dead_s, world.lag_s)
    shift = moved if settings.mode == "cartesian" else tip_shift_mm(command + moved, command, cell, tool)
    before, after = _errors(run, samples, shift)
    return Replay(time_s, corrections, shift, before, after, tuple(_findings(run, corrections)))


def as_json(result: Replay) -> dict[str, Any]:
    """Return the object of ``online replay --json``."""
    corrections = result.corrections
    gates = np.bincount(corrections.gate, minlength=len(Gate))
    return {
        "cycles": len(result.time_s),
        "time_s": float(result.time_s[-1] - result.time_s[0]),
        "max_correction_mm": float(np.linalg.norm(result.shift_mm, axis=1).max()),
        "max_force_N": float(np.linalg.norm(corrections.measured[:, :3], axis=1).max()),
        "before_mm": None if result.before_mm is None else float(np.nanmax(result.before_mm)),
        "after_mm": None if result.after_mm is None else float(np.nanmax(result.after_mm)),
        "pilot_cycles": int((corrections.weight > 0.0).sum()),
        "gate_cycles": {gate.name.lower(): int(gates[gate]) for gate in Gate if gates[gate]},
        "sensor_lost_cycles": int(corrections.sensor_lost.sum()),
        "blocked_cycles": int(corrections.blocked.sum()),
    }


def columns(result: Replay) -> dict[str, Floats]:
    """Return the table of a replay, for CSV."""
    table = {"t_s": result.time_s}
    tables = (
        ("correction_{}_mm", result.shift_mm),
        ("wanted_{}_mm", result.corrections.wanted_mm),
        ("force_{}_N", result.corrections.load[:, :3]),
        ("pilot_{}_N", result.corrections.estimate_N),
    )
    for pattern, values in tables:
        table |= {pattern.format(axis): values[:, k] for k, axis in enumerate("xyz")}
    table |= {"weight": result.corrections.weight, "gate": result.corrections.gate.astype(np.float64)}
    if result.before_mm is not None and result.after_mm is not None:
        table |= {"before_mm": result.before_mm, "after_mm": result.after_mm}
    return table


def _at(table: Measured, values: Floats, time_s: Floats) -> Floats:
    return np.stack([np.interp(time_s, table.time_s, column) for column in values.T], axis=1)


def _silent(table: Measured, values: Floats, time_s: Floats) -> Floats:
    """Return values (n, c), NaN where the table has a gap."""
    after = np.clip(np.searchsorted(table.time_s, time_s), 1, len(table.time_s) - 1)
    gap = table.time_s[after] - table.time_s[after - 1]
    return np.where((gap > _GAP_S)[:, None], np.nan, values)


def _command_mm(run: Run, q_command: Floats, time_s: Floats, cell: Cell, tool: int) -> Floats:
    """Return the commanded tip (n, 3) in ``$BASE``: as recorded, else from the commanded joints."""
    controller = run.controller
    if controller is not None and controller.position_cmd_mm is not None:
        return _at(controller, controller.position_cmd_mm, time_s)
    root, to_base = tip_position(q_command, cell, tool), invert(cell.base_matrix())
    command: Floats = root @ to_base[:3, :3].T + to_base[:3, 3]
    return command


def _announced(run: Run, time_s: Floats, knots: Knots | None, header: PilotHeader | None) -> Announced:
    """Return what the controller would have reported: knots on time, override and mode of ``run.toml``."""
    count = len(time_s)
    nothing = np.full(count, np.nan)
    if knots is None or header is None:
        return Announced(nothing, nothing, nothing, nothing)
    knot = np.searchsorted(knots.time_s - knots.lead_s, time_s, side="right") - 1.0
    return Announced(
        knot=knot.astype(np.float64),
        checksum=np.full(count, float(header.checksum)),
        override_percent=np.full(count, run.head.override_percent),
        t1=np.full(count, float(run.head.mode == "T1")),
    )


def _errors(run: Run, samples: CycleInputs, shift: Floats) -> tuple[Floats | None, Floats | None]:
    """Return the measured deviation normal to the feed, and the rest after the shift; ends are NaN."""
    tracker = run.tracker
    if tracker is None or run.head.frames.tracker != "base":
        return None, None
    error = _at(tracker, tracker.position_mm, samples.time_s) - samples.position_mm
    error[(samples.time_s < tracker.time_s[0]) | (samples.time_s > tracker.time_s[-1])] = np.nan
    feed = np.gradient(samples.position_mm, samples.time_s, axis=0)
    before: Floats = np.linalg.norm(project_normal(error, feed), axis=1)
    after: Floats = np.linalg.norm(project_normal(error + shift, feed), axis=1)
    return before, after


def _findings(run: Run, corrections: Corrections) -> list[Issue]:
    issues = list(run.issues)
    if run.head.channels.rsi:
        text = "run.toml: a correction was on: the joints and the error already include it"
        issues.append(Issue("warning", "replay-corrected", 0, text, "replay a run without correction"))
    if corrections.sensor_lost.any():
        text = f"the force sensor was lost in {int(corrections.sensor_lost.sum())} cycles: correction held"
        issues.append(Issue("warning", "replay-sensor", 0, text, ""))
    return issues
