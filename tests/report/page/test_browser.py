"""The page in a headless browser: what is clicked moves the other views, and everything works by keyboard."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from gcode2krl import load_cell, predict, read_gcode
from gcode2krl.clearance import obstacle_meshes
from gcode2krl.errors import Issue
from gcode2krl.report.page import content_of, content_of_refused, write_page
from gcode2krl.report.page.one_file import HERE
from tests.conftest import ROOT
from tests.report.page.browser import opened_browser, opened_page
from tests.test_clearance import PART, box, cell_with

pytestmark = pytest.mark.browser
PIECE = ROOT / "examples" / "test_piece.nc"


@pytest.fixture(scope="module")
def browser():
    with opened_browser() as made:
        yield made


@pytest.fixture(scope="module")
def file(prediction, tmp_path_factory):
    made = tmp_path_factory.mktemp("page") / "test piece.html"
    write_page(content_of(prediction, text=PIECE.read_text(encoding="ascii")), made)
    return made


@pytest.fixture
def window(browser, file):
    made = opened_page(browser, file)
    yield made
    assert made.said == []
    made.context.close()


TEXTS = """() => {
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const ground = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const colour = numbers(getComputedStyle(one).backgroundColor);
      if (colour.length < 4 || colour[3] > 0.5) return colour.slice(0, 3);
    }
    return [255, 255, 255];
  };
  const hasText = (one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  return [...document.querySelectorAll("body *:not(script, noscript, option)")]
    .filter((one) => one.checkVisibility() && hasText(one))
    .map((one) => [one.className, numbers(getComputedStyle(one).color).slice(0, 3), ground(one)]);
}"""
"""Each element with text, its colour and that of its ground."""
BOXES = """(names) => names.map((name) => {
  const box = document.querySelector(name).getBoundingClientRect();
  return [name, box.left, box.top, box.right, box.bottom];
})"""
FOCUS = """() => {
  const one = document.activeElement;
  return [one.id || one.dataset.view || one.className || one.tagName, getComputedStyle(one).outlineStyle];
}"""
NO_WEBGL = """
const own = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : own.call(this, kind, ...more);
};"""
CURSORS_S = "report.plots.plots.map(({u, now}) => u.posToVal(parseFloat(now.style.left) + 1, 'x'))"
PLOT_BOX = (
    "(({left, top, width}) => [left, top, width])(report.plots.plots[0].u.over.getBoundingClientRect())"
)
LOOK = "document.getElementById('look').scrollIntoView()"


def contrast(ink, ground):
    """Ratio of WCAG 2.1."""
    share = np.array([ink, ground]) / 255.0
    linear = np.where(share <= 0.03928, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    dark, light = sorted(linear @ [0.2126, 0.7152, 0.0722])
    return (light + 0.05) / (dark + 0.05)


def marker_mm(window):
    return window.evaluate("report.scene.marker.position.toArray()")


def chosen_line(window):
    return int(window.locator("#listing li[aria-selected=true]").get_attribute("data-line"))


def row(window):
    return window.evaluate("report.row")


def test_it_begins_at_the_worst_place(window, prediction):
    worst = int(np.argmax(np.linalg.norm(prediction.deflection.deflection_base_mm, axis=1)))
    assert row(window) == worst
    assert chosen_line(window) == prediction.toolpath.source_line[prediction.motion.move[worst]]
    assert "2.47 mm" in window.locator("#readout").inner_text()


def test_a_click_on_a_line_moves_marker_and_time(window, prediction):
    window.evaluate(LOOK)
    before = marker_mm(window)
    window.locator("#listing li[data-line='46']").click()
    line = prediction.toolpath.source_line[prediction.motion.move]
    first = int(np.flatnonzero(line == 46)[0])
    assert row(window) == first
    assert marker_mm(window) != before
    assert marker_mm(window) == pytest.approx(prediction.motion.position_mm[first], abs=2e-3)
    cursor = window.evaluate(CURSORS_S)
    assert cursor == pytest.approx([prediction.motion.time_s[first]] * 4, abs=0.2)


def test_a_click_on_the_force_peak_selects_its_line(window, prediction):
    window.evaluate(LOOK)
    size_N = np.linalg.norm(prediction.forces.force_base_N, axis=1)
    peak = int(np.argmax(size_N))
    window.evaluate("report.select(0)")
    x, y = window.evaluate("(row) => report.plots.placeOf('force', row)", peak)
    window.mouse.click(x, y)
    assert size_N[row(window)] == pytest.approx(size_N.max(), rel=1e-3)
    assert chosen_line(window) == prediction.toolpath.source_line[prediction.motion.move[row(window)]]


def test_a_click_on_the_path_selects_the_sample_there(window, prediction):
    window.evaluate(LOOK)
    window.locator("[data-view=top]").click()
    wanted = int(np.flatnonzero(prediction.toolpath.source_line[prediction.motion.move] == 20)[300])
    window.wait_for_timeout(300)
    place = """(row) => {
      const { scene } = report, box = scene.canvas.getBoundingClientRect();
      const at = scene.marker.position.clone().fromArray(scene.points, 3 * row).project(scene.camera);
      return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
    }"""
    window.mouse.click(*window.evaluate(place, wanted))
    assert marker_mm(window) == pytest.approx(prediction.motion.position_mm[wanted], abs=3.0)
    assert chosen_line(window) == 20


def test_the_drawn_tip_is_where_the_motion_is(window, prediction):
    for at in range(0, len(prediction.motion), 700):
        window.evaluate("(row) => report.select(row)", at)
        assert window.evaluate("report.robot.tip()") == pytest.approx(
            prediction.motion.position_mm[at], abs=0.1
        )


def test_every_column_arrives(window, prediction):
    read = {
        name: np.array(window.evaluate(f"Array.from(report.columns.{name})"))
        for name in ("x", "force", "line")
    }
    assert np.abs(read["x"] - prediction.motion.position_mm[:, 0]).max() < 6e-4
    size_N = np.linalg.norm(prediction.forces.force_base_N, axis=1)
    assert np.abs(read["force"] - size_N).max() < 0.06
    assert (read["line"] == prediction.toolpath.source_line[prediction.motion.move]).all()


def test_keys(window):
    window.evaluate("report.select(100)")
    window.keyboard.press("ArrowRight")
    assert row(window) == 101
    window.keyboard.press("Shift+ArrowLeft")
    assert row(window) == 91
    before = chosen_line(window)
    window.keyboard.press("n")
    assert chosen_line(window) > before
    window.keyboard.press("b")
    assert chosen_line(window) == before
    start = row(window)
    window.keyboard.press("Space")
    window.wait_for_timeout(600)
    window.keyboard.press("Space")
    assert row(window) > start
    rested = row(window)
    window.wait_for_timeout(300)
    assert row(window) == rested


def test_the_tabulator_reaches_everything_and_shows_where_it_is(window):
    seen, outlined = [], 0
    for _ in range(60):
        window.keyboard.press("Tab")
        at, outline = window.evaluate(FOCUS)
        seen.append(at)
        outlined += outline == "solid"
        if at == "slider":
            break
    wanted = [
        "findings",
        "colour",
        "show-rapids",
        "show-robot",
        "part",
        "robot",
        "listing",
        "play",
        "pace",
        "slider",
    ]
    assert [each for each in seen if each in wanted] == wanted
    assert outlined >= len(seen) - 1


def test_a_hidden_pass_is_not_drawn(window):
    window.locator("#passes summary").click()
    boxes = window.locator("#passes input")
    assert boxes.count() == 6
    drawn = window.evaluate("report.scene.fine.count")
    boxes.nth(0).uncheck()
    window.wait_for_timeout(400)
    fewer = window.evaluate("report.scene.fine.count")
    assert fewer < drawn
    window.locator("#passes button").nth(1).click()
    window.wait_for_timeout(400)
    assert window.evaluate("report.scene.fine.count") < fewer
    assert [boxes.nth(k).is_checked() for k in range(6)] == [False, True, False, False, False, False]


def test_a_stretch_of_time_leaves_the_rest_pale(window, prediction):
    window.evaluate(LOOK)
    box = window.evaluate(PLOT_BOX)
    window.mouse.move(box[0] + 0.25 * box[2], box[1] + 10)
    window.mouse.down()
    window.mouse.move(box[0] + 0.5 * box[2], box[1] + 10, steps=4)
    window.mouse.up()
    first, last = window.evaluate("report.stretch")
    whole_s = prediction.motion.time_s[-1]
    assert prediction.motion.time_s[first] == pytest.approx(0.25 * whole_s, abs=0.5)
    assert prediction.motion.time_s[last] == pytest.approx(0.5 * whole_s, abs=0.5)
    shade = np.array(window.evaluate("Array.from(report.scene.shade)"))
    assert (shade[:first] < 0).all()
    assert (shade[first + 1 : last] >= 0).any()
    window.mouse.dblclick(box[0] + 0.5 * box[2], box[1] + 10)
    assert window.evaluate("report.stretch") is None


@pytest.mark.parametrize("colour", ["speed", "force", "deflection", "margin", "pass"])
def test_colours_change_picture_and_legend(window, colour):
    window.locator("#colour").select_option(colour)
    shade = np.array(window.evaluate("Array.from(report.scene.shade)"))
    assert len(np.unique(shade[shade >= 0])) > 4
    name = window.locator("#legend-name").inner_text()
    unit = {"speed": "mm/s", "force": "N", "deflection": "mm", "margin": "°", "pass": "pass"}[colour]
    assert unit in name


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1024, 640), (420, 800)])
def test_nothing_overlaps_or_sticks_out(browser, file, width, height):
    window = opened_page(browser, file, width, height)
    assert window.evaluate("document.documentElement.scrollWidth") <= width
    boxes = window.evaluate(BOXES, [".tools", ".stage", ".code", ".time", ".plots", ".help", "footer"])
    for k, (name, left, top, right, bottom) in enumerate(boxes):
        assert right > left
        assert bottom > top
        for other, left2, top2, right2, bottom2 in boxes[:k]:
            apart = left >= right2 - 1 or left2 >= right - 1 or top >= bottom2 - 1 or top2 >= bottom - 1
            assert apart, (name, other)
    window.context.close()


def test_text_is_dark_enough(window):
    """Contrast by WCAG 2.1: at least 4.5 for every text on the page."""
    texts = window.evaluate(TEXTS)
    assert len(texts) > 50
    faint = [
        (name, round(contrast(ink, ground), 1)) for name, ink, ground in texts if contrast(ink, ground) < 4.5
    ]
    assert faint == []


def test_what_is_printed_has_the_findings_and_no_buttons(window):
    window.emulate_media(media="print")
    assert window.locator("#findings").is_visible()
    assert window.locator("#scene").is_visible()
    for hidden in (".tools", "#slider", "#listing", ".help", "#play"):
        assert not window.locator(hidden).is_visible()
    assert window.evaluate("getComputedStyle(document.getElementById('findings')).overflowY") == "visible"


def test_a_sheet_is_filled_and_left_again(window):
    """A browser prints what is there when it says so; it does not wait."""
    wide = window.evaluate("report.plots.plots[0].u.width")
    window.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert window.evaluate("report.plots.plots.every(({u}) => u.width <= 690)")
    assert window.evaluate("document.getElementById('scene').clientWidth") <= 690
    window.evaluate("dispatchEvent(new Event('afterprint'))")
    assert window.evaluate("report.plots.plots[0].u.width") == wide


def test_gouges_and_rest_are_drawn_where_they_are(browser, prediction, tmp_path):
    corners = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0.0]])
    found = [
        {
            "kind": kind,
            "volume_mm3": 5.0,
            "depth_mm": 0.5,
            "place_mm": place,
            "row": 900,
            "triangles_mm": solid,
        }
        for kind, place, solid in (
            ("gouge", [1.0, 2.0, 3.0], np.stack([corners, corners + 5.0])),
            ("rest", [100.0, 0.0, 0.0], corners[None] + 100.0),
        )
    ]
    nominal = {
        "volume_mm3": {"gouge": 5.0, "rest": 5.0},
        "left_out": {"gouge": 0, "rest": 3},
        "at_mm": None,
        "differences": found,
    }
    made = tmp_path / "nominal.html"
    write_page(content_of(prediction, nominal=nominal), made)
    window = opened_page(browser, made)
    drawn = window.evaluate(
        "report.solids.children.map((one) => [one.material.color.getHex(),"
        " Array.from(one.geometry.attributes.position.array)])"
    )
    assert [colour for colour, _ in drawn] == [0xD55E00, 0x0072B2]
    for (_, points), one in zip(drawn, found, strict=True):
        assert points == pytest.approx(one["triangles_mm"].ravel(), abs=6e-3)
    assert "3 smaller places" in window.locator("#compared").inner_text()
    window.locator("#show-solids").uncheck()
    assert window.evaluate("report.solids.visible") is False
    window.locator("#compared button.go").first.click()
    assert row(window) == 900
    assert window.said == []
    window.context.close()


def test_what_hits_something_is_red_at_that_moment(browser, tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PART)
    predicted = predict(part, cell_with(box("beam", [105.0, -200, 110], [120, 40, 150])))
    write_page(content_of(predicted, verdict="refused", text=PART), tmp_path / "hit.html")
    window = opened_page(browser, tmp_path / "hit.html")
    colour = "name => report.robot.named.get(name).map((mesh) => mesh.material.color.getHex())"
    gap_mm = predicted.clearance.clearance_mm
    for row, is_hit in ((int(np.argmin(gap_mm)), True), (int(np.argmax(gap_mm)), False)):
        window.evaluate("row => report.select(row)", row)
        for name in ("spindle", "beam"):
            assert ({0xD00000} == set(window.evaluate(colour, name))) == is_hit
        assert 0xD00000 not in window.evaluate(colour, "A3")
        assert ("spindle hits beam" in window.inner_text("#readout")) == is_hit
    assert window.is_visible("#show-cell")
    assert window.said == []
    window.context.close()


def test_a_mesh_and_the_cables_are_drawn(browser, tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PART)
    fixture = trimesh.creation.box((20.0, 30.0, 40.0))
    fixture.apply_translation((0.0, 150.0, -20.0))
    fixture.export(tmp_path / "fixture.stl")
    cables = {"capsules": [{"from_mm": [0.0, 250, 0], "to_mm": [-150.0, 0, 40], "radius_mm": 40}]}
    obstacle = {"name": "vice", "mesh": str(tmp_path / "fixture.stl"), "frame": "robroot"}
    predicted = predict(part, cell_with(obstacle, cables=cables), forces=False)
    meshes = obstacle_meshes(predicted.cell)
    write_page(content_of(predicted, text=PART, meshes_mm=meshes), tmp_path / "cell.html")
    window = opened_page(browser, tmp_path / "cell.html")
    corners = window.evaluate(
        "Array.from(report.robot.named.get('vice')[0].geometry.attributes.position.array)"
    )
    assert corners == pytest.approx(meshes["vice"].ravel(), abs=6e-3)
    stretch = "(({ mesh }) => [mesh.scale.y, ...mesh.position.toArray()])(report.robot.cables[0])"
    drawn = []
    for row in (0, len(predicted.motion) // 2):
        window.evaluate("row => report.select(row)", row)
        drawn.append(window.evaluate(stretch))
    assert all(100.0 < length < 2500.0 for length, *_ in drawn)
    assert drawn[0] != drawn[1]
    assert window.said == []
    window.context.close()


def test_a_refused_program(browser, tmp_path):
    issue = Issue("error", "out-of-reach", 25, "X 1 is out of reach", "move it")
    toolpath = read_gcode(PIECE, load_cell())
    text = PIECE.read_text(encoding="ascii")
    made = tmp_path / "refused.html"
    content = content_of_refused([issue], title="part.nc", toolpath=toolpath, cell=load_cell(), text=text)
    write_page(content, made)
    window = opened_page(browser, made)
    window.locator("#findings button.go").click()
    assert chosen_line(window) == 25
    assert window.locator("#listing li.error").get_attribute("data-line") == "25"
    assert window.said == []
    window.context.close()


@pytest.mark.parametrize(("lines", "wrong"), [(2000, 900), (600_000, 512_345)])
def test_a_program_that_is_not_understood(browser, tmp_path, lines, wrong):
    """The second is longer than a browser can scroll line by line."""
    made = tmp_path / "text.html"
    content = content_of_refused(
        [Issue("error", "no-number", wrong, "X is not followed by a number")],
        title="part.nc",
        verdict="not understood",
        text="\n".join(f"G1 X{k}" for k in range(lines)),
    )
    write_page(content, made)
    window = opened_page(browser, made)
    window.locator("#findings button.go").click()
    assert chosen_line(window) == wrong
    chosen = window.locator("#listing li[aria-selected=true]")
    assert chosen.inner_text().endswith(f"G1 X{wrong - 1}")
    place, listing = chosen.bounding_box(), window.locator("#listing").bounding_box()
    assert listing["y"] <= place["y"] <= listing["y"] + listing["height"] - 18
    assert window.said == []
    window.context.close()


def test_a_browser_that_is_too_old_says_so(browser, file):
    window = browser.new_context(offline=True).new_page()
    window.add_init_script("delete window.DecompressionStream")
    window.goto(file.as_uri())
    assert window.locator("#trouble").is_visible()
    assert "too old" in window.locator("#trouble").inner_text()
    assert window.locator("#findings").is_visible()
    window.context.close()


def test_without_webgl_plots_and_text_still_work(browser, file, prediction):
    window = browser.new_context(offline=True).new_page()
    window.add_init_script(NO_WEBGL)
    window.goto(file.as_uri())
    window.wait_for_function("window.report !== undefined", timeout=60_000)
    assert "no WebGL" in window.locator("#scene-note").inner_text()
    window.locator("#listing li[data-line='46']").click()
    assert row(window) == int(
        np.flatnonzero(prediction.toolpath.source_line[prediction.motion.move] == 46)[0]
    )
    window.context.close()


def test_the_level_of_detail_stays_within_its_tolerance(browser):
    """Each row left out lies within 0.05 mm and 0.1 of the shade of the line between those kept."""
    window = browser.new_context(offline=True).new_page()
    script = (HERE / "simplify.js").read_text(encoding="utf-8")
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 60.0, 4000)
    points = np.stack([10.0 * np.cos(t), 10.0 * np.sin(1.3 * t), t], axis=1) + rng.normal(
        0.0, 0.004, (4000, 3)
    )
    shade = 0.5 + 0.4 * np.sin(3.0 * t)
    kind = (t > 30.0).astype(int)
    call = f"([p, s, k]) => {{ {script}; return Array.from(keptRows(p, s, k, 0.05, 0.1)); }}"
    kept = np.array(window.evaluate(call, [points.ravel().tolist(), shade.tolist(), kind.tolist()]))
    assert kept[0] == 0
    assert kept[-1] == 3999
    assert (np.diff(kept) > 0).all()
    assert len(kept) < 2000
    for first, last in pairwise(kept):
        inner = np.arange(first + 1, last)
        along = points[last] - points[first]
        offset = points[inner] - points[first]
        share = np.clip(offset @ along / (along @ along), 0.0, 1.0)
        assert np.linalg.norm(offset - share[:, None] * along, axis=1).max(initial=0.0) <= 0.05 + 1e-9
        assert kind[first] == kind[last] or last == first + 1
    window.context.close()
