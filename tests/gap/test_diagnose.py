"""The whole diagnosis on runs made with the library's effects, noise and normal mismatch."""

import functools
import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from gcode2krl.gap import Gap, diagnose, diagnose_log, diagnosis, text_report
from gcode2krl.gap.answer.result import SCHEMA, EffectAt
from gcode2krl.runs import RunHead
from tests.gap.synthetic import LIBRARY, PROGRAM, TRUE_STEP_S, applied, bent, prediction, runs

# The whole diagnosis on runs made with the library's effects, noise and normal mismatch

SERVO = {"tracker": False, "force": False}
GEAR = {**SERVO, "load_encoders": True}
FORCE = {"tracker": False, "controller": False}
TIP = {"force": False}


def _alike(cause):
    """Return the effects of the library in the declared set of a cause."""
    return [each for each in cause.indistinguishable_from if isinstance(each, EffectAt)]


@functools.cache
def _gap(*texts: str, seed: int = 5, count: int = 2, **signals: bool) -> Gap:
    return diagnose(prediction(), runs(applied(*texts), count, seed, **signals))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "signals", "parameter", "tolerance"),
    [
        ("friction:target=A2,spike_deg=0.006,decay_s=0.15", SERVO, "spike_deg", 0.1),
        ("servo_lag:target=A3,tau_s=0.012", SERVO, "tau_s", 0.06),
        ("backlash:target=A1,gap_deg=0.008", GEAR, "gap_deg", 0.1),
        ("transmission:target=A2,amplitude_deg=0.004,harmonic=2,phase=1", GEAR, "amplitude_deg", 0.1),
        ("clock:target=q_load,offset_s=0.01", GEAR, "offset_s", 0.2),
        ("tool_wear:growth_per_m=0.5", FORCE, "growth_per_m", 0.15),
        ("force_scale:target=radial,scale=1.5", FORCE, "scale", 0.06),
        ("runout:runout_mm=0.02", FORCE, "runout_mm", 0.1),
        ("force_offset:fx_N=20,fy_N=-10,fz_N=5", FORCE, "fx_N", 0.2),
        ("stiffness:target=A2,scale=0.5", TIP, "scale", 0.12),
        ("mastering:target=A2,offset_deg=0.01", TIP, "offset_deg", 0.2),
        ("vibration:hz=12,participation=0.5,direction=1/0/0", TIP, "hz", 0.01),
        ("base_frame:x_mm=0.5,y_mm=-0.3,c_deg=0.02", TIP, "x_mm", 0.1),
    ],
)
def test_an_effect_is_named_with_its_target_and_size(text, signals, parameter, tolerance):
    truth = applied(text)[0]
    gap = _gap(text, **signals)
    first = gap.causes[0]
    alike = [(each.effect, each.target) for each in _alike(first)]
    assert (truth.effect.name, truth.target) in [(first.effect, first.target), *alike]
    assert len(gap.named_causes) == 1
    assert first.probability > 0.5
    assert gap.verdict == "explained"
    assert gap.gap.held_out
    assert gap.gap.shrink > 0.9
    if first.effect == truth.effect.name:
        value = first.parameters[parameter]
        assert value.value == pytest.approx(truth.values[parameter], rel=tolerance)
        assert value.low <= value.value <= value.high


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_normal_mismatch_is_no_gap(seed):
    signals = [SERVO, GEAR, FORCE, {}][seed]
    gap = _gap(seed=200 + seed, **signals)
    assert gap.verdict == "no_gap"
    assert gap.causes == ()


@pytest.mark.slow
def test_runs_of_different_programs_are_compared_with_their_own_predictions(tmp_path):
    other = PROGRAM.replace("X140 Y40", "X100 Y30").replace("G1 X60 Y60", "G1 X50 Y50")
    prediction(other).save(tmp_path / "other")
    one = runs([], 1, 1)[0]
    two = runs([], 1, 1, base=prediction(other, TRUE_STEP_S))[0]
    two = replace(two, name="run-2", folder=tmp_path, head=RunHead(prediction="other"))
    assert diagnose(prediction(), [one, two]).verdict == "no_gap"


