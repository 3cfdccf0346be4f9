"""Findings along the path: reach, limits, singularities, joint speeds, PTP paths.

The whole program is judged row by row (`standing`); the few stretches that are named in a finding are then
sampled again, so that a message can state the place and the angle.
"""

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import from_rest
from gcode2krl.compiled.chunks import ROWS
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.robot.branch import Branch
from gcode2krl.robot.lines import Line, path_of, sample_lines
from gcode2krl.robot.poses import forward
from gcode2krl.robot.standing import (
    ALL_BITS,
    FAST,
    UNREACHED,
    WRIST,
    WRIST_ZONE_RAD,
    Bits,
    limit_margin,
    limits_rad,
    what_is_wrong,
)
from gcode2krl.robot.velocity_kinematics import smallest_singular_value
from gcode2krl.tables import Targets
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

WEAK_SIGMA = 0.03
"""Smallest singular value below which an excessive joint speed is called a singularity of the arm."""
_NEIGHBOURS = 2
"""Rows before and after the beginning of a stretch that are sampled with it."""
_GAP = 1000
"""Rows between two spans that are faster to sample than to leave out."""
_TURN_OR_MOVE = 'turn the tool about its axis ([frames] spin = "auto" or an angle), or move the part'
_PTP_SAMPLES = 50
_PTP_TOLERANCE_MM = 0.01


def joint_findings(
    targets: Targets, q: Floats, wrong: Bits, counts: Ints, branch: Branch, cell: Cell
) -> tuple[Issue, ...]:
    """Return the findings along the path, by line.

    ``q`` (p, 6) are the joints at the targets, ``wrong`` (p,) the bits of `what_is_wrong` on the way there,
    ``counts`` (p,) the samples up to and with each.
    """
    findings = [*_cell_findings(cell)]
    if wrong.any():
        line, joints, bits = _sampled(targets, q, _spans(wrong, np.diff(counts, prepend=0)), branch, cell)
        findings += _reach_findings(line, bits, targets)
        findings += _limit_findings(line, joints, bits, targets, cell)
        findings += _speed_findings(line, joints, bits, targets, cell)
        findings += _wrist_findings(line, joints, bits, targets)
    findings += _ptp_findings(targets, q, cell)
    findings += _load_findings(targets, cell)
    return tuple(sorted(findings, key=lambda issue: issue.line)[: 5 * MOST_PLACES])


def _sampled(
    targets: Targets, q: Floats, spans: list[tuple[int, int]], branch: Branch, cell: Cell
) -> tuple[Line, Floats, Bits]:
    """Return the samples (m) of spans of rows, their joints, and what is wrong with them."""
    lines, joints, wrong = [], [], []
    for start, end in spans:
        line = sample_lines(targets, cell, start, end)
        starts = np.isnan(line.duration_s)
        q_span = branch.joints(path_of(line, cell), cell, _last_reached(q, start))
        line.duration_s[:1] = np.nan  # the sample before is another span's
        bits = what_is_wrong(q_span, line.duration_s, cell)
        if not starts[:1].any():  # the start of a span is not the start of a stretch
            bits[:1] |= bits[1:2] & FAST
        lines.append(line)
        joints.append(q_span)
        wrong.append(bits)
    names = [spec.name for spec in fields(Line)]
    columns = {name: np.concatenate([getattr(line, name) for line in lines]) for name in names}
    return Line(**columns), np.concatenate(joints), np.concatenate(wrong)


def _last_reached(q: Floats, row: int) -> Floats | None:
    """Return the joints (6,) of the last row in reach before ``row``, None where there is none."""
    for end in range(row, 0, -ROWS):
        first = max(end - ROWS, 0)
        reached = np.flatnonzero(~np.isnan(q[first:end, 0]))
        if len(reached):
            q_last: Floats = q[first + reached[-1]]
            return q_last
    return None


