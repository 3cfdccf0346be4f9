"""How large an effect is in each signal, and where: readings with it against readings without, no noise."""

import numpy as np

from tests.plant import surface
from tests.plant.instruments import Instruments
from tests.plant.robot import Run

SMOOTH_s = 0.1
APART_s = 0.2


def signals(tables: dict[str, dict]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Time and columns of the measured signals; joints against the joint in front of them in the chain."""
    out = {}
    if "tracker" in tables:
        t = tables["tracker"]
        out["tcp"] = t["t_s"], np.stack([t[f"{a}_mm"] for a in "xyz"], axis=1)
    if "force" in tables:
        t = tables["force"]
        out["force"] = t["t_s"], np.stack([t[f"f{a}_N"] for a in "xyz"], axis=1)
    if "controller" in tables:
        t = tables["controller"]
        columns = {k: np.stack([t[f"q{j}_{k}_deg"] for j in range(1, 7)], axis=1) for k in ("cmd", "act")}
        out["joint_commanded"] = t["t_s"], columns["cmd"]
        out["joint_actual"] = t["t_s"], columns["act"] - columns["cmd"]
        if any(f"q{j}_load_deg" in t for j in range(1, 7)):  # a joint without one reads as its motor
            load = np.stack([t.get(f"q{j}_load_deg", t[f"q{j}_act_deg"]) for j in range(1, 7)], axis=1)
            out["joint_load"] = t["t_s"], load - columns["act"]
    return out


def noise_of(signal: str, how: Instruments) -> float:
    """Noise of one column of a signal."""
    return {
        "tcp": how.tracker_mm,
        "force": how.force_N,
        "joint_commanded": 10.0**-how.q_decimals / np.sqrt(12.0),  # of the last digit
        "joint_actual": how.q_act_deg,
        "joint_load": float(np.hypot(how.q_act_deg, how.q_load_deg)),
    }[signal]


def differences(with_it: dict, without: dict) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Change of each signal of a run by an effect; the shorter of two runs counts."""
    one, two = signals(with_it), signals(without)
    out = {}
    for name in one:
        n = min(len(one[name][0]), len(two[name][0]))
        out[name] = one[name][0][:n], one[name][1][:n] - two[name][1][:n]
    return out


def sizes(per_run: list[dict], how: Instruments) -> dict[str, dict]:
    """RMS of the change over all runs, and its ratio to the noise, of each signal.

    Places and forces count as vectors (per axis), joints by the one that changes most. Encoders are
    compared without their constant offset, which is the zeroing of the encoders and says nothing.
    """
    out = {}
    for name in per_run[0]:
        change = np.concatenate([run[name][1] for run in per_run])
        if name in ("joint_actual", "joint_load"):
            change = change - change.mean(axis=0)
        square = np.mean(change**2, axis=0)
        rms = np.sqrt(square.mean() if name in ("tcp", "force") else square.max())
        out[name] = {"rms": float(rms), "ratio": float(rms / noise_of(name, how))}
        if name in ("tcp", "force"):
            out[name]["constant_share"] = _constant_share(change)
    return out


def scan_size(acted: list[Run], bare: list[Run], how: Instruments) -> dict[str, float]:
    """RMS of the change of the finished surfaces along their normals, and its ratio to a scan's noise."""
    pairs = zip(acted, bare, strict=True)
    change = np.concatenate([surface.change_mm(one, two) for one, two in pairs])
    rms = float(np.sqrt(np.mean(change**2))) if len(change) else 0.0
    return {"rms": rms, "ratio": rms / how.scan_mm}


def _constant_share(change: np.ndarray) -> float:
    """Share of a change's power that one constant vector takes: 1 is an offset and nothing else."""
    power = float(np.mean(np.sum(change**2, axis=1)))
    return float(np.sum(change.mean(axis=0) ** 2) / power) if power > 0.0 else 0.0


def places(per_run: list[dict], signal: str) -> list[list[list[float]]]:
    """Intervals of each run in which the smoothed change exceeds its RMS over all runs."""
    size = [np.linalg.norm(run[signal][1], axis=1) for run in per_run]
    level = np.sqrt(np.mean(np.concatenate(size) ** 2))
    out = []
    for run, values in zip(per_run, size, strict=True):
        t = run[signal][0]
        width = max(1, int(SMOOTH_s / (t[1] - t[0])))
        smooth = np.sqrt(np.convolve(values**2, np.ones(width) / width, mode="same"))
        out.append(_joined(_spans(smooth > max(level, 1e-12), t)))
    return out


def _spans(high: np.ndarray, t_s: np.ndarray) -> list[list[float]]:
    """First and last time of each stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], high.astype(int), [0]])))
    return [[float(t_s[a]), float(t_s[b - 1])] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _joined(spans: list[list[float]]) -> list[list[float]]:
    """Stretches that are closer than `APART_s` are one."""
    out = []
    for span in spans:
        if out and span[0] - out[-1][1] < APART_s:
            out[-1][1] = span[1]
        else:
            out.append(span)
    return out


def above_noise(per_run: list[dict], signal: str, how: Instruments) -> list[list[list[float]]]:
    """Intervals of each run in which the smoothed change exceeds the noise of a column."""
    out = []
    for run in per_run:
        t, change = run[signal]
        width = max(1, int(SMOOTH_s / (t[1] - t[0])))
        power = np.convolve(np.sum(change**2, axis=1), np.ones(width) / width, mode="same")
        out.append(_joined(_spans(np.sqrt(power) > noise_of(signal, how), t)))
    return out


def moments(per_run: list[dict], signal: str, most: int = 8) -> list[dict]:
    """Times at which a change is largest, each more than `APART_s` from the others, the largest first."""
    every = []
    for i, run in enumerate(per_run):
        t, change = run[signal]
        every += [(float(s), i, float(at)) for s, at in zip(np.linalg.norm(change, axis=1), t, strict=True)]
    out: list[tuple[int, float]] = []
    for _, i, at in sorted(every, reverse=True):
        if all(i != other or abs(at - there) > APART_s for other, there in out):
            out.append((i, at))
        if len(out) == most:
            break
    return [{"run": f"run-{i + 1}", "t_s": at} for i, at in out]
