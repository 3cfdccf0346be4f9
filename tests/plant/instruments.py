"""The measured signals of a run, their noise and clocks: clean readings first, then noise on top."""

from dataclasses import dataclass, replace

import numpy as np

from tests.plant import arm as arms
from tests.plant import foreign as strange
from tests.plant import memory
from tests.plant.robot import SIGN, SLOW, Run
from tests.plant.scene import DEGREE, JOINT_ROW, GRAVITY_m_s2

XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Instruments:
    """The measuring chain of a case."""

    tracker_hz: float = 250.0
    tracker_mm: float = 0.02
    tracker_memory: float = 0.5
    tracker_decimals: int = 4
    tracker_turns: bool = False
    force_hz: float = 250.0
    force_N: float = 4.0
    force_memory: float = 0.3
    force_decimals: int = 2
    force_frame: str = "sensor"
    force_moments: bool = True
    controller_s: float = 0.012
    q_act_deg: float = 3e-4
    q_load_deg: float = 3e-4
    q_decimals: int = 5
    q_load: bool = True
    load_sees_twist: bool = False
    torques: bool = False
    scan_mm: float = 0.03
    scan: bool = False
    tables: tuple = ("controller", "tracker", "force")
    drop_outs: bool = True
    foreign: tuple = ()  # of foreign.Foreign
    blank: tuple = ()  # columns that are not there


def drawn(rng: np.random.Generator, needs: frozenset, twist: bool = False) -> Instruments:
    """Instruments of a case: noise from that of a good tracker and sensor to five times as much."""
    tables = ["controller", "tracker", "force"]
    spare = [t for t in ("force", "controller", "tracker") if t not in needs]
    if rng.random() < 0.12 and spare:
        tables.remove(str(rng.choice(spare)))

    def log(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    return Instruments(
        tracker_hz=float(rng.choice([100.0, 200.0, 250.0])),
        tracker_mm=log(0.008, 0.05),
        tracker_memory=rng.uniform(0.0, 0.8),
        tracker_decimals=int(rng.choice([3, 4])),
        tracker_turns=bool(rng.random() < 0.2),
        force_hz=float(rng.choice([125.0, 250.0])),
        force_N=log(2.0, 10.0),
        force_memory=rng.uniform(0.0, 0.8),
        force_decimals=int(rng.choice([1, 2])),
        force_frame=str(rng.choice(["sensor", "sensor", "base", "tcp"])),
        force_moments=bool(rng.random() < 0.5),
        controller_s=float(rng.choice([0.012, 0.012, 0.004])),
        q_act_deg=log(1e-4, 6e-4),
        q_load_deg=log(1e-4, 6e-4),
        q_decimals=int(rng.choice([4, 5])),
        q_load=bool("q_load" in needs or rng.random() < 0.5),
        load_sees_twist=twist,
        torques=bool(rng.random() < 0.5),
        scan_mm=log(0.02, 0.06),
        scan=bool("scan" in needs or rng.random() < 0.15),
        tables=tuple(tables),
    )


def without(how: Instruments, missing: tuple[str, ...]) -> Instruments:
    """A chain that lacks tables, or columns of one."""
    tables = tuple(t for t in how.tables if t not in missing)
    blank = tuple(m for m in missing if m not in READERS)
    if not tables:
        raise ValueError("a run without any table is none; leave one")
    return replace(how, tables=tables, blank=how.blank + blank)


def disturbed(how: Instruments, kinds: tuple) -> Instruments:
    """A chain with foreign noise on top."""
    return replace(how, foreign=kinds)


def true_times(run: Run, table: str, stamps_s: np.ndarray) -> np.ndarray:
    """When the samples with these stamps were taken: stamp = t·(1 + skew) + offset."""
    offset, skew = run.clocks.get(table, (0.0, 0.0))
    taken = (stamps_s - offset) / (1.0 + skew)
    if table in run.jumps:
        at, more = run.jumps[table]
        taken = np.where(stamps_s > at, taken - more, taken)
    return taken


def simulated(run: Run, times_s: np.ndarray) -> np.ndarray:
    """Times of the run as times of the simulation, which leaves out the middle of long dwells."""
    return np.interp(times_s, run.elapsed_s, run.t_s) if run.pauses else times_s


def _at(times_s: np.ndarray, grid_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(times_s, grid_s, columns[:, k]) for k in range(columns.shape[1])], axis=1)


