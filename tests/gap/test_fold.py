"""What is held out, and when nothing can be."""

from types import SimpleNamespace

import numpy as np

from gcode2krl.gap.compare.links import SERVO
from gcode2krl.gap.compare.pair import Simulator
from gcode2krl.gap.compare.trace import Trace, folds_of

COUNT, STEP_S = 2000, 0.01


def _part(number: int) -> Trace:
    time_s = STEP_S * np.arange(COUNT)
    return Trace(
        link=SERVO,
        run=f"run-{number}",
        run_number=number,
        simulator=Simulator(),
        factor=1.0,
        components=("A1",),
        columns=(0,),
        plus="q_act_rad",
        inputs=SimpleNamespace(time_s=time_s),
        time_s=time_s,
        measured=np.zeros((COUNT, 1)),
        segments=np.array([[0, COUNT]], dtype=np.int64),
    )


def test_whole_runs_are_held_out_by_turns():
    traces = [_part(0), _part(1), _part(2)]
    pairs = folds_of(traces, [np.ones(COUNT)] * 3)
    assert [[trace.run for trace in held] for _, held in pairs] == [["run-0"], ["run-1"], ["run-2"]]
    assert all(held[0] not in kept for kept, held in pairs)


def test_where_one_run_has_the_power_its_quarters_are_held_out_with_guards():
    traces = [_part(0), _part(1)]
    pairs = folds_of(traces, [np.ones(COUNT), np.zeros(COUNT)])
    assert len(pairs) == 4
    for kept, held in pairs:
        first, last = held[0].time_s[[0, -1]]
        own = next(trace for trace in kept if trace.run == "run-0")
        away = np.minimum(np.abs(own.time_s - first), np.abs(own.time_s - last))
        assert away[(own.time_s < first) | (own.time_s > last)].min() > 1.0
        assert not np.any((own.time_s >= first) & (own.time_s <= last))


def test_what_happens_at_one_place_only_cannot_be_held_out():
    power = np.zeros(COUNT)
    power[1000:1080] = 1.0  # 0.8 s, within any guard
    assert folds_of([_part(0), _part(1)], [power, np.zeros(COUNT)]) == []
    power[300:380] = 1.0
    assert folds_of([_part(0), _part(1)], [power, np.zeros(COUNT)]) != []
