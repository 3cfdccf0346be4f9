"""Which of the eight branches a program runs in, and its joints along a path in that branch.

The controller keeps its configuration on LIN, so the branch is chosen once, for the whole program: a trial on
a thinned path picks it, and the full path is solved in that branch only.
"""

import itertools
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import distinct
from gcode2krl.robot.inverse_kinematics import one_branch
from gcode2krl.robot.kinematics import status_turn
from gcode2krl.robot.poses import flange_frames
from gcode2krl.robot.standing import WRIST_ZONE_RAD, limit_margin, limits_rad
from gcode2krl.units import RAD_PER_REV

_TRIAL_SAMPLES = 2000


class Path(NamedTuple):
    """Tool poses in ``$BASE``, in order."""

    position_mm: Floats
    rotation: Floats
    tool: Ints32
    starts: Bools
    """(n,) True where a chain starts: there the joints come from HOME, not from the row before."""


class Branch(NamedTuple):
    """A branch, and the joints of the thinned path it was tried on."""

    number: int
    turns_rad: Floats
    """(6,) whole turns added to the turns nearest to HOME."""
    samples: Ints
    q_rad: Floats
    """(t, 6) joints at these samples, the turns included."""

    def joints(self, path: Path, cell: Cell, before_rad: Floats | None = None) -> Floats:
        """Return the joints (n, 6) along a path in this branch, each the turn nearest to the row before.

        ``before_rad`` (6,) are the joints in front of the first row, turns included; by default HOME's.
        """
        position, rotation = flange_frames(path.position_mm, path.rotation, path.tool, cell)
        home = cell.home_q_rad()
        reference = home if before_rad is None else before_rad - self.turns_rad
        q = _chains(position, rotation, path.starts, self.number, home, reference, cell)
        if self.turns_rad.any():
            q += self.turns_rad
        return q

    def guess(self, sample: int) -> Floats | None:
        """Return the joints (6,) of the last tried sample up to ``sample``, None where it is out of reach."""
        at = int(np.searchsorted(self.samples, sample, side="right")) - 1
        known = at >= 0 and not np.isnan(self.q_rad[at, 0])
        return self.q_rad[at] if known else None


def same_branch(path: Path, q_rad: Floats, cell: Cell) -> Floats:
    """Return the joints (n, 6) along a path in the branch and turns of the joints (6,) near its first row."""
    position, rotation = flange_frames(path.position_mm, path.rotation, path.tool, cell)
    geometry = cell.robot.geometry.array()
    number = int(status_turn(q_rad[None, :], geometry)[0][0])
    return one_branch(position, rotation, geometry, number, q_rad)


def thinned(starts: Ints, count: int) -> Ints:
    """Return the samples of the trial: some 2000, with the first of each chain and the last of all."""
    evenly = np.arange(0, count, max(1, count // _TRIAL_SAMPLES))
    return distinct(np.concatenate([evenly, starts, np.arange(count)[-1:]]))


def best_branch(path: Path, samples: Ints, cell: Cell) -> Branch:
    """Return the branch and turns that keep a thinned path (samples of the full one) within the limits.

    Among those it takes the branch whose weakest point (limits, wrist) is not poor and whose start is
    nearest to HOME.
    """
    position, rotation = flange_frames(path.position_mm, path.rotation, path.tool, cell)
    home = cell.home_q_rad()
    scored = []
    for number in range(8):
        q = _chains(position, rotation, path.starts, number, home, home, cell)
        turns = _turns(q, cell)
        q += turns
        scored.append((_cost(q, cell), number, turns, q))
    _, number, turns, q = min(scored, key=lambda entry: (entry[0], entry[1]))
    return Branch(number, turns, samples, q)


def _chains(
    position: Floats,
    rotation: Floats,
    starts: Bools,
    number: int,
    home: Floats,
    reference: Floats,
    cell: Cell,
) -> Floats:
    """Solve each chain (from PTP to PTP) with one branch; rows before the first start continue a chain."""
    borders = [*np.flatnonzero(starts), len(position)]
    if borders[0] > 0:
        borders.insert(0, 0)
    geometry = cell.robot.geometry.array()
    pieces = [
        one_branch(
            position[a:b],
            rotation[a:b] if len(rotation) > 1 else rotation,
            geometry,
            number,
            home if starts[a] else reference,
        )
        for a, b in itertools.pairwise(borders)
    ]
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces) if pieces else np.empty((0, 6))


def _turns(q: Floats, cell: Cell) -> Floats:
    """Return the whole turns (6,) in rad that bring each joint's range best into its limits."""
    limits = limits_rad(cell)
    if np.isnan(q).all() or np.isinf(limits).any():
        return np.zeros(6)
    low, high = np.nanmin(q, axis=0), np.nanmax(q, axis=0)
    candidates = RAD_PER_REV * np.array([0.0, -1.0, 1.0])
    margin = np.minimum(low + candidates[:, None] - limits[:, 0], limits[:, 1] - high - candidates[:, None])
    fits_already = margin[0] >= 0
    best = np.where(fits_already, 0, np.argmax(margin, axis=0))
    return candidates[best]


def _cost(q: Floats, cell: Cell) -> tuple[float, float]:
    """Return (fraction of impossible samples, distance of the start from HOME plus penalty of the wrist)."""
    if len(q) == 0:
        return 0.0, 0.0
    bad = ~(limit_margin(q, cell) >= 0)  # NaN, out of reach, too
    start = np.abs(q[0] - cell.home_q_rad()).sum()
    wrist = np.nanmin(np.abs(np.sin(q[:, 4]))) if not np.isnan(q).all() else 0.0
    poor = max(0.0, np.sin(WRIST_ZONE_RAD) - wrist) / np.sin(WRIST_ZONE_RAD)
    other_arm = _arm_bits(q[:1], cell) != _arm_bits(cell.home_q_rad()[None, :], cell)
    return float(bad.mean()), float(np.nan_to_num(start, nan=1e3) + 10.0 * poor + 20.0 * other_arm)


def _arm_bits(q: Floats, cell: Cell) -> int:
    """Return the bits of S that say how the arm stands (the wrist's bit left out)."""
    return int(status_turn(np.nan_to_num(q), cell.robot.geometry.array())[0][0]) & 3
