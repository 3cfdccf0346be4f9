"""The page is whole in itself, and its libraries are those that were looked at."""

import json
import re
from hashlib import sha256

import numpy as np
import pytest

from gcode2krl import load_cell, predict, read_gcode
from gcode2krl.errors import Issue
from gcode2krl.report.page import content_of, content_of_refused, page
from gcode2krl.report.page.one_file import LIBRARIES, as_constant, coded, figure
from gcode2krl.report.page.samples import samples_of, thinned
from tests.conftest import ROOT

PINNED = {
    "three.module.min.js": "08fd7545d13d2c7fb65ab691530a802dafefd638596501854f267d0fb13c39e7",
    "OrbitControls.js": "80efaadea4f8a636a65fb0bd08bfef62f3d93a0bb94e2e7500f23176c5c07f4e",
    "three.LICENSE": "4c40a1ef62450b857c3b2aaf294936304cd552d965fbcd9d32d4c5bcf4ba4454",
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "uPlot.LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}
"""three.js 0.170.0 and uPlot 1.6.32 as published."""
PIECE = ROOT / "examples" / "test_piece.nc"


@pytest.fixture(scope="module")
def text(prediction):
    return page(content_of(prediction, text=PIECE.read_text(encoding="ascii")))


def head_of(text):
    return json.loads(re.search(r'<script type="application/json" id="head">(.*?)</script>', text, re.S)[1])


def test_the_libraries_are_as_published():
    assert {file.name: sha256(file.read_bytes()).hexdigest() for file in LIBRARIES.iterdir()} == PINNED


def test_each_copy_carries_the_licences(text):
    for name in ("three.LICENSE", "uPlot.LICENSE"):
        assert (LIBRARIES / name).read_text(encoding="utf-8") in text


def test_nothing_is_fetched(text):
    markup = re.sub(r"<script type=\"module\">.*?</script>", "", text, flags=re.S)
    assert not re.search(r"(src|href)\s*=|@import|url\(", markup)
    own = "".join(
        file.read_text(encoding="utf-8")
        for file in LIBRARIES.parent.iterdir()
        if file.suffix in (".js", ".css")
    )
    assert not re.search(r"https?://|\bfetch\(|XMLHttpRequest|\bimport\b", own)


def test_each_script_ends_where_it_should(text):
    """No library or text closes the script that it stands in."""
    assert text.count("</script>") == 4
    assert text.count("<script") == 4


def test_a_hostile_program_stays_text():
    issue = Issue("error", "no-number", 3, "</script><img src=x onerror=alert(1)>", "<b>no</b>")
    made = page(content_of_refused([issue], title="<i>.nc", text="(</script><script>alert(1)</script>)\n"))
    assert "<img" not in made
    assert "<i>.nc" not in made
    assert made.count("<script") == 4


def test_size(text):
    """Libraries and samples of the test piece; plotly.js 4.1.2 alone is 4.83 MB."""
    assert len(text.encode("utf-8")) < 1_000_000


def test_first_comes_what_matters(text, prediction):
    order = [
        "<h1>1 min 18 s for 2.95 m",
        'id="time"',
        'id="worst"',
        'id="findings"',
        'id="not-checked"',
        'id="look"',
    ]
    places = [text.index(each) for each in order]
    assert places == sorted(places)
    for issue in prediction.issues:
        assert f"<code>{issue.code}</code>" in text
    size_N = np.linalg.norm(prediction.forces.force_base_N, axis=1)
    assert f"{size_N.max():.0f} N" in text


def test_the_head_describes_the_columns(text, prediction):
    head = head_of(text)
    assert head["rows"] == head["all"] == len(prediction.motion)
    names = [column["name"] for column in head["columns"]]
    assert names[:8] == ["time", "x", "y", "z", "speed", "force", "deflection", "margin"]
    assert names[-6:] == [f"q{k}" for k in range(1, 7)]
    scale = {quantity["name"]: quantity for quantity in head["quantities"]}
    assert scale["deflection"]["beyond"] == pytest.approx(2.47, abs=0.01)
    assert scale["deflection"]["high"] < 2.4
    assert [line for line, _ in head["marked"]] == sorted({i.line for i in prediction.issues if i.line > 0})


def test_a_refused_program_shows_its_path():
    toolpath = read_gcode(PIECE, load_cell())
    issue = Issue("error", "out-of-reach", 20, "too far", "move it nearer")
    content = content_of_refused([issue], title="part.nc", toolpath=toolpath, cell=load_cell(), text="")
    assert content.sentence == "No program was written: too far (line 20)"
    assert content.head["rows"] > 400
    assert not content.head["timed"]
    assert content.shares == []
    assert any(line.startswith("Time and speed") for line in content.not_checked)


def test_a_program_that_is_not_understood_shows_its_text_without_libraries():
    content = content_of_refused(
        [Issue("error", "no-number", 5, "X is not followed by a number")],
        title="part.nc",
        verdict="not understood",
        text="G1 X\n",
    )
    made = page(content)
    assert content.head["rows"] == 0
    assert "line 5</button>" in made
    assert len(made) < 100_000


def test_long_motions_keep_their_extremes(prediction):
    samples = samples_of(prediction)
    rows = thinned(samples, 300)
    assert len(rows) <= 300
    assert (np.diff(rows) > 0).all()
    for quantity in samples.quantities:
        assert quantity.values[rows].max() == quantity.values.max()
        assert quantity.values[rows].min() == quantity.values.min()


def test_a_module_becomes_a_constant():
    made = as_constant("import {\n A,\n B\n} from 'three';\nclass x{}\nexport{x as Y,z};\n", "NAME")
    assert (
        made == "const NAME = (() => {\nconst {\n A,\n B\n} = THREE;\nclass x{}\n\nreturn {Y:x,z:z};\n})();"
    )
    with pytest.raises(ValueError, match="NAME"):
        as_constant("export default 1;", "NAME")


def test_figures_and_code():
    assert [figure(value) for value in (1234.5, 12.345, 1.2345)] == ["1234", "12.3", "1.23"]
    assert coded("say `a < b`") == "say <code>a &lt; b</code>"


def test_the_tool_is_drawn_where_it_leans(text):
    folder = ROOT / "examples" / "five_axis"
    leaning = predict(folder / "five_axis.nc", load_cell(folder / "cell.toml"), forces=False)
    made = page(content_of(leaning))
    ends = np.array(head_of(made)["axes"])
    assert ends.shape[1:] == (2, 3)
    directions = np.unique(np.round((ends[:, 1] - ends[:, 0])[:, :2], 2), axis=0)
    assert len(directions) > 20  # the swarf cut turns the tool all the way round
    assert 'id="show-axes"' in made
    assert 'id="show-axes"' not in text
    assert "axes" not in head_of(text)
