"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make. What a load encoder shows but the joint does not do, its zero and its clock, stays
out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.judgement import Judgement
from gcode2krl.gap.choose.selection import Question, nuisance_for
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.signatures import Signatures

_ENCODER = ("clock", "encoder zero")
"""Nuisance of the load encoders themselves."""


def with_fitted(pairs: Sequence[Pair], judgement: Judgement, question: Question) -> list[Pair]:
    """Return the pairs with what the judged link (servo or gear) really is, by its fitted model."""
    mine = {trace.run_number: trace for trace in judgement.every}
    found = []
    for pair in pairs:
        table, trace = pair.run.controller, mine.get(pair.number)
        if trace is None or table is None:
            found.append(pair)
            continue
        model = _model(trace, judgement, question)
        stamps = pair.stamps(table)
        whole = np.zeros((len(stamps), 6))
        for column, values in zip(trace.columns, model.T, strict=True):
            whole[:, column] = np.interp(stamps, trace.time_s, values)
        found.append(replace(pair, fitted={**pair.fitted, judgement.link: whole}))
    return found


def _model(trace: Trace, judgement: Judgement, question: Question) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best."""
    applied = judgement.examination.applied
    nuisance = nuisance_for([trace], question, Signatures())
    target = Likelihood([trace], nuisance, judgement.examination.noise)
    b = target.nuisance_of(target.whiten([trace.measured - trace.sample(applied)]))
    if trace.link == "gear":
        trace = replace(trace, plus_late_s=0.0)
        applied = tuple(one for one in applied if one.effect.name != "clock")
        widths = [
            (each.name, each.columns.shape[2])
            for shared in (True, False)
            for each in nuisance[0]
            if each.shared is shared
        ]
        kept = np.concatenate([np.full(width, name not in _ENCODER) for name, width in widths])
        b = np.where(kept, b, 0.0)
    n, k = trace.shape
    model: Floats = trace.sample(applied) + (target.raw(nuisance)[0] @ b).reshape(k, n).T
    return model
