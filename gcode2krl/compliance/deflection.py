"""How far the tool tip bends away under a load, and how much each joint adds.

Elastic model: Haehn & Weigold 2020, eq. 1-11, the exact finite product of all frames. The load acts on the
undeformed arm (no iteration on the bent shape), stiffness does not depend on pose or load, there is no
backlash, friction or weight. The authors found the measured deflection 6 % larger on average (750 N).
"""

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compliance import chain, model
from gcode2krl.compliance.projection import make_directions, project_rows
from gcode2krl.compliance.rows import rows_of

STANDSTILL_MM_S = 1e-6
"""A tip slower than this has no feed direction: rounding of the joint speeds alone gives 1e-7 mm/s."""
NOTHING = np.zeros(3)
ROOT = np.eye(3)


def displace(
    q_rad: npt.ArrayLike,
    force_root_N: npt.ArrayLike,
    moment_root_Nmm: npt.ArrayLike,
    cell: Cell,
    tool: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> tuple[Floats, Floats]:
    """Return how a load at the tool tip moves and turns it, eq. 1-9, all along the robot root's axes.

    Exact for finite angles: a virtual joint may turn by up to 1.5 rad. Results do not depend on ``threads``.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.
    force_root_N : (n, 3), or (3,) for all rows
        Force on the tool, at its tip.
    moment_root_Nmm : (n, 3), or (3,) for all rows
        Moment on the tool about its tip.
    cell : Cell
        Robot geometry, virtual joints and tools.
    tool : int or (n,), optional
        Tool number; by default the mounted tool, else the first.
    threads : int, optional
        Most threads; by default one for each core.

    Returns
    -------
    displacement_mm : (n, 3)
        Deflected minus nominal tip.
    rotation_rad : (n, 3)
        Rotation vector from the nominal to the deflected tool frame.

    Raises
    ------
    NotUnderstoodError
        If the cell does not state the stiffness of every virtual joint, or has no such tool.
    ValueError
        If an array has the wrong shape.
    """
    load = (q_rad, force_root_N, moment_root_Nmm, cell, tool, model.softness(cell))
    shift, turn, _ = _displaced(*load, threads=threads)
    return shift, turn


def joint_shares(
    q_rad: npt.ArrayLike,
    force_root_N: npt.ArrayLike,
    moment_root_Nmm: npt.ArrayLike,
    cell: Cell,
    tool: npt.ArrayLike | None = None,
) -> Floats:
    """Return the displacement (n, 10, 3) in mm by each virtual joint alone, along the root's axes.

    The order is that of `gcode2krl.cell.sections.VIRTUAL_JOINTS`; all other joints are rigid. The sum is
    that of `displace` to second order in the elastic angles. Parameters and errors as there.
    """
    soft = model.softness(cell)
    alone = (np.where(np.arange(chain.FRAMES)[:, None] == i, soft, 0.0) for i in range(chain.FRAMES))
    load = (q_rad, force_root_N, moment_root_Nmm, cell, tool)
    return np.stack([_displaced(*load, one)[0] for one in alone], axis=1)


def deflection_of(
    q_rad: npt.ArrayLike,
    force_base_N: npt.ArrayLike,
    moment_base_Nmm: npt.ArrayLike,
    feed_base: npt.ArrayLike,
    cell: Cell,
    tool: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> tuple[Floats, Floats]:
    """Return deflection and correction of the tip, eq. 1-11, along the axes of ``$BASE``.

    Parameters
    ----------
    q_rad : (n, 6)
        A1 to A6 with the controller's signs and zero.
    force_base_N, moment_base_Nmm : (n, 3), or (3,) for all rows
        Force on the tool and moment about its tip, along ``$BASE``.
    feed_base : (n, 3), or (3,) for all rows
        Direction of the feed; its length does not matter, zero = standstill.
    cell, tool, threads
        As for `displace`.

    Returns
    -------
    deflection_base_mm : (n, 3)
        Deflected minus nominal tip.
    correction_base_mm : (n, 3)
        Minus the deflection, without its component along the feed; at a standstill all of it.

    Raises
    ------
    NotUnderstoodError
        If the cell does not state the stiffness of every virtual joint, or has no such tool.
    ValueError
        If an array has the wrong shape.
    """
    base = np.ascontiguousarray(cell.base_matrix()[:3, :3])
    deflection, _, _ = _displaced(
        q_rad, force_base_N, moment_base_Nmm, cell, tool, model.softness(cell), base, False, threads
    )
    feed = rows_of("feed_base", feed_base, 3, len(deflection))
    return deflection, _corrections(deflection, feed, threads)


def deflection_along(
    q_rad: Floats, qd_rad_s: Floats, force_base_N: Floats, moment_base_Nmm: Floats, cell: Cell, tool: Ints32
) -> tuple[Floats, Floats]:
    """Return what `deflection_of` returns, where the feed direction is that of `feed_direction`.

    ``qd_rad_s`` (n, 6) are the speeds of the joints; other parameters and errors as there.
    """
    base = np.ascontiguousarray(cell.base_matrix()[:3, :3])
    load = (q_rad, force_base_N, moment_base_Nmm, cell, tool, model.softness(cell), base)
    qd = rows_of("qd_rad_s", qd_rad_s, 6, len(q_rad))
    deflection, _, feed = _displaced(*load, turned=False, qd_rad_s=qd)
    make_directions(feed, STANDSTILL_MM_S)
    return deflection, _corrections(deflection, feed)


def _corrections(deflection: Floats, feed: Floats, threads: int | None = None) -> Floats:
    """Return minus the deflection (n, 3) without its component along the feed (n, 3)."""
    correction = np.empty_like(deflection)

    def work(start: int, end: int) -> None:
        rows = slice(start, end)
        project_rows(deflection[rows], feed[rows], -1.0, correction[rows])

    in_chunks(work, chunk_borders(len(deflection)), threads)
    return correction


def deflection_magnitude(
    q_rad: npt.ArrayLike,
    force_base_N: npt.ArrayLike,
    direction_base: npt.ArrayLike,
    cell: Cell,
    tool: npt.ArrayLike | None = None,
    moment_base_Nmm: npt.ArrayLike = NOTHING,
) -> Floats:
    """Return how far the tip bends away normal to a direction (n,) in mm, for maps over poses or spins.

    ``direction_base`` is (n, 3) or (3,), zero = the whole deflection; a pose that is NaN (out of reach) gives
    NaN. Other parameters and errors as for `deflection_of`.
    """
    _, correction = deflection_of(q_rad, force_base_N, moment_base_Nmm, direction_base, cell, tool)
    magnitude: Floats = np.sqrt(np.einsum("ij,ij->i", correction, correction))
    return magnitude


def tip_position(q_rad: npt.ArrayLike, cell: Cell, tool: npt.ArrayLike | None = None) -> Floats:
    """Return the nominal tool tip (n, 3) in mm in the robot root, eq. 2, for joints (n, 6) in rad."""
    return _tip(q_rad, np.zeros(6), cell, tool, ROOT)[0]


def tip_velocity(
    q_rad: npt.ArrayLike, qd_rad_s: npt.ArrayLike, cell: Cell, tool: npt.ArrayLike | None = None
) -> Floats:
    """Return J(q)·qd, the velocity of the nominal tip (n, 3) in mm/s along ``$BASE``.

    ``q_rad`` (n, 6) with the controller's signs and zero, ``qd_rad_s`` (n, 6).
    """
    return _tip(q_rad, qd_rad_s, cell, tool, cell.base_matrix()[:3, :3])[1]


def feed_direction(
    q_rad: npt.ArrayLike, qd_rad_s: npt.ArrayLike, cell: Cell, tool: npt.ArrayLike | None = None
) -> Floats:
    """Return the unit vector of the tip's velocity (n, 3) along ``$BASE``; zero at a standstill.

    For use where there is no path, only joints (n, 6) in rad and their speeds (n, 6) in rad/s.
    """
    direction = tip_velocity(q_rad, qd_rad_s, cell, tool)
    make_directions(direction, STANDSTILL_MM_S)
    return direction


def _displaced(
    q_rad: npt.ArrayLike,
    force_N: npt.ArrayLike,
    moment_Nmm: npt.ArrayLike,
    cell: Cell,
    tool: npt.ArrayLike | None,
    softness: Floats,
    base: Floats = ROOT,
    turned: bool = True,
    threads: int | None = None,
    qd_rad_s: Floats = chain.NO_SPEED,
) -> tuple[Floats, Floats, Floats]:
    """Return displacement, rotation vector and the rigid tip's velocity (n, 3) along ``base``.

    Rotation and velocity are (0, 3) if not asked for.
    """
    q = rows_of("q_rad", q_rad, 6)
    force = rows_of("force", force_N, 3, len(q))
    moment = rows_of("moment", moment_Nmm, 3, len(q))
    tip = model.tips(cell, tool, len(q))
    frames = model.frames(cell)
    counts = (len(q), len(q) if turned else 0, len(qd_rad_s))
    shift, turn, velocity = (np.empty((count, 3)) for count in counts)

    def work(start: int, end: int) -> None:
        rows = slice(start, end)
        chain.displaced_rows(
            q[rows],
            force[rows],
            moment[rows],
            frames,
            softness,
            base,
            tip.position_mm,
            tip.tool[rows],
            shift[rows],
            turn[rows],
            qd_rad_s[rows],
            velocity[rows],
        )

    in_chunks(work, chunk_borders(len(q)), threads)
    return shift, turn, velocity


def _tip(
    q_rad: npt.ArrayLike, qd_rad_s: npt.ArrayLike, cell: Cell, tool: npt.ArrayLike | None, base: Floats
) -> tuple[Floats, Floats]:
    """Return position from the robot root and velocity (n, 3) of the nominal tip along ``base``."""
    q = rows_of("q_rad", q_rad, 6)
    qd = rows_of("qd_rad_s", qd_rad_s, 6, len(q))
    tip = model.tips(cell, tool, len(q))
    frames, axes = model.frames(cell), np.ascontiguousarray(base)
    position, velocity = np.empty((len(q), 3)), np.empty((len(q), 3))

    def work(start: int, end: int) -> None:
        rows = slice(start, end)
        chain.tip_rows(
            q[rows], qd[rows], frames, axes, tip.position_mm, tip.tool[rows], position[rows], velocity[rows]
        )

    in_chunks(work, chunk_borders(len(q)))
    return position, velocity
