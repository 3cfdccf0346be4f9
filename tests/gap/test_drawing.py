"""Pictures and the page: what is drawn, from numbers that are known."""

import json
from dataclasses import replace
from functools import cache

import lxml.html
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.answer.drawing import (
    draw_dependence,
    draw_path,
    draw_time,
    has_causes,
    largest_size,
    page,
    picture_bytes,
    points,
    rows_of,
    run_figure,
    scale_colours,
    strip,
    views,
    views_of,
    write_page,
    write_pictures,
)
from gcode2krl.gap.answer.evidence import Against
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
from tests.gap.answered import (
    BACKLASH,
    GAP,
    LAG,
    STEP,
    STRETCH,
    TIME_S,
    UNEXPLAINED,
    UNSURE,
    evidence,
    run_evidence,
)

# The pictures: what is drawn, from numbers that are known

DRAWN = replace(GAP, evidence=evidence(), where=Where(intervals=(STRETCH,)))
PNG = b"\x89PNG\r\n\x1a\n"


def axes():
    return Figure().add_subplot()


def lines_of(drawn):
    """Return the lines that have a name in the legend."""
    return {line.get_label(): line for line in drawn.lines if not line.get_label().startswith("_")}


def test_over_time_before_after_noise_stretches_and_lines_are_drawn():
    drawn = axes()
    draw_time(drawn, evidence(), run_evidence(), (STRETCH, replace(STRETCH, run="run-2", t_start_s=7.0)))
    lines = lines_of(drawn)
    assert set(lines) == {"before", "with the causes"}
    time_s, values = lines["before"].get_data()
    inside = (time_s > 2.1) & (time_s < 3.9)
    np.testing.assert_allclose(values[inside], 0.3)
    np.testing.assert_allclose(values[(time_s < 1.9) | (time_s > 4.1)], 0.0, atol=1e-12)
    spans = {patch.get_label(): patch.get_window_extent() for patch in drawn.patches}
    assert set(spans) == {"larger than the noise", "noise, ±1 σ"}  # that of run-2 is not in it
    (top,) = drawn.child_axes
    assert top.get_xlabel() == "G-code line"
    assert [text.get_text() for text in top.get_xticklabels()][:3] == ["1", "2", "3"]


def test_without_a_named_cause_there_is_no_line_after_and_without_lines_no_second_axis():
    run = run_evidence(after=run_evidence().before, line=np.zeros(1000, dtype=np.int64))
    assert not has_causes(run)
    drawn = axes()
    draw_time(drawn, evidence(), run)
    assert set(lines_of(drawn)) == {"before"}
    assert drawn.child_axes == []


def test_a_line_is_not_drawn_across_a_gap_of_the_record():
    keep = (TIME_S < 5.0) | (TIME_S > 6.0)
    names = ("time_s", "line", "before", "after", "size_before", "size_after")
    run = run_evidence(**{name: getattr(run_evidence(), name)[keep] for name in names})
    drawn = axes()
    draw_time(drawn, evidence(), run)
    _, values = lines_of(drawn)["before"].get_data()
    assert np.count_nonzero(np.isnan(values)) == 1


def test_the_path_is_coloured_by_the_size_and_the_worst_is_marked():
    drawn = axes()
    draw_path(drawn, evidence(), run_evidence(), (0, 1))
    (lines,) = [each for each in drawn.collections if isinstance(each, LineCollection)]
    sizes = lines.get_array()
    assert set(np.unique(sizes)) == {0.0, 0.3}
    # 2 s to 4 s of an ellipse in 10 s: a point there is at angles of 72 to 144 degrees
    worst = np.concatenate([s for s, size in zip(lines.get_segments(), sizes, strict=True) if size > 0.0])
    angle = np.degrees(np.arctan2(worst[:, 1] / 50.0, worst[:, 0] / 100.0))
    assert angle.min() == pytest.approx(72.0, abs=0.5)
    assert angle.max() == pytest.approx(144.0, abs=0.5)
    x, y = drawn.lines[0].get_data()
    assert np.degrees(np.arctan2(y[0] / 50.0, x[0] / 100.0)) == pytest.approx(72.0, abs=0.5)


def test_views_from_above_and_from_the_longer_side():
    run = run_evidence()
    assert views_of(run) == [(0, 1), (0, 2)]
    assert views_of(replace(run, position_mm=run.position_mm[:, [1, 0, 2]])) == [(0, 1), (1, 2)]
    assert views_of(replace(run, position_mm=run.position_mm * [1.0, 1.0, 0.0])) == [(0, 1)]
    drawn = axes()
    draw_path(drawn, evidence(), replace(run, position_mm=None), (0, 1))
    assert "the robot is not known" in drawn.texts[0].get_text()


def test_the_dependence_is_drawn_against_its_input_both_ways_apart():
    drawn = axes()
    draw_dependence(drawn, evidence(), run_evidence())
    assert drawn.get_xlabel() == "speed of A2 (deg/s)"
    assert set(lines_of(drawn)) == {"before", "with the causes"}
    turning = Against("time since A2 reversed (s)", TIME_S, np.where(TIME_S < 5.0, 1.0, -1.0))
    drawn = axes()
    draw_dependence(drawn, evidence(), run_evidence(against=turning))
    lines = lines_of(drawn)
    assert lines["before, joint moving up"].get_xdata().max() < 5.0
    assert lines["before, moving down"].get_xdata().min() >= 5.0
    nothing = axes()
    draw_dependence(nothing, evidence(), run_evidence(against=None))
    assert "no input is known" in nothing.texts[0].get_text()


