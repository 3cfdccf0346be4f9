"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make. What a load encoder shows but the joint does not do, its zero and its clock, stays
out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.examine import Question, nuisance_for
from gcode2krl.gap.judge import Judgement
from gcode2krl.gap.part import Part
from gcode2krl.gap.side import Side
from gcode2krl.gap.signatures import Signatures
from gcode2krl.gap.target import Target

Floats = NDArray[np.float64]
_ENCODER = ("clock", "encoder zero")
"""Nuisance of the load encoders themselves."""


def with_fitted(sides: Sequence[Side], judgement: Judgement, question: Question) -> list[Side]:
    """Return the sides with what the judged link (servo or gear) really is, by its fitted model."""
    mine = {part.side: part for part in judgement.every}
    found = []
    for side in sides:
        table, part = side.run.controller, mine.get(side.number)
        if part is None or table is None:
            found.append(side)
            continue
        model = _model(part, judgement, question)
        stamps = side.stamps(table)
        whole = np.zeros((len(stamps), 6))
        for column, values in zip(part.columns, model.T, strict=True):
            whole[:, column] = np.interp(stamps, part.time_s, values)
        found.append(replace(side, fitted={**side.fitted, judgement.link: whole}))
    return found


def _model(part: Part, judgement: Judgement, question: Question) -> Floats:
    """Return what the link does to the joints (n, k): its effects and the mismatch that fits best."""
    applied = judgement.examination.applied
    nuisance = nuisance_for([part], question, Signatures())
    target = Target([part], nuisance, judgement.examination.noise)
    b = target.nuisance_of(target.whiten([part.measured - part.sample(applied)]))
    if part.link == "gear":
        part = replace(part, plus_late_s=0.0)
        applied = tuple(one for one in applied if one.effect.name != "clock")
        widths = [
            (each.name, each.columns.shape[2])
            for shared in (True, False)
            for each in nuisance[0]
            if each.shared is shared
        ]
        kept = np.concatenate([np.full(width, name not in _ENCODER) for name, width in widths])
        b = np.where(kept, b, 0.0)
    n, k = part.shape
    model: Floats = part.sample(applied) + (target.raw(nuisance)[0] @ b).reshape(k, n).T
    return model
