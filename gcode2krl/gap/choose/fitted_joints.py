"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make. What a load encoder shows but the joint does not do, its zero and its clock, stays
out.
"""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.fit.design import nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.signatures import Signatures


def fitted_signal(trace: Trace, examination: Examination) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best."""
    applied = examination.applied
    nuisance = nuisance_for([trace], examination.question, Signatures())
    likelihood = Likelihood([trace], nuisance, examination.noise)
    b = likelihood.nuisance_of(likelihood.whiten([trace.measured - trace.sample(applied)]))
    if trace.link.instrument:
        trace = replace(trace, plus_late_s=0.0)
        applied = tuple(each for each in applied if not each.effect.is_clock)
        b[np.isin(likelihood.design.names(0), trace.link.instrument)] = 0.0
    return trace.sample(applied) + likelihood.design.effect(0, trace, b)
