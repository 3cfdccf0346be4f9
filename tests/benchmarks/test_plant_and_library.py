"""The plant and the library are written apart; where they mean the same effect they use the same words."""

from importlib import import_module

import pytest

from gcode2krl import load_cell
from gcode2krl.effects import library
from tests.benchmarks import hand_made  # noqa: F401 - puts the benchmarks on the path
from tests.plant import faults

cases = import_module("gap_blind_cases")
oracle = import_module("gap_blind_oracle")

DRAWS = 12
SIZE = 0.02


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
        assert fault.target in effect.targets(cell)
        known = set(oracle.flat(fault.values(SIZE)))
        assert known & set(effect.names), f"{sorted(known)} beside {sorted(effect.names)}"
