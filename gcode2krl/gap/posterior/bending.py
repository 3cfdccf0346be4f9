"""What bends the arm where the model of the force fails: the tip tells it from an error of the sensor.

A force that is there bends the arm; an error of its sensor does not. With X what the measured force less the
predicted one would do to the tip, and r what the tip does beside its prediction, both less normal mismatch,
r = g·X + noise: g is near 1 where the force is there, and near 0 where it is the sensor's. What is noise of
the sensor in X makes g smaller (errors in variables, Fuller 1987).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.compare.links import FORCE, MECHANICS
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.trace import Context, Trace, evenly_spread, is_lost
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import Nuisance, nuisance_for
from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import fitted_mismatch, question_of
from gcode2krl.gap.posterior.judgement import Judgement
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.posterior
_SURE = 3.0
"""Standard deviations."""


@dataclass(frozen=True)
class Bend:
    """Runs whose arm the measured force bends, and what the tip says to it."""

    pairs: tuple[Pair, ...]
    gain: float
    """How much of what that would do the tip does."""
    nats: float
    """The evidence of it."""
    sigma: float
    """Of the gain."""

    @property
    def is_seen(self) -> bool:
        """Tell whether the tip does what the force says, and not by chance."""
        return self.nats >= _LIMITS.bend_nats and abs(self.gain - 1.0) <= _LIMITS.bend_off

    @property
    def is_denied(self) -> bool:
        """Tell whether the tip surely does not do what the force says: that is the sensor's."""
        return self.gain + _SURE * self.sigma < 1.0 - _LIMITS.bend_off


def bends_of(judged: Judgement, context: Context) -> list[Bend]:
    """Return the arm bent by the measured force, in the cut alone and in air too, where its model may fail.

    Of the force link alone, where it is lost, or what may be noise of its sensor is slow or loud; else none.
    """
    if judged.link is not FORCE or not (is_lost(judged) or _is_doubtful(judged)):
        return []
    base = FORCE.base(context)
    seen, bending = (*base, *judged.applied), (*base, *context.learned)
    bent = [
        tuple(pair.with_measured_load(seen, bending, in_air=in_air) for pair in context.pairs)
        for in_air in (False, True)
    ]
    of_tip = MECHANICS.base(context)
    traces = evenly_spread(MECHANICS.traces(context.pairs, of_tip))
    if not traces or traces[0].still:
        return [Bend(each, 0.0, 0.0, np.inf) for each in bent]
    question = replace(question_of(MECHANICS, traces, context), blocks=())
    nuisance = nuisance_for(traces, question, Signatures())
    return [Bend(each, *_followed(traces, _on(each, traces), nuisance)) for each in bent]


def _on(pairs: Sequence[Pair], traces: Sequence[Trace]) -> list[Trace]:
    """Return the traces of the tip, at the same rows, beside the models of other pairs."""
    models = {trace.run_number: trace.inputs for trace in MECHANICS.traces(pairs)}
    return [replace(trace, inputs=models[trace.run_number]) for trace in traces]


def shown_at_tip(traces: Sequence[Trace], judged: Judgement, bends: Sequence[Bend]) -> list[Trace] | None:
    """Return the traces of a force whose slow or loud noise bends the arm, and so is no noise; else None."""
    if not (bends and _is_doubtful(judged) and any(bend.is_seen for bend in bends)):
        return None
    return [replace(trace, is_shown_at_tip=True) for trace in traces]


def bent_by(bends: Sequence[Bend], context: Context) -> Context:
    """Return the context whose arm the measured force bends, in air too where the tip shows that better.

    Where the tip does not tell, in the cut alone; where it denies the force, the predicted one goes on.
    """
    seen = [bend for bend in bends if bend.is_seen]
    if not seen and (not bends or bends[0].is_denied):
        return context
    return context.with_pairs(max(seen or bends[:1], key=lambda bend: bend.nats).pairs)


def _is_doubtful(judged: Judgement) -> bool:
    """Tell whether the noise has a slow part, or loud rows that its sensor may have had."""
    return judged.size.is_loud or any(noise.slow for noise in judged.examination.noise)


def _followed(
    traces: Sequence[Trace], bent: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]]
) -> tuple[float, float, float]:
    """Return the gain g of r = g·X + noise, its evidence in nats, and its standard deviation.

    ``traces`` are tips beside the predicted load, ``bent`` the same beside the measured one. g by least
    squares, the evidence ½·(|r|² - |r - g·X|²), both over how much more than noise is left.
    """
    ways = [there.nominal - trace.nominal for trace, there in zip(traces, bent, strict=True)]
    if not any(way.any() for way in ways):
        return 0.0, 0.0, np.inf
    columns = [np.ascontiguousarray(way.T)[:, :, None] for way in ways]
    likelihood = Likelihood(traces, nuisance, noise_of(traces, columns, nuisance))
    r = _beside_mismatch(likelihood, [trace.residual for trace in traces])
    x = _beside_mismatch(likelihood, ways)
    power = max(float(x @ x), 1e-30)
    gain = float(r @ x) / power
    unexplained = float(np.sum((r - gain * x) ** 2))
    inflation = max(1.0, unexplained / len(r))
    return gain, 0.5 * (float(r @ r) - unexplained) / inflation, float(np.sqrt(inflation / power))


def _beside_mismatch(likelihood: Likelihood, values: Sequence[Floats]) -> Floats:
    """Return values (n, k) of all traces, whitened (v,), less the mismatch that fits them best."""
    of_runs, shared = fitted_mismatch(likelihood, values)
    return likelihood.whiten([value - a - b for value, a, b in zip(values, of_runs, shared, strict=True)])
