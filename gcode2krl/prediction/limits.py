"""Predicted figures beyond ``[limits]`` of the cell, beyond the robot's data sheet, or absurd.

- Beyond ``[limits]``: a warning with the line where the largest value occurs.
- Beyond the rated payload: an error. The cutting force and the weight on the flange together must not exceed
  the weight of the payload that the robot is rated for: by ISO 8373 the rated load is the largest that may
  act on the mechanical interface in normal use. (Its moment is not judged: the models do not state it. A
  warning up to twice as much where the stock is only guessed.)
- Not finite, or beyond `ABSURD_FORCE_N` or `ABSURD_DEFLECTION_MM`: an error, and the figures are left out.
"""

from collections.abc import Iterator

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.tables import Deflection, Forces, Motion
from gcode2krl.units import GRAVITY_M_S2, MM_PER_M, NMM_PER_NM

GUESSED_FACTOR = 2.0
"""Factor by which a force may be too large because its stock is guessed (an assumption): up to this many
times the rated payload it is then a warning."""
ABSURD_FORCE_N = 100_000.0
"""No robot of the library carries a tenth of it (10 t): the figure is a mistake, not a prediction."""
ABSURD_DEFLECTION_MM = 100.0
"""The compliance model is linear in small angles: at this size, 2° on a reach of 3 m, it is not valid."""


