"""Held-out error, coverage and time of ``identify kinematics`` on made-up arms, beside plain least squares.

``python benchmarks/identify_kinematics.py`` makes arms of six makers (tests/plant/pose_arms.py): clean ones
with 17 small errors, and hard ones with weight, play, eccentric encoders, drift, air and 2 % of outliers too.
Errors are root mean squares over places left out of the fit, in mm; "oracle" is the noise of a distance,
sqrt(3) sigma. The peer is what a person writes with scipy: least squares on the 24 Denavit-Hartenberg numbers
with base and tool, in as many lines as `_peer` has. ``--draws`` arms of each kind and maker, ``--poses`` of
each. ``--pybotics PYTHON``: an interpreter that has pybotics (3.1.2 needs numpy < 2), a second peer on the
same poses and folds: its modified Denavit-Hartenberg numbers, tool and world (benchmarks/peers).
"""

import argparse
import inspect
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from gcode2krl.identify.kinematics import (
    Geometry,
    arm_named,
    identify_kinematics,
    read_readings,
)
from tests.plant import pose_arms

PYBOTICS = Path(__file__).parent / "peers" / "identify_pybotics.py"
AIMS = {"clean": 0.04, "ratio": 1.2, "coverage": (0.87, 0.93), "seconds": 10.0}


def main(arguments: Sequence[str] | None = None, write: Callable[[str], object] = print) -> int:
    """Print the figures, and whether they meet the aims."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--poses", type=int, default=400)
    parser.add_argument("--pybotics", metavar="PYTHON", help="an interpreter that has pybotics")
    given = parser.parse_args(arguments)
    met = [*(figures(kind, given.draws, given.poses, write, given.pybotics) for kind in ("clean", "hard"))]
    write("every aim met" if all([*met, timed(write)]) else "not every aim met")
    return 0


def figures(
    kind: str, draws: int, poses: int, write: Callable[[str], object], pybotics: str | None = None
) -> bool:
    """Print the figures of one kind of arm; True where the aims are met."""
    write(f"{kind} arms, {draws} of each maker, {poses} poses")
    names = ("before", "after", "oracle", "ratio", "most", "peer", *(["pybot."] if pybotics else []))
    write(f"  {'arm':<20} {' '.join(f'{name:>7}' for name in names)}  outliers found")
    inside, worst = [], 0.0
    for number, maker in enumerate(pose_arms.MAKERS):
        rows, hits = [], np.zeros(2, dtype=int)
        for draw in range(draws):
            arm = getattr(pose_arms, kind)(maker, 100 * number + draw)
            table = pose_arms.measured(arm, poses, draw, again=0 if kind == "clean" else 20)
            found = identify_kinematics(read_readings(table.columns()), arm_named(maker.name))
            oracle = np.sqrt(3.0) * arm.noise_mm
            after = found.rms_after_mm
            peers = [_peer(arm, table), *([_of_pybotics(arm, table, pybotics)] if pybotics else [])]
            rows.append((found.rms_before_mm, after, oracle, after / oracle, after / oracle, *peers))
            hits += ((found.is_outlier & table.is_wrong).sum(), table.is_wrong.sum())
            inside += _held(arm, found) if kind == "clean" else []
        shown = np.mean(rows, axis=0)
        shown[4] = max(row[3] for row in rows)
        worst = max(worst, shown[4])
        words = " ".join(f"{value:7.3f}" for value in shown)
        write(f"  {maker.name:<20} {words}  {hits[0]} of {hits[1]}")
    write(f"  largest ratio {worst:.2f} (aim {AIMS['ratio']})")
    if not inside:
        return worst <= AIMS["ratio"]
    low, high = AIMS["coverage"]
    share = float(np.mean(inside))
    write(f"  90 % intervals that hold the truth: {share:.3f} of {len(inside)} (aim {low} to {high})")
    return worst <= AIMS["ratio"] and low <= share <= high


def _held(arm: pose_arms.MadeUp, found: Geometry) -> list[bool]:
    """Tell for each told number of a clean arm whether its interval holds the truth."""
    by_name = {part.name: part for part in found.parts}
    truth = pose_arms.truth(arm).items()
    return [by_name[name].estimate.contains(value) for name, value in truth if by_name[name].is_told]


def timed(write: Callable[[str], object]) -> bool:
    """Print the seconds of 1,000 poses."""
    table = pose_arms.measured(pose_arms.hard(pose_arms.KR300, 1), 1000, 1, again=20)
    readings = read_readings(table.columns())
    began = time.perf_counter()
    identify_kinematics(readings, arm_named(pose_arms.KR300.name))
    seconds = time.perf_counter() - began
    lines = sum(len(inspect.getsource(each).splitlines()) for each in (_peer, _peer_tips))
    script = sum(bool(line) for line in PYBOTICS.read_text(encoding="utf-8").split('"""')[2].splitlines())
    write(f"1,000 poses: {seconds:.1f} s (aim {AIMS['seconds']:.0f} s)")
    write(f"a user writes {lines} lines for the peer, {script} with pybotics, and one command here")
    return seconds < AIMS["seconds"]


