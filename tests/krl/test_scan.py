"""The scanner of KRL text: what each form of a statement becomes, and that chunks change nothing."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import gcode2krl
from gcode2krl import krl_words as w
from gcode2krl.krl.scan import scan_krl

NAN = np.nan


def one(text):
    """Return kind, blending and numbers of the only statement of a text."""
    scanned = scan_krl(text)
    assert len(scanned.kind) == 1
    return int(scanned.kind[0]), int(scanned.blend[0]), np.concatenate([scanned.pose, scanned.value])[0]


@pytest.mark.parametrize(
    ("text", "kind", "blend", "value"),
    [
        (b"LIN {X 1,Y -2.5,Z +.5,A 4,B 5,C 6} C_DIS", w.KIND_LIN, 1, [1, -2.5, 0.5, 4, 5, 6]),
        (b"\t lin{ c -0 , x\t1. }c_dis;text", w.KIND_LIN, 1, [1, NAN, NAN, NAN, NAN, -0.0]),
        (b"PTP {X 1,S 2,T 35}", w.KIND_PTP, 0, [1, NAN, NAN, NAN, NAN, NAN, 2, 35]),
        (b"PTP {A1 10,A6 -60}", w.KIND_PTP_AXES, 0, [10, NAN, NAN, NAN, NAN, -60]),
        (b"$vel.cp = 0.25 ; text", w.KIND_VEL_CP, 0, [0.25]),
        (b"$APO.CDIS=1", w.KIND_APO_CDIS, 0, [1]),
        (b"WAIT  SEC 0.5 ; Dwell", w.KIND_WAIT_SEC, 1, [0.5]),
        (b"WAIT SEC 0.5 ; another", w.KIND_WAIT_SEC, 0, [0.5]),
        (b"WAIT FOR $IN[1]", w.KIND_OTHER, 0, []),
    ],
)
def test_a_statement_is_its_numbers(text, kind, blend, value):
    expected = np.full(w.STATEMENT_COLUMNS, NAN)
    expected[: len(value)] = value
    read = one(text + b"\r\n")
    assert read[:2] == (kind, blend)
    np.testing.assert_array_equal(read[2], expected)
    assert np.signbit(read[2]).tolist() == np.signbit(expected).tolist()


@pytest.mark.parametrize(
    "text",
    [
        b"LIN {X 1",
        b"LIN {X 1,}",
        b"LIN {X 1,X 2}",
        b"LIN {X1}",
        b"LIN {A1 5}",
        b"LIN {X --1}",
        b"LIN {X 1.2.3}",
        b"LIN {X 1e3}",
        b"LIN {X 1234567890.123456}",  # 16 digits are more than a double holds
        b"LIN {X 1} C_PTP",
        b"LIN",
        b"PTP {X 1,A2 5}",
        b"$VEL.CP",
        b"$VEL.CP 0.1",
        b"$APO.CDIS=",
        b"WAIT SEC",
        b"WAIT SEC 1 2",
    ],
)
def test_a_motion_or_setting_that_cannot_be_read_is_malformed(text):
    assert one(text)[1] == w.MALFORMED


def test_fifteen_digits_are_read_exactly():
    for digits in ("123456789012345", "0.12345678901234", "12345678.9012345"):
        assert one(b"WAIT SEC " + digits.encode("ascii"))[2][0] == float(digits)


def test_a_trigger_is_its_numbers_and_the_place_of_its_name():
    text = b"; before\nTRIGGER WHEN DISTANCE=0 DELAY=-7 DO GK_PILOT (1,-2.5,3,4) PRIO=-1"
    kind, does, value = one(text)
    assert (kind, does) == (w.KIND_TRIGGER, w.CALLS)
    assert value.tolist() == [0, -7, 1, -2.5, 3, 4, text.index(b"GK_PILOT"), len("GK_PILOT")]
    kind, does, value = one(b"trigger when distance = 1 delay = 5 do $SEN_PINT[1] = 8 ; text")
    assert (kind, does) == (w.KIND_TRIGGER, w.ASSIGNS)
    assert value[:3].tolist() == [1, 5, 8]


@pytest.mark.parametrize(
    "text",
    [
        b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO",
        b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO =1",
        b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO A(1,2,3) PRIO=-1",
        b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO A(1,2,3,4) PRIO=2",
        b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO A=1 B",
        b"TRIGGER WHEN PATH=0 DELAY=1 DO A=1",
    ],
)
def test_a_trigger_of_another_form_is_another_statement(text):
    assert one(text)[0] == w.KIND_OTHER


def test_lines_without_a_statement_are_counted_and_left_out():
    text = b"&ACCESS\r\n;FOLD A\r\n\r\n \t\r\nLIN {X 1}\r\n; text\r\n  HALT \r\nEND"
    scanned = scan_krl(text)
    assert scanned.line.tolist() == [5, 7, 8]
    assert scanned.open_folds == 1
    assert scanned.pose[:, 0].tolist() == [1]
    assert [text[a:b] for a, b in scanned.span.tolist()] == [b"HALT", b"END"]


def test_the_first_line_too_long_and_the_first_that_is_not_ascii():
    good, longest = b"HALT\r\n", b";" + b"x" * (w.LONGEST_LINE - 1) + b"\r\n"
    assert scan_krl(good + longest).too_long == 0
    text = good + longest[:1] + longest + b"; \xe4\r\n" + b"\xff" + longest + b"x" * 600
    assert (scan_krl(text).too_long, scan_krl(text).not_ascii) == (2, 3)


@pytest.mark.parametrize("chunk_bytes", [1, 7, 64, 1000, 10**6])
@pytest.mark.parametrize("end", [b"", b"\n", b"\n\n", b"\r"])
def test_chunks_change_nothing(chunk_bytes, end):
    lines = [b";FOLD", b"LIN {X 1,Y 2} C_DIS", b"", b"x" * 500, b"$VEL.CP=1", b"; \xe4", b"HALT"]
    text = b"\r\n".join(lines * 20) + end
    whole, cut = scan_krl(text), scan_krl(text, chunk_bytes)
    for expected, found in zip(whole, cut, strict=True):
        np.testing.assert_array_equal(found, expected)
    assert whole.line[-1] == 140
    assert (whole.too_long, whole.not_ascii, whole.open_folds) == (4, 6, 20)


def test_a_text_without_a_line():
    scanned = scan_krl(b"")
    assert len(scanned.kind) == 0
    assert scanned[6:9] == (0, 0, 0)
    assert len(scanned.external) == 0


PACKAGE = Path(gcode2krl.__file__).parent
NATIVE = PACKAGE.parent / "native"
WRITERS = {"composition", "number_text", "statements", "pilot_text", "rsi_text", "write", "provenance"}
READING = ("scan.c", "letters.h", "motion.h", "statement.h", "statement.c", "columns.c")
"""What reads a program back in the core."""


def nodes(file, kind):
    """Return the nodes of a kind in a file of the package."""
    tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kind)]


@pytest.mark.parametrize("file", ["krl/scan.py", "krl/read.py", "krl/executed.py"])
def test_reading_back_imports_nothing_of_the_writer(file):
    modules = {(node.module or "").split(".")[-1] for node in nodes(file, ast.ImportFrom)}
    names = {alias.name for node in nodes(file, ast.ImportFrom) for alias in node.names}
    assert (modules | names) & WRITERS == set()


@pytest.mark.skipif(not NATIVE.exists(), reason="no sources beside the installed package")
@pytest.mark.parametrize("file", READING)
def test_the_core_reads_back_without_the_writer(file):
    included = re.findall(r'#include "(.*)"', (NATIVE / "krl" / file).read_text(encoding="utf-8"))
    own = {f"krl/{name}" for name in READING if name.endswith(".h")}
    assert set(included) <= {"core.h", "constants.h"} | own
