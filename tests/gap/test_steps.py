"""Steps from a moment on, in all later runs or in that one alone."""

from dataclasses import replace

import numpy as np

from gcode2krl.effects.dependence import Where
from gcode2krl.gap.components import Place
from gcode2krl.gap.posterior.families import Rows
from gcode2krl.gap.posterior.study import Steps
from tests.gap import constructed as c


def steps_of(hours):
    traces = [
        c.trace(np.zeros((500, 1)), number=number, inputs=replace(c.motion(), hours=at))
        for number, at in enumerate(hours)
    ]
    place = Place("A1", Where.JOINT, [np.ones((1, 500, 1))] * len(hours), 0, 0)
    return Steps(Rows(c.likelihood(traces)), place)


def test_a_step_stays_in_later_runs_in_the_order_of_the_clock():
    """The second folder is the run of the morning."""
    columns = steps_of((2.0, 0.0, 1.0)).columns([(2, 4.0, True)])
    assert columns[1].max() == 0.0
    assert columns[0].min() == 1.0
    assert columns[2][0, :, 0].tolist() == (c.motion().time_s >= 4.0).astype(float).tolist()


def test_a_step_that_is_mended_between_runs_is_in_its_run_alone():
    first, second, third = steps_of((2.0, 0.0, 1.0)).columns([(2, 4.0, False)])
    assert first.max() == second.max() == 0.0
    assert third[0, :, 0].tolist() == (c.motion().time_s >= 4.0).astype(float).tolist()
    blocks = steps_of((0.0, 1.0)).blocks([(0, 4.0, True), (0, 4.0, False), (1, 4.0, True)])
    after = len(blocks) // 2
    assert blocks[after:, 0].any()
    assert not blocks[after:, 1].any()


def test_the_last_run_has_no_later_one_that_could_be_without():
    assert {(run, stays) for run, _, stays in steps_of((0.0, 1.0)).coarse()} == {
        (0, True),
        (0, False),
        (1, True),
    }


def test_moments_are_inside_the_runs_and_get_finer():
    steps = steps_of((0.0, 1.0))
    coarse = steps.coarse()
    assert {run for run, *_ in coarse} == {0, 1}
    assert all(1.0 <= time <= 9.0 for _, time, _ in coarse)
    near = [time for _, time, _ in steps.finer((1, 5.0, True))]
    assert max(np.diff(near)) < 0.06
    assert min(near) > 4.5
    assert max(near) < 5.5
