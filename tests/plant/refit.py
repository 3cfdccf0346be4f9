"""Effects themselves, beyond their signatures: sizes, directions and shares fitted to a true change."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from tests.plant.distance import Fit
from tests.plant.effects import LIBRARY
from tests.plant.signatures import MOST_SHARE, SQUARED, TONES, Column, Start, columns
from tests.plant.whitened import Case

EVALUATIONS = (3, 8)
"""Of the first refit, and of one that is worth going on with."""


def settings(start: Start, cols: Sequence[Column], values: np.ndarray) -> tuple[float, dict[int, object]]:
    """Size and answers of an effect whose columns have these values."""
    given: dict[int, object] = dict(start.given)
    signs = [i for i, kind in enumerate(start.asked) if kind == ("sign",)]
    n = len(start.directions)
    if start.name in TONES and n:  # two phases of a line
        left, sizes, right = np.linalg.svd(values.reshape(2, 3))
        given[start.directions[0]] = tuple(sizes[0] * right[0])
        given[start.shares[1]] = float(np.arctan2(left[1, 0], left[0, 0]) / (2.0 * np.pi) % 1.0)
        return start.size, given
    if start.name in SQUARED:
        xx, yy, zz, xy, xz, yz = values
        xy, xz, yz = (0.5 * v for v in (xy, xz, yz))
        diagonal = np.array([xx + xy + xz, yy + xy + yz, zz + xz + yz])
        tensor = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]]) + np.diag(diagonal)
        sizes, ways = np.linalg.eigh(tensor)
        given[start.directions[0]] = tuple(np.sqrt(max(sizes[-1], 1e-6)) * ways[:, -1])
        return start.size, given
    if n:
        for k, i in enumerate(start.directions):
            given[i] = tuple(values[3 * k : 3 * k + 3])
        size, level, tail = start.size, max(np.abs(values[: 3 * n]).max(), 1e-6), values[3 * n :]
    else:
        size, level, tail = start.size * max(abs(values[0]), 1e-6), values[0], values[1:]
        for i in signs[:1]:
            given[i] = float(np.sign(values[0]) or 1.0)
    level = level if abs(level) > 1e-6 else 1e-6
    free = [i for i in start.shares if i not in dict(start.given)]
    for i, value in zip(free, tail, strict=False):
        given[i] = float(np.clip(0.5 + value / level, 0.5 - MOST_SHARE, 0.5 + MOST_SHARE))
    return float(size), given


class Guess:
    """Effects with free sizes, directions and shares against a whitened change of a case."""

    def __init__(self, case: Case, change: dict[tuple, np.ndarray], fit: Fit):
        self.case, self.change = case, change
        self.parts, start, lower, upper = [], [], [], []
        for block, values in zip(fit.blocks, fit.values, strict=True):
            s = block.start
            size, given = settings(s, columns(s), values)
            most = LIBRARY[s.name].sizes[1]
            free: list[tuple[int, int]] = []  # question and axis; (-1, 0) is the size
            if not s.directions:
                free.append((-1, 0))
                start.append(size / s.size)
                lower.append(0.0)
                upper.append(most / s.size)
            reach = np.sqrt(most / s.size) if s.name in SQUARED else most / s.size
            for i in s.directions:
                free += [(i, axis) for axis in range(3)]
                start += list(given[i])
                lower += [-reach] * 3
                upper += [reach] * 3
            for i in s.shares:
                free.append((i, 0))
                start.append(float(given.get(i, 0.5)))
                lower.append(0.0)
                upper.append(1.0)
            self.parts.append((s, size, given, free))
        self.lower, self.upper = np.array(lower), np.array(upper)
        room = 1e-6 * (self.upper - self.lower)
        self.start = np.clip(np.array(start), self.lower + room, self.upper - room)

    def white(self, values: np.ndarray) -> dict[tuple, np.ndarray]:
        """The effects' whitened change."""
        out: dict[tuple, np.ndarray] = {}
        at = 0
        for s, size, given, free in self.parts:
            answers, size = dict(given), s.size if s.directions else size
            for i, axis in free:
                if i < 0:
                    size = s.size * values[at]
                elif i in s.directions:
                    way = list(answers[i])
                    way[axis] = float(values[at])
                    answers[i] = tuple(way)
                else:
                    answers[i] = float(values[at])
                at += 1
            white = self.case.white(self.case.changes(s.hooks(max(size, 1e-12), answers)))
            out = {k: v + out.get(k, 0.0) for k, v in white.items()}
        return out

    def chi2(self, acted: dict[tuple, np.ndarray]) -> float:
        """Least chi² of the truth less this, beside bounded mismatch."""
        left = {k: v - acted[k] for k, v in self.change.items()}
        return self.case.against(left, ()).least().chi2

    def refitted(self, goes_on) -> float:
        """Least chi² from the start on; `goes_on(chi2)` says whether a first refit is worth another."""
        values, chi2 = self.start, np.inf
        for evaluations in EVALUATIONS:
            found = least_squares(
                self._rest,
                values,
                bounds=(self.lower, self.upper),
                x_scale=np.maximum(np.abs(values), 0.05 * (self.upper - self.lower)),
                diff_step=0.01,
                max_nfev=evaluations,
            )
            values = found.x
            chi2 = min(chi2, self.chi2(self.white(values)))
            if not goes_on(chi2):
                break
            room = 1e-6 * (self.upper - self.lower)
            values = np.clip(values, self.lower + room, self.upper - room)
        return chi2

    def _rest(self, values: np.ndarray) -> np.ndarray:
        """What these leave of the change beside mismatch, each bound taken for a standard deviation."""
        acted = self.white(values)
        left = {k: v - acted[k] for k, v in self.change.items()}
        m = self.case.mismatch.at
        inner = self.case.own[np.ix_(m, m)] + np.eye(len(m))
        onto = self.case.against(left, ()).products[m, 0]
        return np.concatenate(list(self.case.less(left, m, np.linalg.solve(inner, onto)).values()))
