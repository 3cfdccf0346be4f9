"""Planning the motion again, each plan once: all runs of a program share it."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Self

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.effects.inputs import Inputs
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.pipeline import plan_motion
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Motion, Targets

LIMITS = THRESHOLDS.beside
_SAME_S, _SAME_MM = 1e-9, 1e-6
"""Rounding errors of a plan."""


class RememberedPlan:
    """A `Plan` that keeps its last results, of long programs fewer; ``finer`` samples it more often."""

    def __init__(self, plan: Callable[..., Motion], dt_s: float) -> None:
        """Take what plans targets for a cell, sampled every ``dt_s``."""
        self._plan, self._dt_s = plan, dt_s
        self._known: OrderedDict[Any, Motion] = OrderedDict()

    def __call__(self, targets: Targets, cell: Cell) -> Motion:
        """Return the motion of some targets, planned once."""
        key = (
            targets.cdis_mm.tobytes(),
            targets.speed_mm_s.tobytes(),
            targets.wait_s.tobytes(),
            targets.position_mm.tobytes(),
            cell.controller.model_dump_json(),
        )
        if key not in self._known:
            self._known[key] = self._plan(targets, cell, dt_s=self._dt_s)
            rows = sum(map(len, self._known.values()))
            while len(self._known) > 1 and rows > LIMITS.remembered_plan_rows:
                rows -= len(self._known.popitem(last=False)[1])
        self._known.move_to_end(key)
        return self._known[key]

    def finer(self) -> Self:
        """Return the plan that samples a blended corner of a rapid, some 5 ms, more than once."""
        return type(self)(self._plan, min(self._dt_s, LIMITS.corner_step_s))


def remembered_plan(prediction: Prediction) -> RememberedPlan | None:
    """Return what plans a prediction's motion anew; None = the effects' own, which knows no joint speeds.

    Joint speed limits cost more than the rest of a plan together; they are left out where none was met.
    """
    from gcode2krl.effects.apply import inputs_of

    dt_s = float(prediction.inputs.get("dt_s", prediction.cell.controller.cycle_s))
    if any(issue.code == "joint-speed" for issue in prediction.issues):
        return RememberedPlan(partial(plan_motion, watches=False), dt_s)
    plan = inputs_of(prediction).plan
    return RememberedPlan(plan.func, dt_s) if isinstance(plan, partial) else None


def with_corners(inputs: Inputs) -> Inputs:
    """Return inputs sampled often enough for corners of rapids; as they are where they were moved since."""
    plan, motion, targets = inputs.plan, inputs.motion, inputs.targets
    if not isinstance(plan, RememberedPlan) or motion is None or targets is None:
        return inputs
    again = plan(targets, inputs.cell)
    if len(again) != len(motion) or not np.allclose(again.time_s, inputs.time_s, atol=_SAME_S):
        return inputs
    if not np.allclose(again.position_mm, inputs.position_mm, atol=_SAME_MM):
        return inputs
    fine = plan.finer()
    return replace(replace(inputs, cut=None, forces=None).moved(fine(targets, inputs.cell)), plan=fine)
