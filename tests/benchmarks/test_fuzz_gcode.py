"""Programs read beside LinuxCNC's interpreter: the draws are valid, and a difference is seen."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import gcode_rules as rules
from gcode_beside_rs274 import Beside, by_us, difference
from gcode_draws import drawn

from gcode2krl.errors import Issue

ROOT = Path(__file__).resolve().parents[2]
with_rs274 = pytest.mark.skipif(shutil.which("rs274") is None, reason="no rs274")


def rng(number):
    return np.random.default_rng([7, number])


@pytest.mark.parametrize("number", range(60))
def test_a_drawn_program_is_read(number):
    read, toolpath = by_us(drawn(rng(number)))
    assert read.refused == ""
    assert np.isfinite(toolpath.position_mm).all()


def test_draws_are_of_many_kinds():
    text = b"".join(drawn(rng(number)) for number in range(200)).upper()
    words = b"G2 G3 G18 G19 G20 G91 G90.1 G93 G95 G83 G98 G10 G92 G52 G55 G43 G41.1 G28 G53".split()
    words += [b"M98", b"REPEAT", b"@", b"R-", b"ROUND[", b"O1001"]
    assert not [word for word in words if word not in text]


def test_every_rule_has_its_row():
    page = (ROOT / "docs" / "gcode.md").read_text(encoding="utf-8")
    table = page[page.index("## Where it differs from LinuxCNC") :]
    assert not [row for row in rules.rows() if row not in table]


def test_what_no_row_names_is_not_explained():
    assert rules.why_refused_here(Issue("error", "rotary-axis", 1, "B is a rotary axis"))
    assert not rules.why_refused_here(Issue("error", "arc-radius-mismatch", 1, "radii differ"))
    assert not rules.why_refused_here(
        Issue("error", "no-number", 1, "X is not followed by a number", excerpt="^XY")
    )
    assert not rules.why_refused_there("Unknown word starting with E | E")
    assert not rules.why_refused_there("runs without an end")


@with_rs274
def test_a_program_moves_alike_and_a_difference_is_seen(tmp_path):
    other = Beside(tmp_path)
    for number in range(8):
        program = drawn(rng(number))
        moves = other.read(program).moves
        _, toolpath = by_us(program)
        assert difference(toolpath, moves) == ""
        off = toolpath.position_mm + np.where(
            np.arange(len(toolpath))[:, None] == len(toolpath) - 1, 2e-6, 0.0
        )
        assert difference(replace(toolpath, position_mm=off), moves)
        assert difference(toolpath, moves[:-1])


@with_rs274
@pytest.mark.parametrize(
    ("text", "z_mm", "row"),
    [
        ("G20\nG43 H2\nG0 X0 Y0 Z1\nG21\nG49\nG0 X5\nM2\n", 25.4 + 25.5, "`G20 G43 H2`"),
        ("G21\nT1 M6\nG43\nG0 X0 Y0 Z5\nG43 H2\nT2 M6\nG0 X1\nM2\n", 5.0 + 10.0 - 25.5, "M6 behind a change"),
    ],
)
def test_where_rs274_loses_a_length_this_reader_does_not(tmp_path, text, z_mm, row):
    """The tip moves by the change of length, as the machine stands still; the tools of tool.tbl."""
    read, toolpath = by_us(text.encode())
    assert read.refused == ""
    assert toolpath.position_mm[-1, 2] == pytest.approx(z_mm)
    theirs = Beside(tmp_path).read(text.encode())
    off = difference(toolpath, theirs.moves)
    assert theirs.moves[-1]["end"][2] != pytest.approx(z_mm)
    assert rules.why_lost(text.encode(), off).startswith(row)
    assert not rules.why_lost(b"G21\nG0 Z5\nM2\n", off)


@with_rs274
def test_where_rs274_loses_a_rotation_at_m6_the_tip_stands_still(tmp_path):
    text = b"G21 G90\nG0 X10 Y5 Z0\nG10 L2 P1 R30\nT2 M6\nG0 Z1\nM2\n"
    _, toolpath = by_us(text)
    np.testing.assert_allclose(toolpath.position_mm[-1], [10, 5, 1], atol=1e-9)
    off = difference(toolpath, Beside(tmp_path).read(text).moves)
    assert rules.why_lost(text, off).startswith("M6 behind")
    moved = text.replace(b"R30\n", b"R30\nG0 X1 Y2\n")
    assert difference(by_us(moved)[1], Beside(tmp_path).read(moved).moves) == ""
    assert not rules.why_lost(moved, off)
