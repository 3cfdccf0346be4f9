"""Foreign noise has the size, memory, spectrum and tails that its name says."""

from itertools import pairwise

import numpy as np
import polars as pl
import pytest

from tests.plant import foreign, kinds
from tests.plant.foreign import CHANNELS, Foreign

T = np.arange(0.0, 400.0, 0.004)


def made(kind: str, amplitude: float = 1.0, time_s: float = 1.0, seed: int = 4, t_s=T) -> np.ndarray:
    spec = Foreign("tracker", kind, amplitude, "mm", time_s)
    return foreign.added(spec, t_s, np.random.default_rng(seed))


def slope(x: np.ndarray, low_hz: float, high_hz: float) -> float:
    """Exponent of the power spectrum between two frequencies."""
    hz = np.fft.rfftfreq(len(x), T[1])
    power = np.abs(np.fft.rfft(x)) ** 2
    edges = np.geomspace(low_hz, high_hz, 13)
    middle = [power[(hz >= a) & (hz < b)].mean() for a, b in pairwise(edges)]
    return float(np.polyfit(np.log(np.sqrt(edges[:-1] * edges[1:])), np.log(middle), 1)[0])


def kept(x: np.ndarray, after_s: float) -> float:
    lag = round(after_s / T[1])
    return float(np.corrcoef(x[:-lag], x[lag:])[0, 1])


@pytest.mark.parametrize("kind", sorted(set(foreign.MAKERS) - {"relock"}))
def test_amplitude_is_the_rms(kind):
    rms = np.sqrt(np.mean([np.mean(made(kind, 0.03, 0.5, seed) ** 2) for seed in range(3)]))
    assert rms == pytest.approx(0.03, rel=0.15)


@pytest.mark.parametrize("time_s", [0.1, 1.0, 3.0])
def test_ornstein_uhlenbeck_forgets_within_its_time(time_s):
    x = made("ornstein_uhlenbeck", 1.0, time_s)
    assert kept(x, time_s) == pytest.approx(np.exp(-1.0), abs=0.15)


def test_spectra():
    assert slope(made("pink"), 0.02, 50.0) == pytest.approx(-1.0, abs=0.1)
    assert slope(made("random_walk"), 0.1, 20.0) == pytest.approx(-2.0, abs=0.2)
    assert slope(made("student"), 0.02, 50.0) == pytest.approx(0.0, abs=0.15)


def test_a_random_walk_of_a_long_run_is_bounded():
    assert np.abs(made("random_walk")).max() < 5.0
    assert kept(made("random_walk"), 1.0) > 0.9


def test_bursts_are_quiet_most_of_the_time_and_tails_are_heavy():
    bursts, tails = made("bursts"), made("student")
    assert np.mean(np.abs(bursts) < 0.05) > 0.6
    assert np.mean(np.abs(tails) > 5.0) > 100.0 * 5.7e-7  # of a normal law beyond five sigma
    assert np.mean((bursts / bursts.std()) ** 4) > 6.0


def test_hum_is_the_mains_and_folds_where_the_sampling_is_slow():
    hz = np.fft.rfftfreq(len(T), T[1])
    assert hz[np.argmax(np.abs(np.fft.rfft(made("hum"))))] == pytest.approx(50.0, abs=0.05)
    slow = np.arange(0.0, 100.0, 0.008)
    folded = np.fft.rfftfreq(len(slow), 0.008)[np.argmax(np.abs(np.fft.rfft(made("hum", t_s=slow))))]
    assert folded == pytest.approx(50.0, abs=0.05)  # of 125 Hz; the third harmonic is at 25 Hz
    third = np.abs(np.fft.rfft(made("hum", t_s=slow)))
    assert third[np.abs(np.fft.rfftfreq(len(slow), 0.008) - 25.0) < 0.1].max() > 0.2 * third.max()


def test_a_relocked_beam_stands_on_steps_and_comes_back():
    x = made("relock", foreign.RELOCK_mm)
    np.testing.assert_allclose(x / foreign.RELOCK_mm, np.round(x / foreign.RELOCK_mm), atol=1e-9)
    assert np.count_nonzero(x) > 0
    assert np.mean(x == 0.0) > 0.5


def test_only_its_channel_gets_it():
    table = {"t_s": T, "x_mm": np.zeros(len(T)), "a_deg": np.zeros(len(T))}
    spec = Foreign("tracker", "pink", 0.02, "mm", 1.0)
    out = foreign.on_top(table, (spec,), 1.0, np.random.default_rng(1))
    assert out["x_mm"].std() == pytest.approx(0.02, rel=1e-6)
    assert out["a_deg"].std() == 0.0
    assert foreign.of_channel("q3_act_deg") == "q_act"
    assert foreign.of_channel("q3_load_deg") == "q_load"
    assert foreign.of_channel("q3_cmd_deg") is None


def test_a_case_states_the_short_part_and_has_more(tmp_path):
    for seed in range(30):
        plan, _ = kinds.plan_of("null_foreign_noise", seed)
        tracker = [f for f in plan.how.foreign if f.channel == "tracker" and f.kind == "ornstein_uhlenbeck"]
        if tracker and "tracker" in plan.how.tables:
            break
    label = kinds.draw_case("null_foreign_noise", seed, tmp_path / "case")
    stated = (tmp_path / "case" / "run-1" / "run.toml").read_text(encoding="utf-8")
    assert f"tcp_mm = {round(label['instruments']['tracker_mm'], 9)}" in stated
    file = next((tmp_path / "case" / "run-1").glob("tracker.*"))
    table = pl.read_csv(file) if file.suffix == ".csv" else pl.read_parquet(file)
    run = plan.drive(plan.days[0], [])
    taken = table["t_s"].to_numpy() - run.clocks["tracker"][0]
    rest = table["x_mm"].to_numpy() - np.interp(taken, run.t_s, run.tip_mm[:, 0])
    rest = rest[np.isfinite(rest)]
    slow, short = tracker[0].amplitude, plan.how.tracker_mm
    assert 0.6 < rest.std() / np.hypot(slow, short) < 1.6


def test_kinds_and_sizes_are_spread():
    plans = [kinds.plan_of("null_foreign_noise", seed)[0] for seed in range(120)]
    seen = {(f.channel, f.kind) for plan in plans for f in plan.how.foreign}
    assert seen == {(channel, kind) for channel, names in CHANNELS.items() for kind in names}