@pytest.mark.slow
def test_an_effect_that_the_library_lacks_is_not_blamed_on_another():
    def bump(name, values, stamps, signals, number):
        if name != "q_act_rad":
            return values
        shape = np.zeros_like(values)
        shape[:, 3] = 2e-4 * np.sin(2.0 * np.pi * 0.7 * stamps) ** 5  # nothing that servos do
        return values + shape

    gap = diagnose(prediction(), runs([], 2, 3, extra=bump, **SERVO))
    assert gap.verdict == "unexplained"
    assert not gap.named_causes
    assert gap.where.joints[0].joint == "A4"
    assert gap.unexplained.significant


@pytest.mark.slow
def test_two_effects_are_both_named():
    gap = _gap("friction:target=A1,spike_deg=0.008,decay_s=0.15", "servo_lag:target=A4,tau_s=0.01", **SERVO)
    found = {(each.effect, each.target) for each in gap.named_causes}
    assert found == {("friction", "A1"), ("servo_lag", "A4")}


@pytest.mark.slow
def test_commands_with_a_clock_of_their_own_are_named_once():
    """They differ from the plan and from the drives; the table's own clock and the tracker's are right."""
    gap = _gap("clock:target=q_cmd,offset_s=0.012", force=False)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("clock", "q_cmd")]
    assert gap.named_causes[0].parameters["offset_s"].value == pytest.approx(0.012, abs=5e-4)
    assert gap.verdict == "explained"


@pytest.mark.slow
def test_what_the_data_do_not_see_is_not_said_to_be_known():
    gap = _gap("tool_frame:x_mm=0.3,y_mm=-0.2,c_deg=0.02", **TIP)
    alike = {each.effect for cause in gap.causes for each in _alike(cause)}
    assert {"tool_frame", "base_frame"} & ({gap.causes[0].effect} | alike)
    angle = gap.causes[0].parameters.get("c_deg")
    if gap.causes[0].effect == "tool_frame":  # the tracker sees the tip, which a turn about it leaves
        assert angle.low < -0.1
        assert angle.high > 0.1


@pytest.mark.slow
def test_what_rings_is_told_from_noise():
    gap = _gap("vibration:hz=13,damping=0.02,participation=0.6,direction=0.6/0.5/-0.62", **TIP)
    cause = gap.causes[0]
    assert (cause.effect, gap.verdict) == ("vibration", "explained")
    assert cause.parameters["hz"].value == pytest.approx(13.0, rel=0.005)
    found = np.array([cause.parameters[f"direction_{axis}"].value for axis in "xyz"])
    wanted = np.array([0.6, 0.5, -0.62]) / np.linalg.norm([0.6, 0.5, -0.62])
    assert abs(found @ wanted) > 0.995  # a line, not an arrow
    assert gap.gap.noise_floor < 1.3 * 0.02 * np.sqrt(3.0)


@pytest.mark.slow
def test_the_place_of_a_spike_is_after_the_reversals_of_its_joint():
    gap = _gap("friction:target=A2,spike_deg=0.01,decay_s=0.15", **SERVO)
    assert gap.where.phases[0].phase in ("reversal", "corner")
    assert gap.where.joints[0].joint == "A2"
    assert {each.what for each in gap.where.intervals} & {"reversal of A2"}
    for each in gap.where.intervals:
        assert each.t_end_s - each.t_start_s < 1.0


@pytest.mark.slow
def test_a_held_out_run_is_reported_on_and_not_used():
    some = runs(applied("servo_lag:target=A3,tau_s=0.012"), 3, 6, **SERVO)
    gap = diagnose(prediction(), some[:2], some[2:])
    assert gap.gap.held_out
    assert gap.gap.shrink > 0.95
    other = runs([], 1, 7, **SERVO)  # held out and without the effect: it must not shrink there
    unsupported = diagnose(prediction(), some[:2], other)
    assert unsupported.named_causes == ()
    assert not unsupported.gap.shrink


@pytest.mark.slow
def test_a_single_run_is_split_with_guard_gaps():
    gap = _gap("servo_lag:target=A3,tau_s=0.012", count=1, **SERVO)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("servo_lag", "A3")]
    assert gap.gap.held_out


