"""Runs and their predictions to pairs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial

from gcode2krl.effects import Inputs, inputs_of
from gcode2krl.effects.inputs import Cut
from gcode2krl.gap.beside.fine_prediction import refined_prediction
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.planning import remembered_plan
from gcode2krl.gap.beside.poses import is_of_poses, pose_pair
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.gap.beside.temperature import temperature_at
from gcode2krl.prediction import Prediction
from gcode2krl.runs import Run
from gcode2krl.units import S_PER_H


def pairs_of(prediction: Prediction, runs: Sequence[Run]) -> Iterator[Pair]:
    """Yield each run beside its prediction: the one that its ``run.toml`` names, else the given one.

    Raises an input error where a run is of another program than its prediction.
    """
    first = first_start(runs)
    shared: dict[str, tuple[Inputs, Simulator]] = {}
    for number, run in enumerate(runs):
        if is_of_poses(run):
            yield pose_pair(run, number, prediction.cell, hours_since(first, run))
            continue
        folder = run.path("prediction")
        named = folder is not None and folder.exists()
        key = str(folder.resolve()) if named and folder else ""  # runs name it from where they are
        if key not in shared:
            shared[key] = _shared(Prediction.load(folder) if named and folder else prediction)
        inputs, simulator = shared[key]
        temperature_C = temperature_at(run.controller, inputs.time_s)
        own = replace(inputs, hours=hours_since(first, run), temperature_C=temperature_C)
        yield Pair(run=run, number=number, inputs=own, simulator=simulator)


def _shared(prediction: Prediction) -> tuple[Inputs, Simulator]:
    fine = refined_prediction(prediction)
    return inputs_of(fine, plan=remembered_plan(fine), cut=_cut_of(fine)), Simulator()


def _cut_of(prediction: Prediction) -> Cut | None:
    """Return what cuts the part again for its mean forces; None where none are predicted."""
    if prediction.forces is None:
        return None
    from gcode2krl.cutting import mean_cut

    return partial(mean_cut, prediction.toolpath)


def first_start(runs: Sequence[Run]) -> datetime | None:
    """Return when the earliest of the runs started; None where no run says."""
    return min((run.head.started for run in runs if run.head.started is not None), default=None)


def hours_since(first: datetime | None, run: Run) -> float:
    """Return the hours from the first start to that of a run; 0 where one is not known."""
    if first is None or run.head.started is None:
        return 0.0
    return (run.head.started - first).total_seconds() / S_PER_H
