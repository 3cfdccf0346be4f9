"""Whole cases of the plant with slow noise added to tracker and force sensor: sound ones stay sound."""

import json
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gcode2krl.gap import diagnose
from tests.plant.cases import make_case

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
blind = import_module("blind.cases")
plans_of = import_module("blind.cases").predictions

pytestmark = pytest.mark.slow
COLUMNS = {"tracker": ("x_mm", "y_mm", "z_mm"), "force": ("fx_N", "fy_N", "fz_N")}


@pytest.fixture(scope="module")
def predictions(tmp_path_factory):
    return Path(next(iter(plans_of(tmp_path_factory.mktemp("predictions")).values()))).parent


def wandering(time_s, seconds, generator):
    """Return what forgets within some seconds, of rms one, at stamps with gaps."""
    x = np.empty(len(time_s))
    x[0] = generator.standard_normal()
    kept = np.exp(-np.diff(time_s) / seconds)
    for i, share in enumerate(kept, start=1):
        x[i] = share * x[i - 1] + np.sqrt(1.0 - share**2) * generator.standard_normal()
    return x


def with_slow_noise(case, seconds, seed):
    """Add slow noise as large as the short one, without telling `run.toml`."""
    how = json.loads(case.with_name(case.name + ".label.json").read_text())["instruments"]
    generator = np.random.default_rng(seed)
    sigma = {"tracker": how["tracker_mm"], "force": how["force_N"]}
    for file in sorted(case.glob("run-*/*")):
        if file.stem not in COLUMNS:
            continue
        is_csv = file.suffix == ".csv"
        table = pl.read_csv(file, infer_schema_length=None) if is_csv else pl.read_parquet(file)
        time_s = table["t_s"].to_numpy()
        moved = [
            pl.col(name) + pl.Series(sigma[file.stem] * wandering(time_s, seconds, generator))
            for name in COLUMNS[file.stem]
        ]
        table = table.with_columns(moved)
        if is_csv:
            table.write_csv(file)
        else:
            table.write_parquet(file)


@pytest.mark.parametrize(("seed", "seconds"), [(7001, 0.3), (7004, 1.0)])
def test_sound_runs_with_slow_noise_have_no_gap(seed, seconds, predictions, tmp_path):
    case = tmp_path / "case"
    make_case(seed, case, "none", predictions=predictions.as_posix())
    with_slow_noise(case, seconds, seed)
    runs, prediction = blind.loaded(case)
    found = diagnose(prediction, runs)
    assert found.verdict == "no_gap"
    assert found.causes == ()


def test_an_effect_beside_slow_noise_keeps_its_name(predictions, tmp_path):
    case = tmp_path / "case"
    make_case(7101, case, "backlash", "same", predictions=predictions.as_posix())
    with_slow_noise(case, 0.3, 1)
    label = json.loads(case.with_name("case.label.json").read_text())
    runs, prediction = blind.loaded(case)
    found = diagnose(prediction, runs)
    assert found.causes[0].effect == "backlash"
    assert found.causes[0].target == label["effects"][0]["target"]
    assert found.causes[0].probability > 0.5
