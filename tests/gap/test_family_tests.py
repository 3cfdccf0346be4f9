"""A name needs its family: the three tests on effects that are imitated."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.posterior.cause_tests import FamilyTests, LinkFamilies, Rest, net_gain
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.posterior.study import Study
from tests.gap import constructed as c

SIGMA = 1e-4
T = c.motion().time_s


class Drift(c.Added):
    """A drift that goes on over the runs, as the clock on the wall does."""

    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.RUN_TIME, Dependence.WALL_CLOCK})


class Dragging(c.Added):
    """A form of the joint's own velocity."""

    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY})


def traces(form, runs=2):
    """Return servo traces of A1 with a form (n,) of run number and time, in sigmas."""
    return [
        c.trace(
            SIGMA * form(number, T)[:, None] + c.noise(500, number, SIGMA),
            number=number,
            declared_sigma=SIGMA,
        )
        for number in range(runs)
    ]


def first_tests(form, effect, runs=2):
    made = traces(form, runs)
    found = c.examined(made, [effect])
    assert len(found.causes) == 1
    return LinkFamilies(found, made).tests[0]


def judged(form, effect, runs=2):
    return judge(c.LINK["servo"], traces(form, runs), [], c.question([effect]))


def speed(t):
    return c.joint_rates(t)[:, 0] / c.joint_rates(t)[:, 0].max()


def passes(found):
    return found.is_best and found.form_fits and found.is_alone


def test_a_right_form_passes_all_three():
    found = first_tests(lambda run, t: 3.0 * speed(t), Dragging("dragging", speed))
    assert passes(found)
    assert found.margin > 0.0
    assert found.form_ratio == pytest.approx(1.0, abs=0.02)
    assert found.other_share < 0.01


def test_a_step_is_not_named_for_the_drift_that_imitates_it():
    """It takes most of the gap on either run, and the step is better by far."""
    drift = Drift("drift", lambda t: 0.5 + 0.5 * np.tanh(t - 5.0))
    form = lambda run, t: 6.0 * (t > 5.0)  # noqa: E731
    found = first_tests(form, drift, runs=1)
    assert found.better.on is Dependence.RUN_TIME_STEP
    assert not found.is_best
    result = judged(form, drift, runs=1)
    assert result.verdict == "unexplained"
    assert result.applied == ()
    assert result.rest.worth_naming[0].on is Dependence.RUN_TIME_STEP


def test_another_form_of_the_same_kind_is_a_family_without_a_name():
    """Velocity it is, but not in that form: (b) alone fails."""
    found = first_tests(
        lambda run, t: 3.0 * np.tanh(5.0 * speed(t)), Dragging("dragging", lambda t: speed(t) ** 3)
    )
    assert not found.form_fits
    assert found.is_best
    assert found.family.on is Dependence.VELOCITY


def test_another_family_beside_the_effect_forbids_its_name():
    dragging = Dragging("dragging", speed)
    found = first_tests(lambda run, t: 3.0 * speed(t) + 1.5 * (t > 5.0), dragging, runs=1)
    assert not found.is_alone
    assert found.other_share > 0.1


def test_what_is_left_in_another_joint_does_not_speak_against_a_cause():
    dragging = Dragging("dragging", speed)
    steps = [0.8 * (T > 5.0), 0.8 + 0.0 * T, 0.8 + 0.0 * T]
    made = [
        c.trace(
            np.stack([3.0 * speed(T), step], axis=1) * SIGMA + c.noise(500, number, SIGMA, 2),
            number=number,
            declared_sigma=SIGMA,
        )
        for number, step in enumerate(steps)
    ]
    result = judge(c.LINK["servo"], made, [], c.question([dragging]))
    assert [each.effect.name for each in result.applied] == ["dragging"]
    assert result.verdict == "partly_explained"
    assert result.rest.worth_naming[0].place.name == "A2"


