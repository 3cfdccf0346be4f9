"""Noise that is no model's: sound runs stay sound, by made-up noise and by whole cases of the plant."""

import json
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gcode2krl.gap import diagnose
from gcode2krl.gap.compare.events import sorted_out
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.constructed import LINK, Added, motion, question, trace, wave
from tests.plant.cases import make_case

# Noise that the model was not made of: sound runs are sound, and what is wrong keeps its name beside it


COUNT, STEP_S, SIGMA = 750, 0.02, 1e-4
"""Runs of 15 s."""
TIME_S = STEP_S * np.arange(COUNT)
PLAY = Added("play", lambda t: np.sign(np.sin(2.0 * np.pi * t / 4.3)))
DRIFT = Added("drift", lambda t: t / 7.5 - 1.0)
EFFECTS = (PLAY, DRIFT, wave(0.37), wave(2.0), wave(3.0))


def ou(seconds):
    def drawn(generator):
        kept, x = np.exp(-STEP_S / seconds), np.empty(COUNT)
        x[0] = generator.standard_normal()
        for i in range(1, COUNT):
            x[i] = kept * x[i - 1] + np.sqrt(1.0 - kept**2) * generator.standard_normal()
        return x

    return drawn


def walk(generator):
    """Return a random walk between two walls, of rms one."""
    x = np.zeros(COUNT)
    for i in range(1, COUNT):
        x[i] = np.clip(x[i - 1] + 0.15 * generator.standard_normal(), -1.7, 1.7)
    return x


def one_over_f(generator):
    f = np.fft.rfftfreq(COUNT, STEP_S)
    f[0] = np.inf
    x = np.fft.irfft((generator.standard_normal(len(f)) + 1j * generator.standard_normal(len(f))) / f**0.5)
    return x / x.std()


def bursts(generator):
    """Return two or three bursts of a fifth of a second, six times the usual noise, and some outliers."""
    x = np.zeros(COUNT)
    for _ in range(int(generator.integers(2, 4))):
        at = int(generator.integers(0, COUNT - 10))
        x[at : at + 10] = 6.0 * generator.standard_normal(10)
    x[generator.integers(0, COUNT, 3)] += 15.0
    return x


NOISES = {
    "ou 0.1 s": ou(0.1),
    "ou 0.3 s": ou(0.3),
    "ou 1 s": ou(1.0),
    "ou 3 s": ou(3.0),
    "walk": walk,
    "1/f": one_over_f,
    "bursts": bursts,
    "heavy tails": lambda generator: 0.5 * generator.standard_t(3.0, COUNT),
}


def judged(kind, gap, seed, quantum=0.0, **more):
    """Return the judgement of three runs of different programs: white noise, a foreign one, and a gap."""
    traces = []
    for i in range(3):
        generator = np.random.default_rng([seed, i])
        y = generator.standard_normal(COUNT) + NOISES[kind](generator) + gap(i) if kind else gap(i)
        if quantum:
            y = quantum * np.round((y + generator.standard_normal(COUNT)) / quantum)
        inputs = motion(15.0)
        inputs = replace(inputs, position_mm=inputs.position_mm + 5.0 * i)
        traces.append(trace(SIGMA * y[:, None], number=i, inputs=inputs, **more))
    return judge(LINK["servo"], sorted_out(traces, {}), [], question(EFFECTS))


def nothing(run):
    return np.zeros(COUNT)


@pytest.mark.slow
@pytest.mark.parametrize("kind", NOISES)
def test_sound_runs_are_sound(kind):
    verdicts = [judged(kind, nothing, seed).verdict for seed in range(4)]
    assert verdicts == ["no_gap"] * 4


@pytest.mark.slow
def test_stating_the_short_noise_does_not_make_slow_noise_a_gap():
    found = [judged("ou 0.3 s", nothing, seed, declared_sigma=SIGMA) for seed in range(3)]
    assert [each.verdict for each in found] == ["no_gap"] * 3


@pytest.mark.slow
def test_steps_of_the_last_decimal_are_no_gap():
    """Ten micrometres where the noise is seven."""
    assert judged("", nothing, 1, quantum=1.5).verdict == "no_gap"


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["ou 0.3 s", *(pytest.param(k, marks=pytest.mark.slow) for k in ("ou 1 s", "1/f", "bursts"))]
)
@pytest.mark.parametrize(("effect", "size"), [(PLAY, 2.0), (DRIFT, 3.5), (EFFECTS[3], 2.8)])
def test_an_effect_of_twice_the_short_noise_keeps_its_name(kind, effect, size):
    found = judged(kind, lambda run: size * effect.form(TIME_S), 11)
    assert [one.effect.name for one in found.applied] == [effect.name]
    (cause,) = found.causes
    interval = cause.parameters["size_rad"]
    assert interval.low < size * SIGMA < interval.high or interval.value == pytest.approx(
        size * SIGMA, rel=0.2
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "gap",
    [
        lambda run: 1.1 * np.sqrt(2.0) * np.sin(2.0 * np.pi * 8.7 * TIME_S + run),
        lambda run: 3.0 * ((TIME_S > 6.2) if run == 1 else np.full(COUNT, run > 1)) - 1.5,
        lambda run: 2.0 * np.sign(np.sin(motion(15.0).q_cmd_rad[:, 2] * 40.0)),
    ],
    ids=["floor vibration", "step of the tracker", "error by place"],
)
def test_what_the_library_lacks_stays_a_gap(gap):
    """No drawn noise besides: the tone is 1.1 times the white noise, the others one and a half and two."""
    NOISES["white"] = lambda generator: np.zeros(COUNT)
    try:
        found = judged("white", gap, 5)
    finally:
        del NOISES["white"]
    assert found.size.significant
    assert found.verdict != "no_gap"


# Whole cases of the plant with slow noise added to tracker and force sensor: sound ones stay sound


sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
blind = import_module("blind.cases")
plans_of = import_module("blind.cases").predictions
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


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "seconds"), [(7001, 0.3), (7004, 1.0)])
def test_sound_runs_with_slow_noise_have_no_gap(seed, seconds, predictions, tmp_path):
    case = tmp_path / "case"
    make_case(seed, case, "none", predictions=predictions.as_posix())
    with_slow_noise(case, seconds, seed)
    runs, prediction = blind.loaded(case)
    found = diagnose(prediction, runs)
    assert found.verdict == "no_gap"
    assert found.causes == ()


@pytest.mark.slow
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
