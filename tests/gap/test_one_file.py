"""The page: one file that needs no network, with everything that the answer says."""

import json
from dataclasses import replace
from functools import cache

import lxml.html
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.answer.drawing import page, write_page
from gcode2krl.gap.answer.result import (
    Course,
    EffectAt,
    EventResult,
    Expectation,
    NextRun,
    RivalResult,
    RunSize,
    Separates,
    Where,
)
from gcode2krl.gap.answer.words import headline
from gcode2krl.gap.posterior.cause_tests import Constancy
from tests.gap.answered import BACKLASH, GAP, LAG, STEP, STRETCH, UNEXPLAINED, UNSURE, evidence, run_evidence

WHERE = Where(intervals=(STRETCH, replace(STRETCH, share=0.1)))
RICH = replace(
    GAP,
    causes=(
        replace(
            BACKLASH,
            indistinguishable_from=(EffectAt("hysteresis", "A2"),),
            rivals=(RivalResult("friction", "A2", 0.04), RivalResult("thermal", None, 0.001)),
            family="A2, reversals",
            form_fits=0.7,
            constant=Constancy(inconstancy=0.4, p=0.01),
        ),
        UNSURE,
    ),
    where=WHERE,
    evidence=evidence(),
    notes=("angles are relative",),
    next_run=NextRun(
        program="reversals",
        minutes=4.0,
        separates=(Separates(first="backlash A2", second="hysteresis A2", odds=30.0),),
        expect=(Expectation(answer="backlash A2", shows="the same at any force"),),
    ),
)
NO_GAP = replace(
    GAP,
    verdict="no_gap",
    causes=(),
    at_part=None,
    evidence=evidence(run_evidence(after=run_evidence().before)),
)
SLIP = replace(
    GAP,
    causes=(replace(LAG, effect="other_program", target=None, words="run-1 is of <another> program"),),
    gap=replace(GAP.gap, rms_after=None, shrink=None, noise_floor=None),
    links=(),
    unexplained=replace(GAP.unexplained, rms=None),
    at_part=None,
)
LOG_ALONE = replace(
    UNEXPLAINED,
    evidence=evidence(run_evidence(position_mm=None, against=None, line=run_evidence().line * 0)),
)
ANSWERS = {"rich": RICH, "no gap": NO_GAP, "slip": SLIP, "unexplained": UNEXPLAINED, "log alone": LOG_ALONE}


@cache
def made(name):
    """Return the page of an answer: its pictures take seconds."""
    return page(ANSWERS[name])


def parsed(gap):
    names = [name for name, answer in ANSWERS.items() if answer is gap]
    return lxml.html.document_fromstring(made(*names) if names else page(gap))


def words(tree, section):
    """Return the text of a section, spaces made one."""
    return " ".join(" ".join(tree.get_element_by_id(section).itertext()).split())


@pytest.mark.parametrize("name", ANSWERS)
def test_every_answer_has_its_sentence_and_its_parts_and_needs_no_network(name):
    gap, text = ANSWERS[name], made(name)
    tree = lxml.html.document_fromstring(text)
    assert " ".join(tree.find(".//h1").text_content().split()) == headline(gap)
    assert [each.get("id") for each in tree.iter("section")] == ["where", "why", "left", "next"]
    for element in tree.iter():
        for name in ("src", "href", "srcset", "action"):
            assert element.get(name, "data:").startswith("data:"), f"{element.tag} loads {element.get(name)}"
    assert "http" not in text
    assert "@import" not in text
    assert "url(" not in text
    points = json.loads(tree.get_element_by_id("points").text)
    assert len(points) == len(gap.evidence.runs if gap.evidence else ())
    assert len(tree.xpath("//img")) == len(points)
    ids = tree.xpath("//@id")
    assert len(ids) == len(set(ids))


