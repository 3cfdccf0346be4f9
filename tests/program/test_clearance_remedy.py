"""The remedy of a feed above the clearance plane names a height sufficient for the whole program."""

import io

from gcode2krl import load_cell
from gcode2krl.gcode.read import read_stream
from gcode2krl.program.checks import check_toolpath

PART = b"G21\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z50\nG1 Z110 F500\nG0 Z20\nG1 Z125\nM5\nM2\n"


def test_the_remedy_names_the_highest_feed():
    cell = load_cell()
    found = [
        i
        for i in check_toolpath(read_stream(io.BytesIO(PART), "part.nc", cell), cell)
        if i.code == "above-clearance"
    ]
    assert found
    assert all("z_mm to 125.000 or more" in issue.remedy for issue in found)
