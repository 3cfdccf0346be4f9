"""The program says who applied the lengths of the tools."""

import pytest

from gcode2krl import load_cell, read_gcode, set_targets, write_krl

PART = "G21 G90\nT1 M6\nS9000 M3\nG0 X0 Y0 Z20\nG1 Z-1 F300\nX20\nG0 Z20\nM5\nM30\n"


@pytest.mark.parametrize("from_table", [True, False])
def test_the_header_tells_lengths_from_the_table(tmp_path, from_table):
    path, part = tmp_path / "cell.toml", tmp_path / "part.nc"
    key = '[program]\ntool_length = "from_table"\n' if from_table else ""
    path.write_text(f'based_on = "demonstration"\n{key}', encoding="ascii")
    part.write_text(PART if from_table else PART.replace("M6", "M6 G43"), encoding="ascii")
    cell = load_cell(path)
    write_krl(set_targets(read_gcode(part, cell), cell), tmp_path / "part.src", cell)
    header = (tmp_path / "part.src").read_text(encoding="ascii").split(";ENDFOLD")[0]
    assert ('tool_length = "from_table"' in header) is from_table
