"""The summary a person reads after a translation."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.cell.checked_parts import collision_scope
from gcode2krl.chain import Plan
from gcode2krl.cli.loads import load_lines
from gcode2krl.compiled.inputs import distinct
from gcode2krl.krl import WrittenProgram
from gcode2krl.krl.external_words import axes_words
from gcode2krl.pose.chatter import chatter_not_judged
from gcode2krl.prediction.forecast import Forecast
from gcode2krl.translation.quantity import band_words, quantities
from gcode2krl.units import BYTES_PER_MB, DEG_PER_RAD, MM_PER_M, S_PER_MIN


def summary_lines(
    part: str, plan: Plan, forecast: Forecast, corner_mm: float, written: WrittenProgram
) -> Iterator[str]:
    """Yield the lines of the summary; ``corner_mm`` is the largest corner error."""
    toolpath, targets, joints, cell = plan.toolpath, plan.targets, plan.joints, plan.cell
    size_mb = written.size_bytes / BYTES_PER_MB
    report = written.report
    lin = ~targets.ptp
    steps_m = np.zeros(len(targets))
    steps_m[1:] = np.linalg.norm(np.diff(targets.position_mm, axis=0), axis=1) / MM_PER_M
    rapid = lin & (targets.speed_mm_s == cell.controller.rapid_m_s * MM_PER_M)
    feed = lin & ~rapid
    blended = targets.cdis_mm > 0
    away = ~targets.home
    lines = _span(targets.source_line[targets.source_line > 0], 0)
    x, y, z = (_span(targets.position_mm[lin, k], 2) for k in range(3))
    tools = [f"T{n} {cell.tool[n].model}".rstrip() for n in distinct(targets.tool[lin]).tolist()]
    wrist_deg = np.degrees(np.abs(joints.q_rad[away, 4]).min())
    limit_deg = joints.limit_margin_rad[away].min() * DEG_PER_RAD
    read_back = f"{report.max_deviation_mm:.4f} mm, {report.max_rotation_deg:.4f} deg"
    speed_off = report.max_speed_difference_mm_min

    yield f"{part} -> {_files(written)} ({size_mb:.2f} MB)"
    yield f"  program    {written.name}: {len(toolpath) - 1} moves, {len(targets)} motions, lines {lines}"
    yield from (f"  name       {issue.message}" for issue in written.issues if issue.code == "krl-name")
    yield f"  time       {_duration(forecast.time_s)} of motion, without spindle and tools"
    yield f"  path       {steps_m[feed].sum():.3f} m at feed, {steps_m[rapid].sum():.3f} m rapid"
    yield f"  feed       {_span(targets.speed_mm_s[feed] * S_PER_MIN, 0)} mm/min"
    yield f"  extent     X {x}, Y {y}, Z {z} mm in $BASE"
    yield f"  tools      {', '.join(tools)}"
    yield f"  blending   {np.count_nonzero(blended)} corners, CDIS {_span(targets.cdis_mm[blended], 3)} mm"
    yield f"  corners    off by at most {corner_mm:.4f} mm"
    yield f"  standstill {np.count_nonzero(lin & ~blended)} exact stops, {targets.wait_s.sum():.1f} s dwell"
    yield f"  robot      {cell.robot.title}, status S = {joints.status[away][0]}"
    yield f"  joints     nearest limit {limit_deg:.1f} deg, |A5| at least {wrist_deg:.1f} deg"
    yield from (f"  external   {words}" for words in axes_words(targets, cell))
    yield f"  read back  {report.motions} motions, off by {read_back}, {speed_off:.2f} mm/min"
    yield from load_lines(forecast.loads, cell)
    known = quantities(forecast.loads, forecast.time_s, targets, cell)
    yield from (f"  band       {words}" for words in band_words(known))
    yield from _collisions(cell, distinct(targets.tool).tolist(), is_cut=forecast.has_forces)


def _collisions(cell: Cell, tools: list[int], *, is_cut: bool) -> Iterator[str]:
    """Yield what was checked for collisions and what was not."""
    scope, chatter = (
        collision_scope(cell, tools, is_cut=is_cut),
        chatter_not_judged(cell, tools, is_cut=is_cut),
    )
    if scope is None:
        yield "  not known  collision of arm, spindle and cables" + f"; {chatter}" * bool(chatter)
        return
    yield f"  collisions none: {', '.join(scope.movers)}"
    yield f"             against {', '.join(scope.obstacles) or 'nothing that the cell states'}"
    yield f"  not known  collision of {', '.join(scope.unchecked)}" + f"; {chatter}" * bool(chatter)


def _duration(seconds: float) -> str:
    minutes, seconds_left = divmod(float(seconds), S_PER_MIN)
    return f"{int(minutes)} min {seconds_left:.1f} s" if minutes else f"{seconds_left:.2f} s"


def _files(written: WrittenProgram) -> str:
    first, *further = [str(file) for file in written.files]
    parts = [name for name in further if name.endswith(".src")]
    others = [name for name in further if not name.endswith(".src")]
    if len(parts) > 2:
        parts = [f"{len(parts)} parts {parts[0]} ... {parts[-1]}"]
    return ", ".join([first, *parts, *others])


def _span(values: "np.ndarray[tuple[int], np.dtype[np.float64 | np.int32]]", decimals: int) -> str:
    if len(values) == 0:
        return "none"
    low, high = float(values.min()), float(values.max())
    return f"{low:.{decimals}f}" if low == high else f"{low:.{decimals}f}..{high:.{decimals}f}"
