"""The same motion said in two ways is the same table: written and read, inches, G91, R, planes, loops."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.gcode import read

HEAD = "G21 G90 G17 G94 F500\nG0 X0 Y0 Z0\n"
MM_PER_INCH = 25.4
number = st.integers(-90_000, 90_000).map(lambda n: n / 1000)
point = st.tuples(number, number, number)
few = settings(max_examples=60, deadline=None)


def alike(one, other, mm=1e-9):
    """Assert that two toolpaths are the same motion."""
    np.testing.assert_allclose(one.position_mm, other.position_mm, rtol=0, atol=mm)
    np.testing.assert_allclose(one.feed_mm_s, other.feed_mm_s, rtol=1e-9)
    np.testing.assert_allclose(one.dwell_s, other.dwell_s, rtol=0, atol=1e-12)
    for column in ("rapid", "arc", "known", "machine", "exact_stop"):
        np.testing.assert_array_equal(getattr(one, column), getattr(other, column), err_msg=column)


# --- a table, written and read --------------------------------------------------------------------------

ROWS = st.lists(
    st.fixed_dictionaries(
        {
            "position": point,
            "feed": st.one_of(st.none(), st.integers(1, 9000)),  # none: rapid
            "dwell": st.sampled_from((0.0, 0.0, 0.25, 1.5)),
            "rpm": st.sampled_from((0, 800, -900, 12000)),
            "path": st.sampled_from(("G61", "G64", "G64 P0.05")),
            "tool": st.sampled_from((1, 2, 7)),
        }
    ),
    min_size=1,
    max_size=12,
)


def written(rows):
    """Return a program in which each row says its motion and its modes anew."""
    lines = ["G21 G90 G17 G94"]
    for row in rows:
        x, y, z = row["position"]
        spindle = f"S{abs(row['rpm'])} {'M4' if row['rpm'] < 0 else 'M3'}" if row["rpm"] else "M5"
        motion = "G0" if row["feed"] is None else f"G1 F{row['feed']}"
        lines += [f"T{row['tool']} M6", spindle, row["path"], f"{motion} X{x:.3f} Y{y:.3f} Z{z:.3f}"]
        lines += [f"G4 P{row['dwell']}"] if row["dwell"] else []
    return "\n".join(lines) + "\nM2\n"


@few
@given(ROWS)
def test_a_table_that_is_written_and_read_is_the_same_table(rows):
    rows = [
        {"position": (1.0, 2.0, 3.0), "feed": None, "dwell": 0.0, "rpm": 0, "path": "G61", "tool": 1},
        *rows,
    ]
    toolpath = read(written(rows))
    assert len(toolpath) == len(rows) + 1
    np.testing.assert_allclose(toolpath.position_mm[1:], [row["position"] for row in rows], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(toolpath.rapid[1:], [row["feed"] is None for row in rows])
    fed = [k for k, row in enumerate(rows, start=1) if row["feed"] is not None]
    np.testing.assert_allclose(toolpath.feed_mm_s[fed], [rows[k - 1]["feed"] / 60 for k in fed], rtol=1e-12)
    np.testing.assert_allclose(toolpath.dwell_s[1:], [row["dwell"] for row in rows])
    np.testing.assert_array_equal(toolpath.tool[1:], [row["tool"] for row in rows])
    np.testing.assert_allclose(
        toolpath.spindle_rad_s[1:], [row["rpm"] * math.tau / 60 for row in rows], rtol=1e-12
    )
    np.testing.assert_array_equal(toolpath.exact_stop[1:], [row["path"] == "G61" for row in rows])
    bounded = [0.05 if "P" in row["path"] else math.nan for row in rows]
    np.testing.assert_allclose(toolpath.tolerance_mm[1:], bounded)
    assert toolpath.known[1:].all()
    assert (toolpath.arc < 0).all()


# --- motions, and how they may be said -------------------------------------------------------------------


@st.composite
def motions(draw):
    """Draw straight moves and arcs: (code, end, centre, height), each in the plane's own axes."""
    moves, here = [], (0.0, 0.0, 0.0)
    for _ in range(draw(st.integers(1, 6))):
        code = draw(st.sampled_from((0, 1, 2, 3)))
        if code < 2:
            here = draw(point)
            moves.append((code, here, None))
            continue
        radius, begin = draw(st.integers(1, 50)), draw(st.integers(0, 359))
        sweep = draw(st.integers(5, 355))
        turned = begin + sweep if code == 3 else begin - sweep
        centre = [here[k] - radius * trig(math.radians(begin)) for k, trig in enumerate((math.cos, math.sin))]
        end = (
            *(centre[k] + radius * trig(math.radians(turned)) for k, trig in enumerate((math.cos, math.sin))),
            draw(number),
        )
        moves.append((code, end, (centre[0] - here[0], centre[1] - here[1], radius, sweep)))
        here = end
    return moves


