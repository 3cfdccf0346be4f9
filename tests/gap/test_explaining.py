"""What noise is cleaned of: the same inputs as those of families, as columns of a component."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.noise.slow import block_means, explaining_columns, slow_parts_of
from tests.gap.constructed import motion, noise, trace

COUNT = 1000
TIME_S = np.arange(0.0, 20.0, 0.02)


def spanned(columns, form):
    """Return the share of a form that columns and a constant explain."""
    design = np.column_stack([np.ones(len(form)), columns])
    centred = form - form.mean()
    left = form - design @ np.linalg.lstsq(design, form, rcond=None)[0]
    return 1.0 - left @ left / (centred @ centred)


def logged_torque():
    """Return a torque that no angle tells and that is no tone: it forgets within a second."""
    wave = lfilter([1.0], [1.0, -0.98], noise(COUNT, 11, 0.2)[:, 0])
    return np.column_stack([wave * (joint + 1.0) for joint in range(6)])


def one(residual, link="servo", **more):
    return trace(residual, link=link, inputs=replace(motion(20.0), **more))


def test_a_joint_has_its_own_torque_with_memory_among_its_columns():
    made = one(np.zeros((COUNT, 2)), torque_Nm=logged_torque())
    torque = Admissible(made).torque_Nm[:, 1]
    (first,), (second,) = explaining_columns([made])
    assert spanned(second, np.tanh(2.0 * torque)) > 0.99
    assert spanned(second, torque - Admissible(made).torque_with_memory(1)[:, 1]) > 0.999
    assert first.shape == second.shape


def test_a_tip_has_a_vector_that_turns_with_the_tool():
    made = one(np.zeros((COUNT, 3)), link="mechanics")
    _, (y,), _ = explaining_columns([made])
    vector = made.inputs.tool_rotation @ np.array([0.2, -0.1, 0.3])
    assert spanned(y, vector[:, 1]) > 0.999


def test_temperatures_are_columns_of_every_component():
    warm_C = (20.0 + np.cumsum(noise(COUNT, 4, 0.01)[:, 0]))[:, None]
    made = one(np.zeros((COUNT, 1)), temperature_C=warm_C)
    ((columns,),) = explaining_columns([made])
    assert spanned(columns, warm_C[:, 0]) > 0.999


def test_what_follows_the_torque_is_not_learnt_as_slow_noise():
    """Of three times the noise: without the torque, which is irregular, it could only be slow noise."""
    follows = 3.0 * np.tanh(logged_torque()[:, :1])
    residual = noise(COUNT, 7) + follows

    def slow_sigma(**more):
        made = one(residual, **more)
        (means,) = block_means([made], [residual], [np.zeros((1, COUNT, 0))], [[]], False)
        return sum(part.sigma for part in slow_parts_of(means))

    assert slow_sigma(torque_Nm=logged_torque()) < 0.2
    assert slow_sigma(torque_Nm=np.zeros((COUNT, 6))) > 1.0
