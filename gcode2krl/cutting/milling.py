"""The stage: Motion and stock to Forces, and the findings of the material removal."""

from dataclasses import dataclass, replace

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.cutting.engagement import NODES_PER_DIAMETER, engage
from gcode2krl.cutting.findings import Cut, findings_of
from gcode2krl.cutting.force import peak_force
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.law import feed_per_tooth, law_array, linear_edge_law
from gcode2krl.cutting.raw_part import height_field_of
from gcode2krl.cutting.reading import Result
from gcode2krl.cutting.stock_checks import Work, stock_findings
from gcode2krl.cutting.tool_use import uses
from gcode2krl.cutting.turns import Shaped, shaped
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.tables import Forces, Motion, Toolpath

_SAME_AXIS = 1e-9
_ARC_COLUMNS = 6
_SHANK_MM = 1.0
_CDIS_OF_TOLERANCE = 2.0 * 2.0**0.5
"""CDIS of a corner of 90° for a tolerance, d = 2·tolerance/cos(alpha/2)."""


@dataclass(frozen=True)
class Removal:
    """The result of `remove`."""

    forces: Forces
    part: HeightField
    """The material that is left."""
    to_field: Floats
    """(3, 3) rotation from ``$BASE`` to the frame of ``part``."""


def cut(toolpath: Toolpath, motion: Motion, cell: Cell) -> Forces:
    """Return the force that the cutter feels at every sample, from removing the stock along the motion.

    Means over one spindle revolution (Altintas' linear edge model, or Kienzle), read at the place of the
    sample before its sweep is removed; feed per tooth from the predicted speed. ``issues`` name collisions
    and cuts that tool or spindle cannot take, with their lines. Not predicted: run-out, chatter, dynamics.

    Raises
    ------
    NotUnderstoodError
        Where the stock cannot be read, or the material has no force law.
    RefusedError
        Where the tool axis changes within the program: one height field holds one direction.
    """
    return remove(toolpath, motion, cell).forces


def mean_cut(toolpath: Toolpath, motion: Motion, cell: Cell) -> Forces:
    """Return what `cut` does without what takes a third of its time: findings, and peaks above the means."""
    return remove(toolpath, motion, cell, is_checked=False).forces


def force_basis(toolpath: Toolpath, motion: Motion, cell: Cell) -> Floats:
    """Return the force (m, 3, 6) along ``$BASE`` for a unit of each coefficient of the linear edge law.

    The force is their sum, multiplied by Ktc, Krc, Kac (N/mm²), Kte, Kre, Kae (N/mm). Errors as for `cut`.
    """
    parts = [remove(toolpath, motion, cell, linear_edge_law(unit)).forces.force_base_N for unit in np.eye(6)]
    return np.stack(parts, axis=2)


def remove(
    toolpath: Toolpath,
    motion: Motion,
    cell: Cell,
    law: Floats | None = None,
    *,
    is_checked: bool = True,
    nodes_per_diameter: float = NODES_PER_DIAMETER,
) -> Removal:
    """Return the result of `cut` and the machined part; ``law`` (8,) replaces that of the material.

    Unless ``is_checked``, that of `mean_cut`. ``nodes_per_diameter`` as in `engagement.engage`.
    """
    if cell.material is None:
        raise input_error("material-missing", "the cell names no material", "give [material] in the cell")
    law = law_array(cell.material) if law is None else law
    to_field = _set_up(motion)
    numbers = np.unique(motion.tool)
    tools = [cell.tool[int(number)] for number in numbers]
    tool = np.searchsorted(numbers, motion.tool).astype(np.int32)
    row = np.clip(motion.move, 0, len(toolpath) - 1)
    spindle = toolpath.spindle_rad_s[row]
    rapid = toolpath.rapid[row]
    teeth = np.array([one.teeth for one in tools])[tool]
    f_z_mm = feed_per_tooth(motion.speed_mm_s, spindle, 1) / teeth
    programmed_f_z_mm = feed_per_tooth(np.where(rapid, 0.0, toolpath.feed_mm_s[row]), spindle, 1) / teeth
    position = np.ascontiguousarray(motion.position_mm @ to_field.T)
    field = height_field_of(toolpath, cell, to_field, tools)
    before = _uncut(field)
    # the sweep to the first sample of a rapid move began on the feed move before it
    wholly_rapid = rapid & np.concatenate([rapid[:1], rapid[:-1]])
    way = _way(position, motion, to_field, tool)
    rows = way.sample
    engaged = engage(
        field,
        way.position_mm,
        tool[rows],
        wholly_rapid[rows],
        f_z_mm[rows],
        [_with_shank(one) for one in tools],
        law,
        direction=(motion.direction @ to_field.T)[rows],
        wanted=way.read,
        nodes_per_diameter=nodes_per_diameter,
    )
    overlap_mm = engaged.overlap_mm
    flutes_mm = np.array([one.flute_length_mm or np.inf for one in tools])[tool]
    overlap_mm[:, 1] = np.maximum(overlap_mm[:, 1], engaged.a_p_mm - flutes_mm)
    # a rapid through material is reported as a collision, and is not a cut
    force_N, moment_Nmm = (
        np.where(rapid[:, None], 0.0, each) for each in (engaged.force_N, engaged.moment_Nmm)
    )
    mean_N = np.linalg.norm(force_N, axis=1)
    forces = Forces(
        force_base_N=force_N @ to_field,
        moment_base_Nmm=moment_Nmm @ to_field,
        peak_N=_peaks(engaged, f_z_mm, tool, tools, law, mean_N) if is_checked else mean_N,
        torque_Nmm=np.where(rapid, 0.0, engaged.torque_Nmm),
        a_p_mm=engaged.a_p_mm,
        a_e_mm=engaged.a_e_mm,
        phi_rad=engaged.phi_rad,
        tool=motion.tool,
        relative_band=cell.material.relative_band,
    )
    if not is_checked:
        return Removal(forces, field, to_field)
    steps = np.diff(position, axis=0, prepend=position[:1])
    seen = Cut(
        source_line=toolpath.source_line[row],
        rapid=rapid,
        engaged=np.isfinite(forces.phi_rad[:, 0]),
        spindle_rad_s=spindle,
        f_z_mm=f_z_mm,
        ramp_rad=engaged.ramp_rad,
        cycle_s=float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else 0.0,
        centre_mm=engaged.centre_mm,
        overlap_mm=overlap_mm,
        step_mm=np.linalg.norm(steps, axis=1),
        descent_mm=np.maximum(-steps[:, 2], 0.0),
        blend_mm=_largest_cdis(toolpath, cell),
    )
    work = Work(
        position_mm=position,
        tool=tool,
        tools=tuple(tools),
        numbers=tuple(int(number) for number in numbers),
        source_line=seen.source_line,
        feed=~rapid & ~toolpath.machine[row] & (motion.move > 0),
    )
    issues = (
        *findings_of(seen, forces, cell, field.guessed),
        *stock_findings(work, cell.stock, before, seen.engaged & work.feed),
        *uses(seen.source_line, rapid, programmed_f_z_mm, seen.ramp_rad, seen.centre_mm, forces, cell),
    )
    ordered = tuple(sorted(issues, key=lambda issue: issue.line))
    return Removal(replace(forces, issues=ordered), field, to_field)


