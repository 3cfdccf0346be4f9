"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make. What a load encoder shows but the joint does not do, its zero and its clock, stays
out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.design import NuisanceDesign, nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.signatures import Signatures


def fitted_signal(trace: Trace, examination: Examination, stamps_s: Floats | None = None) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best.

    At the trace's own stamps, or at others (n,): rows that were left out of the trace, of a burst or where
    the joints turn about, have a model too.
    """
    applied = examination.applied
    nuisance = nuisance_for([trace], examination.question, examination.data.known)
    likelihood = Likelihood([trace], nuisance, examination.noise)
    b = likelihood.nuisance_of(likelihood.whiten([trace.measured - trace.sample(applied)]))
    if trace.link.instrument:
        applied = tuple(each for each in applied if not each.effect.is_clock)
        b[np.isin(likelihood.design.names(0), trace.link.instrument)] = 0.0
    shown, design = trace, likelihood.design
    if stamps_s is not None and not np.array_equal(stamps_s, trace.time_s):
        shown = at_stamps(trace, stamps_s)
        design = NuisanceDesign.of(nuisance_for([shown], examination.question, Signatures()))
        b = _renamed(b, likelihood.design.names(0), design.names(0))
    if trace.link.instrument:
        shown = replace(shown, plus_late_s=0.0)
    return shown.sample(applied) + design.effect(0, shown, b)


def _renamed(b: Floats, names: Sequence[str], wanted: Sequence[str]) -> Floats:
    """Return coefficients (m,) in the order of other names; 0 for mismatch that was not there."""
    of_name: dict[str, list[float]] = {}
    for name, value in zip(names, b.tolist(), strict=True):
        of_name.setdefault(name, []).append(value)
    left = {name: iter(values) for name, values in of_name.items()}
    return np.array([next(left.get(name, iter(())), 0.0) for name in wanted])


def at_stamps(trace: Trace, stamps_s: Floats) -> Trace:
    """Return a trace of the same run at other stamps (n,), in one segment and with nothing measured."""
    nothing = np.zeros((len(stamps_s), trace.shape[1]))
    return replace(trace, time_s=stamps_s, measured=nothing, segments=np.array([[0, len(stamps_s)]]))