@pytest.mark.slow
def test_the_json_has_plain_values():
    found = json.loads(
        json.dumps(_gap("servo_lag:target=A3,tau_s=0.012", **SERVO).as_dict(), allow_nan=False)
    )
    assert found["schema"] == SCHEMA
    assert {each["link"] for each in found["not_examined"]} == {"gear", "force", "mechanics", "part"}


@pytest.mark.slow
def test_the_report_begins_with_a_sentence():
    text = text_report(_gap("backlash:target=A2,gap_deg=0.01", **GEAR))
    assert text.splitlines()[0].endswith(".")
    assert "backlash of A2" in text.splitlines()[0]
    assert "not examined" in text


@pytest.mark.slow
def test_every_cause_of_the_library_has_a_link():
    assert all(effect.links for effect in LIBRARY.values() if effect.kind == "cause")


@pytest.mark.slow
def test_a_collision_is_told_with_moment_line_and_force_and_what_it_left_behind():
    """A blow of 1.1 kN in the second run, by which A2 slips by 0.0225 deg."""

    def blow_N(time_s):
        since = (time_s - 8.0) / 0.05
        pulse = np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)
        return 1100.0 * pulse[:, None] * np.array([0.6, 0.0, 0.8])

    def struck(name, values, stamps, signals, number):
        if number != 1 or name not in ("force_N", "position_mm"):
            return values
        if name == "force_N":
            return values + blow_N(stamps)
        return bent(values, stamps, signals, blow_N(signals.time_s))

    slipped = applied("step:target=A2,at_s=1808.025,size_deg=0.0225")
    gap = diagnose(prediction(), runs(slipped, extra=struck, load_encoders=True))
    (event,) = [each for each in gap.events if each.link == "force"]
    assert (event.what, event.run) == ("impulse", "run-2")
    assert event.t_s == pytest.approx(8.025, abs=0.02)
    assert event.size == pytest.approx(1100.0, rel=0.05)
    hit = f"The tool hit something at {event.t_s:.2f} s of run-2, line {event.line}: 1.1 kN"
    assert text_report(gap).startswith(hit)
    # the runs do not say when they began, so that the step of run-2 is nobody's in particular
    step = gap.unexplained.depends_on[0]
    assert (step.form, step.at, step.run, step.line) == ("step", "A2", "run-2", event.line)
    assert step.size == pytest.approx(0.0225, rel=0.05)


# Logs alone, without a prediction


@pytest.mark.slow
def test_a_lag_is_found_from_the_log_alone():
    gap = diagnose_log(runs(applied("servo_lag:target=A3,tau_s=0.012"), 2, 5, **SERVO))
    assert [(each.effect, each.target) for each in gap.named_causes] == [("servo_lag", "A3")]
    missing = {each.link for each in gap.not_examined}
    assert {"timing", "path", "force", "mechanics"} <= missing


@pytest.mark.slow
def test_backlash_is_found_between_the_encoders():
    some = runs(applied("backlash:target=A2,gap_deg=0.01"), 2, 5, load_encoders=True, **SERVO)
    gap = diagnose_log(some)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("backlash", "A2")]


@pytest.mark.slow
def test_a_known_robot_adds_the_mechanics():
    some = runs(applied("mastering:target=A2,offset_deg=0.05"), 2, 5, force=False)
    gap = diagnose_log(some, prediction().cell)
    assert "mechanics" in {each.link for each in gap.links}


@pytest.mark.slow
def test_relative_angles_have_no_kinematics():
    some = [
        replace(run, head=RunHead(angles="relative"))
        for run in runs([], 2, 5, load_encoders=True, force=False)
    ]
    gap = diagnose_log(some, prediction().cell)
    assert gap.verdict == "no_gap"
    assert "mechanics" in {each.link for each in gap.not_examined}


# What one link has named is part of the model of the links behind it, and is not named there again


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "signals"),
    [
        # the load encoders saw a transmission error of the same size and the other sign
        ("encoder_interpolation:target=A5,amplitude_deg=0.004,periods=2,phase=3", {"force": False}),
        # the tip moved by what the pull bent, as if an axis were not parallel
        ("cable_pull:target=A3,N_per_deg=3,direction=-0.4/0.9/0", {}),
    ],
)
def test_a_cause_that_shows_in_two_links_is_named_once(text, signals):
    effect, target = text.split(":")[0], text.split("target=")[1].split(",")[0]
    gap = diagnose(prediction(), runs(applied(text), 2, 5, load_encoders=True, **signals))
    assert [(each.effect, each.target) for each in gap.named_causes] == [(effect, target)]
    assert gap.verdict == "explained"
    assert all(link.verdict in ("explained", "no_gap") for link in gap.links)


