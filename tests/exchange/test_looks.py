"""What a terminal and a notebook show of results: short, and with every text escaped."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Issue, load_cell, predict, write_krl
from gcode2krl.errors import told
from gcode2krl.exchange.html import line_picture, path_picture
from gcode2krl.gap.answer.result import Gap, GapSize, Unexplained, Where
from gcode2krl.runs import Run, RunHead, Tracker
from tests.conftest import ROOT

EVIL = '<script>alert("&")</script>'
MOST_OF_A_REPR = 300
MOST_OF_A_PAGE = 60_000
MOST_OF_A_PICTURE = 30_000


def tracker():
    count = 20
    return Tracker(
        time_s=0.01 * np.arange(count),
        row=np.arange(count) + 2,
        segments=np.array([[0, count]]),
        position_mm=np.zeros((count, 3)),
    )


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """One of everything, with long and evil names."""
    folder = tmp_path_factory.mktemp("shown")
    part = folder / "part.nc"
    part.write_bytes((ROOT / "examples" / "test_piece.nc").read_bytes())
    prediction = predict(part)
    evil = Issue("warning", "evil", 3, EVIL * 20, EVIL, EVIL)
    motion = replace(prediction.motion, issues=(*prediction.motion.issues, evil))
    source = str(Path("folder") / (EVIL.replace("/", "") * 8))
    toolpath = replace(prediction.toolpath, source=source)
    targets = replace(prediction.targets, source=source)
    evil_prediction = replace(prediction, toolpath=toolpath, targets=targets, motion=motion)
    cell = load_cell().model_copy(update={"name": EVIL * 9})
    run = Run(EVIL * 9, folder, RunHead(), tracker=tracker(), issues=(evil,))
    gap = Gap(
        verdict="no_gap",
        gap=GapSize(signal=EVIL, unit="mm"),
        links=(),
        where=Where(),
        causes=(),
        unexplained=Unexplained(rms=None, significant=False, structure="unknown"),
        not_examined=(),
        issues=(evil,),
    )
    written = write_krl(prediction, None, name="PART")
    return {
        "prediction": evil_prediction,
        **{f"{name}": getattr(evil_prediction, name) for name in ("toolpath", "targets", "motion")},
        **{name: getattr(prediction, name) for name in ("joints", "forces", "deflection")},
        "samples": evil_prediction.samples(),
        "findings": evil_prediction.findings,
        "issue": evil,
        "cell": cell,
        "run": run,
        "tracker": run.tracker,
        "gap": gap,
        "written": replace(written, issues=(evil,)),
        "report": replace(
            written.report,
            issues=(evil,),
            worst=({"file": EVIL, "line": 1, "gcode_line": 2, "deviation_mm": 0.1},),
        ),
    }


STAGES = ("toolpath", "targets", "motion", "joints", "forces", "deflection")
NAMES = ["prediction", *STAGES, "samples", "findings", "issue", "cell", "run", "tracker", "gap"]
NAMES += ["written", "report"]


@pytest.mark.parametrize("name", NAMES)
def test_a_repr_is_short_and_on_one_line(shown, name):
    text = repr(shown[name])
    assert len(text) < MOST_OF_A_REPR
    assert "\n" not in text
    assert re.match(r"[A-Z]\w+\(", text)
    assert str(shown[name]) == text


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("issue", "tracker")])
def test_html_is_small_whole_and_escaped(shown, name):
    page = shown[name]._repr_html_()
    assert "<script" not in page
    assert len(page) < MOST_OF_A_PAGE
    ET.fromstring(page)  # every element is closed, every text escaped


def test_a_table_shows_its_path_and_its_findings(shown):
    assert shown["motion"]._repr_html_().count("<svg") == 1
    assert "&lt;script&gt;" in shown["motion"]._repr_html_()
    assert "<svg" not in shown["joints"]._repr_html_()
    assert repr(told([shown["issue"]] * 500).findings[0]).startswith("Finding(500 times Issue(warning evil")
    assert len(repr(told([shown["issue"]] * 500).findings[0])) < MOST_OF_A_REPR


def test_the_texts_are_there(shown):
    assert "&lt;script&gt;" in shown["prediction"]._repr_html_()
    assert "&lt;script&gt;" in shown["findings"]._repr_html_()


def test_a_prediction_is_told_by_its_figures():
    prediction = predict(ROOT / "examples" / "test_piece.nc")
    assert repr(prediction) == "Prediction(test_piece.nc: 436 moves, 78.3 s, 895 N, 2.47 mm, 4 notes)"
    assert repr(prediction.motion) == f"Motion({len(prediction.motion)} samples, 78.3 s)"
    bare = replace(prediction, motion=None, joints=None, forces=None, deflection=None, skipped=())
    assert repr(bare).startswith("Prediction(test_piece.nc: 436 moves")
    assert "not known" in bare._repr_html_()


@pytest.mark.parametrize("count", [2, 100, 50_000])
def test_a_picture_is_small_and_shows_the_whole_path(count):
    turn = np.linspace(0.0, 40.0, count)
    path = np.stack([turn * np.cos(turn), turn * np.sin(turn), turn], axis=1)
    picture = path_picture(path, np.arange(count) % 7 > 2)
    assert len(picture) < MOST_OF_A_PICTURE
    box = [float(word) for word in ET.fromstring(picture).get("viewBox").split(" ")]
    places = np.array(re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", picture), dtype=float)
    assert (places >= -0.1).all()
    assert (places.max(axis=0) <= np.array(box[2:]) - 7.0).all()


def test_nothing_to_draw_is_no_picture():
    assert path_picture(np.full((5, 3), np.nan)) == ""
    assert path_picture(np.zeros((1, 3))) == ""
    assert line_picture(np.arange(3.0), [np.full(3, np.nan)]) == ""


def test_a_picture_of_lines_leaves_out_missing_values():
    time_s = np.arange(5000.0)
    values = np.sin(time_s / 100.0)
    values[100:200] = np.nan
    picture = line_picture(time_s, [values, 0.5 * values])
    assert "nan" not in picture
    assert len(picture) < MOST_OF_A_PICTURE