def _stamps(run: Run, step_s: float) -> np.ndarray:
    """Stamps of a table; the middle of a long dwell is not logged."""
    stamps = np.arange(0.0, run.elapsed_s[-1] - 0.05, step_s)
    logged = np.ones(len(stamps), bool)
    gone = 0.0
    for at_s, seconds in run.pauses:
        logged &= (stamps <= at_s + gone) | (stamps >= at_s + gone + seconds)
        gone += seconds
    return stamps[logged]


def _turned_degrees(axes: np.ndarray) -> np.ndarray:
    """A, B, C of axes (n, 3, 3)."""
    b = np.arctan2(-axes[:, 2, 0], np.hypot(axes[:, 0, 0], axes[:, 1, 0]))
    a = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    c = np.arctan2(axes[:, 2, 1], axes[:, 2, 2])
    return np.degrees(np.stack([a, b, c], axis=1))


def _motor_torques(run: Run) -> np.ndarray:
    """Torque of the drives at the slow samples, N·m: the cut, the tool's weight, friction. Rough."""
    slow = np.ascontiguousarray(run.q_load[::SLOW])
    weight = np.zeros((len(slow), 3))
    weight[:, 2] = -120.0 * GRAVITY_m_s2
    turning = arms.torques(run.arm, slow, run.force_N + weight, run.moment_Nmm)[:, JOINT_ROW, 2] * SIGN
    speed = run.rates(run.q_cmd)[::SLOW]
    return -turning / 1000.0 + 60.0 * np.tanh(speed / 0.002) + 150.0 * speed


def _tracker(run: Run, how: Instruments) -> dict:
    stamps = _stamps(run, 1.0 / how.tracker_hz)
    taken = simulated(run, true_times(run, "tracker", stamps))
    place = _at(taken, run.t_s, run.tip_mm) * run.units.get("tracker", 1.0)
    table = {"t_s": stamps, **{f"{a}_mm": place[:, i] for i, a in enumerate(XYZ)}}
    if how.tracker_turns:
        turns = _at(taken, run.t_s, _turned_degrees(run.tip_axes))
        table |= {f"{a}_deg": turns[:, i] for i, a in enumerate("abc")}
    return table


def _force(run: Run, how: Instruments) -> dict:
    stamps = _stamps(run, 1.0 / how.force_hz)
    taken = simulated(run, true_times(run, "force", stamps))
    force, moment = run.sensed_N, run.sensed_Nmm / 1000.0
    if how.force_frame == "sensor":  # moments about the sensor's middle, 28 mm in front of the flange
        lever = run.believed.tool.origin_mm - np.array([0.0, 0.0, 28.0])
        moment = moment + np.cross(lever, force) / 1000.0
    else:  # about the TCP, turned by the nominal tool frame, upright
        turn = run.sensor_axes[0] if how.force_frame == "base" else run.believed.tool.axes.T
        if how.force_frame == "base" and run.axes is not None:
            force, moment = (np.einsum("nij,nj->ni", run.sensor_axes, v) for v in (force, moment))
        else:
            force, moment = force @ turn.T, moment @ turn.T
    force = _at(taken, run.slow_s, force) * run.units.get("force", 1.0)
    table = {"t_s": stamps, **{f"f{a}_N": force[:, i] for i, a in enumerate(XYZ)}}
    if how.force_moments:
        moment = _at(taken, run.slow_s, moment)
        table |= {f"m{a}_Nm": moment[:, i] for i, a in enumerate(XYZ)}
    return table


