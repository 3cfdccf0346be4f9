"""The part on the page: it carries what the history says, and a page without a part carries nothing of it."""

import zlib
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell, predict
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import remove
from gcode2krl.errors import Issue
from gcode2krl.report.page import content_of, page, write_page
from gcode2krl.report.part_error import above_on, error_on, scale_end
from gcode2krl.translation.page import part_of
from tests.conftest import ROOT
from tests.report.page.browser import opened_browser, opened_page

FIVE = ROOT / "examples" / "five_axis"
PIECE = ROOT / "examples" / "test_piece.nc"
STOCK_MM = [[0.0, -100.0, -30.0], [300.0, 100.0, 0.0]]
VOLUME = "report.part.volume()"
FINISHED = (
    "(on) => { const box = document.getElementById('show-finished'); if (box.checked !== on) box.click(); }"
)

TWO_FRAMES = "new Promise((then) => requestAnimationFrame(() => requestAnimationFrame(then)))"
"""Then the camera stands where it goes."""
PLACE = """(place) => {
  const { scene } = report, box = scene.canvas.getBoundingClientRect();
  const at = scene.marker.position.clone().fromArray(place).project(scene.camera);
  return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
}"""


@pytest.fixture(scope="module")
def prediction():
    return predict(PIECE, resolve_cell({"based_on": "demonstration", "stock": {"box_mm": STOCK_MM}}))


@pytest.fixture(scope="module")
def history(prediction):
    return part_of(prediction)


@pytest.fixture(scope="module")
def content(prediction, history):
    return content_of(prediction, text=PIECE.read_text(encoding="ascii"), part=history)


def column(packed, described, name, rows):
    """What `data.js` reads."""
    number = [one["name"] for one in described].index(name)
    weights = np.frombuffer(zlib.decompress(b64decode(packed)), np.uint8).reshape(len(described), 4, rows)
    whole = np.cumsum(np.ascontiguousarray(weights[number].T).view("<i4")[:, 0], dtype=np.int32)
    return np.where(whole == -(2**31), np.nan, whole * described[number]["step"])


def test_it_carries_every_event_and_the_error(prediction, history, content):
    head = content.head["part"]
    count = head["events"]["rows"]
    row, cell, height = (
        column(content.part, head["events"]["columns"], name, count) for name in ("row", "cell", "height")
    )
    order = np.lexsort((cell, row))
    wanted = np.lexsort((history.cell, history.sample))
    assert row[order] == pytest.approx(history.sample[wanted])
    assert cell[order] == pytest.approx(history.cell[wanted])
    assert height[order] == pytest.approx(history.height_mm[wanted], abs=0.006)
    error = column(content.part_cells, head["columns"], "error", history.raw_mm.size)
    assert error == pytest.approx(error_on(history, prediction).ravel(), abs=6e-4, nan_ok=True)


def test_a_page_that_would_be_too_large_draws_fewer_samples(prediction, history, content, monkeypatch):
    monkeypatch.setattr("gcode2krl.report.page.content.MOST_DATA", len(content.data) - 1)
    fewer = content_of(prediction, part=history)
    assert fewer.head["all"] == content.head["all"]
    assert fewer.head["rows"] <= content.head["rows"] // 2
    assert len(fewer.data) < 0.8 * len(content.data)
    events = fewer.head["part"]["events"]
    row = column(fewer.part, events["columns"], "row", events["rows"])
    assert row.max() < fewer.head["rows"]


def test_a_page_without_a_cut_carries_no_part(prediction):
    made = page(content_of(replace(prediction, forces=None, deflection=None)))
    assert part_of(replace(prediction, forces=None)) is None
    assert "part-colour" not in made
    assert "class Part " not in made


def test_the_error_of_a_compensated_program_is_not_that_of_its_deflection(prediction, history):
    assert error_on(history, replace(prediction, inputs={"compensate": "offline"})) is None


def test_a_map_keeps_what_is_farthest_off(history):
    off_mm = np.array([[0.1, -0.3, 0.0, 0.0], [0.0, 0.2, 0.0, 0.4]])
    two = history._replace(raw_mm=np.zeros((1, 2)))
    assert above_on(two, off_mm, None).tolist() == [[-0.3, 0.4]]


def test_a_map_of_a_surface_has_what_is_near_its_sites(five):
    _, surface = five
    points_mm, squares = surface.surface()
    site = int(squares[0, 0])
    at_mm = points_mm[site] + np.array([[0.0, 0.0, 0.01], [0.01, 0.0, 0.0]])
    above_mm = above_on(surface, np.array([0.2, -0.5]), at_mm)
    assert above_mm[site] == -0.5
    assert np.count_nonzero(above_mm) == 1


def test_a_scale_ends_at_a_round_number_beyond_nearly_all():
    assert scale_end(np.append(np.linspace(-0.18, 0.18, 1000), 7.0)) == 0.2


