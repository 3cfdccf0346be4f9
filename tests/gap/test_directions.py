"""Places have directions: along the tool, along gravity, along one line, at the price of one component."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.posterior.study import along_one
from tests.gap import constructed as c
from tests.gap.test_families import COUNT, best_of

SIGMA_MM = 0.02


def tip_traces(shift, link="mechanics", sigma=SIGMA_MM):
    """Return traces of three runs; ``shift`` of the inputs and the number of a run is added to the signal."""
    made = []
    for number in range(3):
        inputs = Admissible(c.trace(np.zeros((COUNT, 3)), link, number))
        made.append(c.trace(shift(inputs, number) + c.noise(COUNT, number, sigma, 3), link, number))
    return made


def pull_out(own, run, mm=0.03):
    """Return what a tool that slips out of its holder in the second run does to the tip."""
    out = 1.0 * (run > 1) if run != 1 else 1.0 * (own.since_start_s > 4.3)
    return -mm * np.reshape(out, (-1, 1)) * own.tool_axes[:, :, 2]


def test_a_pull_out_along_the_tool_is_the_tips_and_no_joints():
    study = best_of(tip_traces(pull_out), sigma=SIGMA_MM)
    best = study.evidences[0]
    assert (best.place.name, best.on) == ("tip", Dependence.RUN_TIME_STEP)
    assert best.place.width == 1
    axis = tip_traces(pull_out)[2].inputs.tool_rotation[-1, :, 2]
    along = best.signal[2][-1]
    assert along @ axis / np.linalg.norm(along) == pytest.approx(-1.0, abs=1e-6)
    joints = [each.nats for each in study.evidences if each.place.name.startswith("A")]
    assert best.nats > max(joints) + 4.6


def test_a_pull_along_gravity_is_along_gravity_however_the_tool_stands():
    study = best_of(
        tip_traces(lambda own, run: 0.03 * (run > 0) * np.tile(own.trace.inputs.gravity, (COUNT, 1))),
        sigma=SIGMA_MM,
    )
    best = next(each for each in study.evidences if each.on is Dependence.RUN_TO_RUN)
    assert (best.place.name, best.place.width) == ("tip", 1)
    assert np.abs(best.signal[2][-1][:2]).max() < 1e-9


@pytest.mark.parametrize(("link", "sigma"), [("mechanics", SIGMA_MM), ("force", 2.0)])
def test_functions_along_one_line_say_more_than_along_three(link, sigma):
    """A bend in the place: twelve functions along one line, not thirty-six along three axes."""
    line = np.array([0.6, -0.8, 0.0])

    def bent(own, run):
        return 0.8 * sigma * np.sin(own.position_mm[:, :1] / 20.0) * line

    study = best_of(tip_traces(bent, link, sigma), sigma=sigma)
    best = next(each for each in study.evidences if each.place.name in ("tip", "force"))
    assert best.on is Dependence.PLACE
    largest = best.signal[0][int(np.argmax(np.linalg.norm(best.signal[0], axis=1)))]
    assert abs(largest @ line) / np.linalg.norm(largest) == pytest.approx(1.0, abs=0.02)
    # one line: all rows of the signal are multiples of each other, as those of three axes are not
    assert np.linalg.matrix_rank(best.signal[0], tol=1e-6 * np.abs(best.signal[0]).max()) == 1


def test_by_chance_a_line_says_no_more_than_three_axes():
    study = best_of(tip_traces(lambda own, run: 0.0 * own.position_mm), sigma=SIGMA_MM)
    assert study.p > 0.01
    assert study.evidences[0].nats < 10.0


def test_one_function_is_along_one_line_as_it_is():
    class Constant:
        directions = 3

    assert along_one(None, object(), Constant, [0, 0, 0], np.zeros((0, 0))) is None
