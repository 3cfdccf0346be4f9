"""The G-code reader against LinuxCNC's own interpreter (see tests/reference/rs274)."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import Cell, Gcode2KrlError, read_gcode
from gcode2krl.cell.sections import Frame

REFERENCE = Path(__file__).parents[1] / "reference" / "rs274"
EXPECTED = json.loads((REFERENCE / "expected.json").read_text(encoding="ascii"))
OFFSETS = json.loads((REFERENCE / "offsets.json").read_text(encoding="ascii"))
SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
AXES = {"xy": (0, 1, 2), "zx": (2, 0, 1), "yz": (1, 2, 0)}  # first, second, normal

ACCEPTED_HERE = {
    "g43_unknown_tool": "tool-undeclared",
    "g43_2_unknown_tool": "tool-undeclared",
    "unknown_tool": "a tool that is only preselected does nothing",
    "unknown_m": "an event; translation refuses it where the cell has no KRL for it",
    "m_too_large": "the same",
    "percent_in_program": "a lone closing tape mark ends the program",
    "arc_k_zero_in_xy": "centre-zero",
    "arc_tiny_radius": "arc-small",
    "g28_with_rapid": "home-beside-rapid",
    "g28_with_motion": "home-beside-rapid",
}
"""Programs that LinuxCNC refuses and this reader reads on purpose; a code is that of the finding it gives."""

POSITION_MM = 1e-6
FEED_MM_S = 1e-7
CHORD_MM = 0.01


def _name(case):
    """Return a short test name for an entry of expected.json."""
    return Path(case["file"]).stem + ("-block-delete" if case.get("block_delete") else "")


def _cell(offsets):
    """Return a cell that has nothing but work offsets."""
    origins = {system: [*offsets.get(system, (0.0, 0.0, 0.0)), 0.0][:4] for system in SYSTEMS}
    frames = {
        system: Frame(x_mm=x, y_mm=y, z_mm=z, a_deg=a, b_deg=0.0, c_deg=0.0)
        for system, (x, y, z, a) in origins.items()
    }
    return Cell.model_construct(tool={}, work_offsets=frames)


def _read(case):
    """Return the toolpath of an entry of expected.json."""
    offsets = OFFSETS if case["file"].startswith("programs_offsets/") else {}
    return read_gcode(
        REFERENCE / case["file"],
        _cell(offsets),
        tools=REFERENCE / "tool.tbl",
        chord_tolerance_mm=CHORD_MM,
        block_delete=case.get("block_delete", False),
    )


def _last_rows(toolpath):
    """Return the rows that end a move: every straight row, and the last chord of every arc."""
    arc = toolpath.arc[1:]
    ends = np.ones(len(arc), dtype=bool)
    ends[:-1] = (arc[:-1] < 0) | (arc[:-1] != arc[1:])
    return np.flatnonzero(ends) + 1


def _directed(angle, sign):
    """Return ``angle`` as turned in the direction ``sign``: above 0, up to a full circle."""
    turned = (sign * np.asarray(angle)) % math.tau
    return np.where(turned < 1e-6, turned + math.tau, turned)


def _rotated_back(points, about):
    """Return points (k, 3) in the frame of a work offset that is rotated about (x, y) by some degrees."""
    x, y, angle = *about[:2], math.radians(about[2])
    back = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return np.column_stack(((points[:, :2] - [x, y]) @ back + [x, y], points[:, 2]))


def _check_arc(points, arc):
    """Check that ``points`` (k + 1, 3), the start and the chord ends, follow ``arc`` of expected.json."""
    points = _rotated_back(points, arc["about"]) if "about" in arc else points
    first, second, normal = AXES[arc["plane"]]
    radial = points[:, [first, second]] - arc["centre"]
    radius = np.hypot(*radial.T)
    direction = np.arctan2(radial[:, 1], radial[:, 0])
    height = points[:, normal]
    sign = math.copysign(1.0, arc["rotation"])
    steps = _directed(np.diff(direction), sign)
    whole = _directed(direction[-1] - direction[0], sign) + math.tau * (abs(arc["rotation"]) - 1)

    assert steps.sum() == pytest.approx(float(whole), abs=2e-6)

    share = np.concatenate(([0.0], np.cumsum(steps) / steps.sum()))
    np.testing.assert_allclose(height, height[0] + share * (height[-1] - height[0]), rtol=0, atol=POSITION_MM)
    assert radius.min() >= min(radius[0], radius[-1]) - POSITION_MM
    assert radius.max() <= max(radius[0], radius[-1]) + POSITION_MM
    chord_error = radius.max() * (1.0 - np.cos(steps / 2.0))
    assert chord_error.max() <= CHORD_MM + POSITION_MM


@pytest.mark.parametrize("case", EXPECTED["programs"], ids=_name)
def test_a_program_moves_as_linuxcnc_moves(case):
    """Ends, lines, kinds, feeds, dwells and arcs of its moves."""
    toolpath, moves = _read(case), case["moves"]
    rows = _last_rows(toolpath)

    np.testing.assert_array_equal(toolpath.position_mm[0], 0.0)
    assert len(rows) == len(moves)
    np.testing.assert_allclose(
        toolpath.position_mm[rows], [move["end"] for move in moves], rtol=0, atol=POSITION_MM
    )
    lines = zip(toolpath.source_line[rows].tolist(), moves, strict=True)
    assert all(move["line"] in (None, line) for line, move in lines)

    kinds = np.where(toolpath.arc[rows] >= 0, "arc", np.where(toolpath.rapid[rows], "rapid", "feed"))
    assert kinds.tolist() == [move["kind"] for move in moves]
    assert not toolpath.rapid[toolpath.arc >= 0].any()

    rows = np.concatenate(([0], rows))
    seconds = [case["start_dwell_s"], *(move["dwell_s"] for move in moves)]
    np.testing.assert_allclose(toolpath.dwell_s[rows], seconds, rtol=0, atol=1e-9)
    assert toolpath.dwell_s.sum() == pytest.approx(sum(seconds), abs=1e-9)

    for before, row, move in zip(rows[:-1], rows[1:], moves, strict=True):
        if "feed_mm_s" in move:
            feeds = toolpath.feed_mm_s[before + 1 : row + 1]
            np.testing.assert_allclose(feeds, move["feed_mm_s"], rtol=1e-9, atol=FEED_MM_S)
        if move["kind"] == "arc":
            chord_ends = toolpath.position_mm[before + 1 : row + 1]
            _check_arc(np.vstack((move["start"], chord_ends)), move)


def _named(group, names):
    """Return the entries of a group of expected.json that have one of the names."""
    return [case for case in EXPECTED[group] if _name(case) in names]


@pytest.mark.parametrize("case", _named("errors", ACCEPTED_HERE), ids=_name)
def test_what_is_read_here_in_spite_of_linuxcnc(case):
    toolpath = _read(case)
    code = ACCEPTED_HERE[_name(case)]
    assert " " in code or code in [issue.code for issue in toolpath.issues]


@pytest.mark.parametrize("case", [c for c in EXPECTED["errors"] if _name(c) not in ACCEPTED_HERE], ids=_name)
def test_what_linuxcnc_refuses_is_refused_at_the_same_line(case):
    with pytest.raises(Gcode2KrlError) as caught:
        _read(case)
    assert caught.value.issues[0].line == case["line"], case["message"]
