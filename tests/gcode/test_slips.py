"""Usual slips of hand-written code and of posts are named, each with a remedy that helps."""

import pytest

from tests.gcode import Control

SLIPS = Control("G21 G90 G17\nG0 X0 Y0 Z5\nG1 Z-1 F300\n", "G0 Z5\nM2")


@pytest.mark.parametrize(
    ("block", "says", "remedy", "mended"),
    [
        ("G1 X1O Y5", "the letter O stands in the number of X", "X10", "G1 X10 Y5"),
        ("G1 XO.5", "the letter O stands in the number of X", "X0.5", "G1 X0.5"),
        ("g1 x1o5", "the letter O stands", "X105", "g1 x105"),
        ("G1 Xl", "the letter l stands in the number of X", "digit 1", "G1 X1"),
        ("G1 X--1", "two signs", "one sign", "G1 X-1"),
        ("G1 X1E-3", "exponent", "0.001", "G1 X0.001"),
        ("G1 X10 E5", "E is not a word", "extruder", "G1 X10"),
        ("G1 X10 $", "character '$'", "command to the control", "G1 X10"),
        ("G1\u00a0X10", "NO-BREAK SPACE", "plain blank", "G1 X10"),
        ("G2 X20 Y0 I-10", "signs of I, J, K reversed", "from the start to the centre", "G2 X20 Y0 I10"),
        ("G2 X20 Y0 J10", "centre words exchanged", "which axis", "G2 X20 Y0 I10"),
        ("G2 X20 Z-1 I10 K0", "K0 is not in the plane of this arc (G17)", "plane", "G18 G2 X20 Z-1 I10 K0"),
        ("G2 X20 Z-2 I10 K3", "K3 is not in the plane", "plane", "G2 X20 Z-2 I10"),
    ],
)
def test_a_slip_is_named_and_its_remedy_helps(block, says, remedy, mended):
    (found,) = SLIPS.errors(block)
    assert found.line == 1
    assert says in found.message
    assert remedy in found.remedy
    assert not SLIPS.errors(mended)


@pytest.mark.parametrize("block", ["G2 X20 Y0 I3", "G2 X20 Y0 I10.2 J0.7"])
def test_an_arc_that_fits_in_no_way_gets_no_hint(block):
    (found,) = SLIPS.errors(block)
    assert found.code == "arc-radius-mismatch"
    assert "radii fit" not in found.message


def test_a_zero_across_the_plane_is_no_slip_where_the_plane_is_named():
    assert not SLIPS.errors("G2 X20 Y0 Z-2 I10 J0 K0")
    assert not SLIPS.errors("G2 X20 Z-2 I10 J0 K0")
    assert not SLIPS.errors("G2 X20 I10 K0")
