"""The whole diagnosis on runs made with the library's effects, noise and normal mismatch."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap import Gap, diagnose, text_report
from gcode2krl.gap.answer.result import SCHEMA, EffectAt
from gcode2krl.runs import RunHead
from tests.gap.synthetic import LIBRARY, PROGRAM, TRUE_STEP_S, applied, bent, prediction, runs

pytestmark = pytest.mark.slow

SERVO = {"tracker": False, "force": False}
GEAR = {**SERVO, "load_encoders": True}
FORCE = {"tracker": False, "controller": False}
TIP = {"force": False}


def _alike(cause):
    """Return the effects of the library in the declared set of a cause."""
    return [each for each in cause.indistinguishable_from if isinstance(each, EffectAt)]


def _gap(*texts: str, seed: int = 5, count: int = 2, **signals: bool) -> Gap:
    return diagnose(prediction(), runs(applied(*texts), count, seed, **signals))


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


@pytest.mark.parametrize("seed", range(4))
def test_normal_mismatch_is_no_gap(seed):
    signals = [SERVO, GEAR, FORCE, {}][seed]
    gap = _gap(seed=200 + seed, **signals)
    assert gap.verdict == "no_gap"
    assert gap.causes == ()


def test_runs_of_different_programs_are_compared_with_their_own_predictions(tmp_path):
    other = PROGRAM.replace("X140 Y40", "X100 Y30").replace("G1 X60 Y60", "G1 X50 Y50")
    prediction(other).save(tmp_path / "other")
    one = runs([], 1, 1)[0]
    two = runs([], 1, 1, base=prediction(other, TRUE_STEP_S))[0]
    two = replace(two, name="run-2", folder=tmp_path, head=RunHead(prediction="other"))
    assert diagnose(prediction(), [one, two]).verdict == "no_gap"


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


def test_two_effects_are_both_named():
    gap = _gap("friction:target=A1,spike_deg=0.008,decay_s=0.15", "servo_lag:target=A4,tau_s=0.01", **SERVO)
    found = {(each.effect, each.target) for each in gap.named_causes}
    assert found == {("friction", "A1"), ("servo_lag", "A4")}


def test_commands_with_a_clock_of_their_own_are_named_once():
    """They differ from the plan and from the drives; the table's own clock and the tracker's are right."""
    gap = _gap("clock:target=q_cmd,offset_s=0.012", force=False)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("clock", "q_cmd")]
    assert gap.named_causes[0].parameters["offset_s"].value == pytest.approx(0.012, abs=5e-4)
    assert gap.verdict == "explained"


def test_what_the_data_do_not_see_is_not_said_to_be_known():
    gap = _gap("tool_frame:x_mm=0.3,y_mm=-0.2,c_deg=0.02", **TIP)
    alike = {each.effect for cause in gap.causes for each in _alike(cause)}
    assert {"tool_frame", "base_frame"} & ({gap.causes[0].effect} | alike)
    angle = gap.causes[0].parameters.get("c_deg")
    if gap.causes[0].effect == "tool_frame":  # the tracker sees the tip, which a turn about it leaves
        assert angle.low < -0.1
        assert angle.high > 0.1


def test_what_rings_is_told_from_noise():
    gap = _gap("vibration:hz=13,damping=0.02,participation=0.6,direction=0.6/0.5/-0.62", **TIP)
    cause = gap.causes[0]
    assert (cause.effect, gap.verdict) == ("vibration", "explained")
    assert cause.parameters["hz"].value == pytest.approx(13.0, rel=0.005)
    found = np.array([cause.parameters[f"direction_{axis}"].value for axis in "xyz"])
    wanted = np.array([0.6, 0.5, -0.62]) / np.linalg.norm([0.6, 0.5, -0.62])
    assert abs(found @ wanted) > 0.995  # a line, not an arrow
    assert gap.gap.noise_floor < 1.3 * 0.02 * np.sqrt(3.0)


def test_the_place_of_a_spike_is_after_the_reversals_of_its_joint():
    gap = _gap("friction:target=A2,spike_deg=0.01,decay_s=0.15", **SERVO)
    assert gap.where.phases[0].phase in ("reversal", "corner")
    assert gap.where.joints[0].joint == "A2"
    assert {each.what for each in gap.where.intervals} & {"reversal of A2"}
    for each in gap.where.intervals:
        assert each.t_end_s - each.t_start_s < 1.0


def test_a_held_out_run_is_reported_on_and_not_used():
    some = runs(applied("servo_lag:target=A3,tau_s=0.012"), 3, 6, **SERVO)
    gap = diagnose(prediction(), some[:2], some[2:])
    assert gap.gap.held_out
    assert gap.gap.shrink > 0.95
    other = runs([], 1, 7, **SERVO)  # held out and without the effect: it must not shrink there
    unsupported = diagnose(prediction(), some[:2], other)
    assert unsupported.named_causes == ()
    assert not unsupported.gap.shrink


def test_a_single_run_is_split_with_guard_gaps():
    gap = _gap("servo_lag:target=A3,tau_s=0.012", count=1, **SERVO)
    assert [(each.effect, each.target) for each in gap.named_causes] == [("servo_lag", "A3")]
    assert gap.gap.held_out


def test_the_json_has_every_key_and_plain_values():
    found = json.loads(
        json.dumps(_gap("servo_lag:target=A3,tau_s=0.012", **SERVO).as_dict(), allow_nan=False)
    )
    assert found["schema"] == SCHEMA
    assert set(found) >= {
        "verdict",
        "gap",
        "links",
        "where",
        "causes",
        "unexplained",
        "not_examined",
        "next_run",
    }
    assert set(found["gap"]) == {
        "signal",
        "unit",
        "rms_before",
        "rms_after",
        "noise_floor",
        "max_before",
        "max_after",
        "shrink",
        "held_out",
        "per_run",
    }
    assert set(found["where"]) == {
        "signals",
        "intervals",
        "direction_base",
        "phases",
        "joints",
        "frequency_hz",
    }
    assert {each["link"] for each in found["not_examined"]} == {"gear", "force", "mechanics", "part"}


def test_the_report_begins_with_a_sentence():
    text = text_report(_gap("backlash:target=A2,gap_deg=0.01", **GEAR))
    assert text.splitlines()[0].endswith(".")
    assert "backlash of A2" in text.splitlines()[0]
    assert "not examined" in text


def test_every_cause_of_the_library_has_a_link():
    assert all(effect.links for effect in LIBRARY.values() if effect.kind == "cause")


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