def test_where():
    tree = parsed(RICH)
    text = words(tree, "where")
    assert "The first of 2 stretches holds 85% of the gap; in them it exceeds the noise." in text
    assert "run-1: 2.00-4.00 s, lines 120-131 reversal of A2 0.8 85%" in text
    runs = tree.xpath("//article")
    assert [run.find("h3").text for run in runs] == ["run-1", "run-2"]
    for run in runs:
        assert len(run.xpath(".//div[@class='views']//svg")) == 2
        assert run.xpath(".//input[@type='range']/@max") == ["499"]


def test_why():
    text = words(parsed(RICH), "why")
    assert "backlash of A2, 0.021 deg ± 0.002 probability 0.94; takes 98% of the gap on data not used" in text
    assert (
        "of the kind A2, reversals; its form takes 70% of what its kind takes; its size varies by 40%" in text
    )
    assert "These data cannot tell it from hysteresis of A2." in text
    assert "others in its place: friction of A2 (0.04)" in text
    assert "thermal probability 0.31, not named; would take 98% of the gap" in text
    assert "mechanics 0.412 0.0611 0.0304 mm explained" in text


def test_what_remains_and_the_next_run():
    text = words(parsed(UNEXPLAINED), "left")
    assert "0.412 mm RMS, with a noise floor of 0.0304 mm: more than noise explains." in text
    assert "0.93 tip, a step from 11.2 s of run-1 on" in text
    assert "force: needs force.csv" in text
    following = words(parsed(RICH), "next")
    assert "gcode2krl make-test reversals, 4 minutes" in following
    assert "if backlash A2: the same at any force" in following
    assert words(parsed(GAP), "next") == "Next run None is needed to tell causes apart."


def test_without_a_signal_in_time_or_a_path_the_page_says_so():
    assert "No signal in time shows it" in words(parsed(SLIP), "where")
    assert "Nowhere is the difference larger" in words(parsed(NO_GAP), "where")
    assert "No path: the robot is not known." in words(parsed(LOG_ALONE), "where")


def test_text_of_a_run_cannot_become_markup():
    named = replace(RICH, evidence=evidence(run_evidence("<script>alert(1)</script>")), runs=("<b>",))
    tree = parsed(named)
    assert tree.xpath("//article/h3")[0].text == "<script>alert(1)</script>"
    assert len(tree.xpath("//script")) == 2
    assert "run-1 is of <another> program" in words(parsed(SLIP), "why")


def test_the_file_is_written_whole_or_not_at_all(tmp_path):
    file = tmp_path / "gap.html"
    write_page(UNEXPLAINED, file)
    assert file.read_text(encoding="utf-8") == page(UNEXPLAINED)
    assert [each.name for each in tmp_path.iterdir()] == ["gap.html"]
    with pytest.raises(NotUnderstoodError, match="cannot write"):
        write_page(GAP, tmp_path / "no" / "gap.html")
    with pytest.raises(NotUnderstoodError, match="input"):
        write_page(GAP, file, [file])


def test_runs_events_and_courses_are_on_the_page():
    per_run = tuple(
        RunSize(run=run, rms_before=before, rms_after=0.02, held_out=held)
        for run, before, held in (("run-1", 0.029, False), ("run-2", 0.159, True))
    )
    blow = EventResult(
        link="force", run="run-2", t_s=11.8, line=42, what="impulse", size=1154.0, unit="N", lasts_s=0.04
    )
    course = Course(over="way cut", over_unit="m", unit="mm", points=((0.5, 0.011), (2.5, 0.073)))
    drift = replace(STEP, on="metres cut", form="smooth", at_time_s=None, run=None, course=course)
    rest = replace(UNEXPLAINED.unexplained, depends_on=(drift,))
    gap = replace(UNEXPLAINED.gap, per_run=per_run)
    text = page(replace(UNEXPLAINED, gap=gap, events=(blow,), unexplained=rest))
    for said in ("held out: it only tests", "0.159", "an impulse of", "way cut (m)", "0.073"):
        assert said in text