def _spans(wrong: Bits, samples: Ints) -> list[tuple[int, int]]:
    """Return (first row, end) of the spans in which the first stretches of each kind begin, with neighbours.

    A stretch begins with a run of wrong rows, or within it where a row or the one before has several samples.
    """
    chosen = np.zeros(len(wrong) + 2 * _NEIGHBOURS, dtype=np.bool_)
    several = samples > 1
    several[1:] |= several[:-1].copy()
    for bit in ALL_BITS:
        starts, ends = _runs((wrong & bit) != 0)
        for start, end in zip(starts[:MOST_PLACES], ends[:MOST_PLACES], strict=True):
            begins = start + np.append(0, np.flatnonzero(several[start:end]))
            for neighbour in range(2 * _NEIGHBOURS + 1):
                chosen[begins + neighbour] = True
    starts, ends = _runs(chosen[_NEIGHBOURS : _NEIGHBOURS + len(wrong)])
    is_gap = starts[1:] - ends[:-1] > _GAP
    first, last = np.append(True, is_gap), np.append(is_gap, True)
    return [(int(start), int(end)) for start, end in zip(starts[first], ends[last], strict=True)]


def _runs(has: Bools) -> tuple[Ints, Ints]:
    """Return the first row of each run of True and the row after its last."""
    change = np.diff(np.concatenate([[False], has, [False]]).astype(np.int8))
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)


def _stretches(bits: Bits, bit: int) -> list[int]:
    return [int(sample) for sample in _runs((bits & bit) != 0)[0][:MOST_PLACES]]


def _source_line(line: Line, sample: int, targets: Targets) -> int:
    return int(targets.source_line[line.target[sample]])


def _cell_findings(cell: Cell) -> Iterator[Issue]:
    """Yield the findings that do not depend on the path."""
    if cell.robot.limits.q_deg is None:
        yield Issue(
            "error",
            "limits-unknown",
            0,
            f"the joint limits of {cell.robot.title} are not known",
            "give [robot.limits] q_deg in the cell, from the data sheet",
        )
    home = limit_margin(cell.home_q_rad()[None, :], cell)[0]
    if home < 0:
        yield Issue(
            "error",
            "home-limit",
            0,
            f"HOME is {-home * DEG_PER_RAD:.2f} deg beyond a joint limit",
            "correct [home] q_deg in the cell",
        )
    if cell.robot.speeds.qd_deg_s is None:
        yield Issue(
            "warning",
            "joint-speeds-unknown",
            0,
            f"joint speeds of {cell.robot.title} are not known; singularities are judged by |A5| alone",
            "give [robot.speeds] qd_deg_s in the cell",
        )


