"""Rapids that go down into material are found however slow they are, and sound ones are not reported."""

import numpy as np
import pytest

from gcode2krl import predict
from gcode2krl.cutting.engagement import engage
from gcode2krl.cutting.law import linear_edge_law
from gcode2krl.cutting.raw_part import block
from tests.cells import over_demonstration

HEAD = "G21 G90 G17 G54\nT1 M6\nS13000 M3\nG0 G43 H1 Z30\nG0 X0 Y0\nG0 Z2\n"
END = "G0 Z30\nM5\nM30\n"
STOCK = {"stock": {"box_mm": [[-20, -20, -20], [120, 80, 0]]}}


def rapids_in_stock(tmp_path, body, **data):
    part = tmp_path / "part.nc"
    part.write_text(HEAD + body + END)
    cell = over_demonstration(data)
    return [issue for issue in predict(part, cell).issues if issue.code == "rapid-in-stock"]


@pytest.mark.parametrize(("stock", "severity"), [(STOCK, "error"), ({}, "warning")])
@pytest.mark.parametrize("rapid_m_s", [0.02, 0.2])
@pytest.mark.parametrize("depth_mm", [0.6, 0.9, 2.0])
def test_a_short_rapid_plunge_is_no_graze(tmp_path, depth_mm, rapid_m_s, stock, severity):
    body = f"G64 P0.5\nG0 Z-{depth_mm}\nG1 Z-5 F600\nG1 X100\n"
    found = rapids_in_stock(tmp_path, body, controller={"rapid_m_s": rapid_m_s, "cdis_mm": 0.5}, **stock)
    assert [(issue.line, issue.severity) for issue in found] == [(8, severity)]
    assert f"{depth_mm:.2f} mm deep" in found[0].message or f"{depth_mm - 0.01:.2f} mm" in found[0].message


def test_a_rapid_back_through_its_own_slot_is_sound(tmp_path):
    body = "".join(f"G1 Z{z} F600\nG1 X100\nG0 X0\n" for z in (-3, -6, -9))
    assert rapids_in_stock(tmp_path, body, **STOCK) == []


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 37.0])
def test_what_rapids_meet_does_not_depend_on_the_strips(angle_deg):
    """A slot there and back: the field is divided at another place for each number of threads."""
    tool = over_demonstration().tool[1]
    angle = np.radians(angle_deg)
    way = np.array([np.cos(angle), np.sin(angle)])
    for length_mm in (97.0, 103.3, 110.07):
        there = np.arange(0.0, length_mm, 0.37)
        back = np.arange(there[-1], 0.0, -2.4)
        along = np.concatenate([there, back])
        position = np.column_stack([along[:, None] * way, np.full(len(along), -3.0)])
        rapid = np.arange(len(along)) > len(there)
        box = np.array([[-120.0, -120.0, -10.0], [120.0, 120.0, 0.0]])
        law = linear_edge_law(np.eye(6)[0])
        for threads in (1, 2, 3, 4):
            engaged = engage(
                block(box, 0.2),
                position,
                np.zeros(len(along), np.int32),
                rapid,
                np.full(len(along), 0.05),
                [tool],
                law,
                threads=threads,
            )
            assert engaged.overlap_mm[:, 0].max() < 0.01, threads
