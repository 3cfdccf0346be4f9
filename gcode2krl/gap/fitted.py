"""What a link's model says, mismatch included, as the input of the links behind it.

Encoders' noise would go into the tip otherwise, magnified by the arm's length, and smoothing would smear the
steps that effects make.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl.gap.examine import Question, nuisance_for
from gcode2krl.gap.judge import Judgement
from gcode2krl.gap.links import parts_of
from gcode2krl.gap.refit import Target
from gcode2krl.gap.side import Side
from gcode2krl.gap.signatures import Signatures

Floats = NDArray[np.float64]


def with_fitted(sides: Sequence[Side], judgement: Judgement, question: Question) -> list[Side]:
    """Return the sides with what the judged link (servo or gear) really is, by its fitted model."""
    link, applied = judgement.link, judgement.examination.applied
    found = []
    for side in sides:
        parts = parts_of(link, [side])
        table = side.run.controller
        if not parts or table is None:
            found.append(side)
            continue
        part = parts[0]
        nuisance = nuisance_for(parts, question, Signatures())
        target = Target(parts, nuisance, judgement.examination.noise)
        model = part.sample(applied)
        b = target.nuisance_of(target.whiten([part.measured - model]))
        n, k = part.shape
        model = model + (target.raw(nuisance)[0] @ b).reshape(k, n).T
        stamps = side.stamps(table)
        whole = np.zeros((len(stamps), 6))
        for column, values in zip(part.columns, model.T, strict=True):
            whole[:, column] = np.interp(stamps, part.time_s, values)
        found.append(replace(side, fitted={**side.fitted, link: whole}))
    return found
