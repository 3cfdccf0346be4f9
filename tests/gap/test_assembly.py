"""The answer of several links: verdict, size, links and notes, from judgements that are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.effects import Dependence, inputs_of
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue
from gcode2krl.gap.answer import assembly
from gcode2krl.gap.answer.evidence import Depends
from gcode2krl.gap.answer.result import DependsOnResult, Unexplained
from gcode2krl.gap.compare.links import FORCE, GEAR, MECHANICS, PATH, SERVO
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import Slip
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.examination import Size
from gcode2krl.gap.posterior.judgement import Cause, Judgement
from gcode2krl.runs import Run, RunHead
from tests.gap.synthetic import LIBRARY, applied, prediction

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")


def _size(before=4.0, after=1.0, excess_before=3.0):
    return Size(
        rows=100,
        before=before,
        after=after,
        floor=0.25,
        noise=0.25,
        excess=0.0,
        excess_before=excess_before,
        deviation=1.0,
        largest_before=5.0,
        largest_after=2.0,
    )


def _trace(link, factor=10.0, components=JOINTS, zero=0.0, left_out=()):
    return SimpleNamespace(
        run="run-1",
        left_out=left_out,
        events=(),
        still=False,
        declared_sigma=None,
        shape=(4, len(components)),
        link=link,
        signal=link.signal,
        unit=link.unit,
        factor=factor,
        components=components,
        measured=np.full((4, len(components)), zero) + np.array([[0.1], [-0.1], [0.1], [-0.1]]),
    )


def _judgement(link, verdict="no_gap", size=None, usual=(), **trace):
    size = size or _size()
    traces = (_trace(link, **trace),)
    return Judgement(
        link=link,
        verdict=verdict,
        causes=(),
        size=size,
        held_out=True,
        factor=traces[0].factor,
        traces=traces,
        examination=SimpleNamespace(noise=[white(1e-4)] * traces[0].shape[1]),
        usual=tuple(usual),
    )


def _slip(link=PATH, final=False):
    return Slip(applied("override:percent=50")[0], link, 2.0, 0.1, "deg", "shown", final)


@pytest.mark.parametrize(
    ("verdicts", "slips", "wanted"),
    [
        ([], 0, "no_gap"),
        (["no_gap", "no_gap"], 0, "no_gap"),
        (["no_gap"], 1, "explained"),
        (["no_gap", "explained"], 0, "explained"),
        (["explained", "explained"], 1, "explained"),
        (["unexplained"], 0, "unexplained"),
        (["unexplained"], 1, "partly_explained"),
        (["explained", "unexplained"], 0, "partly_explained"),
        (["partly_explained"], 0, "partly_explained"),
    ],
)
def test_the_verdict_of_all_links(verdicts, slips, wanted):
    judgements = [_judgement(SERVO, verdict) for verdict in verdicts]
    assert assembly._verdict(judgements, [_slip()] * slips) == wanted


def test_the_largest_gap_is_that_over_its_noise_and_links_with_one_come_first():
    small, large = (
        _judgement(SERVO, "explained", _size(excess_before=1.0)),
        _judgement(FORCE, "no_gap", _size()),
    )
    assert max([large, small], key=assembly._weight) is small
    larger = _judgement(GEAR, "unexplained", _size(excess_before=2.0))
    assert max([small, large, larger], key=assembly._weight) is larger


def test_sizes_are_in_the_unit_of_the_report():
    size = assembly._size(_judgement(GEAR, "unexplained"), [], {})
    assert (size.signal, size.unit) == (GEAR.signal, "deg")
    assert (size.rms_before, size.rms_after, size.noise_floor) == (20.0, 10.0, 5.0)
    assert (size.max_before, size.max_after, size.held_out) == (50.0, 20.0, True)
    assert size.shrink is None  # no cause, so nothing shrinks


def test_a_slip_states_the_size_where_links_have_no_gap():
    size = assembly._size(_judgement(GEAR), [_slip()], {})
    assert (size.signal, size.rms_before, size.rms_after) == (PATH.signal, 2.0, 0.1)
    nothing = assembly._size(None, [], {})
    assert (nothing.signal, nothing.unit, nothing.rms_before) == ("tcp", "mm", None)


def test_links_come_in_the_order_of_the_chain_with_zeros_of_encoders():
    judgements = [_judgement(FORCE, "explained"), _judgement(GEAR, zero=0.5), _judgement(SERVO, "explained")]
    links = list(assembly._links(judgements, [_slip(GEAR)]))
    assert [(link.link, link.verdict) for link in links] == [
        ("servo", "explained"),
        ("gear", "explained"),
        ("force", "explained"),
    ]
    assert links[1].offset_deg == pytest.approx(dict.fromkeys(JOINTS, 5.0))
    assert links[0].offset_deg is None
    assert [link.verdict for link in assembly._links([_judgement(GEAR)], [])] == ["no_gap"]


def test_links_without_data_say_what_they_need():
    needs = {each.link: each.needs for each in assembly._not_examined([_judgement(PATH)], [])}
    assert set(needs) == {"servo", "gear", "force", "mechanics", "part"}
    assert "force.csv" in needs["force"]
    final = {each.needs for each in assembly._not_examined([], [_slip(final=True)])}
    assert final == {"a run that belongs to the prediction"}


def test_what_is_left_is_structured_where_it_is_significant():
    rest = assembly._unexplained(_judgement(GEAR, "unexplained"))
    assert (rest.rms, rest.significant, rest.structure) == (10.0, False, "white")
    assert assembly._unexplained(None).structure == "unknown"


def test_notes_name_joints_left_out_and_effects_within_mismatch():
    (usual,) = applied("backlash:target=A2,gap_deg=0.0001")
    judgements = [_judgement(SERVO, components=JOINTS[:4]), _judgement(MECHANICS, usual=[usual])]
    assert [note for note in assembly._notes([], judgements) if "noise" not in note] == [
        "servo: A5, A6 left out: not recorded, or never moving",
        "mechanics: backlash A2 within normal mismatch",
    ]


def test_notes_name_what_was_taken_out_of_the_measured_values():
    judgement = _judgement(FORCE, left_out=("hum of the mains at 50 Hz",))
    assert list(assembly._notes([], [judgement])) == [
        "force, run-1: hum of the mains at 50 Hz left out",
        "force: the noise is neither stated nor repeated; taken as 0.001 N",
    ]


def test_a_run_that_is_of_another_program_gets_an_answer_without_links(tmp_path):
    issue = Issue("warning", "run-clock", 3, "late", "set it")
    run = Run("run-1", tmp_path, RunHead(angles="relative"), issues=(issue,))
    context = Context((Pair(run=run, number=0, inputs=inputs_of(prediction())),), 1, LIBRARY, Mismatch())
    gap = assembly.answer(context, [_slip(final=True)], [issue])
    assert (gap.verdict, gap.links, gap.named, gap.runs) == ("explained", (), (), ("run-1",))
    assert [cause.words for cause in gap.named_causes] == ["shown"]
    assert [each.message for each in gap.issues] == ["late", "run-1: late"]
    assert gap.notes == ("angles are relative: no kinematics, no limits, no gravity",)
    assert len(gap.not_examined) == 7
    assert [one.effect.name for one in assembly.answer(context, [_slip()], []).named] == ["override"]


def test_the_picture_shows_the_named_cause_else_what_is_left_depends_on():
    (play,) = applied("backlash:target=A2,gap_deg=0.02")
    cause = Cause(play, "gear", 0.9, {}, 0.9, 0.1)
    left = DependsOnResult(link="gear", at="A3", on="own torque", form="loop", probability=0.9, share=0.8)
    nothing = Unexplained(rms=1.0, significant=True, structure="structured")
    unnamed = _judgement(GEAR, "unexplained")
    named = replace(unnamed, causes=(cause,))
    assert assembly._depends(named, nothing) == Depends("A2", frozenset({Dependence.REVERSALS}))
    assert assembly._depends(unnamed, nothing) is None
    found = assembly._depends(unnamed, replace(nothing, depends_on=(left,)))
    assert found == Depends("A3", frozenset({Dependence.OWN_TORQUE}))
    other = replace(left, link="force", at="fx")
    assert assembly._depends(unnamed, replace(nothing, depends_on=(other,))) is None
