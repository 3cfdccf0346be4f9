"""Made-up programs and motions for the tests of figures."""

import numpy as np
from matplotlib.figure import Figure

from gcode2krl.tables import Deflection, Forces, Joints, Motion, Targets, Toolpath

LIMITS_DEG = np.array([[-147, 147], [-140, -5], [-112, 153], [-350, 350], [-122.5, 122.5], [-350, 350.0]])
SPEEDS_DEG_S = np.array([84, 85, 83, 115, 110, 184.0])
DOG_LEG = np.array([[0, 0, 5], [0, 0, 0], [100, 0, 0], [100, 60, 0], [100, 60, 30.0]])


def toolpath_of(points, feed=50.0):
    rows = len(points)
    return Toolpath(
        position_mm=points,
        axis=np.tile([0.0, 0.0, 1.0], (rows, 1)),
        rapid=np.arange(rows) == rows - 1,
        feed_mm_s=np.where(np.arange(rows) == rows - 1, np.inf, feed),
        spindle_rad_s=np.zeros(rows),
        tool=np.ones(rows),
        exact_stop=np.zeros(rows),
        tolerance_mm=np.full(rows, np.nan),
        dwell_s=np.zeros(rows),
        source_line=10 + np.arange(rows),
        arc=np.full(rows, -1),
        machine=np.zeros(rows),
        known=np.ones((rows, 3)),
        length_offset_mm=np.full(rows, np.nan),
        length_offset_tool=np.full(rows, -1),
        source="dir/part.nc",
    )


def targets_of(points, cdis=10.0):
    """HOME, the points, HOME."""
    points = np.vstack([[500, 0, 500], points, [500, 0, 500]])
    rows = len(points)
    added = np.isin(np.arange(rows), [0, rows - 1])
    return Targets(
        position_mm=points,
        rotation=np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1)),
        ptp=added | (np.arange(rows) == 1),
        home=added,
        speed_mm_s=np.where(added, np.nan, 50.0),
        cdis_mm=np.where(added, 0.0, cdis),
        wait_s=np.zeros(rows),
        move=np.where(added, -1, np.arange(rows) - 1),
        source_line=np.where(added, 0, 9 + np.arange(rows)),
        tool=np.ones(rows),
    )


def motion_of(targets, speed=50.0, dt=0.012):
    """A fake: the blended path of the programmed targets at constant speed, corners as parabolas."""
    rows = np.flatnonzero(targets.move >= 0)
    corners, pieces = targets.position_mm[rows], []
    for at in range(1, len(rows)):
        start, end = corners[at - 1], corners[at]
        half = np.linalg.norm(end - start) / 2
        if half == 0:
            continue
        along = (end - start) / (2 * half)
        reach = [0.0, 0.0]
        for side, row in enumerate((at - 1, at)):
            if 0 < row < len(rows) - 1:
                other = np.linalg.norm(corners[row + 1 if side else row - 1] - corners[row]) / 2
                reach[side] = min(targets.cdis_mm[rows[row]], half, other)
        pieces.append(
            (start + along * reach[0], end - along * reach[1], end, reach[1], targets.move[rows[at]])
        )
    position, move, corner = [corners[:1]], [[pieces[0][4]]], [[False]]
    for number, (start, end, vertex, reach, row) in enumerate(pieces):
        count = max(int(np.linalg.norm(end - start) / (speed * dt)), 1)
        s = np.linspace(0, 1, count + 1)[1:, None]
        position.append(start + s * (end - start))
        move.append([row] * count)
        corner.append([False] * count)
        if reach > 0 and number + 1 < len(pieces):
            count = int(2 * reach / (speed * dt))
            s = (np.arange(count)[:, None] + 0.5) / max(count, 1)
            after = pieces[number + 1][0]
            position.append((1 - s) ** 2 * end + 2 * s * (1 - s) * vertex + s**2 * after)
            move.append(np.where(s[:, 0] < 0.5, row, pieces[number + 1][4]))
            corner.append([True] * count)
    return motion_from(np.vstack(position), np.concatenate(move), np.concatenate(corner), speed, dt)


def motion_from(position, move, corner, speed=50.0, dt=0.012):
    rows = len(position)
    length = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return Motion(
        time_s=np.arange(rows) * dt,
        position_mm=position,
        rotation=np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1)),
        speed_mm_s=np.full(rows, speed),
        acceleration_mm_s2=np.where(corner, 200.0, 0.0),
        jerk_mm_s3=np.zeros(rows),
        path_mm=np.append(0.0, np.cumsum(length)),
        move=move,
        corner=corner,
        tool=np.ones(rows),
    )


def joints_of(motion, scale=1.0):
    wave = np.sin(motion.time_s[:, None] + np.arange(6))
    return Joints(
        q_rad=np.radians(np.array([0, -90, 90, 0, 45, 0]) + 20 * scale * wave),
        qd_rad_s=np.radians(20 * scale * np.cos(motion.time_s[:, None] + np.arange(6))),
        limit_margin_rad=np.radians(40 + 10 * wave[:, 0]),
        sigma_min=0.2 + 0.05 * wave[:, 1],
        status=np.zeros(len(motion)),
        turn=np.zeros(len(motion)),
    )


def forces_of(motion, force_N, **columns):
    """Forces (m, 3) with a cut of 2 x 3 mm wherever there is one."""
    cuts = np.linalg.norm(force_N, axis=1) > 0
    arcs = np.where(cuts[:, None], np.radians([30.0, 90.0]), np.nan)
    given = {
        "force_base_N": force_N,
        "moment_base_Nmm": np.zeros((len(motion), 3)),
        "peak_N": 1.5 * np.linalg.norm(force_N, axis=1),
        "torque_Nmm": np.zeros(len(motion)),
        "a_p_mm": np.where(cuts, 2.0, 0.0),
        "a_e_mm": np.where(cuts, 3.0, 0.0),
        "phi_rad": arcs,
        "tool": motion.tool,
        "relative_band": 0.4,
    }
    return Forces(**{**given, **columns})


def deflection_of(deflection_mm):
    return Deflection(
        deflection_base_mm=deflection_mm, correction_base_mm=-0.5 * deflection_mm, relative_band=0.4
    )


def texts(figure):
    """All words over and in the panels."""
    words = []
    for axes in figure.axes:
        words += [text.get_text() for text in (*axes.texts, axes.title, axes._left_title, axes._right_title)]
    return words


def labels(figure):
    return {label for axes in figure.axes for label in axes.get_legend_handles_labels()[1]}


def longest_line(figure):
    return max(len(line.get_xdata()) for axes in figure.axes for line in axes.lines)


def draw(figure):
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()
