"""Planning the motion again, each plan once: all runs of a program share it."""

from collections import OrderedDict
from functools import partial
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.effects.inputs import Plan
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.pipeline import plan_motion
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Motion, Targets

LIMITS = THRESHOLDS.beside


def remembered_plan(prediction: Prediction) -> Plan | None:
    """Return what plans a prediction's motion anew; None = the effects' own, which knows no joint speeds.

    Joint speed limits cost more than the rest of a plan together; they are left out where none was met.
    """
    from gcode2krl.effects.apply import inputs_of

    dt_s = float(prediction.inputs.get("dt_s", prediction.cell.controller.cycle_s))
    slowed = any(issue.code == "joint-speed" for issue in prediction.issues)
    plan = partial(plan_motion, dt_s=dt_s, watches=False) if slowed else inputs_of(prediction).plan
    if plan is None:
        return None
    known: OrderedDict[Any, Motion] = OrderedDict()

    def once(targets: Targets, cell: Cell) -> Motion:
        key = (
            targets.cdis_mm.tobytes(),
            targets.speed_mm_s.tobytes(),
            targets.wait_s.tobytes(),
            targets.position_mm.tobytes(),
            cell.controller.model_dump_json(),
        )
        if key not in known:
            known[key] = plan(targets, cell)
            if len(known) > LIMITS.remembered_plans:
                known.popitem(last=False)
        return known[key]

    return once