# A diagnosis finds a step: in which run, when, where and how large

BEGIN = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)


def dated(*texts, **more):
    """Return three runs, half an hour apart as they are made."""
    made = runs(applied(*texts), 3, seed=11, **more)
    heads = [
        run.head.model_copy(update={"started": BEGIN + timedelta(hours=0.5 * n)})
        for n, run in enumerate(made)
    ]
    return [replace(run, head=head) for run, head in zip(made, heads, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "target", "at_s", "size", "value"),
    [
        pytest.param(
            "step:target=tip,at_s=1806,size_mm=0.15,direction=0/0/1",
            "tip",
            1806.0,
            "size_mm",
            0.15,
        ),
        ("step:target=A2,at_s=7.5,size_deg=0.01", "A2", 7.5, "size_deg", 0.01),
    ],
)
def test_a_step_is_named_with_its_moment(text, target, at_s, size, value):
    found = diagnose(prediction(), dated(text, load_encoders=target != "tip")).as_dict()
    (cause,) = found["causes"]
    assert (cause["effect"], cause["target"]) == ("step", target)
    numbers = cause["parameters"]
    assert numbers["at_s"]["value"] == pytest.approx(at_s, abs=0.05)
    assert numbers["at_s"]["high"] - numbers["at_s"]["low"] < 0.5
    assert numbers[size]["value"] == pytest.approx(value, rel=0.05)


# A force that bends the arm is there; one that the sensor alone shows is the sensor's, noise or error

WANDER_N = 30.0


def wander(time_s, number):
    """Return a slow force (n, 3) in the cut, which forgets within a second, another one in each run."""
    generator = np.random.default_rng(50 + number)
    hats_s = np.arange(0.0, time_s[-1] + 1.0, 0.5)
    values = WANDER_N * generator.standard_normal((len(hats_s), 3))
    return np.stack([np.interp(time_s, hats_s, column) for column in values.T], axis=1)


def added(*, bends):
    """Return what is added to the tables of a run: the force shows the wander, the tip where it bends."""

    def extra(name, values, stamps, signals, number):
        if name == "force_N":
            return values + wander(stamps, number)
        if name != "position_mm" or not bends:
            return values
        return bent(values, stamps, signals, wander(signals.time_s, number))

    return extra


@pytest.fixture(scope="module", params=[True, False], ids=["a force", "the sensor"])
def case(request):
    gains = []
    with pytest.MonkeyPatch.context() as patch:
        followed = diagnosis._followed

        def kept(*given):
            gains.append(followed(*given))
            return gains[-1]

        patch.setattr(diagnosis, "_followed", kept)
        gap = diagnose(prediction(), runs([], extra=added(bends=request.param)))
    return request.param, gap, gains


def link(gap, name):
    return next(each for each in gap.links if each.link == name)


@pytest.mark.slow
def test_the_tip_does_what_a_force_says_and_nothing_of_what_its_sensor_says(case):
    bends, _, gains = case
    assert gains, "the slow part of the noise was not asked about"
    gain, nats, _ = max(gains, key=lambda each: each[1])
    assert gain == pytest.approx(1.0, abs=0.3) if bends else abs(gain) < 0.3
    assert (nats > 100.0) == bends


@pytest.mark.slow
def test_slow_noise_that_bends_the_arm_is_no_noise(case):
    bends, gap, _ = case
    assert (link(gap, "force").floor < WANDER_N) == bends
    assert link(gap, "force").verdict == "unexplained"


@pytest.mark.slow
def test_the_tip_is_not_told_of_what_is_the_forces_or_the_sensors(case):
    """The measured load explains the tip where it is a force, and is not taken where it is the sensor's."""
    _, gap, _ = case
    tip = link(gap, "mechanics")
    assert tip.rms_before == pytest.approx(tip.floor, rel=0.05)
