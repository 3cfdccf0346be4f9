"""Arcs as CIRC: the circles that a controller would go along, against those of the G-code."""

import re

import numpy as np
import pytest

from gcode2krl import load_cell, predict, set_targets, write_krl
from gcode2krl.gcode import read_gcode
from gcode2krl.krl.read import read_texts
from gcode2krl.translation import Order, carry_out
from tests.cells import over_demonstration
from tests.conftest import draws
from tests.krl.conftest import verified

HEAD = "G21 G90 G94 G17\nT1 M6\nS10000 M3\nG0 G43 H1 X0 Y0 Z40\nG1 Z0 F3000\n"
END = "G0 Z60\nM5\nM30\n"
PLANES = {"G17": (0, 1, "IJ"), "G18": (2, 0, "KI"), "G19": (1, 2, "JK")}
"""First and second axis, so that G3 turns from the first to the second; the words of the centre."""
OFF_MM = 0.005
ARCS = "G2 X40 Y0 I20 J0\nG1 X60\nG3 X60 Y0 I0 J15\nG1 X90\n"
LINE = re.compile(r"(LIN|CIRC) (?:\{X (\S+),Y (\S+),Z (\S+)\},)?\{X (\S+),Y (\S+),Z ([-\d.]+)")


def cell_with_arcs(**more):
    controller = {"circ": True, **more.pop("controller", {})}
    return over_demonstration({"controller": controller, **more})


def random_arcs(rng, count=8):
    """Return G-code of arcs one behind the other, and start, centre, axis and turn of each."""
    at, lines, arcs = np.zeros(3), [], []
    for _ in range(count):
        plane = rng.choice(list(PLANES))
        first, second, words = PLANES[plane]
        radius, begin = rng.uniform(1, 25), rng.uniform(0, 2 * np.pi)
        turn = rng.uniform(0.3, 2 * np.pi - 0.05) if rng.random() < 0.7 else 2 * np.pi
        sign = rng.choice([-1, 1])
        centre, end = at.copy(), at.copy()
        centre[[first, second]] -= radius * np.array([np.cos(begin), np.sin(begin)])
        end[[first, second]] = centre[[first, second]] + radius * np.array(
            [np.cos(begin + sign * turn), np.sin(begin + sign * turn)]
        )
        end = np.round(end, 4)
        offset = (centre - at)[[first, second]]
        places = "".join(f" {axis}{value:.4f}" for axis, value in zip("XYZ", end, strict=True))
        middle = "".join(f" {word}{value:.6f}" for word, value in zip(words, offset, strict=True))
        lines.append(f"{plane} G{3 if sign > 0 else 2}{places}{middle}")
        arcs.append((at.copy(), centre, (first, second), begin, sign * turn, radius))
        at = end
        if rng.random() < 0.5:
            at = np.round(at + rng.uniform(-15, 15, 3) * [1, 1, 0.3], 4)
            lines.append("G1" + "".join(f" {axis}{value:.4f}" for axis, value in zip("XYZ", at, strict=True)))
    return "\n".join(lines) + "\n", arcs


def circle_points(start, via, end, count=60):
    """Return points from the first to the last of three, by way of the second: solved as linear equations."""
    a, b = via - start, end - start
    normal = np.cross(a, b)
    centre = start + np.linalg.solve(np.stack([a, b, normal]), [a @ a / 2, b @ b / 2, 0.0])
    x = start - centre
    y = np.cross(normal / np.linalg.norm(normal), x)
    angle = np.arctan2((end - centre) @ y, (end - centre) @ x) % (2 * np.pi)
    share = np.linspace(0, angle, count)[:, None]
    return centre + np.cos(share) * x + np.sin(share) * y