def _way(position_mm: Floats, motion: Motion, to_field: Floats, tool: Ints32) -> Shaped:
    """Return the path of the tip in the frame of the field, with the turns between samples."""
    joined = np.concatenate([[False], tool[1:] == tool[:-1]])
    return shaped(position_mm, motion.direction @ to_field.T, motion.path_mm, joined)


def _largest_cdis(toolpath: Toolpath, cell: Cell) -> float:
    """Return the largest CDIS that tolerances need at corners of 90° and wider, or the cell's."""
    tolerances = np.append(toolpath.tolerance_mm, cell.controller.tolerance_mm or 0.0)
    return max(cell.controller.cdis_mm, _CDIS_OF_TOLERANCE * float(np.nanmax(tolerances)))


def _uncut(field: HeightField) -> HeightField:
    """Return the field before it is cut; a block is one number."""
    low, high = field.height_mm.min(), field.height_mm.max()
    if low != high:
        return field.copy()
    height = np.broadcast_to(low, field.height_mm.shape)
    return HeightField(height, field.origin_mm, field.cell_mm, field.bottom_mm, field.guessed)


def no_forces(motion: Motion) -> Forces:
    """Return the Forces of a motion that cuts nothing."""
    count = len(motion)
    return Forces(
        force_base_N=np.zeros((count, 3)),
        moment_base_Nmm=np.zeros((count, 3)),
        peak_N=np.zeros(count),
        torque_Nmm=np.zeros(count),
        a_p_mm=np.zeros(count),
        a_e_mm=np.zeros(count),
        phi_rad=np.full((count, _ARC_COLUMNS), np.nan),
        tool=motion.tool,
    )


def _with_shank(tool: Tool) -> Tool:
    """Return a tool whose edges reach a little up a cylindrical shank, so that deeper cuts become visible."""
    if tool.kind in ("tapered", "drill") or tool.flute_length_mm is None:
        return tool
    return tool.model_copy(update={"flute_length_mm": tool.flute_length_mm + _SHANK_MM})


def _set_up(motion: Motion) -> Floats:
    """Return the rotation (3, 3) from ``$BASE`` to a frame whose z is the tool axis of the program."""
    axis = fr.rotation_from_quaternion(motion.rotation[:1])[0][:, 2]
    x, y, z, w = motion.rotation.T
    turned = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)
    if np.abs(turned - axis).max() > 1e-6:
        raise RefusedError(
            Issue(
                "error",
                "axis-changes",
                0,
                "the tool axis changes: material removal needs one direction",
                "split the program by its set-up directions",
            )
        )
    if axis[2] > 1.0 - _SAME_AXIS:
        return np.eye(3)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    return np.stack([np.cross(across, axis), across, axis])


def _peaks(
    engaged: Result, f_z_mm: Floats, tool: Ints32, tools: list[Tool], law: Floats, mean_N: Floats
) -> Floats:
    """Return the largest force of a revolution (m,), at least the mean; zero in air.

    Between two samples that were read its ratio to the mean lies between theirs.
    """
    peak = np.zeros(len(mean_N))
    cuts = np.isfinite(engaged.phi_rad[:, 0]) & (mean_N > 0.0)
    for number, one in enumerate(tools):
        rows = np.flatnonzero((tool == number) & cuts & engaged.is_read)
        if len(rows):
            arcs, depth, ramp = engaged.phi_rad[rows], engaged.a_p_mm[rows], engaged.ramp_rad[rows]
            peak[rows] = peak_force(one, law, arcs, depth, f_z_mm[rows], ramp)
    read, between = np.flatnonzero(cuts & engaged.is_read), np.flatnonzero(cuts & ~engaged.is_read)
    if len(between):
        ratio = np.interp(between, read, peak[read] / mean_N[read])
        peak[between] = ratio * mean_N[between]
    return np.maximum(peak, mean_N)
