"""Announced leads, forces and times of many programs against a replay of their ``.src`` alone."""

import math

import numpy as np
import pytest

from gcode2krl import write_krl
from gcode2krl.pilot import read_pilot
from tests.cells import over_demonstration
from tests.conftest import draws
from tests.krl.brute_replay import Law, replay
from tests.krl.conftest import read
from tests.krl.forces import cutting_below, moved, with_forces

CYCLE_S, LEAD_S, GRID_S = 0.012, 0.040, 0.0015
TRUE_S = 0.003
"""How true a stated lead is; the contract says a cycle."""
BORDER_S = 0.002
"""A knot of the sample at which the robot rests belongs to what was before, or to what follows."""
MOST_SHORT_S = 0.5
"""Behind a standstill of unknown length knots may have less than the lead for so long."""
CELLS = {
    "default": {},
    "unlimited": {"controller": {"advance": "unlimited"}},
    "slow": {"controller": {"acc_cp_m_s2": 0.8, "advance": 5}},
    "sharp": {"controller": {"k_s": 0.06, "cdis_mm": 1.0, "acc_cp_m_s2": 3.0}},
    "stops": {"controller": {"advance": 0}},
}


def head(tool):
    return f"G21 G90 G17 G54\nT{tool} M6\nS9000 M3\nG0 G43 H{tool} Z30\nG0 X0 Y0\nG0 Z2\n"


def generated(chance):
    """Return a program with tools, dwells, M-codes, unequal feeds, arcs, exact stops and short moves."""
    here = np.zeros(2)
    lines = [head(1), f"G64 P{chance.choice([0.02, 0.1, 1.0, 4.0])}", f"G1 Z-1 F{chance.integers(300, 1500)}"]
    for _ in range(int(chance.integers(6, 16))):
        kind = chance.choice(
            ["far", "far", "near", "feed", "feed", "arc", "dwell", "m", "retract", "tool", "exact", "chain"]
        )
        feed = f" F{chance.integers(300, 5000)}"
        if kind in ("far", "feed", "near"):
            here = np.clip(here + chance.normal(0, {"near": 2.0}.get(str(kind), 40.0), 2), -150, 150)
            lines.append(f"G1 X{here[0]:.3f} Y{here[1]:.3f}{feed if kind != 'near' else ''}")
        elif kind == "arc":
            x, y = np.round(np.clip(here, -100, 100), 3)
            lines.append(f"G1 X{x:.3f} Y{y:.3f}")
            radius = round(float(chance.uniform(1, 15)), 3)
            here = np.array([x + 2 * radius, y])
            lines.append(f"{chance.choice(['G2', 'G3'])} X{here[0]:.3f} Y{y:.3f} I{radius:.3f} J0{feed}")
        elif kind == "dwell":
            lines.append(f"G4 P{chance.uniform(0.05, 1.5):.2f}")
        elif kind == "m":
            lines.append(str(chance.choice(["M8", "M9", "M0", "S8000 M3"])))
        elif kind == "retract":
            lines += ["G0 Z3", f"G0 X{here[0] + 5:.3f}", f"G1 Z-1{feed}", f"G1 X{here[0]:.3f}"]
        elif kind == "tool":
            lines += ["G0 Z30", head(int(chance.integers(1, 4))).split("\n", 1)[1], f"G1 Z-1{feed}"]
            here = np.zeros(2)
        elif kind == "exact":
            here = np.clip(here + chance.normal(0, 20, 2), -150, 150)
            lines += ["G61", f"G1 X{here[0]:.3f} Y{here[1]:.3f}", "G64 P0.05"]
        else:
            for _ in range(int(chance.integers(5, 40))):
                here = here + chance.normal(0, 1.0, 2)
                lines.append(f"G1 X{here[0]:.3f} Y{here[1]:.3f}")
    return "\n".join([*lines, "G0 Z30", "M5", "M30", ""])


class Case:
    """A program with a pilot force, and what the replay finds in it."""

    def __init__(self, folder, text, data, steps):
        self.cell = over_demonstration(data)
        prediction = moved(read(text, self.cell), self.cell)
        self.force_N = cutting_below(prediction, force_N=300.0, ramp_s=0.0 if steps else 0.3)
        self.prediction = with_forces(prediction, self.force_N)
        self.program = write_krl(self.prediction, folder / "part.src")
        if self.program.pilot is not None:
            self.knots, self.header = read_pilot(folder / "part.pilot.csv")
        controller = self.cell.controller
        law = Law(controller.k_s, math.inf if controller.advance == "unlimited" else controller.advance)
        first, last = np.flatnonzero(self.program.targets.move >= 0)[[0, -1]]
        self.replay = replay(folder / "part.src", int(first), int(last), law)

    def check_motion(self):
        """The replay's motion is the predicted one."""
        motion, done = self.prediction.motion, self.replay
        assert abs(done.total_s - motion.time_s[-1]) < CYCLE_S + GRID_S
        some = slice(None, None, 7)
        speed = motion.speed_mm_s[some]
        places = np.array([done.place(t) for t in motion.time_s[some]])
        off = np.linalg.norm(places - motion.position_mm[some], axis=1)
        assert (off <= 0.02 + speed * GRID_S).all(), off.max()

    def check_leads(self):
        """Each knot is announced at least the lead ahead, and its stated lead is true, in real time."""
        done, knots = self.replay, self.knots
        count = len(knots)
        ends = len(done.fired) - count
        assert ends in (0, 1)
        if ends:
            assert not any(number > 0 for number in done.fired[-1].numbers), "the last says: no knot"
        fired_s = np.array([fired.real_s for fired in done.fired])
        both = np.array([[done.real(t + b) - b for t in knots.time_s] for b in (-BORDER_S, BORDER_S)])
        leads_s = both - fired_s[:count]
        lead_s = np.where(np.abs(leads_s - knots.lead_s).argmin(axis=0) == 0, *leads_s)
        assert (np.abs(lead_s - knots.lead_s) <= TRUE_S).all(), np.abs(lead_s - knots.lead_s).max()
        starts = np.array([begin for begin, _ in done.sections]) - BORDER_S
        since_s = np.array([(t - starts[starts <= t]).min() for t in knots.time_s])
        least_s = np.where(since_s > MOST_SHORT_S, LEAD_S, np.minimum(LEAD_S, knots.lead_s))
        assert (lead_s >= least_s - GRID_S).all(), (lead_s - least_s).min()
        assert all(fired.time_s <= fired.end_s + BORDER_S for fired in done.fired)
        assert (np.diff(fired_s) >= CYCLE_S - GRID_S).all()
        return lead_s


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(k, marks=pytest.mark.slow) for k in range(8, 8 + draws(12)))]
)
def test_leads_of_generated_programs(tmp_path, seed):
    """Several cells, both forms, with steps of the force and without."""
    chance = np.random.default_rng(seed)
    data = list(CELLS.values())[seed % len(CELLS)]
    form = ("index", "values")[seed // len(CELLS) % 2]
    case = Case(tmp_path, generated(chance), {**data, "pilot": {"form": form}}, steps=seed % 3 == 0)
    case.check_motion()
    if case.program.pilot is not None:
        case.check_leads()
