"""A chain with its time law: the Motion, sampled block after block or at chosen samples."""

from collections.abc import Generator

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.errors import input_error
from gcode2krl.krc4.motion import Chain, one_orientation
from gcode2krl.krc4.profile import Profile
from gcode2krl.krc4.sampling import Sampler, Samples, count_samples
from gcode2krl.tables import BLOCK_ROWS, Gathered, Motion, Targets
from gcode2krl.units import S_PER_H

_MOST_SAMPLES = 50_000_000


class Course:
    """The Motion of a chain, sampled every ``dt_s`` from 0 to its end; no sample is kept."""

    def __init__(self, targets: Targets, chain: Chain, profile: Profile, cell: Cell, dt_s: float) -> None:
        """Take a chain of targets and its profile; raises `NotUnderstoodError` where samples are too many."""
        if not (np.isfinite(dt_s) and dt_s > 0):
            raise input_error("option-value", f"sample time {dt_s} s is not positive")
        if profile.total_s / dt_s > _MOST_SAMPLES:
            hours = profile.total_s / S_PER_H
            raise input_error(
                "too-long",
                f"the motion lasts {hours:.1f} h, more than {_MOST_SAMPLES} samples",
                "use a larger --dt",
            )
        self.dt_s = dt_s
        self.moves = len(chain.length_mm)
        self.count = count_samples(profile, dt_s) if self.moves else 1
        self._start = _standstill(targets, chain.first)
        if self.moves:
            columns = (chain.start_mm, chain.end_mm, chain.length_mm, chain.blend_mm)
            self._sampler = Sampler(profile, *columns, cell.controller.k_s)
            self._move, self._tool = chain.move, chain.tool
            self._from, self._to = chain.from_rotation, chain.to_rotation
            self._turns = not one_orientation(self._from, self._to)
            self._from_external, self._to_external = chain.from_external, chain.to_external

    def blocks(self, rows: int = BLOCK_ROWS) -> Generator[tuple[Motion, bool], None, None]:
        """Yield the Motion in blocks of rows, and whether it ends with each."""
        first_move = 0
        for start in range(0, self.count, rows):
            end = min(start + rows, self.count)
            motion, first_move = self._sampled(np.arange(start, end), first_move)
            yield motion, end == self.count

    def at(self, rows: Ints) -> Motion:
        """Return rising rows of the Motion."""
        return self._sampled(rows, first_move=0)[0]

    def whole(self) -> Motion:
        """Return the Motion."""
        gathered = Gathered[Motion](self.count)
        for motion, _ in self.blocks():
            gathered.take(motion)
        return gathered.table()

    def _sampled(self, rows: Ints, first_move: int) -> tuple[Motion, int]:
        """Return rows of the Motion, and the move in which the last of them lies."""
        if not self.moves:
            return self._start, 0
        time_s = rows.astype(np.float64) * self.dt_s
        samples = self._sampler.at(time_s, first_move)
        move = self._move[samples.move]
        if rows[0] == 0:
            move[0] = self._start.move[0]
        motion = Motion(
            time_s=time_s,
            position_mm=samples.position_mm,
            rotation=self._rotations(samples),
            speed_mm_s=samples.speed_mm_s,
            acceleration_mm_s2=samples.acceleration_mm_s2,
            jerk_mm_s3=samples.jerk_mm_s3,
            path_mm=samples.path_mm,
            move=move,
            corner=samples.corner,
            direction=samples.direction,
            tool=self._tool[samples.move],
            external=self._external(samples),
        )
        return motion, int(samples.move[-1])

    def _external(self, samples: Samples) -> Floats:
        """Interpolate E1 to E6 with the position along each move."""
        if self._to_external.strides[0] == 0:
            return np.broadcast_to(self._to_external[0], (len(samples.move), 6))
        begins, ends = self._from_external[samples.move], self._to_external[samples.move]
        return np.asarray(begins + (ends - begins) * samples.part[:, None])

    def _rotations(self, samples: Samples) -> Floats:
        """Interpolate the orientation with the position along each move (``$ORI_TYPE = #VAR``)."""
        if not self._turns:
            return np.broadcast_to(self._to[0], (len(samples.move), 4))
        return fr.slerp(self._from[samples.move], self._to[samples.move], samples.part)


def sample_motion(targets: Targets, chain: Chain, profile: Profile, cell: Cell, dt_s: float) -> Motion:
    """Return the Motion of a chain, sampled every ``dt_s`` from 0 to its end."""
    return Course(targets, chain, profile, cell, dt_s).whole()


def _standstill(targets: Targets, row: int) -> Motion:
    """Return the motion of a program with one position: one sample at rest."""
    zero = np.zeros(1)
    return Motion(
        time_s=zero,
        position_mm=targets.position_mm[row : row + 1],
        rotation=targets.rotation[row : row + 1],
        speed_mm_s=zero,
        acceleration_mm_s2=zero,
        jerk_mm_s3=zero,
        path_mm=zero,
        move=targets.move[row : row + 1],
        corner=np.zeros(1, dtype=np.bool_),
        tool=targets.tool[row : row + 1],
        external=targets.external[row : row + 1],
    )
