"""Spectra of values at any times, at frequencies that are evenly spaced in narrow bands of one width."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Complexes, Floats


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of so many frequencies each, of values at some times (n,)."""

    time_s: Floats
    step_hz: float
    count: int

    def hz(self, first_hz: float) -> Floats:
        """Return the frequencies (f,) of the band that begins at one."""
        return np.asarray(first_hz + self.step_hz * np.arange(self.count), dtype=np.float64)

    @cached_property
    def _factors(self) -> tuple[Complexes, Complexes]:
        """Waves (a, n) and (b, n), whose products are those of all frequencies of a band from 0 on.

        Some 2·sqrt(f) waves are computed, and not f of them for each band.
        """
        wide = max(1, round(self.count**0.5))
        coarse = np.arange(-(-self.count // wide)) * wide
        first, second = (self._waves(self.step_hz * each) for each in (coarse, np.arange(wide)))
        return first, second

    def _waves(self, hz: Floats) -> Complexes:
        waves: Complexes = np.exp(-2j * np.pi * hz[:, None] * self.time_s)
        return waves

    def power(self, first_hz: float, values: Floats) -> Floats:
        """Return the squared absolute sums (f, k) of values (n, k) times exp(-2·pi·i·f·t)."""
        first, second = self._factors
        moved = self._waves(np.array([first_hz]))[0][:, None] * values
        sums = [((first * column) @ second.T).reshape(-1)[: self.count] for column in moved.T]
        power: Floats = np.abs(np.stack(sums, axis=1)) ** 2
        return power
