"""The ten lines of docs/python.md say what the tables say, for a program of several tools."""

import re

import numpy as np
import pytest

from gcode2krl import load_cell, predict
from tests.conftest import ROOT

CELL = """based_on = "demonstration"

[stock]
box_mm = [[17, 17, -20], [143, 83, 0]]
"""


def script():
    """Return the ten lines."""
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    return re.search(r"## Ten lines.*?```python\n(.*?)^```", text, re.M | re.S)[1]


def test_it_has_ten_lines():
    assert len([line for line in script().splitlines() if line]) == 10


def test_the_worst_second_of_every_tool(tmp_path, monkeypatch, capsys):
    (tmp_path / "part.nc").write_bytes((ROOT / "examples" / "contour_arcs.nc").read_bytes())
    (tmp_path / "cell.toml").write_text(CELL, encoding="ascii")
    monkeypatch.chdir(tmp_path)
    exec(compile(script(), "script", "exec"), {})
    said = re.findall(
        r"T(\d+): second (\d+), (\d+) N on average, ([\d.]+) mm at most, lines (\d+) to (\d+)",
        capsys.readouterr().out,
    )
    prediction = predict("part.nc", load_cell("cell.toml"))
    motion, size_N = prediction.motion, np.sqrt((prediction.forces.force_base_N**2).sum(axis=1))
    assert [int(words[0]) for words in said] == sorted(set(motion.tool.tolist()))
    assert len(said) > 1
    for words in said:
        tool, second = int(words[0]), int(words[1])
        means = {}
        for at in range(int(motion.time_s[-1]) + 1):
            rows = (motion.tool == tool) & (motion.time_s >= at) & (motion.time_s < at + 1)
            if rows.any():
                means[at] = size_N[rows].mean()
        assert max(means, key=means.get) == second
        assert float(words[2]) == pytest.approx(means[second], abs=0.51)
        rows = (motion.tool == tool) & (motion.time_s >= second) & (motion.time_s < second + 1)
        lines = prediction.toolpath.source_line[motion.move[rows]]
        assert (int(words[4]), int(words[5])) == (lines.min(), lines.max())
