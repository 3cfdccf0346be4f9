"""The material as cut before a restart, and the way down into it.

The way: HOME, PTP to a point on the tool axis above the first position, at the highest safe height that is
known; at rapid speed down the axis to just above the material; from there at feed to the start of the line's
move. A rapid is not repeated: the way then ends at its end.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from gcode2krl import cutting, krc4, program
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, prepare
from gcode2krl.cutting.dexels import Dexels
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.errors import Gcode2KrlError, Issue, RefusedError
from gcode2krl.pipeline import plan_motion
from gcode2krl.restart.rows import approached_row, begun_at, begun_row, row_before
from gcode2krl.tables import Motion, Restart, Toolpath

ABOVE_STOCK_MM = 10.0
"""Least height above the raw part at which the tool arrives: assumed, as the part may stand higher."""
ENTRY_MM = 2.0
"""Height above the material at which the way down goes on at feed."""
_LEAST_UPRIGHT = 0.5
"""Least z of a tool axis along which a way from above is taken: 60 degrees from the vertical."""
_CONTACT_MM = 0.02
_MOST_OF_CORNER_MM = 0.3
"""A rounded corner never excuses a thicker layer, as in `cutting.findings`."""
_UNTRUE = "rapid-in-stock"
"""A finding about the lines before that makes the material they have left doubtful."""
_MISSING = frozenset({"tool-unknown", "tool-missing"})


@dataclass(frozen=True)
class _Before:
    """The whole program, and what the lines before the restart have left."""

    plan: Plan
    material: HeightField | Dexels | None
    """Dexels where the tool axis turns anywhere in the program."""
    to_field: Floats
    """(3, 3) from ``$BASE`` to the frame of the field."""

    @property
    def toolpath(self) -> Toolpath:
        """What the G-code says, from its first line on."""
        return self.plan.toolpath


def restarted(toolpath: Toolpath, line: int, cell: Cell, tolerance_mm: float | None = None) -> Toolpath:
    """Return the Toolpath that begins at a G-code line, see the module's head.

    Parameters
    ----------
    line : G-code line whose move is to be the first.
    tolerance_mm : blend tolerance that the program is made with.

    Raises
    ------
    NotUnderstoodError
        Where the line cannot be one to begin at, see `begun_row`.
    RefusedError
        Where a tool used before is missing, or the start of the line lies in material.
    """
    row = begun_row(toolpath, line)
    before, issues = _before(toolpath, row, cell, tolerance_mm)
    first = _first_row(before, row, cell)
    if first != row:
        issues.append(_one_before(toolpath, row, first))
    begins = int(toolpath.source_line[first])
    restart = Restart(line=line, begins_line=begins, material=before.material)
    begun = begun_at(toolpath, first, restart, _way(before, first, cell))
    issues += _other_arm(before, begun, cell, tolerance_mm)
    return replace(begun, issues=(*begun.issues, *issues))


# --- the lines before -------------------------------------------------------------------------------------


def _before(
    toolpath: Toolpath, row: int, cell: Cell, tolerance_mm: float | None
) -> tuple[_Before, list[Issue]]:
    """Return the program up to a row, and what makes its material doubtful or keeps it from being known."""
    _refuse_missing_tools(toolpath, row, cell)
    plan = prepare(toolpath, cell, tolerance_mm)
    try:
        motion = plan_motion(plan.targets, cell, cell.controller.cycle_s, watches=False)
        known = Restart(line=0, begins_line=0, material=cutting.raw_material(toolpath, motion, cell))
        done = _until(motion, krc4.build_chain(plan.targets, cell), row)
        removal = cutting.remove(replace(toolpath, restart=known), done, cell)
    except Gcode2KrlError as error:
        sentence = f"the material that the lines before have left is not known: {error.issues[0].message}"
        issue = Issue(
            "error", "restart-stock-unknown", 0, sentence, error.issues[0].advice() or "state [stock]"
        )
        return _Before(plan, None, np.eye(3)), [issue]
    # a rapid has removed what it met, so what is below it would count as cut
    collisions = [issue for issue in removal.forces.issues if issue.code == _UNTRUE]
    return _Before(plan, removal.material, removal.to_field), collisions


def _until(motion: Motion, chain: krc4.Chain, row: int) -> Motion:
    """Return a Motion up to the start of a row of the Toolpath, at least the first sample, above the work.

    The last sample may be a millimetre before it, so the apex of the corner there is added.
    """
    rows = motion.move < row
    rows[0] = True
    columns = {f.name: getattr(motion, f.name)[rows] for f in fields(motion) if "tail" in f.metadata}
    before = np.flatnonzero(chain.move < row)
    if len(before):
        columns = {name: np.concatenate([values, values[-1:]]) for name, values in columns.items()}
        columns["position_mm"][-1] = _apex(chain, int(before[-1]))
        step = columns["position_mm"][-1] - columns["position_mm"][-2]
        step_mm = float(np.linalg.norm(step))
        columns["path_mm"][-1] += step_mm
        columns["move"][-1] = chain.move[before[-1]]
        if step_mm > 0.0:
            columns["direction"][-1] = step / step_mm
    return Motion(**columns)


def _apex(chain: krc4.Chain, move: int) -> Floats:
    """Return the point (3,) of the path nearest to the end of a move of the chain: its parabola at half."""
    end, d_mm = chain.end_mm[move], float(chain.blend_mm[move])
    if d_mm == 0.0 or move + 1 >= len(chain.end_mm):
        return np.array(end)
    ways = chain.end_mm[move] - chain.start_mm[move], chain.end_mm[move + 1] - chain.start_mm[move + 1]
    u1, u2 = (way / np.linalg.norm(way) for way in ways)
    apex: Floats = end + 0.25 * d_mm * (u2 * chain.scale[move + 1] - u1 * chain.scale[move])
    return apex


def _refuse_missing_tools(toolpath: Toolpath, row: int, cell: Cell) -> None:
    """Raise where a tool of the lines before is missing: what it has cut is not known."""
    line = int(toolpath.source_line[row])
    issues = program.check_toolpath(toolpath, cell)
    missing = [issue for issue in issues if issue.code in _MISSING and issue.line <= line]
    if missing:
        raise RefusedError(missing, toolpath.source)


# --- where it begins --------------------------------------------------------------------------------------


def _first_row(before: _Before, row: int, cell: Cell) -> int:
    """Return the row to begin at: that of the line, or of the one before where the line begins in material.

    Raises `RefusedError` where that one does too.
    """
    depth_mm = _depth_mm(before, row, cell)
    if depth_mm <= _CONTACT_MM:
        return row
    other = row_before(before.toolpath, row)
    if other is not None and _depth_mm(before, other, cell) <= _CONTACT_MM:
        return other
    toolpath = before.toolpath
    sentence = (
        f"line {toolpath.source_line[row]} begins {depth_mm:.2f} mm deep in material as cut so far, and the "
        "line before does too: no straight way down the tool axis leads there"
    )
    rapids = np.flatnonzero(toolpath.rapid[1:row] & toolpath.is_position()[1:row]) + 1
    remedy = "begin at a rapid move"
    if len(rapids):
        remedy = f"--from-line {toolpath.source_line[rapids[-1]]}, the last rapid before it"
    issue = Issue("error", "restart-in-stock", int(toolpath.source_line[row]), sentence, remedy)
    raise RefusedError(issue, toolpath.source)


def _depth_mm(before: _Before, row: int, cell: Cell) -> float:
    """Return how deep in material the tool stands at the start of a row; of a rapid 0, as its end counts."""
    at = approached_row(before.toolpath, row)
    if before.material is None or at == row:
        return 0.0
    ends = np.flatnonzero(before.plan.targets.move == at)
    cdis_mm = float(before.plan.targets.cdis_mm[ends[-1]]) if len(ends) else 0.0
    slack_mm = min(0.5 * cdis_mm, _MOST_OF_CORNER_MM)  # no corner is off by more than half of CDIS
    tool = cell.tool[_tool(before, row)]
    tip_mm, axis = before.toolpath.position_mm[at], before.toolpath.axis[at]
    return cutting.depth_in_material(before.material, before.to_field, tip_mm, axis, tool, slack_mm)


def _tool(before: _Before, row: int) -> int:
    """Return the number of the tool whose frame moves in a row; a row that leads nowhere has no target."""
    move = before.plan.targets.move
    so_far = np.flatnonzero((move >= 0) & (move <= row))
    return int(before.plan.targets.tool[so_far[-1] if len(so_far) else 0])


def _one_before(toolpath: Toolpath, row: int, first: int) -> Issue:
    line, begins = int(toolpath.source_line[row]), int(toolpath.source_line[first])
    sentence = f"line {line} begins where material is left, so the program begins at line {begins} before it"
    return Issue(
        "warning", "restart-line-before", line, sentence, "none: that line is run twice, once in air"
    )


# --- the way down -----------------------------------------------------------------------------------------


def _way(before: _Before, row: int, cell: Cell) -> Floats:
    """Return the way (k, 3) from above to the first position of a row, see `begun_at`.

    Empty where that is not known, which the checks of any program refuse.
    """
    toolpath = before.toolpath
    at = approached_row(toolpath, row)
    is_feed = not toolpath.rapid[row]
    if is_feed and not toolpath.is_position()[row - 1]:
        return np.zeros((0, 3))
    end, axis = toolpath.position_mm[at], toolpath.axis[at]
    if float(axis[2]) < _LEAST_UPRIGHT:
        sentence = "the tool axis is inclined by more than 60 degrees: no way from above leads along it"
        line = int(toolpath.source_line[row])
        issue = Issue("error", "restart-axis", line, sentence, "begin at a line with an upright tool")
        raise RefusedError(issue, toolpath.source)
    above_mm = max(_safe_height(before, cell) - float(end[2]), 0.0) / float(axis[2])
    heights = [above_mm]
    if at != row:
        entry_mm = above_mm
        if before.material is not None:
            tool = cell.tool[_tool(before, row)]
            free_mm = cutting.free_above_mm(before.material, before.to_field, end, axis, tool, above_mm)
            entry_mm = max(free_mm, 0.0) + ENTRY_MM
        heights += [entry_mm, 0.0] if entry_mm < above_mm else [0.0]
    return np.asarray(end + np.outer(heights, axis))


def _safe_height(before: _Before, cell: Cell) -> float:
    """Return the highest of the safe heights in ``$BASE``: clearance plane, retracts, above the stock."""
    toolpath = before.toolpath
    rapids = toolpath.is_position() & toolpath.rapid & ~toolpath.machine
    heights = [float(toolpath.position_mm[rapids, 2].max(initial=-np.inf))]
    if cell.clearance_z_mm is not None:
        heights.append(cell.clearance_z_mm)
    if before.material is not None:
        heights.append(_top(before.material, before.to_field) + ABOVE_STOCK_MM)
    return max(heights)


def _top(field: HeightField | Dexels, to_field: Floats) -> float:
    """Return the highest place of dexels, or the highest corner in ``$BASE`` of the box around a field."""
    if isinstance(field, Dexels):
        return field.top_mm
    rows, columns = field.height_mm.shape
    size = np.array([columns, rows]) * field.cell_mm
    top_mm = float(field.height_mm.max(initial=field.bottom_mm))
    span = [[at, at + step] for at, step in zip(field.origin_mm, size, strict=True)] + [
        [field.bottom_mm, top_mm]
    ]
    corners = np.array(np.meshgrid(*span)).reshape(3, -1).T @ to_field
    return float(corners[:, 2].max())


# --- the arm ----------------------------------------------------------------------------------------------


def _other_arm(before: _Before, begun: Toolpath, cell: Cell, tolerance_mm: float | None) -> list[Issue]:
    """Return a warning where the arm stands otherwise than in the whole program: its branch, or its spin."""
    here, there = prepare(begun, cell, tolerance_mm), before.plan
    other = _status(here) != _status(there)
    other |= abs(float(_last_rotation(here) @ _last_rotation(there))) < 1.0 - 1e-9
    if not other:
        return []
    sentence = "the arm stands otherwise than in the whole program (S and T, or the spin about the tool axis)"
    remedy = "watch it in T1: what was free of collisions before may not be"
    return [Issue("warning", "restart-arm", 0, sentence, remedy)]


def _status(plan: Plan) -> int:
    return int(plan.joints.status[~plan.targets.home][0])


def _last_rotation(plan: Plan) -> Floats:
    rotation: Floats = plan.targets.rotation[~plan.targets.home][-1]
    return rotation
