"""Polar words: equal to X and Y worked out from them; refused where they have no meaning."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.gcode import Control, read

POLAR = Control("G21 G90 G17\nF100\nG0 X1 Y2 Z10\n")
distance = st.integers(1, 50)
angle = st.integers(-400, 400)


toolpath = POLAR.read


def found(text):
    """Return the code, the line and the quoted block of each error."""
    return [(issue.code, issue.line, issue.excerpt) for issue in POLAR.errors(text)]


@given(st.lists(st.tuples(distance, angle), min_size=1, max_size=5))
@settings(max_examples=40, deadline=None)
def test_polar_words_equal_x_and_y(points):
    polar = toolpath("\n".join(f"G1 @{r} ^{a}" for r, a in points))
    expected = [(r * math.cos(math.radians(a)), r * math.sin(math.radians(a)), 10.0) for r, a in points]
    np.testing.assert_allclose(polar.position_mm[2:], expected, atol=1e-9)
    assert polar.is_position()[1:].all()


@given(st.lists(st.tuples(distance, angle), min_size=2, max_size=5))
@settings(max_examples=40, deadline=None)
def test_incremental_polar_words_add_up(points):
    (r, a), *others = points
    text = [f"G1 @{r} ^{a}", "G91"]
    expected = []
    for dr, da in others:
        r, a = r + dr, a + da
        text.append(f"@{dr} ^{da}")
        expected.append((r * math.cos(math.radians(a)), r * math.sin(math.radians(a)), 10.0))
    np.testing.assert_allclose(toolpath("\n".join(text)).position_mm[3:], expected, atol=1e-8)


def test_holes_on_a_circle():
    table = toolpath("G99 G0 @20 ^0\nG91 G81 ^60 Z-12 R-8 L6")
    bottom = table.position_mm[table.position_mm[:, 2] == -10]
    np.testing.assert_allclose(np.hypot(bottom[:, 0], bottom[:, 1]), 20.0)
    turned = np.degrees(np.diff(np.unwrap(np.arctan2(bottom[:, 1], bottom[:, 0]), period=2 * np.pi)))
    np.testing.assert_allclose(turned, 60.0)
    assert bottom[0].tolist() == pytest.approx([10.0, 20.0 * math.sin(math.pi / 3), -10.0])


@pytest.mark.parametrize(
    ("text", "code", "excerpt"),
    [
        ("G0 X1 @3", "polar-and-axis", "G0 X1 ^@3"),
        ("G0 X0 Y0 @3", "polar-and-axis", "G0 X0 Y0 ^@3"),
        ("G18 G0 ^3 @1", "polar-plane", "G18 G0 ^^3 @1"),
        ("G53 G0 @3", "polar-and-axis", "G53 G0 ^@3"),
        ("G0 @3 @4", "repeated-word", "G0 @3 ^@4"),
        ("G0 ^", "no-number", "G0 ^^"),
        ("G28 ^3", "unused-word", "G28 ^^3"),
        ("M8 @3", "no-motion-mode", None),
    ],
)
def test_what_has_no_meaning_is_refused(text, code, excerpt):
    issues = found("G80\n" + text)
    assert [issue[:2] for issue in issues] == [(code, 2)]
    assert excerpt is None or issues[0][2] == excerpt


@pytest.mark.parametrize("word", ["@5", "^30", "G91 @5 ^30"])
def test_from_the_zero_a_single_word_leads_nowhere(word):
    assert POLAR.refused(f"G0 X0 Y0\nG1 {word}") == ("polar-zero", 2)


def test_a_single_polar_word_from_an_unknown_position_is_unknown():
    assert read("G21 G0 X5 Z3\n@7\n@7 ^30\nM2\n").known[2:].tolist() == [[0, 0, 1], [1, 1, 1]]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("G5 X1 Y1 I1 J1 P1 Q1", "cubic"),
        ("G5.1 X1 Y1 I1 J1", "quadratic"),
        ("G5.2 X1 Y1 P1", "NURBS"),
        ("G6 X1 Y1 I1 J1 P1 Q1", "spline"),
        ("G6.2 X1 Y1 P1", "NURBS"),
        ("G7", "diameter"),
        ("G8", "radius"),
        ("G33 Z-1 K1", "follow the turning"),
        ("G33.1 Z-1 K1", "rigid tapping"),
        ("G38.2 Z-1", "probing"),
        ("G38.5 Z-1", "probing"),
        ("G70 Q1", "finishing"),
        ("G71.2 Q1", "along"),
        ("G72 Q1", "across"),
        ("G76 P1 Z-1 I1 J1 K1", "threading"),
        ("G96 D100 S30", "lathe"),
    ],
)
def test_what_is_never_read_says_why(code, words):
    (issue,) = POLAR.errors(code)
    assert (issue.code, issue.line) == ("unsupported-g", 1)
    assert words in issue.message
    assert issue.remedy


def test_polar_words_take_expressions():
    table = toolpath("#1=10\nG0 @[#1] ^[3*#1]\n@#1 ^-[#1]")
    plain = toolpath("G0 @10 ^30\n@10 ^-10")
    np.testing.assert_array_equal(table.position_mm, plain.position_mm)


@pytest.mark.parametrize("block", ["G1 @[2] X1", "G1 @[1+1] Y[1]"])
def test_expressions_beside_an_axis_are_refused(block):
    assert found(block) == [("polar-and-axis", 1, f"G1 ^{block[3:]}")]