def cycle_acceleration(motion: Motion, cycle_s: float) -> Floats:
    """Return the acceleration (m,) in mm/s² over one interpolation cycle, as a trace would show it.

    The law's own peak, v²·cos(alpha/2)/d, is not what drives see where a corner is passed within a cycle:
    at 0.2 m/s and d = 0.1 mm it lasts 1 ms, and the controller commands a position every ``cycle_s``.
    It is 0 at a tool change, where the tip becomes another point.
    """
    result = np.zeros(len(motion))
    if len(motion) < 3:
        return result
    dt_s = float(motion.time_s[1] - motion.time_s[0])
    n = min(max(1, round(cycle_s / dt_s)), (len(motion) - 1) // 2)
    position = motion.position_mm
    bend = position[2 * n :] - 2.0 * position[n:-n] + position[: -2 * n]
    result[n:-n] = np.sqrt(np.einsum("ij,ij->i", bend, bend)) / (n * dt_s) ** 2
    same = motion.tool[2 * n :] == motion.tool[: -2 * n]
    result[n:-n][~same] = 0.0
    return result


def motion_findings(motion: Motion, line: Ints32, cell: Cell) -> Iterator[Issue]:
    """Yield what exceeds the limits in a Motion; ``line`` (m,) is the G-code line of each sample."""
    acceleration = cycle_acceleration(motion, cell.controller.cycle_s)
    most = cell.limits.acceleration_mm_s2
    if len(motion) and acceleration.max() > most:
        row = int(acceleration.argmax())
        sentence = (
            f"the tip is accelerated by {acceleration[row] / MM_PER_M:.1f} m/s2 over one cycle, "
            f"more than {most / MM_PER_M:g}: no robot follows that"
        )
        remedy = "lower F or [controller] rapid_m_s, or raise CDIS there ([limits] acceleration_mm_s2 judges)"
        yield Issue("warning", "acceleration-high", int(line[row]), sentence, remedy)


def force_findings(forces: Forces, line: Ints32, cell: Cell) -> Iterator[Issue]:
    """Yield what exceeds the limits and the robot's payload; one finding, at the largest value, each."""
    size_N, limits = np.linalg.norm(forces.force_base_N, axis=1), cell.limits
    if not len(size_N):
        return
    remedy = (
        "check S, F and the depth of cut; [limits] {key} judges, [stock] and [material] decide the figure"
    )
    row = int(size_N.argmax())
    overload = _payload(forces, line, cell)
    if overload is not None:
        yield overload
    elif size_N[row] > limits.force_N:
        sentence = f"T{forces.tool[row]} is loaded with {size_N[row]:.0f} N, more than {limits.force_N:g} N"
        yield Issue("warning", "force-high", int(line[row]), sentence, remedy.format(key="force_N"))
    torque_Nm = forces.torque_Nmm / NMM_PER_NM
    row = int(torque_Nm.argmax())
    if torque_Nm[row] > limits.torque_Nm:
        sentence = f"T{forces.tool[row]} takes {torque_Nm[row]:.1f} Nm, more than {limits.torque_Nm:g} Nm"
        yield Issue("warning", "torque-high", int(line[row]), sentence, remedy.format(key="torque_Nm"))


def _payload(forces: Forces, line: Ints32, cell: Cell) -> Issue | None:
    rated_kg = cell.robot.payload.mass_kg
    own_kg = cell.load.mass_kg or 0.0  # where the cell names no load, the cut alone is compared
    if rated_kg is None:
        return None
    down = -cell.base_in_world()[2, :3]  # the world's -z along the axes of $BASE
    cut_N = np.linalg.norm(forces.force_base_N, axis=1)
    whole_N = np.linalg.norm(forces.force_base_N + own_kg * GRAVITY_M_S2 * down, axis=1)
    load_N = np.where(cut_N > 0.0, np.maximum(cut_N, whole_N), 0.0)
    row, rated_N = int(load_N.argmax()), rated_kg * GRAVITY_M_S2
    if load_N[row] <= rated_N:
        return None
    with_own = f", with the {own_kg:g} kg on the flange {whole_N[row]:.0f} N" if cut_N[row] < rated_N else ""
    sentence = (
        f"T{forces.tool[row]} is loaded with {cut_N[row]:.0f} N{with_own}; the {cell.robot.model} is rated "
        f"for {rated_kg:g} kg ({rated_N:.0f} N)"
    )
    remedy = "check S, F and the depth of cut, [stock], [material] and [load] mass_kg of the cell"
    guessed = any(issue.code == "stock-guessed" for issue in forces.issues)
    sure = not guessed or load_N[row] > GUESSED_FACTOR * rated_N
    return Issue("error" if sure else "warning", "payload", int(line[row]), sentence, remedy)


def absurd_forces(forces: Forces, line: Ints32) -> Issue | None:
    """Return the finding on absurd forces, None if there are none."""
    columns = (
        forces.force_base_N,
        forces.moment_base_Nmm,
        forces.torque_Nmm[:, None],
        forces.peak_N[:, None],
    )
    finite = np.logical_and.reduce([np.isfinite(column).all(axis=1) for column in columns])
    with np.errstate(over="ignore", invalid="ignore"):
        wrong = ~finite | ~(np.linalg.norm(forces.force_base_N, axis=1) <= ABSURD_FORCE_N)
    if not wrong.any():
        return None
    sentence = f"the forces on T{forces.tool[np.argmax(wrong)]} are absurd: they are left out"
    remedy = "check [material] (N/mm2, N/mm), the tool's diameter_mm and teeth, S and F"
    return Issue("error", "force-absurd", int(line[np.argmax(wrong)]), sentence, remedy)


def absurd_deflection(deflection: Deflection, reached: Bools, line: Ints32) -> Issue | None:
    """Return the finding on an absurd deflection, None if there is none.

    ``reached`` (m,) is False where the robot has no joint angles, which is reported separately.
    """
    columns = (deflection.deflection_base_mm, deflection.correction_base_mm)
    finite = np.logical_and.reduce([np.isfinite(column).all(axis=1) for column in columns])
    with np.errstate(over="ignore", invalid="ignore"):
        small = np.linalg.norm(deflection.deflection_base_mm, axis=1) <= ABSURD_DEFLECTION_MM
    wrong = reached & ~(finite & small)
    if not wrong.any():
        return None
    sentence = f"the deflection comes out beyond {ABSURD_DEFLECTION_MM:g} mm: it is left out"
    remedy = (
        "check [compliance.virtual_joints] of the cell (N·mm/rad: N·m/deg times 57,296; a robot's axis has "
        "1e8 to 1e11), and the forces"
    )
    return Issue("error", "deflection-absurd", int(line[np.argmax(wrong)]), sentence, remedy)


def deflection_findings(deflection: Deflection, line: Ints32, cell: Cell) -> Iterator[Issue]:
    """Yield the deflection that exceeds the limit, at its largest value."""
    size_mm = np.linalg.norm(deflection.deflection_base_mm, axis=1)
    row, most = int(np.argmax(np.nan_to_num(size_mm))) if len(size_mm) else 0, cell.limits.deflection_mm
    if len(size_mm) and size_mm[row] > most:
        sentence = f"the tool bends away by {size_mm[row]:.2f} mm, more than {most:g} mm"
        remedy = (
            "cut less deep or slower, or state [stock] and a measured [compliance]; "
            "[limits] deflection_mm judges"
        )
        yield Issue("warning", "deflection-high", int(line[row]), sentence, remedy)