def said(moves, axes="XYZ", unit_mm=1.0, incremental=False, by_radius=False):
    """Return the blocks of motions; the first two axes are those of the plane, the third the tool's."""
    centres, here, blocks = {"X": "I", "Y": "J", "Z": "K"}, (0.0, 0.0, 0.0), []
    for code, end, arc in moves:
        to = [a - b for a, b in zip(end, here, strict=True)] if incremental else end
        words = [f"{axis}{value / unit_mm:.9f}" for axis, value in zip(axes, to, strict=True)]
        if arc is not None and by_radius:
            words.append(f"R{arc[2] / unit_mm * (1 if arc[3] < 180 else -1):.9f}")
        elif arc is not None:
            words += [f"{centres[axes[k]]}{arc[k] / unit_mm:.9f}" for k in (0, 1)]
        blocks.append(f"G{code} {' '.join(words)}")
        here = end
    return "\n".join(blocks) + "\n"


def centres_absolute(moves):
    absolute, here = [], (0.0, 0.0)
    for code, end, arc in moves:
        absolute.append((code, end, arc and (arc[0] + here[0], arc[1] + here[1], *arc[2:])))
        here = end[:2]
    return "G90.1\n" + said(absolute)


WAYS = {
    "inches": lambda moves: (  # F counts in the unit before its block
        f"G20\nG90 G17 G94 F{500 / MM_PER_INCH:.12f}\nG0 X0 Y0 Z0\n{said(moves, unit_mm=MM_PER_INCH)}"
    ),
    "incremental": lambda moves: f"{HEAD}G91\n{said(moves, incremental=True)}",
    "absolute centres": lambda moves: HEAD + centres_absolute(moves),
}


@pytest.mark.parametrize("way", WAYS)
@few
@given(motions())
def test_motions_may_be_said_otherwise(way, moves):
    alike(read(HEAD + said(moves) + "M2\n"), read(WAYS[way](moves) + "M2\n"), mm=1e-6)


@few
@given(motions())
def test_an_arc_by_its_radius_is_the_arc_by_its_centre(moves):
    """Where both exist: at half a circle the side of the centre hangs on the last digit."""
    assume(all(arc is None or (15 < arc[3] < 345 and abs(arc[3] - 180) > 10) for *_, arc in moves))
    alike(read(HEAD + said(moves) + "M2\n"), read(HEAD + said(moves, by_radius=True) + "M2\n"), mm=1e-5)


@few
@given(motions(), st.sampled_from((("G18", "ZXY"), ("G19", "YZX"))))
def test_another_plane_is_the_same_motion_with_its_axes_exchanged(moves, plane):
    code, axes = plane
    turned = read(f"{HEAD}{code}\n{said(moves, axes)}M2\n")
    as_plain = turned.position_mm[:, ["XYZ".index(axis) for axis in axes]]
    alike(replace(turned, position_mm=as_plain), read(HEAD + said(moves) + "M2\n"))


# --- loops -----------------------------------------------------------------------------------------------


@few
@given(motions(), st.integers(0, 4))
def test_a_loop_is_its_turns_written_out(moves, turns):
    body = said(moves, incremental=True)
    plain = read(f"{HEAD}G91\n{body * turns}G0 X1\nM2\n")
    counted = f"{HEAD}G91\n#1 = 0\no1 while [#1 LT {turns}]\n{body}#1 = [#1 + 1]\no1 endwhile\nG0 X1\nM2\n"
    repeated = f"{HEAD}G91\no1 repeat [{turns}]\n{body}o1 endrepeat\nG0 X1\nM2\n"
    for text in (counted, repeated):
        alike(read(text), plain)
    if turns:
        done = f"{HEAD}G91\n#1 = 0\no1 do\n{body}#1 = [#1 + 1]\no1 while [#1 LT {turns}]\nG0 X1\nM2\n"
        called = f"{HEAD}G91\nM98 P1000 L{turns}\nG0 X1\nM2\nO1000\n{body}M99\n"
        subs = f"o1 sub\n{body}o1 endsub\n{HEAD}G91\n" + "o1 call\n" * turns + "G0 X1\nM2\n"
        for text in (done, called, subs):
            alike(read(text), plain)


@few
@given(motions(), motions(), st.booleans())
def test_the_branch_that_is_taken_is_the_program(first, second, taken):
    text = f"{HEAD}o1 if [{int(taken)} EQ 1]\n{said(first)}o1 else\n{said(second)}o1 endif\nM2\n"
    alike(read(text), read(HEAD + said(first if taken else second) + "M2\n"))


@few
@given(motions(), st.sampled_from(("G41.1", "G42.1")))
def test_a_contour_under_compensation_by_nothing_is_the_contour(moves, code):
    head, body, end = f"{HEAD}G0 X-150 Y-120\n", f"G1 X0 Y0\n{said(moves)}G40\n", "G1 X200 Y200\nM2\n"
    alike(read(f"{head}{code} D0\n{body}{end}"), read(head + body + end), mm=1e-6)
