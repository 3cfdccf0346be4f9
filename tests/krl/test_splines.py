"""Chains of short moves as SPLINE blocks: the points that a controller would pass, and what is between."""

import re

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from gcode2krl import predict, read_gcode, set_targets, write_krl
from gcode2krl.program.splines import FEWEST, OFF_MM, splines_of
from gcode2krl.runkit.accepted import read_program
from tests.cells import over_demonstration
from tests.conftest import draws
from tests.krl.conftest import verified

HEAD = "G21 G90 G94 G17\nT1 M6\nS10000 M3\nG0 G43 H1 X0 Y0 Z40\nG0 Z5\nG1 Z0 F800\n"
END = "G0 Z60\nM5\nM30\n"
POINT = re.compile(r"(LIN|SPL) \{X (\S+),Y (\S+),Z ([-\d.]+)")


def cell_with_splines(**controller):
    return over_demonstration({"controller": {"spline": True, **controller}})


def wave(count=60, feed=2000, length=60.0, height=3.0):
    x = np.linspace(0.0, length, count + 1)[1:]
    y = height * np.sin(x / length * 2.0 * np.pi)
    lines = [f"G1 X{a:.4f} Y{b:.4f}" for a, b in zip(x, y, strict=True)]
    return f"F{feed}\n" + "\n".join(lines) + "\n"


def random_curve(rng):
    """Moves along a smooth curve in space, with corners and straight pieces between."""
    at, heading, lines = np.array([0.0, 0.0, 0.0]), 0.0, [f"F{rng.integers(800, 4000)}"]
    for _ in range(rng.integers(2, 6)):
        bend, step = rng.uniform(-0.12, 0.12), rng.uniform(0.2, 1.5)
        for _ in range(rng.integers(3, 80)):
            heading += bend * min(step, 1.0)
            at = at + step * np.array([np.cos(heading), np.sin(heading), rng.uniform(-0.02, 0.02)])
            lines.append(f"G1 X{at[0]:.4f} Y{at[1]:.4f} Z{at[2]:.4f}")
        heading += rng.uniform(-2.5, 2.5)
    return "\n".join(lines) + "\n"


@pytest.fixture
def translated(tmp_path):
    def translated(text, cell=None):
        part = tmp_path / "part.nc"
        part.write_text(HEAD + text + END, encoding="ascii")
        cell = cell_with_splines() if cell is None else cell
        toolpath = read_gcode(part, cell)
        program = write_krl(set_targets(toolpath, cell), tmp_path / "SPLINES.src", cell, toolpath=toolpath)
        return program, toolpath, cell

    return translated


def blocks_in(program):
    """The points of each block, with the one before it, as they are written."""
    blocks, at, inside = [], None, False
    for line in program.texts["SPLINES.src"].decode("ascii").splitlines():
        if line == "SPLINE":
            blocks.append([at])
            inside = True
        elif line == "ENDSPLINE":
            inside = False
        elif found := POINT.match(line):
            assert (found[1] == "SPL") == inside
            at = np.array([float(value) for value in found.groups()[1:]])
            if inside:
                blocks[-1].append(at)
        else:
            assert not inside or line.startswith("; line")
    return [np.array(block) for block in blocks]


def test_a_chain_becomes_a_block_that_begins_and_ends_at_rest(translated):
    program, toolpath, cell = translated(wave())
    (block,) = blocks_in(program)
    assert len(block) > 55
    targets = program.targets
    (chain,) = splines_of(targets, False)
    assert targets.cdis_mm[chain.first - 1] == targets.cdis_mm[chain.end] == 0.0
    assert (targets.cdis_mm[chain.first : chain.end] > 0.0).all()
    assert np.abs(block[1:] - targets.position_mm[chain.first : chain.end + 1]).max() <= 0.0005 + 1e-9
    assert program.report.ok
    assert verified(program.files[0], toolpath, cell).ok
    assert "spline" in {issue.code for issue in program.issues}


