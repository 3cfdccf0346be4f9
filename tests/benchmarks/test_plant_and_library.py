"""The plant and the library are written apart; where they mean the same effect they use the same words."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from gcode2krl import load_cell, predict
from gcode2krl.effects import inputs_of, library
from gcode2krl.effects import simulate as library_signals
from tests.benchmarks import hand_made  # noqa: F401 - puts the benchmarks on the path
from tests.plant import faults, instruments
from tests.plant.robot import simulate
from tests.plant.scene import World
from tests.plant.waypoints import PROGRAMS

cases = import_module("blind.cases")
words = import_module("blind.score")
oracle = import_module("blind.cases")

DRAWS = 12
SIZE = 0.02
PROGRAM, HOURS, STEP_s = "pocket", 2.0, 0.02
MODELLED_s = 0.004
"""A log of 12 ms is modelled this finely by the diagnosis."""
LEAST = {"tcp": 2e-3, "force": 0.3, "motor": 1e-5, "servo": 1e-5, "gear": 1e-5, "part": 2e-3}
"""Changes of a smaller RMS in mm, N and degrees are not compared."""
NUMBERS_DECIDE = {"advance_stop": 0.85, "friction": 0.85, "tool_diameter": 0.85, "vibration": 0.95}
"""Cosine to the other where more than a formula decides: which corners, samples of 12 ms, the last chips."""


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
        assert known & set(effect.names), f"{sorted(known)} beside {sorted(effect.names)}"


def test_units_of_the_library():
    def flat(effect, **parameters):
        return words.flat({"effect": effect, "target": None, "parameters": parameters})

    assert flat("fixture_compliance", mm_per_kN=[1.0, 2.0, 3.0])["y_um_per_N"] == 2.0
    assert flat("spindle_growth", mm=0.026) == {"um_per_krpm": pytest.approx(2.0)}
    bent = flat("tracker_refraction", mm_at_2m=0.00186, stand_mm=[1500.0, -700.0, 300.0])
    assert bent == {"K_per_m": pytest.approx(1.0), "tracker_x_m": 1.5, "tracker_y_m": pytest.approx(-0.7)}
    moved = flat("step", size=0.3, unit="mm", run="run-1", at_s=3.0, direction=[1.0, 0.0, 0.0])
    assert (moved["size_mm"], moved["at_s"], moved["direction_x"]) == (0.3, 3.0, 1.0)
    turned = flat("step", size=0.01, unit="deg", run="run-1", at_s=3.0, direction=-1.0)
    assert turned == {"size_deg": -0.01, "at_s": 3.0}
    assert flat("hose_pack", h0_N=[1.0, 2.0, 3.0])["h0_y_N"] == 2.0


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    """One program without any effect: inputs of the package, and the plant's run."""
    folder = tmp_path_factory.mktemp("nominal")
    (folder / "cell.toml").write_text(cases.CELL_TOML, encoding="utf-8")
    (folder / "part.nc").write_text(PROGRAMS[PROGRAM]().text(), encoding="utf-8")
    cell = load_cell(folder / "cell.toml")
    inputs = inputs_of(predict(folder / "part.nc", cell, dt_s=MODELLED_s))
    return replace(inputs, hours=HOURS), driven([])


def driven(hooks):
    way = PROGRAMS[PROGRAM]().waypoints()
    return simulate(way, World(), hooks, age_s=3600.0 * HOURS, number=2)


def of_plant(run, grid):
    table = instruments.clean(run, instruments.Instruments(drop_outs=False, force_frame="base"))
    log = table["controller"]

    def columns(name, keys):
        return np.stack([np.interp(grid, table[name]["t_s"], table[name][key]) for key in keys], axis=1)

    cmd, act, load = (
        columns("controller", [key for key in log if key.startswith("q") and key.endswith(f"{part}_deg")])
        for part in ("cmd", "act", "load")
    )
    part = np.stack([np.interp(grid, run.slow_s, run.part_mm[:, k]) for k in range(3)], axis=1)
    tip, force = columns("tracker", ("x_mm", "y_mm", "z_mm")), columns("force", ("fx_N", "fy_N", "fz_N"))
    return {"tcp": tip, "force": force, "motor": act, "servo": act - cmd, "gear": load - act, "part": part}


def of_library(inputs, effects, grid):
    signals = library_signals(inputs, effects)
    cmd, act, load = (np.degrees(signals.seen(f"q_{part}_rad", grid)) for part in ("cmd", "act", "load"))
    shift = getattr(signals, "part_shift_mm", None)
    part = np.zeros((len(grid), 3))
    if shift is not None:
        part = np.stack([np.interp(grid, inputs.time_s, column) for column in shift.T], axis=1)
    tip, force = signals.seen("tcp_base_mm", grid), signals.seen("force_meas_base_N", grid)
    return {"tcp": tip, "force": force, "motor": act, "servo": act - cmd, "gear": load - act, "part": part}


@pytest.mark.slow
@pytest.mark.parametrize("name", cases.simulated())
def test_the_same_effect_does_the_same(name, nominal):
    """Sign, size and axes of the plant's form are those of the library with the label's numbers."""
    inputs, bare = nominal
    grid = np.arange(0.3, min(inputs.time_s[-1], bare.t_s[-1]) - 0.6, STEP_s)
    fault = faults.build(name, "same", 1)
    size = float(np.sqrt(np.prod(fault.kind.sizes)))
    entry = {"effect": name, "target": fault.target, "parameters": fault.values(size), "form": "same"}
    one = oracle._applied(entry, inputs)
    assert one is not None
    plant, theirs = of_plant(driven([fault.hooks(size)]), grid), of_library(inputs, [one], grid)
    plant_bare, their_bare = of_plant(bare, grid), of_library(inputs, [], grid)
    compared = set()
    for signal, least in LEAST.items():
        a, b = (plant[signal] - plant_bare[signal]).ravel(), (theirs[signal] - their_bare[signal]).ravel()
        sizes = np.sqrt(np.mean(a**2)), np.sqrt(np.mean(b**2))
        if max(sizes) < least:
            continue
        compared.add(signal)
        assert min(sizes) > 0.0, f"{signal}: one of the two does nothing"
        cosine = float(a @ b / np.sqrt((a @ a) * (b @ b)))
        assert cosine > NUMBERS_DECIDE.get(name, 0.97), signal
        assert sizes[1] == pytest.approx(sizes[0], rel=0.35 if name in NUMBERS_DECIDE else 0.1), signal
    assert compared, "too small to be compared"
