"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make. What a load encoder shows but the joint does not do, its zero and its clock, stays
out.
"""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.selection import Examination, nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.signatures import Signatures


def fitted_signal(trace: Trace, examination: Examination) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best."""
    applied = examination.applied
    nuisance = nuisance_for([trace], examination.question, Signatures())
    target = Likelihood([trace], nuisance, examination.noise)
    b = target.nuisance_of(target.whiten([trace.measured - trace.sample(applied)]))
    if trace.link.instrument:
        trace = replace(trace, plus_late_s=0.0)
        applied = tuple(one for one in applied if not one.effect.is_clock)
        widths = [
            (each.name, each.columns.shape[2])
            for shared in (True, False)
            for each in nuisance[0]
            if each.shared is shared
        ]
        kept = np.concatenate([np.full(width, name not in trace.link.instrument) for name, width in widths])
        b = np.where(kept, b, 0.0)
    n, k = trace.shape
    model: Floats = trace.sample(applied) + (target.raw(nuisance)[0] @ b).reshape(k, n).T
    return model
