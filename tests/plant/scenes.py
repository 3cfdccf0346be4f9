"""A program without mismatch, kept at every stage, so that an effect costs only what comes after its hook."""

import copy

import numpy as np

from tests.plant import instruments
from tests.plant.instruments import Instruments
from tests.plant.robot import STAGES, Hooks, Mismatch, Run
from tests.plant.scene import World
from tests.plant.waypoints import PROGRAMS

READ = Instruments(tracker_hz=250.0, force_hz=250.0, controller_s=0.004, force_moments=False)
CHANNELS = {"tcp": 3, "force": 3, "cmd": 6, "act": 6, "load": 6}
"""Columns of each; `act` and `load` are read against `cmd`, in degrees."""
ORDER = list(STAGES)

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
            for stage in ("bend", "load", "world"):
                run = _own(self.before[stage], age_s, number)
                hooks["world"](run)
                begin = ORDER.index(stage)
                if begin <= at and _allows(stage, run, self.before[stage]):
                    break
        if run is None:
            run = _own(self.after[later[0]], age_s, number)
            hooks[later[0]](run)
            begin = at + 1
        for stage in ORDER[begin:]:
            work = STAGES[stage]
            if work is not None:
                work(run)
            if stage in later and not ("world" not in hooks and stage == later[0]):
                hooks[stage](run)
        return run


def _allows(stage: str, run: Run, bare: Run) -> bool:
    """Whether a changed world leaves alone what was done before this stage."""
    planned = run.way is bare.way and run.believed is bare.believed
    cut = (
        run.world.cutter is bare.world.cutter
        and run.world.stock_mm is bare.world.stock_mm
        and run.world.stock_turn_deg == bare.world.stock_turn_deg
        and run.depth_taper_mm == bare.depth_taper_mm
    )
    return {"bend": planned and cut, "load": planned, "world": True}[stage]


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
