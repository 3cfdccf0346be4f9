"""Programs read beside LinuxCNC's interpreter: the draws are valid, and a difference is seen."""

import shutil
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.errors import Issue
from tests.conftest import ROOT, draws
from tests.reference.rs274 import rules
from tests.reference.rs274.beside import ENDLESS, Beside, by_us, difference, is_known
from tests.reference.rs274.draws import blocks, drawn, slipped

with_rs274 = pytest.mark.skipif(shutil.which("rs274") is None, reason="no rs274")


def rng(number):
    return np.random.default_rng([7, number])


@pytest.mark.parametrize("number", range(60))
def test_a_drawn_program_is_read(number):
    read, toolpath = by_us(drawn(rng(number)))
    assert read.refused == ""
    assert np.isfinite(toolpath.position_mm).all()


def unexplained(program, other):
    """Read a program twice; return how that ends, and what no rule explains."""
    ours, toolpath = by_us(program)
    theirs = other.read(program)
    if ours.refused and theirs.refused:
        return "both refuse", ""
    if not (ours.refused or theirs.refused):
        off = difference(toolpath, theirs.moves)
        known = not off or is_known(toolpath, theirs.moves)
        row = off and (rules.why_lost(program, off) or rules.why_unknown(program, known))
        return "both read", "" if row else off
    if ours.refused:
        row = rules.why_refused_here(ours.issue)
    else:
        row = "" if theirs.refused == ENDLESS else rules.why_refused_there(theirs.refused)
    return "one refuses", "" if row else f"{ours.refused or 'read'} here, {theirs.refused or 'read'} there"


@pytest.mark.slow
@with_rs274
def test_programs_slips_and_blocks_are_read_as_linuxcnc_reads_them(tmp_path):
    """Valid programs, one-letter slips of them, and random blocks."""
    other, ends, faults = Beside(tmp_path), Counter(), []
    for number in range(draws(600)):
        chance = rng(number)
        program, share = drawn(chance), chance.random()
        if share > 0.35:
            program = slipped(chance, program) if share < 0.8 else blocks(chance)
        end, fault = unexplained(program, other)
        ends[end] += 1
        if fault:
            faults.append(f"{number}: {fault}\n{program.decode('latin-1')}")
    assert not faults, "\n".join(faults[:5])
    assert min(ends["both read"], ends["both refuse"]) > 20


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
