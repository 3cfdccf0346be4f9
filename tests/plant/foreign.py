"""Measurement noise that is neither white nor of a short memory: what real instruments add beside it.

A data sheet states the short part; what is here comes on top and is stated nowhere but in the label.
"""

from dataclasses import dataclass

import numpy as np

from tests.plant import memory

CHANNELS = {
    "tracker": ("random_walk", "pink", "ornstein_uhlenbeck", "bursts", "student", "relock"),
    "force": ("random_walk", "pink", "ornstein_uhlenbeck", "bursts", "student", "hum", "zero_wander"),
    "q_act": ("pink", "ornstein_uhlenbeck", "bursts", "student"),
    "q_load": ("pink", "ornstein_uhlenbeck", "bursts", "student"),
}
UNITS = {"tracker": "mm", "force": "N", "q_act": "deg", "q_load": "deg"}
RELOCK_mm = 0.01  # a tracker's interferometer or its angle encoders step by this much
LEAK_s = 40.0  # of the bounded random walk


@dataclass(frozen=True)
class Foreign:
    """One kind of noise in one channel; `amplitude` is its RMS, or the step of a re-lock."""

    channel: str
    kind: str
    amplitude: float
    unit: str
    time_s: float


def drawn(rng: np.random.Generator, short: dict[str, float]) -> tuple[Foreign, ...]:
    """One kind in one channel or in several; 0.5 to 2 times the short noise in size."""
    names = list(CHANNELS)
    count = int(rng.integers(1, len(names) + 1))
    chosen = rng.choice(names, count, replace=False)
    return tuple(_one(str(name), rng, short[str(name)]) for name in chosen)


def _one(channel: str, rng: np.random.Generator, short: float) -> Foreign:
    kind = str(rng.choice(CHANNELS[channel]))
    size = short * float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    time_s = float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
    if kind == "relock":
        size = RELOCK_mm
    return Foreign(channel, kind, size, UNITS[channel], time_s)


def of_channel(column: str) -> str | None:
    """Channel of a table's column, none where nothing foreign is added."""
    if column in ("x_mm", "y_mm", "z_mm"):
        return "tracker"
    if column in ("fx_N", "fy_N", "fz_N"):
        return "force"
    for name in ("q_act", "q_load"):
        if column.startswith("q") and column.endswith(name[1:] + "_deg"):
            return name
    return None


def added(spec: Foreign, t_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noise of one column at these times."""
    if len(t_s) < 3:
        return np.zeros(len(t_s))
    return spec.amplitude * MAKERS[spec.kind](t_s, spec, rng)


def _random_walk(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """Steps add up; a weak pull to zero bounds the walk."""
    return _unit(_ou(t_s, LEAK_s, rng))


def _ou(t_s: np.ndarray, time_s: float, rng: np.random.Generator) -> np.ndarray:
    """Exact samples of dx = -x/T·dt + noise, of unit variance (Uhlenbeck and Ornstein 1930)."""
    return memory.coloured(rng.normal(size=len(t_s)), float(np.exp(-(t_s[1] - t_s[0]) / time_s)))


def _ornstein_uhlenbeck(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    return _ou(t_s, spec.time_s, rng)


def _pink(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """Power falling with 1/f: white noise shaped in the spectrum, twice as long as needed."""
    n = 2 * len(t_s)
    spectrum = np.fft.rfft(rng.normal(size=n))
    share = np.arange(len(spectrum), dtype=float)
    share[0] = np.inf  # no mean
    return _unit(np.fft.irfft(spectrum / np.sqrt(share), n)[: len(t_s)])


def _bursts(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """Quiet, then for a fraction of a second far louder: about a tenth of the time."""
    out = np.zeros(len(t_s))
    span = t_s[-1] - t_s[0]
    for start in rng.uniform(t_s[0], t_s[-1], max(1, rng.poisson(0.1 * span / 0.3))):
        loud = np.exp(-0.5 * ((t_s - start) / 0.15) ** 2)
        out += loud * rng.normal(size=len(t_s))
    return _unit(out)


def _student(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """Heavy tails: Student's t with three degrees of freedom, of variance one."""
    return rng.standard_t(3.0, len(t_s)) / np.sqrt(3.0)


def _relock(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """The beam locks one to three steps beside where it was and comes back after a while."""
    out = np.zeros(len(t_s))
    for _ in range(int(rng.integers(2, 7))):
        start, length = rng.uniform(t_s[0], t_s[-1]), rng.uniform(0.3, 4.0)
        out[(t_s >= start) & (t_s < start + length)] += float(rng.choice([-3, -2, -1, 1, 2, 3]))
    return out


def _hum(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """Mains at 50 Hz and its third harmonic, folded by the sampling; the grid wanders by 20 mHz."""
    hz = 50.0 + rng.uniform(-0.02, 0.02)
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    wave = np.sin(2.0 * np.pi * hz * t_s + phase[0])
    return np.sqrt(2.0) * (wave + 0.3 * np.sin(6.0 * np.pi * hz * t_s + phase[1])) / np.sqrt(1.09)


def _zero_wander(t_s: np.ndarray, spec: Foreign, rng: np.random.Generator) -> np.ndarray:
    """The amplifier's zero swings slowly, a turn in ten seconds to a minute."""
    hz, phase = rng.uniform(1.0 / 60.0, 0.1, 2), rng.uniform(0.0, 2.0 * np.pi, 2)
    return np.sin(2.0 * np.pi * hz[0] * t_s + phase[0]) + np.sin(2.0 * np.pi * hz[1] * t_s + phase[1])


def _unit(x: np.ndarray) -> np.ndarray:
    """Of RMS one about the mean."""
    return (x - x.mean()) / max(float(x.std()), 1e-12)


MAKERS = {
    "random_walk": _random_walk,
    "pink": _pink,
    "ornstein_uhlenbeck": _ornstein_uhlenbeck,
    "bursts": _bursts,
    "student": _student,
    "relock": _relock,
    "hum": _hum,
    "zero_wander": _zero_wander,
}


def on_top(table: dict, kinds: tuple[Foreign, ...], units: float, rng: np.random.Generator) -> dict:
    """A table with foreign noise added to its columns; a re-locking tracker also steps in its last digit."""
    out = dict(table)
    for spec in kinds:
        for column in table:
            if of_channel(column) != spec.channel:
                continue
            out[column] = out[column] + units * added(spec, table["t_s"], rng)
            if spec.kind == "relock":
                out[column] = units * RELOCK_mm * np.round(out[column] / (units * RELOCK_mm))
    return out