def _load_findings(targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield the loads of the program's tools that the robot is not rated for, the cell's once."""
    rated = cell.robot.payload.mass_kg
    loads = {id(load): (n, load) for n in distinct(targets.tool).tolist() for load in [cell.load_of(n)]}
    for number, load in loads.values():
        if rated is None or load.mass_kg is None or load.mass_kg <= rated:
            continue
        is_of_tool = load is not cell.load
        whose, key = (f" with T{number}", f"[tool.{number}] load") if is_of_tool else ("", "[load]")
        sentence = f"the load of {load.mass_kg:g} kg{whose} is above the rated {rated:g} kg"
        yield Issue("error", "overload", 0, sentence, f"correct {key}")


def _reach_findings(line: Line, bits: Bits, targets: Targets) -> Iterator[Issue]:
    for sample in _stretches(bits, UNREACHED):
        x, y, z = line.position_mm[sample]
        yield Issue(
            "error",
            "out-of-reach",
            _source_line(line, sample, targets),
            f"X {x:.3f} Y {y:.3f} Z {z:.3f} is out of reach",
            "move the part nearer ([frames] base), or check the unit",
        )


def _limit_findings(line: Line, q: Floats, bits: Bits, targets: Targets, cell: Cell) -> Iterator[Issue]:
    remedy = 'move the part, turn the tool about its axis ([frames] spin), or use spin = "auto"'
    if cell.frames.spin == "auto":
        remedy = 'move the part ([frames] base): spin = "auto" has found no angle that would do'
    for joint, (low, high) in enumerate(limits_rad(cell) * DEG_PER_RAD):
        for sample in _stretches(bits, 1 << joint):
            yield Issue(
                "error",
                "joint-limit",
                _source_line(line, sample, targets),
                f"A{joint + 1} at {q[sample, joint] * DEG_PER_RAD:.2f} deg, allowed {low:g}..{high:g}",
                remedy,
            )


def _speed_findings(line: Line, q: Floats, bits: Bits, targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield joint speeds above the limit on straight lines: singularities, or merely slow joints."""
    if cell.robot.speeds.qd_deg_s is None:
        return
    most = np.array(cell.robot.speeds.qd_deg_s) * RAD_PER_DEG
    for sample in _stretches(bits, FAST):
        speed = np.abs(q[sample] - q[sample - 1]) / line.duration_s[sample]
        joint = int(np.argmax(speed / most))
        near = slice(max(0, sample - 1), sample + 2)
        wrist = np.abs(np.sin(q[near, 4])).min() < np.sin(WRIST_ZONE_RAD)
        tip = cell.tool_matrix(int(line.tool[sample]))[:3, 3]
        arm = smallest_singular_value(q[near], cell.robot.geometry.array(), tip).min() < WEAK_SIGMA
        needed, allowed = speed[joint] * DEG_PER_RAD, most[joint] * DEG_PER_RAD
        number = f"A{joint + 1} would need {needed:.0f} deg/s of {allowed:.0f}"
        where = _source_line(line, sample, targets)
        if wrist or arm:
            what = "wrist singularity (A5 near 0)" if wrist else "singularity of the arm"
            yield Issue("error", "singularity", where, f"{what}: {number}", _TURN_OR_MOVE)
        else:
            yield Issue(
                "warning",
                "joint-speed",
                where,
                f"{number}: slower than programmed here",
                "lower F, or move the part",
            )


def _wrist_findings(line: Line, q: Floats, bits: Bits, targets: Targets) -> Iterator[Issue]:
    for sample in _stretches(bits, WRIST):
        yield Issue(
            "error",
            "singularity",
            _source_line(line, sample, targets),
            f"wrist singularity: A5 at {q[sample, 4] * DEG_PER_RAD:.2f} deg",
            _TURN_OR_MOVE,
        )


def _ptp_findings(targets: Targets, q: Floats, cell: Cell) -> list[Issue]:
    """Return PTP motions that dip below the clearance plane, sampled in joint space."""
    clearance = cell.clearance_z_mm
    if clearance is None:
        return []
    remedy = "choose HOME above the plane ([home] q_deg), or lower [clearance] z_mm"
    home_z = targets.position_mm[targets.home, 2].min(initial=np.inf)
    if home_z < clearance - _PTP_TOLERANCE_MM:
        sentence = f"the tip at HOME is at Z {home_z:.1f}, below the clearance plane at {clearance:g}"
        return [Issue("error", "home-below-clearance", 0, sentence, remedy)]
    part = np.linspace(0.0, 1.0, _PTP_SAMPLES)[:, None]
    for row in np.flatnonzero(targets.ptp[1:]) + 1:
        path = q[row - 1] + (q[row] - q[row - 1]) * part
        if np.isnan(path).any():
            continue
        external = targets.external[row - 1] + (targets.external[row] - targets.external[row - 1]) * part
        seen = forward(path, cell, int(targets.tool[row]))
        lowest = from_rest(*seen, external, cell)[0][:, 2].min()
        if lowest < clearance - _PTP_TOLERANCE_MM:
            sentence = f"PTP comes down to Z {lowest:.1f}, below the clearance plane at {clearance:g}"
            return [Issue("error", "ptp-below-clearance", int(targets.source_line[row]), sentence, remedy)]
    return []
