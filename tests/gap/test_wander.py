"""What each run has in its own way over time is noise while it is small; what runs share is not."""

from dataclasses import replace

import numpy as np

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.posterior.cause_tests import LinkFamilies
from gcode2krl.gap.posterior.judgement import is_wander
from tests.gap.constructed import examined, motion, noise, trace, wave

COUNT, RUNS = 1000, 3
TIME_S = motion(20.0).time_s


def swing(run):
    """Return a slow swing (n,) of rms one, of a period and phase of the run's own."""
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * (0.05 + 0.02 * run) * TIME_S + 2.0 * run)


def residual(run, form):
    """Return noise (n, 3) with a form (n,) in the first component."""
    return noise(COUNT, 30 + run, width=3) + form[:, None] * [1.0, 0.0, 0.0]


def judged(forms, link="force", effects_share=0.0):
    """``effects_share``: what accepted effects say together, over what the best family says."""
    traces = [
        trace(residual(run, form), link, number=run, inputs=motion(20.0)) for run, form in enumerate(forms)
    ]
    found = examined(traces, [wave(9.0)], 1.0)
    rest = LinkFamilies(found, traces).rest
    effects_nats = effects_share * rest.study.evidences[0].nats
    return rest, is_wander(found, traces, replace(rest, is_sized=True), effects_nats)


def test_a_swing_of_each_runs_own_is_wander():
    rest, wanders = judged([swing(run) for run in range(RUNS)])
    assert rest.study.evidences[0].on is Dependence.RUN_TIME
    assert not rest.is_gap
    assert wanders


def test_an_encoder_does_not_wander():
    assert not judged([swing(run) for run in range(RUNS)], link="servo")[1]


def test_more_than_twice_the_short_noise_is_a_finding():
    assert not judged([3.0 * swing(run) for run in range(RUNS)])[1]


def test_what_is_alike_in_all_runs_is_no_wander():
    assert not judged([swing(0)] * RUNS)[1]


def test_what_else_is_there_is_not_hidden_by_wander():
    follows = 1.5 * np.sign(np.gradient(motion(20.0).q_cmd_rad[:, 0]))
    assert not judged([swing(run) + follows for run in range(RUNS)])[1]


def test_of_a_single_run_nobody_can_tell():
    assert not judged([swing(0)])[1]


def test_what_happens_in_one_run_alone_is_an_event():
    slipped = [1.4 * np.tanh(TIME_S - 10.0) * (run == 1) for run in range(RUNS)]
    assert not judged(slipped)[1]


def test_what_effects_of_all_runs_say_as_well_is_no_wander():
    swings = [swing(run) for run in range(RUNS)]
    assert judged(swings, effects_share=0.5)[1]
    assert not judged(swings, effects_share=0.95)[1]