def test_of_an_effect_in_no_joint_alone_only_the_joints_that_it_moves_are_near():
    """What couples two joints acts in one of them: noise of the other, which has no gap, says nothing."""
    coupling = Dragging("coupling", speed)
    made = [
        c.trace(
            np.stack([3.0 * speed(T), 0.0 * T], axis=1) * SIGMA + c.noise(500, number, SIGMA, 2),
            number=number,
            declared_sigma=SIGMA,
        )
        for number in range(2)
    ]
    found = c.examined(made, [coupling])
    (tests,) = LinkFamilies(found, made).tests
    assert tests.is_alone


def test_an_effect_that_states_no_family_is_its_own():
    effect = c.Added("nameless", speed)
    found = first_tests(lambda run, t: 3.0 * speed(t), effect)
    assert found.family is None
    assert found.form_ratio == 1.0
    assert found.is_best


def test_each_test_alone_forbids_the_name():
    good = FamilyTests(20.0, 0.99, 0.0, 0.0, None, None)
    # most of what can be told, a hundredth of the gap
    hidden = FamilyTests(20.0, 0.99, 0.7, 0.01, None, None)
    assert passes(hidden)
    assert passes(good)
    for worse in (
        FamilyTests(-20.0, 0.99, 0.0, 0.0, None, None),
        FamilyTests(20.0, 0.7, 0.0, 0.0, None, None),
        FamilyTests(20.0, 0.99, 0.2, 0.1, None, None),
    ):
        assert not passes(worse)


def test_geometry_is_exact():
    """A form of wear may take nine tenths of what its kind takes; that of a frame takes all."""
    assert FamilyTests(20.0, 0.9, 0.0, 0.0, None, None).form_fits
    assert not FamilyTests(20.0, 0.998, 0.0, 0.0, None, None, least_form=1.0 - 0.03**2).form_fits


def test_evidence_within_its_inflation_counts_for_nothing():
    strong, weak = c.stub(nats=30.0, inflation=2.0), c.stub(nats=30.0, inflation=20.0)
    assert net_gain(strong) == 60.0
    assert net_gain(weak) == 0.0


@pytest.mark.parametrize(
    ("nats", "inflation", "tail_p", "known", "own_time", "in_one", "wanted"),
    [
        (30.0, 1.0, 1e-6, 1e5, 0.0, 0.0, True),
        (30.0, 2.0, 1e-6, 1e5, 0.0, 0.0, False),  # over its inflation it is not certain
        (150.0, 1.0, 0.01, 1e5, 0.0, 0.0, False),  # few strong stretches of a sound link
        (5000.0, 10.0, 0.01, 1e5, 0.0, 0.0, True),  # beyond all that models are off by
        (30.0, 1.0, 1e-6, 1e6, 0.0, 0.0, False),  # less than a hundredth of what is known, in amplitude
        (5000.0, 1.0, 1e-6, 2e8, 0.0, 0.0, False),
        (30.0, 1.0, 1e-6, 1e5, 20.0, 0.0, False),  # slow noise explains two thirds of it
        (80.0, 1.0, 1e-6, 1e5, 20.0, 0.0, True),
        (30.0, 1.0, 1e-6, 1e5, 60.0, 0.0, False),
        (30.0, 1.0, 1e-6, 1e5, 0.0, 0.1, True),
        (90.0, 1.0, 1e-6, 1e5, 0.0, 0.9, False),  # an event, no function
    ],
)
def test_a_gap_is_rare_or_beyond_what_models_are_off_by_however_small_beside_the_noise(
    nats, inflation, tail_p, known, own_time, in_one, wanted
):
    place = c.stub(component=None)
    said = c.stub(nats=nats, unbounded=0.0, gain=2.0 * nats, in_one=in_one, inflation=inflation, place=place)
    evidence = c.stub(**vars(said), on=Dependence.VELOCITY)
    slow = c.stub(
        nats=own_time, unbounded=0.0, gain=0.0, in_one=0.0, inflation=1.0, on=Dependence.RUN_TIME, place=place
    )
    for gap_gain, upstream_gain in ((known, 0.0), (0.0, known)):
        rest = Rest(Study(1e9, (evidence, slow), 0.005, tail_p), gap_gain, upstream_gain=upstream_gain)
        assert rest.is_gap is wanted