def _peer(arm: pose_arms.MadeUp, table: pose_arms.Measured, folds: int = 5) -> float:
    """Return the error at places left out (outliers not counted) of least squares on Denavit-Hartenberg."""
    rows, theta, seen, place = _given(arm, table, folds)
    off = np.zeros(len(seen))
    start = np.concatenate([arm.place_mm, np.array(arm.turn_deg) * pose_arms.DEG, arm.tool_mm, np.zeros(25)])
    for fold in range(folds):
        inside = place != fold

        def residual(x: np.ndarray) -> np.ndarray:
            return (_peer_tips(rows, theta[inside], x) - seen[inside]).ravel()  # noqa: B023

        found = least_squares(residual, start, x_scale="jac")
        off[~inside] = np.linalg.norm(_peer_tips(rows, theta[~inside], found.x) - seen[~inside], axis=1)
    return float(np.sqrt(np.mean(off[~table.is_wrong] ** 2)))


def _given(
    arm: pose_arms.MadeUp, table: pose_arms.Measured, folds: int = 5
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers of the arm without errors, its angles, the points, and the place of each."""
    rows = pose_arms.table_of(pose_arms.MadeUp(arm.name, arm.lengths_mm))
    theta = pose_arms.paper_angles(arm, table.q_deg * pose_arms.DEG)
    _, place = kmeans2(table.seen_mm, folds, minit="++", rng=np.random.default_rng(1))
    return rows, theta, table.seen_mm, place


def _of_pybotics(arm: pose_arms.MadeUp, table: pose_arms.Measured, python: str) -> float:
    """Return the error at places left out of pybotics, whose links turn about x before they turn about z."""
    rows, theta, seen, place = _given(arm, table)
    before = np.vstack([np.zeros(5), rows[:-1]])
    mdh = np.column_stack([before[:, 3], before[:, 2], rows[:, 0], rows[:, 1]])
    world = np.concatenate([arm.place_mm, np.array(arm.turn_deg) * pose_arms.DEG])
    given = {"mdh": mdh, "q_rad": theta, "seen_mm": seen, "place": place, "counts": ~table.is_wrong}
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "poses.npz"
        np.savez(file, **given, world=world, tool=[*arm.tool_mm, 0.0, 0.0, 0.0])
        done = subprocess.run([python, PYBOTICS, file], capture_output=True, text=True, check=True)
    return float(done.stdout)


def _peer_tips(rows: np.ndarray, theta: np.ndarray, x: np.ndarray) -> np.ndarray:
    changed = rows.copy()
    changed[:, :4] += x[9:33].reshape(6, 4)
    changed[1, 4] += x[33]
    turn = np.eye(4)
    for axis, angle in zip((2, 1, 0), x[3:6], strict=True):
        turn = turn @ pose_arms.elementary("turn", axis, np.array([angle]))[0]
    tip = pose_arms.frames(changed, theta)[6] @ np.array([*x[6:9], 1.0])
    return tip[:, :3] @ turn[:3, :3].T + x[:3]


if __name__ == "__main__":
    sys.exit(main())
