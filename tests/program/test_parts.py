"""Targets are the same, wherever the borders of the parts lie."""

from dataclasses import fields

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode, set_targets
from gcode2krl.compiled import chunks
from gcode2krl.program import blending, targets
from tests.conftest import EXAMPLES


@pytest.mark.parametrize("rows", [3, 50])
@pytest.mark.parametrize("tolerance_mm", [None, 0.02])
@pytest.mark.parametrize("part", EXAMPLES, ids=lambda path: path.stem)
def test_same_targets(monkeypatch, part, rows, tolerance_mm):
    cell = load_cell()
    toolpath = read_gcode(part, cell)
    whole = set_targets(toolpath, cell, tolerance_mm)
    for module in (targets, blending):
        monkeypatch.setattr(module, "chunk_borders", lambda count: chunks.chunk_borders(count, rows))
    planned = set_targets(toolpath, cell, tolerance_mm)
    for spec in fields(whole):
        left, right = getattr(planned, spec.name), getattr(whole, spec.name)
        if isinstance(left, np.ndarray):
            np.testing.assert_array_equal(left, right, err_msg=spec.name)
        else:
            assert left == right, spec.name
