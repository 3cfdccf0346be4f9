"""What simulations are compared with: whitened data of all traces, normal mismatch fitted along."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.box import boxed
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.nuisance import Nuisance


class Likelihood:
    """Whitened data of all traces with their nuisance, to be compared with simulations."""

    def __init__(
        self, traces: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]], noise: Sequence[Noise]
    ) -> None:
        self.traces, self.noise = list(traces), list(noise)
        self.shared_width = sum(
            {each.name: each.columns.shape[2] for own in nuisance for each in own if each.shared}.values()
        )
        self.columns = self._wide(nuisance, whitened=True)
        self._decompose()

    def raw(self, nuisance: Sequence[Sequence[Nuisance]]) -> list[Floats]:
        """Return the nuisance columns (k·n, w) of each trace as they are, not whitened."""
        return self._wide(nuisance, whitened=False)

    def _wide(self, nuisance: Sequence[Sequence[Nuisance]], whitened: bool) -> list[Floats]:
        """Return the columns (k·n, w) of each trace: shared ones in common places, own ones side by side."""
        widths = {each.name: each.columns.shape[2] for own in nuisance for each in own if each.shared}
        starts = dict(zip(widths, np.cumsum([0, *widths.values()]).tolist(), strict=False))
        at = sum(widths.values())
        width = at + sum(each.columns.shape[2] for own in nuisance for each in own if not each.shared)
        found: list[Floats] = []
        for trace, own in zip(self.traces, nuisance, strict=True):
            n, k = trace.shape
            wide = np.zeros((k * n, width))
            for each in own:
                flat = self._white(trace, each.columns) if whitened else each.columns.reshape(k * n, -1)
                place = starts[each.name] if each.shared else at
                wide[:, place : place + flat.shape[1]] = flat
                at += 0 if each.shared else flat.shape[1]
            found.append(wide)
        return found

    def _decompose(self) -> None:
        """Prepare y -> y - N·b, whose squared length with that of b is chi2 after nuisance."""
        width = self.columns[0].shape[1] if self.columns else 0
        self.gram = sum((c.T @ c for c in self.columns), np.zeros((width, width))) + np.eye(width)

    def _white(self, trace: Trace, columns: Floats) -> Floats:
        return np.concatenate([
            self.noise[j].whiten(columns[j], trace.segments) for j in range(columns.shape[0])
        ])  # fmt: skip

    def whiten(self, values: Sequence[Floats]) -> Floats:
        """Return residuals (n, k) of all traces as one whitened vector."""
        return np.concatenate([
            self._white(trace, value.T[:, :, None])[:, 0]
            for trace, value in zip(self.traces, values, strict=True)
        ])  # fmt: skip

    def without_nuisance(self, y: Floats) -> Floats:
        """Return the vector whose squared length is chi2 after nuisance within its bounds."""
        b = self.nuisance_of(y)
        fitted = np.concatenate([columns @ b for columns in self.columns]) if self.columns else 0.0 * y
        return np.concatenate([y - fitted, b])

    def nuisance_of(self, y: Floats) -> Floats:
        """Return the nuisance coefficients, within their bounds, that fit a whitened vector best."""
        at, sums = 0, np.zeros(len(self.gram))
        for columns in self.columns:
            sums += columns.T @ y[at : at + len(columns)]
            at += len(columns)
        return boxed(self.gram, sums)

    def projected(self, y: Floats) -> Floats:
        """Return vectors (k·n, c) with unbounded nuisance taken out, its coefficients behind them."""
        at, sums = 0, np.zeros((len(self.gram), y.shape[1]))
        for columns in self.columns:
            sums += columns.T @ y[at : at + len(columns)]
            at += len(columns)
        b = np.linalg.solve(self.gram, sums)
        return np.concatenate([y - np.concatenate([columns @ b for columns in self.columns]), b])

    def residual(self, applied: Sequence[Applied]) -> Floats:
        """Return the marginal residual vector with some effects."""
        return self.without_nuisance(
            self.whiten([trace.measured - trace.sample(applied) for trace in self.traces])
        )