def test_without_the_word_nothing_changes(translated):
    plain, _, _ = translated(wave(), over_demonstration())
    assert b"SPL {" not in plain.texts["SPLINES.src"]


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 4 + draws(8)))]
)
def test_random_programs_are_read_back_and_stay_near_their_chords(seed, translated):
    """Between the points: the cubic spline, and the one of Akima that bends where its points do."""
    rng = np.random.default_rng(seed)
    program, toolpath, cell = translated("".join(random_curve(rng) for _ in range(2)))
    assert program.report.max_deviation_mm <= 0.005
    report = verified(program.files[0], toolpath, cell)
    assert report.ok, report.issues
    assert report.max_deviation_mm <= 0.005
    for block in blocks_in(program):
        assert len(block) >= FEWEST
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(block, axis=0), axis=1))])
        for curve in (CubicSpline(way, block), Akima1DInterpolator(way, block)):
            for k in range(len(block) - 1):
                along = block[k + 1] - block[k]
                off = curve(np.linspace(way[k], way[k + 1], 15)) - block[k]
                across = off - np.outer(off @ along, along) / (along @ along)
                assert np.linalg.norm(across, axis=1).max() < OFF_MM


def test_a_corner_a_change_of_feed_and_an_event_end_a_block(translated):
    straight = "".join(f"G1 X{k}\n" for k in range(1, 13))
    up = "".join(f"G1 Y{k}\n" for k in range(1, 13))
    faster = "F900\n" + "".join(f"G1 Y{k}\n" for k in range(13, 25))
    wet = "M8\n" + "".join(f"G1 Y{k}\n" for k in range(25, 37))
    program, _, _ = translated("F600\n" + straight + up + faster + wet)
    assert [len(block) - 1 for block in blocks_in(program)] == [12, 12, 12, 12]


def test_arcs_go_first_where_both_are_asked_for(translated):
    text = "F1000\nG2 X40 Y0 I20 J0\n" + "".join(f"G1 X{40 + k} Y{0.02 * k * k:.4f}\n" for k in range(1, 20))
    program, toolpath, cell = translated(text, cell_with_splines(circ=True))
    source = program.texts["SPLINES.src"]
    assert source.count(b"\r\nCIRC ") >= 1
    assert source.count(b"\r\nSPLINE\r\n") == 1
    assert verified(program.files[0], toolpath, cell).ok


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("ENDSPLINE\r\n", "", "krl-structure"),
        ("SPLINE\r\nSPL", "SPL", "krl-structure"),
        ("SPL {X 3.000", "$OUT[1]=TRUE\r\nSPL {X 3.000", "krl-structure"),
        ("ENDSPLINE\r\n", "ENDSPLINE C_SPL\r\n", "krl-structure"),
        ("SPL {X 3.000,Y 0.927", "SPL {X 3.000,Y 0.947", "verify-position"),
        ("SPL {X 3.000,Y 0.927", "LIN {X 3.000,Y 0.927", "krl-structure"),
        ("SPL {X 3.000,Y 0.927,Z 0.000", "SPL {X 3.000,Y 0.927,Q 0.000", "krl-malformed"),
    ],
)
def test_an_edited_block_is_told(old, new, code, translated):
    program, toolpath, cell = translated(wave())
    file = program.files[0]
    text = file.read_bytes().decode("ascii")
    assert old in text
    file.write_bytes(text.replace(old, new, 1).encode("ascii"))
    report = verified(file, toolpath, cell)
    assert not report.ok
    assert code in {issue.code for issue in report.issues}


def test_the_stops_are_in_the_predicted_motion(translated, tmp_path):
    program, _, cell = translated(wave())
    prediction = predict(tmp_path / "part.nc", cell, forces=False)
    chain = splines_of(prediction.targets, False)[0]
    for row in (chain.first - 1, chain.end):
        off = np.linalg.norm(prediction.motion.position_mm - prediction.targets.position_mm[row], axis=1)
        assert prediction.motion.speed_mm_s[np.argmin(off)] < 1.0
    assert read_program(program.files[0], cell).targets.cdis_mm[chain.end] == 0.0