@pytest.fixture
def translated(tmp_path):
    def translated(text, cell=None, **options):
        part = tmp_path / "part.nc"
        part.write_text(HEAD + text + END, encoding="ascii")
        cell = cell_with_arcs() if cell is None else cell
        toolpath = read_gcode(part, cell)
        program = write_krl(set_targets(toolpath, cell), tmp_path / "ARC.src", cell, **options)
        return program, toolpath, cell

    return translated


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 4 + draws(8)))]
)
def test_random_arcs_go_where_the_g_code_goes(translated, seed):
    text, arcs = random_arcs(np.random.default_rng(seed))
    program, toolpath, cell = translated(text, cell_with_arcs(clearance={"z_mm": 400}))
    source = program.texts["ARC.src"].decode()
    assert verified(program.files[0], toolpath, cell).ok
    assert program.report.max_deviation_mm < OFF_MM
    turned = np.zeros(len(arcs))
    at = None
    for kind, *numbers in LINE.findall(source):
        end = np.array(numbers[3:], dtype=float)
        if kind == "CIRC":
            points = circle_points(at, np.array(numbers[:3], dtype=float), end)
            turned += np.array([_turn_on(points, arc) for arc in arcs])
            assert np.isfinite([_turn_on(points, arc) for arc in arcs]).any()
            assert any(_is_on(points, arc) for arc in arcs)
        at = end
    wanted = np.array([arc[4] for arc in arcs])
    as_circ = np.abs(turned) > 1e-6
    np.testing.assert_allclose(turned[as_circ], wanted[as_circ], atol=2e-3)
    assert as_circ.mean() > 0.8  # short ones of few chords stay LIN


def _is_on(points, arc):
    return _turn_on(points, arc) != 0.0


def _turn_on(points, arc):
    """Return by how much points turn along an arc of the G-code, 0 where they are not on it."""
    start, centre, (first, second), begin, turn, radius = arc
    level = ({0, 1, 2} - {first, second}).pop()
    off = np.abs(np.hypot(*(points - centre)[:, [first, second]].T) - radius)
    if (off > OFF_MM).any() or (np.abs(points[:, level] - start[level]) > OFF_MM).any():
        return 0.0
    angle = np.unwrap(np.arctan2(*(points - centre)[:, [second, first]].T))
    along = (angle - begin) * np.sign(turn)
    inside = ((along + 1e-3) % (2 * np.pi)) <= abs(turn) + 2e-3
    return float(angle[-1] - angle[0]) if inside.all() else 0.0


def test_one_motion_instead_of_many_with_the_same_speed(translated):
    program, _, _ = translated(ARCS)
    source = program.texts["ARC.src"]
    plain = translated(ARCS, load_cell())[0].texts["ARC.src"]
    assert source.count(b"CIRC {") == 5  # half a circle in two, a full one in three
    assert b"$CIRC_TYPE=#BASE\r\n" in source
    assert b"5 arcs as CIRC" in source
    assert len(source) < 0.7 * len(plain)
    assert b"CIRC" not in plain
    (note,) = [issue for issue in program.issues if issue.code == "circ"]
    assert note.message.startswith("5 CIRC instead of ")
    read = read_texts({"ARC.src": source}, "ARC.src")
    assert len(read.circ_rows) == 5
    np.testing.assert_allclose(read.speed_mm_s[read.circ_rows], 50.0)


@pytest.mark.parametrize(
    "text",
    [
        "G2 X40 Y0 Z-5 I20 J0\n",  # a helix is no circle
        "G2 X0.1 Y0.1 I0.05 J0.05\n",  # too small
        "G1 X10\nG1 X20\nG1 X30\nG1 X40\n",
    ],
)
def test_what_is_no_circle_stays_lin(translated, text):
    program, toolpath, cell = translated(text)
    assert b"CIRC" not in program.texts["ARC.src"]
    assert verified(program.files[0], toolpath, cell).ok


def circ_line(source):
    return next(line for line in source.split("\r\n") if line.startswith("CIRC"))