@pytest.fixture(scope="module")
def browser():
    with opened_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def window(content, browser, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "part.html"
    write_page(content, file)
    made = opened_page(browser, file)
    yield made
    assert made.said == []


@pytest.mark.browser
def test_its_volume_is_that_of_the_machined_stock(window, prediction):
    left = remove(prediction.toolpath, prediction.motion, prediction.cell, is_checked=False).material
    window.evaluate(FINISHED, True)
    assert window.evaluate(VOLUME) == pytest.approx(left.volume_mm3, rel=0.005)


@pytest.mark.browser
def test_it_follows_the_slider_in_both_directions(window, history):
    window.evaluate(FINISHED, False)
    for row in (3000, 5500, 1200, 0):
        window.evaluate("(row) => report.select(row)", row)
        assert window.evaluate(VOLUME) == pytest.approx(history.volume_mm3(row), rel=1e-4)


@pytest.mark.browser
def test_who_moves_the_slider_sees_part_and_robot_there(window):
    window.evaluate(FINISHED, True)
    assert not window.evaluate("report.robot.root.visible")
    window.locator("#slider").fill("3000")
    assert window.evaluate("report.row") == 3000
    assert window.evaluate("report.robot.root.visible")
    assert not window.locator("#show-finished").is_checked()
    window.locator("#show-robot").uncheck()
    window.locator("#slider").fill("2000")
    assert not window.evaluate("report.robot.root.visible")


@pytest.mark.browser
def test_a_click_says_which_line_left_the_surface(window, prediction):
    """In the middle of the slot of line 26, at Y -50."""
    window.evaluate(FINISHED, True)
    window.evaluate("document.getElementById('look').scrollIntoView()")
    window.locator("[data-view=top]").click()
    window.evaluate(TWO_FRAMES)
    window.mouse.click(*window.evaluate(PLACE, [80.0, -50.0, -8.95]))
    row = window.evaluate("report.row")
    assert prediction.toolpath.source_line[prediction.motion.move[row]] == 26
    assert abs(prediction.motion.position_mm[row, 0] - 80.0) < 9.0
    note = window.locator("#part-note").inner_text()
    assert note.startswith("line 26 · ")
    assert "error -" in note  # the helix pulls the tool down


@pytest.mark.browser
@pytest.mark.parametrize("axis", ["0", "1", "2"])
def test_a_section_shows_what_lies_behind_it(window, axis):
    window.locator("#section-axis").select_option(axis)
    cut = window.evaluate("report.part.material.uniforms.cut.value.toArray()")
    middle = np.mean(STOCK_MM, axis=0)
    assert cut[int(axis)] == pytest.approx(middle[int(axis)])
    window.locator("#section-axis").select_option("")
    assert np.abs(window.evaluate("report.part.material.uniforms.cut.value.toArray()")).min() > 1e6


@pytest.fixture(scope="module")
def five():
    prediction = predict(FIVE / "five_axis.nc", load_cell(FIVE / "cell.toml"))
    return prediction, part_of(prediction)


@pytest.fixture(scope="module")
def turned_window(five, browser, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "five.html"
    write_page(content_of(five[0], part=five[1]), file)
    made = opened_page(browser, file)
    yield made
    assert made.said == []


@pytest.mark.browser
def test_under_a_turning_axis_it_follows_the_slider_in_both_directions(turned_window, five):
    turned_window.evaluate(FINISHED, True)
    assert turned_window.evaluate(VOLUME) == pytest.approx(five[1].volume_mm3(), rel=1e-4)
    turned_window.evaluate(FINISHED, False)
    for row in (3000, 4500, 1200, 0):
        turned_window.evaluate("(row) => report.select(row)", row)
        assert turned_window.evaluate(VOLUME) == pytest.approx(five[1].volume_mm3(row), rel=1e-4)


@pytest.mark.browser
def test_under_a_turning_axis_a_click_says_which_line_left_the_surface(turned_window, five):
    """On the tilted face, which line 11 leaves."""
    prediction, _ = five
    turned_window.evaluate(FINISHED, True)
    turned_window.evaluate("document.getElementById('look').scrollIntoView()")
    turned_window.locator("[data-view=top]").click()
    turned_window.evaluate(TWO_FRAMES)
    turned_window.mouse.click(*turned_window.evaluate(PLACE, [20.0, -68.0, -11.5]))
    note = turned_window.locator("#part-note").inner_text()
    assert note.startswith("line 11 · ")
    assert "error -" in note
    row = turned_window.evaluate("report.row")
    assert prediction.toolpath.source_line[prediction.motion.move[row]] == 11
    turned_window.locator("#section-axis").select_option("2")
    turned_window.mouse.click(*turned_window.evaluate(PLACE, [50.0, 40.0, 0.0]))
    assert turned_window.locator("#part-note").inner_text() == ""  # through the section
    turned_window.locator("#section-axis").select_option("")
    turned_window.mouse.click(*turned_window.evaluate(PLACE, [50.0, 40.0, 0.0]))
    assert turned_window.locator("#part-note").inner_text() == "not cut"


@pytest.mark.browser
def test_a_page_with_errors_begins_at_the_first_and_marks_all(five, browser, tmp_path):
    prediction, part = five
    lines = 15, 30
    issues = [Issue("error", "joint-limit", line, "A5 beyond its limit", "move the part") for line in lines]
    file = tmp_path / "errors.html"
    write_page(content_of(prediction, verdict="refused", issues=issues, part=part), file)
    window = opened_page(browser, file)
    assert window.locator("h1").inner_text().endswith("A5 beyond its limit (line 15), and 1 more error")
    rows = window.evaluate("report.plots.errors")
    assert prediction.toolpath.source_line[prediction.motion.move[rows]].tolist() == list(lines)
    assert window.evaluate("report.row") == rows[0]
    assert not window.locator("#show-finished").is_checked()
    assert window.locator("#show-robot").is_checked()
    assert window.evaluate(VOLUME) == pytest.approx(part.volume_mm3(rows[0]), rel=1e-4)
    assert window.said == []