def test_of_an_input_that_changes_from_run_to_run_the_other_runs_are_shown_too():
    first = run_evidence(against=Against("time (h)", 0.0 * TIME_S, across_runs=True))
    second = run_evidence("run-2", against=Against("time (h)", 0.0 * TIME_S + 1.0, across_runs=True))
    drawn = axes()
    draw_dependence(drawn, evidence(first, second), first)
    assert set(lines_of(drawn)["other runs, before"].get_xdata()) == {1.0}


def test_the_colour_scale_is_that_of_all_runs():
    louder = run_evidence("run-2", size_before=np.full(1000, 2.0))
    assert largest_size(evidence(run_evidence(), louder)) == 2.0


def test_a_picture_a_run_is_written(tmp_path):
    odd = evidence(run_evidence(), run_evidence("run 2/b"))
    files = write_pictures(replace(DRAWN, evidence=odd), tmp_path / "pictures")
    assert [file.name for file in files] == ["gap_run-1.png", "gap_run_2_b.png"]
    assert all(file.read_bytes().startswith(PNG) and file.stat().st_size > 20_000 for file in files)
    assert write_pictures(replace(GAP, evidence=None), tmp_path / "none") == []


def test_pictures_that_cannot_be_written_are_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotUnderstoodError):
        write_pictures(DRAWN, tmp_path / "file")
    with pytest.raises(NotUnderstoodError):
        write_pictures(DRAWN, tmp_path / "no" / "folder")


def test_the_whole_figure_has_its_panels_and_is_a_png():
    figure = run_figure(DRAWN, DRAWN.evidence.runs[0])
    assert len([each for each in figure.axes if each.get_xlabel()]) == 4
    assert picture_bytes(figure).startswith(PNG)
    alone = run_figure(DRAWN, run_evidence(position_mm=None, against=None))
    assert len([each for each in alone.axes if each.get_xlabel()]) == 1
    with pytest.raises(ValueError, match="nothing to draw"):
        run_figure(GAP, run_evidence())


# The path and the residual as SVG, with the points of the slider


def coordinates(data):
    """Return the points (n, 2) of path data ``M0 0L1 1``."""
    return np.array([[float(value) for value in point.split()] for point in data[1:].split("L")])


def test_the_path_is_whole_and_its_worst_part_is_drawn_last():
    above, side = views(evidence(), run_evidence())
    assert (above.title, side.title) == ("from above", "from the side, Z drawn 2 times as high")
    drawn = np.concatenate([coordinates(data) for _, data in above.lines])
    assert [drawn[:, 0].min(), drawn[:, 0].max()] == pytest.approx([-100.0, 100.0], abs=0.2)
    colours = [colour for colour, _ in above.lines]
    assert colours[0] == scale_colours()[0]
    assert colours[-1] == scale_colours()[-1]
    worst = coordinates(above.lines[-1][1])
    angle = np.degrees(np.arctan2(-worst[:, 1] / 50.0, worst[:, 0] / 100.0))  # y downwards
    assert [angle.min(), angle.max()] == pytest.approx([72.0, 144.0], abs=1.0)
    left, top, width, height = map(float, above.box.split())
    assert left < -100.0 < 100.0 < left + width
    assert top < -50.0 < 50.0 < top + height


def test_without_a_path_there_is_no_view_and_no_place_of_a_mark():
    run = run_evidence(position_mm=None)
    assert views(evidence(), run) == []
    assert points(run)["at"] == []


def test_the_residual_over_time_in_its_box():
    drawn = strip(evidence(), run_evidence(), (STRETCH, replace(STRETCH, run="run-2")))
    assert (drawn.top, drawn.bottom) == pytest.approx((0.3, -0.03))
    assert (drawn.first_s, drawn.last_s) == pytest.approx((0.0, 9.99))
    assert drawn.stretches == (pytest.approx((200.2, 200.2), abs=0.1),)
    before, after = coordinates(drawn.before), coordinates(drawn.after)
    inside = (before[:, 0] > 215.0) & (before[:, 0] < 385.0)
    np.testing.assert_allclose(before[inside, 1], 0.0, atol=0.1)
    np.testing.assert_allclose(after[:, 1], 200.0 * 0.3 / 0.33, atol=0.1)
    assert drawn.noise == pytest.approx((200.0 * 0.27 / 0.33, 200.0 * 0.06 / 0.33), abs=0.1)
    assert strip(evidence(), run_evidence(after=run_evidence().before), ()).after is None


def test_the_slider_has_time_line_size_and_the_same_points_as_the_path():
    run = run_evidence()
    found, rows = points(run), rows_of(run)
    assert len(rows) == 500 <= 900
    assert found["t"] == pytest.approx(run.time_s[rows])
    assert found["line"] == run.line[rows].tolist()
    assert found["before"] == pytest.approx(run.size_before[rows])
    above = np.array(found["at"][0])
    np.testing.assert_allclose(above[:, 0], run.position_mm[rows, 0], atol=0.01)
    np.testing.assert_allclose(above[:, 1], -run.position_mm[rows, 1], atol=0.01)


# The page: one file that needs no network, with everything that the answer says

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