def _controller(run: Run, how: Instruments) -> dict:
    stamps = _stamps(run, how.controller_s)
    taken = true_times(run, "controller", stamps)
    ahead = simulated(run, true_times(run, "q_cmd", taken))
    behind = simulated(run, true_times(run, "q_load", taken))
    taken = simulated(run, taken)
    place = _at(ahead, run.t_s, run.reported_mm)
    table = {"t_s": stamps, **{f"{a}_cmd_mm": place[:, i] for i, a in enumerate(XYZ)}}
    turns = np.zeros((len(stamps), 3))
    if run.axes is not None:
        turns = _at(ahead, run.t_s, _turned_degrees(run.axes))
    table |= {f"{a}_cmd_deg": turns[:, i] for i, a in enumerate("abc")}
    q_cmd, q_act = _at(ahead, run.t_s, run.q_cmd) / DEGREE, _at(taken, run.t_s, run.q_act) / DEGREE
    table |= {f"q{j + 1}_cmd_deg": q_cmd[:, j] for j in range(6)}
    table |= {f"q{j + 1}_act_deg": q_act[:, j] for j in range(6)}
    if how.q_load:
        q_load = _at(behind, run.t_s, run.q_load)
        if how.load_sees_twist:
            q_load = q_load + _at(behind, run.slow_s, run.twist_rad)
        table |= {f"q{j + 1}_load_deg": q_load[:, j] / DEGREE for j in range(6)}
    if how.torques:
        torque = _at(taken, run.slow_s, _motor_torques(run))
        table |= {f"tau{j + 1}_Nm": torque[:, j] for j in range(6)}
    return table


READERS = {"tracker": _tracker, "force": _force, "controller": _controller}


def clean(run: Run, how: Instruments) -> dict[str, dict]:
    """All tables of a run without noise."""
    read = {name: READERS[name](run, how) for name in how.tables}
    return {name: {c: v for c, v in table.items() if c not in how.blank} for name, table in read.items()}


def sigma(column: str, how: Instruments) -> tuple[float, float, int]:
    """Noise, its memory from row to row, and decimals of a column."""
    if column == "t_s":
        return 0.0, 0.0, 6
    if column in ("x_mm", "y_mm", "z_mm"):
        return how.tracker_mm, how.tracker_memory, how.tracker_decimals
    if column in ("a_deg", "b_deg", "c_deg"):
        return how.tracker_mm / 200.0 / DEGREE, how.tracker_memory, 5
    if column.startswith("f"):
        return how.force_N, how.force_memory, how.force_decimals
    if column.startswith("m"):
        return 0.25 * how.force_N, how.force_memory, 3
    if column.endswith("_act_deg"):
        return how.q_act_deg, 0.0, how.q_decimals
    if column.endswith("_load_deg"):
        return how.q_load_deg, 0.0, how.q_decimals
    if column.startswith("tau"):
        return 15.0, 0.3, 1
    return 0.0, 0.0, 4 if column.endswith("_mm") else how.q_decimals


def noisy(
    tables: dict[str, dict], how: Instruments, units: dict, rng: np.random.Generator
) -> dict[str, dict]:
    """Noise, quantisation and drop-outs (empty or missing rows) on clean tables."""
    out = {}
    own = np.random.default_rng(int(rng.integers(1 << 62))) if how.foreign else rng
    for name, table in tables.items():
        n = len(table["t_s"])
        unit = units.get(name, 1.0)
        table = strange.on_top(table, how.foreign, unit, own)
        seen = {}
        for column, values in table.items():
            spread, keeps, decimals = sigma(column, how)
            if column != "t_s":
                white = rng.normal(size=n)
                values = values + spread * unit * memory.coloured(white, keeps)
                decimals += int(np.ceil(-np.log10(unit))) if unit < 1.0 else 0
            seen[column] = np.round(values, decimals)
        out[name] = _dropped(seen, name, rng) if how.drop_outs else seen
    return out


def _dropped(table: dict, name: str, rng: np.random.Generator) -> dict:
    """A tracker loses its beam now and then; a force table loses single rows; the controller nothing."""
    n = len(table["t_s"])
    keep, empty = np.ones(n, bool), np.zeros(n, bool)
    rate = n / (table["t_s"][-1] + 1e-9)
    if name == "tracker":
        for _ in range(int(rng.integers(0, 4))):
            start, length = int(rng.integers(0, n)), int(rng.uniform(0.05, 0.35) * rate)
            if rng.random() < 0.5:
                keep[start : start + length] = False
            else:
                empty[start : start + length] = True
    if name == "force" and rng.random() < 0.3:
        empty[rng.integers(0, n, 3)] = True
    out = {}
    for column, values in table.items():
        values = values.copy()
        if column != "t_s":
            values[empty] = np.nan
        out[column] = values[keep]
    return out
