"""The programs that throughput is measured with are what they are said to be."""

import io
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from gcode_beside_rs274 import Beside, difference
from throughput_kinds import BLOCKS_OF_A_TURN, arc_lines, macro_lines

from gcode2krl.gcode import read_stream


def read(lines):
    return read_stream(io.BytesIO("\n".join(lines).encode()), "part.nc")


def test_the_program_with_arcs_has_its_lines_and_no_findings():
    lines = list(arc_lines(1200))
    toolpath = read(lines)
    assert len(lines) == 1200
    assert not toolpath.issues
    assert len(np.unique(toolpath.arc)) > 200


def test_the_loop_runs_as_many_blocks_as_are_said():
    toolpath = read(macro_lines(500))
    assert not toolpath.issues
    assert np.count_nonzero(toolpath.source_line == 6) == 500 // BLOCKS_OF_A_TURN


@pytest.mark.skipif(shutil.which("rs274") is None, reason="no rs274")
@pytest.mark.parametrize("lines", [list(arc_lines(300)), list(macro_lines(300))], ids=["arcs", "macro"])
def test_rs274_moves_alike(tmp_path, lines):
    theirs = Beside(tmp_path).read(("\n".join(lines) + "\n").encode())
    assert theirs.refused == ""
    assert difference(read(lines), theirs.moves) == ""
