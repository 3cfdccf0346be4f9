"""The summary a person reads after a translation."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.krl import WrittenProgram
from gcode2krl.tables import Joints, Targets, Toolpath
from gcode2krl.units import BYTES_PER_MB, DEG_PER_RAD, MM_PER_M, S_PER_MIN


def summary_lines(part: str, toolpath: Toolpath, targets: Targets, joints: Joints, written: WrittenProgram, cell: Cell) -> Iterator[str]:
    """Yield the lines of the summary."""
    size_mb = sum(len(text) for text in written.texts.values()) / BYTES_PER_MB
    yield f"{part} -> {', '.join(str(file) for file in written.files)} ({size_mb:.2f} MB)"
    yield f"  program   {written.name}: {len(toolpath) - 1} moves, {len(targets)} motions, G-code lines {_span(targets.source_line[targets.source_line > 0], 0)}"
    lin = ~targets.ptp
    steps = np.zeros(len(targets))
    steps[1:] = np.linalg.norm(np.diff(targets.position_mm, axis=0), axis=1)
    rapid = lin & (targets.speed_mm_s == cell.controller.rapid_m_s * MM_PER_M)
    feed = lin & ~rapid
    yield f"  path      {steps[feed].sum() / MM_PER_M:.3f} m at feed, {steps[rapid].sum() / MM_PER_M:.3f} m rapid"
    if feed.any():
        yield f"  feed      {_span(targets.speed_mm_s[feed] * S_PER_MIN, 0)} mm/min"
    x, y, z = (targets.position_mm[feed | rapid, k] for k in range(3))
    yield f"  extent    X {_span(x, 1)}, Y {_span(y, 1)}, Z {_span(z, 1)} mm in $BASE"
    tools = [f"T{n} {cell.tool[n].model}".rstrip() for n in np.unique(targets.tool).tolist()]
    yield f"  tools     {', '.join(tools)}"
    blended = targets.cdis_mm > 0
    yield f"  corners   {np.count_nonzero(blended)} blended, CDIS {_span(targets.cdis_mm[blended], 3)} mm; {np.count_nonzero(lin & ~blended)} exact stops"
    angle = np.degrees(joints.q_rad[~targets.home])
    nearest = joints.limit_margin_rad[~targets.home].min() * DEG_PER_RAD
    yield f"  robot     {cell.robot.model}, S={joints.status[~targets.home][0]}, nearest joint limit {nearest:.1f} deg, |A5| at least {np.abs(angle[:, 4]).min():.1f} deg"
    report = written.report
    yield f"  read back {report.motions} motions: {report.max_deviation_mm:.4f} mm, {report.max_rotation_deg:.4f} deg, {report.max_speed_difference_mm_min:.2f} mm/min off: verified"
    yield "  not computed: time, corner error, forces, deflection; not checked: collision, material removal"


def _span(values: "np.ndarray[tuple[int], np.dtype[np.float64 | np.int32]]", decimals: int) -> str:
    if len(values) == 0:
        return "none"
    low, high = float(values.min()), float(values.max())
    return f"{low:.{decimals}f}" if low == high else f"{low:.{decimals}f}..{high:.{decimals}f}"
