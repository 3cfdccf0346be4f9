"""A program without mismatch, kept at every stage, so that an effect costs only what comes after its hook."""

import copy

import numpy as np

from tests.plant import arm as arms
from tests.plant import instruments
from tests.plant.instruments import Instruments
from tests.plant.robot import STAGES, Hooks, Mismatch, Run
from tests.plant.scene import World
from tests.plant.waypoints import PROGRAMS

READ = Instruments(tracker_hz=250.0, force_hz=250.0, controller_s=0.004, force_moments=False)
CHANNELS = {"tcp": 3, "force": 3, "cmd": 6, "act": 6, "load": 6}
"""Columns of each; `act` and `load` are read against `cmd`, in degrees."""
ORDER = list(STAGES)
JOINTS_ONLY = {"lags", "servo", "gear", "tip", "sense"}
"""Stages whose hooks leave load and structure alone, so that the tip follows the joints."""

Signals = dict[str, np.ndarray]


class Scene:
    """One program of the plant with the nominal robot."""

    def __init__(self, program: str):
        run = Run(PROGRAMS[program]().waypoints(), World(), Mismatch())
        run.number = 0
        self.before, self.after = {}, {}
        for stage, work in STAGES.items():
            self.before[stage] = copy.copy(run)
            if work is not None:
                work(run)
            self.after[stage] = copy.copy(run)
        self.run = run
        self.tip_per_rad, self.turn_per_rad = self._per_rad()
        self.tables = instruments.clean(run, READ)
        self.signals = signals_of(self.tables)

    @property
    def rows(self) -> int:
        """Rows of a signal, every 4 ms."""
        return min(len(x) for x in self.signals.values())

    def change(self, hooks: Hooks, age_s: float = 0.0, number: int = 0) -> Signals:
        """What hooks change of each signal; zero where the changed run is shorter."""
        acted = signals_of(instruments.clean(self.driven(hooks, age_s, number), READ))
        out = {}
        for name, bare in self.signals.items():
            n = min(len(bare), len(acted[name]))
            out[name] = np.zeros((self.rows, bare.shape[1]))
            m = min(n, self.rows)
            out[name][:m] = acted[name][:m] - bare[:m]
        return out

    def driven(self, hooks: Hooks, age_s: float = 0.0, number: int = 0) -> Run:
        """The run in which hooks act, gone on with from the first stage that they touch."""
        later = [stage for stage in ORDER if stage in hooks and stage != "world"]
        at = ORDER.index(later[0]) if later else len(ORDER)
        run, begin = None, at
        if "world" in hooks:
            for stage in ("sense", "bend", "load", "world"):
                run = _own(self.before[stage], age_s, number)
                hooks["world"](run)
                begin = ORDER.index(stage)
                if begin <= at and _allows(stage, run, self.before[stage]):
                    break
        if run is None:
            run = _own(self.after[later[0]], age_s, number)
            hooks[later[0]](run)
            begin = at + 1
        only_joints = set(hooks) <= JOINTS_ONLY
        for stage in ORDER[begin:]:
            work = STAGES[stage]
            if stage == "tip" and only_joints:
                self._turn(run)
            elif work is not None:
                work(run)
            if stage in later and not ("world" not in hooks and stage == later[0]):
                hooks[stage](run)
        return run

    def _per_rad(self) -> tuple[np.ndarray, np.ndarray]:
        """Way of the tip in mm and turn of its axes by each joint, (n, 3, 6) each, at the fast samples."""
        run, n, base = self.run, len(self.run.t_s), self.run.world.base.axes
        way, turn = np.empty((n, 3, 6)), np.empty((n, 3, 6))
        for j in range(6):
            low, high = (
                arms.pose(run.arm, np.ascontiguousarray(run.q_load + angle * np.eye(6)[j]))
                for angle in (-1e-4, 1e-4)
            )
            way[:, :, j] = (high[0] - low[0]) @ base / 2e-4
            spin = np.einsum("nij,nkj->nik", (high[1] - low[1]) / 2e-4, base @ run.tip_axes)
            turn[:, :, j] = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1) @ base
        return way, turn

    def _turn(self, run: Run) -> None:
        """The structure's answer to other joint angles under the same load, to first order."""
        bare = self.after["tip"]
        off = run.q_load + run.zero_rad - bare.q_load
        run.tip_mm = bare.tip_mm + np.einsum("nij,nj->ni", self.tip_per_rad, off)
        turned = np.einsum("nij,nj->ni", self.turn_per_rad, off)
        run.tip_axes = bare.tip_axes + np.cross(turned[:, None, :], bare.tip_axes, axisb=2, axisc=1, axisa=2)
        run.part_mm = bare.part_mm.copy()
        run.twist_rad, run.bending_mm, run.arm = bare.twist_rad, bare.bending_mm, bare.arm


def _allows(stage: str, run: Run, bare: Run) -> bool:
    """Whether a changed world leaves alone what was done before this stage."""
    planned = run.way is bare.way and run.believed is bare.believed
    cut = (
        run.world.cutter is bare.world.cutter
        and run.world.stock_mm is bare.world.stock_mm
        and run.world.stock_turn_deg == bare.world.stock_turn_deg
        and run.depth_taper_mm == bare.depth_taper_mm
    )
    stands = not run.payload and not run.reshape and not np.any(run.zero_rad)
    read = planned and run.world is bare.world and stands
    return {"sense": read, "bend": planned and cut, "load": planned, "world": True}[stage]


def _own(run: Run, age_s: float, number: int) -> Run:
    """A copy whose arrays and lists hooks may change."""
    out = copy.copy(run)
    for name, value in vars(run).items():
        if isinstance(value, np.ndarray | list | dict):
            setattr(out, name, value.copy())
    out.age_s, out.number = age_s, number
    return out


def signals_of(tables: dict[str, dict]) -> Signals:
    """The measured links' columns of clean tables."""
    t, f, c = tables["tracker"], tables["force"], tables["controller"]
    command = np.stack([c[f"q{j}_cmd_deg"] for j in range(1, 7)], axis=1)
    return {
        "tcp": np.stack([t[f"{a}_mm"] for a in "xyz"], axis=1),
        "force": np.stack([f[f"f{a}_N"] for a in "xyz"], axis=1),
        "cmd": command,
        "act": np.stack([c[f"q{j}_act_deg"] for j in range(1, 7)], axis=1) - command,
        "load": np.stack([c[f"q{j}_load_deg"] for j in range(1, 7)], axis=1) - command,
    }
