"""Clearances along a way of the arm, continuous between its rows.

A row is a pose q (6,) of the joints; between two rows the joints move in a straight line. A pair is two
bodies, or a body and an obstacle. Its gap is computed where it has to be, and bounded everywhere else:

- Both ends e of a capsule's segment bound the way of the whole capsule, as each of its points moves by the
  same mixture of what the ends move by. So a gap g changes by at most what the end moves by that moves more;
  of two bodies by the sum of both.
- Between two rows an end stays within s of the chord: with u from 0 to 1 its second derivative is the sum
  over i and j of dq_i dq_j d2e/dq_i dq_j, and for revolute joints each of these is (axis i) x ((axis j) x
  (e - a point of axis j)), j the outer one of both, no longer than the end's largest distance L_j from that
  axis. So ``s = 1/8 sum_i sum_j |dq_i| |dq_j| L_max(i,j)``, L_j the sum of the lengths beyond axis j.
- A pose whose gap g is known excuses all that follow while, with m how far an end has moved since then,
  ``g - max(m before, m now) - s > allowed`` (eq. 1): every point between two rows is within s of their
  chord, and no point of a chord is farther away than the farther one of its ends.
- Otherwise, from the gaps g0 and g1 of two rows with the chord c, ``gap >= (g0 + g1 - c)/2 - s`` (eq. 2), as
  a point at u has moved by at most u c + s from one and (1 - u) c + s from the other. Where that is not
  enough the way is halved, the joints at its middle solved, and each half judged likewise, until it is
  enough, something touches, or the chord is `SHORT_MM`: then the bound itself counts.

A rail moves the root along a straight line evenly, which adds to the chord and to no second derivative.

The samples of a Motion lie on the controller's way, which between them is not quite that of the joints: by an
eighth of the second difference of an end's last three rows, which is added to s (a controller that filters
its speeds has no larger ones in between; an estimate, some 0.04 mm at 12 ms and 2 m/s2). A PTP needs none.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.collision.scene import BODIES, OBSTACLES, Bodies, Obstacles
from gcode2krl.compiled.core import (
    FLOAT,
    FLOATS,
    INT,
    OUT_FLOATS,
    OUT_INTS,
    OUT_INTS32,
    StructOf,
    core_function,
)
from gcode2krl.compiled.inputs import shaped

EXACT_MM, EXACT_SHARE = 0.05, 0.25
"""What is found between two rows is no more than the larger of these above the least gap there, once it is
below the clearance: a warning states a figure, and a finer one would cost a hundred poses for each row."""
SHORT_MM = 0.01
"""A way on which nothing moves farther is not halved again."""
AT_REST = np.zeros((1, 3))
_STATE = 16
_NOTES = 4096


class Watched(NamedTuple):
    """Pairs (p) and what is known of them from one block of rows to the next."""

    pairs: Ints32
    """(p, 3) body, obstacle (-1: none) and other body."""
    known: Bools
    states: Floats
    """(p, 16) see native/collision/along.c."""
    ends_mm: Floats
    """(b, 13) ends of the bodies in the last row and the one before it, and how far they have gone."""
    steps: Ints
    """(1,) rows since the way began."""


WATCHED = StructOf.record(Watched, written=("known", "states", "ends_mm", "steps"))

_along = core_function(
    "collision_along",
    *(FLOATS, FLOATS, INT, FLOATS, BODIES, OBSTACLES, WATCHED, FLOAT, FLOAT, INT),
    *(OUT_FLOATS, OUT_INTS32, OUT_INTS, OUT_FLOATS, OUT_INTS),
    returns=INT,
)


@dataclass(frozen=True)
class Clearances:
    """What a stretch of rows (n) brought."""

    gap_mm: Floats
    """(n,) least gap since the row before, the horizon where it is larger; NaN out of reach."""
    pair: Ints32
    """(n,) of which pair, -1: none is as near."""
    row: Ints
    """(k,) rows of the notes: where a pair is nearer than the clearance."""
    note_pair: Ints
    note_gap_mm: Floats
    place_mm: Floats
    """(k, 3) the nearest point of the obstacle, in the robot root; NaN inside a mesh."""

    @property
    def hits(self) -> bool:
        """True where something touches."""
        return bool((self.note_gap_mm <= 0.0).any())


class Way:
    """A way along which pairs of bodies and obstacles are watched."""

    def __init__(
        self,
        bodies: Bodies,
        obstacles: Obstacles,
        pairs: Sequence[tuple[int, int, int]],
        geometry: Floats,
        *,
        near_mm: float,
        horizon_mm: float,
        is_sampled: bool,
    ) -> None:
        """Take the pairs (body, obstacle or -1, other body), and up to which gap they are noted and told.

        ``is_sampled`` where the rows are samples of a controller's way rather than of one of the joints.
        """
        self._bodies, self._obstacles = bodies, obstacles
        self._geometry = shaped("geometry", geometry, 6)
        self._near_mm, self._horizon_mm = near_mm, max(horizon_mm, near_mm)
        self._is_sampled = is_sampled
        self._watched = Watched(
            np.array(pairs, dtype=np.int32).reshape(-1, 3),
            np.zeros(len(pairs), dtype=np.bool_),
            np.zeros((len(pairs), _STATE)),
            np.zeros((len(bodies.link), 13)),
            np.zeros(1, dtype=np.int64),
        )
        self._last, self._last_shift = np.zeros((0, 6)), np.zeros((0, 3))

    def take(self, q_rad: Floats, shift_mm: Floats = AT_REST) -> Clearances:
        """Go on along rows of angles (n, 6) in rad; behind a row of NaN another way begins.

        ``shift_mm`` (n, 3) or (1, 3) is how far a rail has taken the robot root, along its own axes.
        """
        q = np.concatenate([self._last, shaped("q_rad", q_rad, -1, 6)])
        shifted = np.empty((len(q), 3))
        shifted[: len(self._last_shift)], shifted[len(self._last_shift) :] = self._last_shift, shift_mm
        first = begin = len(self._last)
        gap, pair = np.empty(len(q)), np.empty(len(q), dtype=np.int32)
        size = max(_NOTES, len(self._watched.pairs))
        noted_rows: list[tuple[Ints, Floats]] = []
        while first < len(q):
            notes, values = np.empty((size, 2), dtype=np.int64), np.empty((size, 4))
            noted = np.zeros(1, dtype=np.int64)
            first = _along(
                *(q, shifted, first, self._geometry, self._bodies, self._obstacles, self._watched),
                *(self._horizon_mm, self._near_mm, int(self._is_sampled)),
                *(gap, pair, notes, values, noted),
            )
            noted_rows.append((notes[: noted[0]].copy(), values[: noted[0]].copy()))
        self._last, self._last_shift = q[-1:].copy(), shifted[-1:].copy()
        notes = np.concatenate([np.zeros((0, 2), np.int64), *(block for block, _ in noted_rows)])
        values = np.concatenate([np.zeros((0, 4)), *(block for _, block in noted_rows)])
        return Clearances(
            gap[begin:], pair[begin:], notes[:, 0] - begin, notes[:, 1], values[:, 0], values[:, 1:]
        )