@pytest.mark.parametrize(
    ("pattern", "other"),
    [
        (r"CIRC \{X (\S+),Y (\S+),", r"CIRC {X \1,Y -\2,"),  # the other way around
        (r"CIRC \{X (\d+)", r"CIRC {X 1\1"),
        (r"CIRC \{[^}]*\},", "LIN "),
        (r"CIRC \{X [^,]+,", "CIRC {"),
        (r"C_DIS", ""),
    ],
)
def test_a_changed_arc_is_found(translated, pattern, other):
    program, toolpath, cell = translated(ARCS)
    file = program.files[0]
    source = file.read_bytes().decode()
    line = circ_line(source)
    changed = re.sub(pattern, other, line, count=1)
    assert changed != line
    file.write_bytes(source.replace(line, changed, 1).encode())
    report = verified(file, toolpath, cell)
    assert not report.ok
    number = source[: source.index(line)].count("\n") + 1
    assert any(issue.line == number for issue in report.issues if issue.severity == "error")


def test_an_arc_that_leaves_its_targets_is_named(translated):
    program, toolpath, cell = translated(ARCS)
    file = program.files[0]
    source = file.read_bytes().decode()
    line = circ_line(source)
    file.write_bytes(source.replace(line, re.sub(r",Y (\S+),", r",Y -\1,", line, count=1), 1).encode())
    issues = verified(file, toolpath, cell).issues
    found = [issue.line for issue in issues if issue.code == "krl-motion-unknown"]
    assert found[0] == source[: source.index(line)].count("\n") + 1


def test_another_kind_of_orientation_is_found(translated):
    program, toolpath, cell = translated(ARCS)
    file = program.files[0]
    file.write_bytes(file.read_bytes().replace(b"#BASE\r\n$IPO", b"#PATH\r\n$IPO"))
    assert not verified(file, toolpath, cell).ok


def test_statements_between_arcs_stay_where_they_are(translated):
    program, toolpath, cell = translated(ARCS + "M8\nG2 X60 Y30 R30\nG4 P0.5\nG3 X30 Y0 R30\nM9\n")
    assert verified(program.files[0], toolpath, cell).ok
    source = program.texts["ARC.src"].decode()
    assert re.search(r"CIRC [^\n]*\}\r\nWAIT SEC 0\.500", source)


@pytest.mark.parametrize("split", ["defs", "files"])
def test_parts_of_a_long_program(translated, split):
    cell = cell_with_arcs(program={"max_lines": 100})
    program, toolpath, cell = translated(f"{ARCS}G1 X0 Y0\n" * 5, cell, split=split)
    whole = b"".join(program.texts[name] for name in program.texts)
    assert whole.count(b"CIRC {") >= 8
    assert verified(program.files[0], toolpath, cell).ok


def test_a_pilot_force_and_arcs(tmp_path):
    """The default pilot force is left out for the arcs; one that is asked for by name keeps the chords."""
    part = tmp_path / "part.nc"
    part.write_text(HEAD + "G1 Z-1\n" + ARCS + END, encoding="ascii")
    prediction = predict(part, cell_with_arcs())
    program = write_krl(prediction, tmp_path / "A.src")
    assert program.pilot is None
    assert b"CIRC {" in program.texts["A.src"]
    named = write_krl(prediction, tmp_path / "B.src", pilot="index")
    assert named.pilot is not None
    assert b"CIRC" not in named.texts["B.src"]
    assert "circ-left-out" in {issue.code for issue in named.issues}


def test_the_command(tmp_path):
    part, cell = tmp_path / "part.nc", tmp_path / "cell.toml"
    part.write_text(HEAD + ARCS + END, encoding="ascii")
    cell.write_text('based_on = "demonstration"\n[controller]\ncirc = true\n', encoding="utf-8")
    attempt = carry_out(Order(part, tmp_path / "C.src", cell_path=cell, no_forces=True))
    assert attempt.exit_code == 0
    assert (tmp_path / "C.src").read_bytes().count(b"CIRC {") == 5
    assert attempt.record["verify"]["ok"]


def test_names_that_begin_like_a_circ_are_none():
    text = b"DEF A( )\r\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\r\nCIRC_PUMP=TRUE\r\nCIRCLES( )\r\nEND\r\n"
    read = read_texts({"A.src": text}, "A.src")
    assert [each.text for each in read.statements] == ["CIRC_PUMP=TRUE", "CIRCLES( )"]
    assert not read.issues
