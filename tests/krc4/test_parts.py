"""The chain and its samples are the same, wherever the borders of their parts lie."""

from dataclasses import fields

import numpy as np
import pytest

from gcode2krl import plan_motion, set_targets
from gcode2krl.compiled import chunks
from gcode2krl.krc4 import build_chain, motion, sampling
from tests.krc4.conftest import HEAD, polyline

RANDOM = np.random.default_rng(11)
POINTS = np.cumsum(RANDOM.uniform(-15, 15, (40, 3)), axis=0)
TEXTS = {
    "blends, changing speeds": polyline(POINTS, RANDOM.uniform(20, 120, 39)),
    "tolerance": polyline(POINTS, RANDOM.uniform(20, 120, 39), "G64 P0.05"),
    "stops and a dwell": polyline(POINTS, np.full(39, 60.0), "G61").replace("M30", "G4 P0.3\nG1 X0\nM30"),
    "one move": HEAD + "G0 X0 Y0 Z0\nG1 X10 F600\nM30\n",
}


def same(table, other):
    for spec in fields(table):
        if isinstance(getattr(table, spec.name), np.ndarray):
            left, right = getattr(table, spec.name), getattr(other, spec.name)
            np.testing.assert_array_equal(left, right, err_msg=spec.name)


@pytest.mark.parametrize("rows", [1, 3, 100])
@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS.keys())
@pytest.mark.parametrize("cdis_mm", [0.1, 50.0])
def test_same_chain_and_motion(monkeypatch, make_cell, read, text, rows, cdis_mm):
    cell = make_cell(cdis_mm=cdis_mm, k_s=0.02)
    targets = set_targets(read(text, cell), cell)
    whole, moving = build_chain(targets, cell), plan_motion(targets, cell)
    for module in (motion, sampling):
        monkeypatch.setattr(module, "chunk_borders", lambda count: chunks.chunk_borders(count, rows))
    same(build_chain(targets, cell), whole)
    same(plan_motion(targets, cell), moving)


def test_speeds_that_change_in_wide_corners_multiply_up_to_the_next_stop(make_cell, read):
    """After each such corner lengths are scaled by v2/v1; an exact stop resets the scale."""
    points = [(x, y, 0) for x, y in [(0, 0), (200, 0), (200, 200), (0, 200), (0, 0), (200, 0), (200, 200)]]
    speeds = [50.0, 60.0, 90.0, 45.0, 45.0, 30.0]
    text = polyline(points, speeds)
    stop = "X0.000000 Y200.000000 Z0.000000 F5400\n"
    assert stop in text
    cell = make_cell(cdis_mm=90.0, k_s=0.02)
    chain = build_chain(set_targets(read(text.replace(stop, stop + "G4 P0.1\n"), cell), cell), cell)
    v = np.array(speeds)
    wanted = [1, v[1] / v[0], v[2] / v[0], 1, 1, v[5] / v[4]]
    np.testing.assert_allclose(chain.scale, wanted, rtol=1e-12)
    np.testing.assert_allclose(chain.length_mm * chain.scale, 200, rtol=1e-12)
