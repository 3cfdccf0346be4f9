"""Parts of the judgement: places in time, parameters, dependences; on answers made by hand."""

from importlib import import_module

import pytest

from tests.benchmarks.hand_made import answer, cause, depends, effect

places = import_module("blind.score")
numbers = import_module("blind.score")
dependences = import_module("blind.score")


def said(value, low, high):
    return {"value": value, "low": low, "high": high}


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([(1.0, 3.0)], 1.0),
        ([(2.0, 4.0)], 1.0 / 3.0),
        ([(1.0, 2.0), (2.0, 3.0)], 1.0),
        ([], 0.0),
        ([(5.0, 6.0)], 0.0),
    ],
)
def test_overlap(spans, expected):
    intervals = [{"run": "run-1", "signal": "tcp", "t_start_s": a, "t_end_s": b} for a, b in spans]
    assert places.overlap(effect(), intervals) == pytest.approx(expected)
    other = [each | {"run": "run-2"} for each in intervals]
    assert places.overlap(effect(), other) == 0.0


def test_overlap_by_either_definition():
    wide = effect(above_noise=[{"run": "run-1", "t_start_s": 0.0, "t_end_s": 4.0}])
    told = [{"run": "run-1", "signal": "tcp", "t_start_s": 1.0, "t_end_s": 3.0}]
    assert places.overlap(wide, told, places.OWN) == pytest.approx(1.0)
    assert places.overlap(wide, told, places.NOISE) == pytest.approx(0.5)


def test_the_worst_stretches_are_those_above_all_together():
    def stretch(start, rms):
        return {"run": "run-1", "signal": "tcp", "t_start_s": start, "t_end_s": start + 1.0, "rms": rms}

    told = [stretch(0.0, 3.0), stretch(2.0, 1.0), stretch(4.0, 1.0)]  # together 1.91
    assert places.worst_of(told) == told[:1]
    assert places.worst_of([stretch(0.0, 2.0), stretch(2.0, 2.0)]) == [stretch(0.0, 2.0), stretch(2.0, 2.0)]
    bare = [{key: value for key, value in each.items() if key != "rms"} for each in told]
    assert places.worst_of(bare) == bare
    assert places.worst_of([]) == []
    assert places.overlap(effect(above_noise=[]), told, places.NOISE) is None
    assert places.overlap(effect("base_frame"), told) is None  # acts everywhere


def test_errors_are_shares_of_what_differs_from_nominal():
    found = numbers.numbers(
        effect("stiffness", "A2", parameters={"scale": 0.8}), cause(scale=said(0.75, 0.7, 0.79))
    )
    assert found == (pytest.approx((0.25,)), (False,))


def test_a_vector_is_one_error():
    true = {"x_mm": 3.0, "y_mm": 4.0, "z_mm": 0.0}
    told = {name: said(value + 0.5 * (name == "z_mm"), -9.0, 9.0) for name, value in true.items()}
    assert numbers.numbers(effect("base_frame", None, parameters=true), cause(**told))[0] == pytest.approx(
        (0.1,)
    )


def test_a_line_has_no_way_round_and_a_phase_no_first_turn():
    true = {"direction": [1.0, 0.0, 0.0], "hz": 9.0}
    told = {"direction_x": said(-1.0, -1.1, -0.9), "direction_y": said(0.0, -0.1, 0.1)}
    told |= {"direction_z": said(0.0, -0.1, 0.1)}
    shakes = effect("vibration", None, parameters=true)
    assert numbers.numbers(shakes, cause(**told))[1] == (True, True, True)
    turned = effect(parameters={"phase": 6.2})
    assert numbers.numbers(turned, cause(phase=said(-0.08, -0.2, 0.0)))[1] == (True,)


def told(entry, causes=(), rest=()):
    found = dependences.told(entry, answer(causes, "unexplained", rest=rest))
    return found.place, found.family, found.form


def test_a_dependence_is_compared_level_by_level():
    assert told(effect(), rest=[depends()]) == (True, True, True)
    assert told(effect(), rest=[depends(form="smooth")]) == (True, True, False)
    assert told(effect(), rest=[depends(on="velocity")]) == (True, False, False)
    assert told(effect(), rest=[depends(at="tip")]) == (False, False, False)
    assert told(effect(), rest=[depends(probability=0.4)]) == (False, False, False)


def test_the_most_probable_dependence_counts():
    rest = [depends(at="tip", probability=0.6), depends(probability=0.8)]
    assert told(effect(), rest=rest) == (True, True, True)


def test_a_named_cause_states_its_own_family():
    named = [cause("friction", family="A2, reversals")]
    assert told(effect(), named, [depends(at="tip")]) == (True, True, True)
    assert told(effect(), [cause("friction", family="A3, reversals")]) == (False, False, False)


@pytest.mark.parametrize(
    ("on", "stated"), [("time_step", "time in the run"), ("own_torque_memory", "own torque")]
)
def test_words_of_the_label_and_of_the_answer(on, stated):
    tip = effect(depends={"where": "tip", "joints": [], "on": [on], "form": "step"})
    assert told(tip, rest=[depends("tip", stated, "step")]) == (True, True, True)


def test_a_drift_is_another_form_than_a_step():
    tip = effect(depends={"where": "tip", "joints": [], "on": ["time_step"], "form": "step"})
    assert told(tip, rest=[depends("tip", "time in the run", "drift")]) == (True, True, False)


def test_a_named_step_is_of_time_in_the_run():
    tip = effect(depends={"where": "tip", "joints": [], "on": ["time_step"], "form": "step"})
    assert told(tip, [cause("step", family="tip, step in time")]) == (True, True, True)


def test_what_the_timing_sees_may_be_told_of_the_timing():
    law = {
        "where": "tip",
        "joints": [],
        "on": ["acceleration"],
        "form": "smooth",
        "links": ["timing", "path"],
    }
    assert told(effect(depends=law), rest=[depends("timing", "acceleration", "smooth")]) == (True, True, True)
    assert not told(effect(), rest=[depends("timing")])[0]


def test_every_word_of_the_plant_is_one_of_the_answer():
    from gcode2krl.effects.dependence import Dependence
    from tests.plant.effects.depends import ON, WHERE

    known = {each.value for each in Dependence}
    for on in ON:
        entry = effect(depends={"where": "tip", "joints": [], "on": [on], "form": "smooth"})
        assert dependences.allowed_by(entry).on & known, on
    assert set(WHERE) == {*dependences.PLACES, "joint"}


def test_one_of_the_declared_set_is_right():
    alike = [{"kind": "unknown", "at": "A2", "on": "velocity"}]
    of_set = depends("A3", "velocity", probability=0.3)
    of_set |= {"indistinguishable_from": alike, "set_probability": 0.6}
    label = effect(depends={"where": "joint", "joints": ["A2"], "on": ["velocity"], "form": "smooth"})
    assert told(label, rest=[of_set]) == (True, True, False)
    assert told(label, rest=[of_set | {"set_probability": 0.4}])[1] is False
    assert told(effect(), rest=[of_set]) == (True, False, False)


def test_what_takes_little_of_its_gap_is_an_aside():
    aside = depends("A2", "time in the run", "impulse", probability=0.95, share=0.01)
    assert told(effect(), rest=[aside, depends()]) == (True, True, True)
    assert told(effect(), rest=[aside]) == (True, False, False)


def test_a_label_without_dependences_is_not_scored():
    assert dependences.told(effect(depends=None), answer()) is None
