"""Findings about the cut are kept when the targets are moved."""

import json

PART = (
    "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X0 Y0\nG0 Z2\nG1 Z-2 F600\n"
    "X60\nG0 X0 Y30\nG0 Z30\nM5\nM30\n"
)
CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[-20, -20, -10], [80, 50, 0]]\nresolution_mm = 0.5\n'
CELL += "[material]\nrelative_band = 0.1\n"


def test_a_rapid_through_stated_stock_refuses_a_compensated_program_too(run, tmp_path):
    (tmp_path / "part.nc").write_text(PART)
    (tmp_path / "cell.toml").write_text(CELL)
    for more in ((), ("--compensate", "offline")):
        done = run("part.nc", "-o", "part.src", "--cell", "cell.toml", "--pilot", "none", "--json", *more)
        assert done.code == 1
        found = [(i["severity"], i["code"], i["line"]) for i in json.loads(done.out)["issues"]]
        assert ("error", "rapid-in-stock", 9) in found
        assert not (tmp_path / "part.src").exists()
