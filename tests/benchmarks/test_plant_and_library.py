"""The plant and the library are written apart; where they mean the same effect they use the same words."""

from importlib import import_module

import pytest

from gcode2krl import load_cell
from gcode2krl.effects import library
from tests.benchmarks import hand_made  # noqa: F401 - puts the benchmarks on the path
from tests.plant import faults

cases = import_module("gap_blind_cases")
words = import_module("gap_blind_words")

DRAWS = 12
SIZE = 0.02
UNEVEN = ("pedestal_compliance",)
"""The plant's pedestal gives way unevenly: two numbers where the library has one."""


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    file = tmp_path_factory.mktemp("cell") / "cell.toml"
    file.write_text(cases.CELL_TOML, encoding="utf-8")
    return load_cell(file)


@pytest.mark.parametrize("name", cases.simulated())
def test_targets_and_parameters(name, cell):
    effect = library()[name]
    for seed in range(DRAWS):
        fault = faults.build(name, "same", seed)
        entry = {"effect": name, "target": fault.target, "parameters": fault.values(SIZE)}
        assert words.truth_of(entry)[1] in effect.targets(cell)
        known = set(words.flat(entry))
        assert name in UNEVEN or known & set(effect.names), f"{sorted(known)} beside {sorted(effect.names)}"


def test_units_of_the_library():
    def flat(effect, **parameters):
        return words.flat({"effect": effect, "target": None, "parameters": parameters})

    assert flat("axis_parallelism", b_deg=0.1) == {"mrad": pytest.approx(1.7453293)}
    assert flat("spindle_growth", mm=0.026) == {"um_per_krpm": pytest.approx(2.0)}
    bent = flat("tracker_refraction", mm_at_2m=0.00186, stand_mm=[1500.0, -700.0, 300.0])
    assert bent == {"K_per_m": pytest.approx(1.0), "tracker_x_m": 1.5, "tracker_y_m": pytest.approx(-0.7)}
    moved = flat("step", size=0.3, unit="mm", run="run-1", at_s=3.0, direction=[1.0, 0.0, 0.0])
    assert (moved["size_mm"], moved["at_s"], moved["direction_x"]) == (0.3, 3.0, 1.0)
    turned = flat("step", size=0.01, unit="deg", run="run-1", at_s=3.0, direction=-1.0)
    assert turned == {"size_deg": -0.01, "at_s": 3.0}
    assert flat("hose_pack", h0_N=[1.0, 2.0, 3.0])["h0_y_N"] == 2.0
