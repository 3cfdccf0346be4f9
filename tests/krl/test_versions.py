"""What is written for a stated controller, or refused; and that each construct of it stands in the table."""

import re
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from docs import make_krl_truth
from gcode2krl import load_cell, read_gcode, set_targets, write_krl
from gcode2krl.errors import Gcode2KrlError, NotUnderstoodError, RefusedError
from gcode2krl.krl.constructs import all_constructs, assumed_in, sources
from gcode2krl.krl.versions import ASSUMED
from tests.cells import over_demonstration
from tests.conftest import ROOT
from tests.krl.conftest import read, verified
from tests.krl.forces import cutting_below, moved, with_forces

KSS = [None, "8.3", "8.5", "8.6", "8.7", "iiqka"]
RSI_OF_KSS = {"8.3": "3", "8.5": "4", "8.6": "4", "8.7": "5"}
"""Read in the headers of files that RSI Visual made, and in tables of ROS drivers."""
HEAD = "G21 G90 G17 G54 G64 P0.02\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\n"
BODY = "G1 Z-2 F600\nG1 X40 F1500\nG1 Y30.5\nG1 X0 Y20\n"
FOOT = "G0 Z20\nM5\nM30\n"
ARC = "G1 Z-2 F600\nG2 X40 Y0 I20 J0 F1500\nG1 X60\n"
WAVE = "G1 Z-2 F600\n" + "".join(f"G1 X{x:.2f} Y{3 * np.sin(x / 6):.4f} F1500\n" for x in np.arange(1, 60))
ONLINE = {"online": {"link": {"address": "192.168.7.3"}}}
TABLE = {
    "kind": "turntable",
    "axis": "z",
    "origin": {"x_mm": 1550.0, "y_mm": 0.0, "z_mm": 700.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0},
    "limits": [-360.0, 360.0],
    "speed": 60.0,
    "acceleration": 120.0,
    "machine_def": 2,
    "position": 0.0,
    "home": 0.0,
}
ON_TABLE = {"x_mm": -50.0, "y_mm": 0.0, "z_mm": 100.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
FEATURES = {
    "plain": ({}, BODY, {}),
    "pilot index": ({}, BODY, {"pilot": "index"}),
    "pilot values": ({}, BODY, {"pilot": "values"}),
    "arcs": ({"controller": {"circ": True}}, ARC, {}),
    "splines": ({"controller": {"spline": True}}, WAVE, {}),
    "split files": ({}, WAVE, {"split": "files"}),
    "external axis": ({"external": {"E1": TABLE}, "frames": {"base": ON_TABLE}}, BODY, {}),
    "online": (ONLINE, BODY, {"online": "A"}),
    "online, pilot": (ONLINE, BODY, {"online": "A", "pilot": "index"}),
    "online, axis": ({"online": {**ONLINE["online"], "mode": "axis"}}, BODY, {"online": "A"}),
}


def cell_of(keys, kss=None, rsi=None):
    stated = {key: value for key, value in (("kss", kss), ("rsi", rsi)) if value is not None}
    return over_demonstration({**keys, "controller": {**keys.get("controller", {}), **stated}})


@cache
def part_of(feature):
    """Return a part as far as it is the same for every version: its prediction, with forces for a pilot."""
    keys, body, options = FEATURES[feature]
    cell = cell_of(keys)
    toolpath = read(HEAD + body + FOOT, cell)
    if "pilot" not in options:
        return set_targets(toolpath, cell)
    prediction = moved(toolpath, cell)
    return with_forces(prediction, cutting_below(prediction))


def written(folder, feature, kss=None, rsi=None):
    keys, _, options = FEATURES[feature]
    part, cell = part_of(feature), cell_of(keys, kss, rsi)
    if "pilot" in options:
        return write_krl(replace(part, cell=cell), folder / "PART.src", **options), cell
    return write_krl(part, folder / "PART.src", cell, **options), cell


def texts_of(program):
    return {
        name: text.decode("ascii").replace("\r\n", "\n")
        for name, text in program.texts.items()
        if not name.endswith(".csv")
    }


def header_of(text):
    return re.findall(r"(?m)^; (.*)$", text[: text.index(";ENDFOLD")])


def beyond_the_table(text):
    """Return what is left of the lines of a file once every construct of the table is taken out of them."""
    left = []
    for line in re.sub(r"(?m)^(?!;(?:END)?FOLD)(.*?) ?;.*$", r"\1", text).split("\n"):
        marks = bytearray(len(line))
        for each in all_constructs():
            for match in each.form.finditer(line):
                marks[match.start() : match.end()] = b"\x01" * (match.end() - match.start())
        rest = "".join(" " if mark else letter for letter, mark in zip(line, marks, strict=True))
        if "<" in text[:1]:  # of a file of RSI: objects, elements and channels
            rest = " ".join(re.findall(r'ObjType="\w+"|TAG="[\w.]+"', rest))
        if re.search(r"[A-Za-z$#&]", re.sub(r'"[^"]*"', "", rest) if "TAG=" not in rest else rest):
            left.append(line)
    return left


# --- written, or refused with the reason ------------------------------------------------------------------


EACH = [
    (feature, kss) for feature in FEATURES for kss in (KSS if "online" in feature else (None, "8.7", "iiqka"))
]


@pytest.mark.parametrize(("feature", "kss"), EACH)
def test_each_feature_is_written_for_a_version_or_refused(tmp_path, feature, kss):
    if kss == "iiqka":
        with pytest.raises(RefusedError, match="kss-iiqka"):
            written(tmp_path, feature, kss)
        assert list(tmp_path.iterdir()) == []
        return
    program, _ = written(tmp_path, feature, kss)
    assert program.report.ok
    texts = texts_of(program)
    stated = f"for KSS {kss}" if kss else "for KSS 8.x, assumed"
    assert any(line.startswith(stated) for line in header_of(texts["PART.src"]))
    if "online" in feature:
        rsi = RSI_OF_KSS.get(kss, "3")
        flow, create = ("A.rsi.xml", "A.rsi") if rsi == "3" else ("A.rsix", "A")
        assert set(texts) - {"PART.src", "PART.dat"} == {"A_ETH.xml", flow}
        assert f'RSI_CREATE("{create}",' in texts["PART.src"]
        assert f"; RSI {rsi}" in "".join(header_of(texts["PART.src"])[:4])


@pytest.mark.parametrize("rsi", ["3", "4", "5"])
@pytest.mark.parametrize("kss", [None, *RSI_OF_KSS])
def test_kss_and_rsi_that_do_not_belong_together_are_no_cell(tmp_path, kss, rsi):
    if kss is not None and RSI_OF_KSS[kss] != rsi:
        with pytest.raises(Gcode2KrlError, match=f"rsi {rsi} does not belong to KSS {kss}"):
            cell_of(ONLINE, kss, rsi)
        return
    program, cell = written(tmp_path, "online", kss, rsi)
    assert f"A{'.rsi.xml' if rsi == '3' else '.rsix'}" in program.texts
    _, body, _ = FEATURES["online"]
    assert verified(program.files[0], read(HEAD + body + FOOT, cell), cell).ok
    other = cell_of(ONLINE, None, "5" if rsi == "3" else "3")
    report = verified(program.files[0], read(HEAD + body + FOOT, other), other)
    assert {"rsi-version", "rsi-file"} <= {issue.code for issue in report.issues}


@pytest.mark.parametrize(("kss", "refused"), [("8.3", True), ("8.6", False), (None, False)])
def test_a_program_larger_than_kss_8_3_holds_is_refused_there(tmp_path, kss, refused):
    keys = {"program": {"warn_size_mb": 0.005}}
    cell = cell_of(keys, kss)
    targets = part_of("plain")
    if refused:
        with pytest.raises(RefusedError, match="program-memory"):
            write_krl(targets, tmp_path / "PART.src", cell)
        return
    program = write_krl(targets, tmp_path / "PART.src", cell)
    assert "program-large" in {issue.code for issue in program.issues}


@pytest.mark.parametrize(("key", "value"), [("kss", "8.4"), ("kss", 8.3), ("rsi", 4), ("rsi", "6")])
def test_another_version_is_refused_with_what_is_allowed(key, value):
    with pytest.raises(NotUnderstoodError, match=f"controller.{key}"):
        over_demonstration({"controller": {key: value}})


# --- the table of constructs ------------------------------------------------------------------------------


@cache
def cases():
    golden = {file.name: file.read_text("ascii") for file in (ROOT / "tests/golden/krl").iterdir()}
    return {name: text.replace("\r\n", "\n") for name, text in golden.items()}


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("kss", ["8.3", "8.7"])
def test_each_construct_of_a_program_stands_in_the_table(tmp_path, feature, kss):
    program, _ = written(tmp_path, feature, kss)
    for name, text in texts_of(program).items():
        assert beyond_the_table(text) == [], name


def test_each_construct_of_the_golden_programs_stands_in_the_table():
    for name, text in cases().items():
        assert beyond_the_table(text) == [], name


@pytest.mark.parametrize(
    "line",
    [
        "$OV_PRO=50",
        "BAS (#FRAMES )",
        "GK_RSI_RET=RSI_RESET()",
        "SLIN {X 1,Y 2,Z 3}",
        "LIN {X 1.000,Y 2.000,Z 3.000} C_VEL",
        "INTERRUPT DECL 22 WHEN $IN[1] DO GK_STOP( )",
        "TRIGGER WHEN PATH=0 DELAY=0 DO $OUT[1]=TRUE",
        "GK_HANDLE=SET_KRLDLG(GK_MSG,GK_PAR[],GK_KEYS[],GK_OPT)",
        "$TOOL=$NULLFRAME",
    ],
)
def test_a_construct_that_the_table_has_not_is_noticed(line):
    assert beyond_the_table(f"DEF A( )\n{line}\nEND\n") == [line]
    assert beyond_the_table('<RSIObject ObjType="STOP" ObjTypeID="18" ObjID="STOP1">')


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("kss", [None, "8.7"])
def test_the_header_lists_what_is_assumed_of_this_program_and_nothing_else(tmp_path, feature, kss):
    program, _ = written(tmp_path, feature, kss)
    texts = texts_of(program)
    listed = [line.removeprefix(ASSUMED) for line in header_of(texts["PART.src"]) if line.startswith(ASSUMED)]
    assert listed == assumed_in(texts.values())
    assert any(look.startswith("RSI:") for look in listed) == ("online" in feature)
    assert any(look.startswith("pilot:") for look in listed) == ("pilot" in feature)
    assert any(look.startswith("splines:") for look in listed) == (feature == "splines")
    assert any(look.startswith("external axes:") for look in listed) == (feature == "external axis")


def test_the_default_example_lists_its_assumptions(tmp_path):
    cell = load_cell()
    part = ROOT / "examples" / "test_piece.nc"
    program = write_krl(set_targets(read_gcode(part, cell), cell), tmp_path / "TEST.src", cell)
    header = header_of(program.texts["TEST.src"].decode("ascii").replace("\r\n", "\n"))
    assert [line for line in header if line.startswith(ASSUMED)] == [
        f"{ASSUMED}{look}"
        for look in (
            "the load on the display (Variable > Single, $LOAD) is that of the tool after the start",
            "the guard passes on this robot, and stops with another trafo_name in the cell",
        )
    ]


def test_every_row_says_what_it_rests_on():
    counts = Counter(each.sure for each in all_constructs())
    print(f"{len(all_constructs())} constructs: {dict(counts)}")
    assert set(counts) == {"right", "probable", "assumed"}
    assert len({each.name for each in all_constructs()}) == len(all_constructs())
    for each in all_constructs():
        assert each.relies, each.name
        assert set() < set(each.source) <= set(sources()), each.name
        assert bool(each.look) == (each.sure == "assumed"), each.name
        assert re.fullmatch(r"(KSS 8|RSI [345]|, )[\d. KSRI,]*", each.since), each.name
    assert {name for each in all_constructs() for name in each.source} == set(sources())


def test_the_page_is_made_from_the_table():
    """Else run docs/make_krl_truth.py."""
    assert make_krl_truth.PAGE.read_text(encoding="utf-8") == make_krl_truth.page()
