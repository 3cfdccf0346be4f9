"""Coverage of the 90 % intervals of `gcode2krl identify controller` over random controllers.

Each draw is a controller with another k (whole cycles of 12 ms), CDIS and law that runs the program of
`make-test controller`; its trace has another noise, rounding and start. The traces are made here by brute
force, a numerical moving average at 0.1 ms and the parabola by its own formula, without the planner and the
reader of the package.

    python benchmarks/identify_controller.py [--draws 200] [--seed 2022]
"""

import argparse
import io
import re
import sys
import time
from dataclasses import dataclass

import numpy as np

from gcode2krl import load_cell, set_targets
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gcode import read_stream
from gcode2krl.identify.controller import identify_controller
from gcode2krl.identify.trial_program import controller_test_program
from gcode2krl.runs import ControllerTrace

CYCLE_S = 0.012
ACC_MM_S2 = 2000.0
FINE_S = 1e-4
RAPID_MM_S = 200.0


@dataclass(frozen=True)
class Controller:
    """The truth of a draw."""

    k_s: float = 0.168
    cdis_mm: float = 5.0
    law: str = "averages"


@dataclass(frozen=True)
class Leg:
    """One or two lines from rest to rest, then a dwell."""

    points_mm: np.ndarray
    speeds_mm_s: tuple[float, ...]
    dwell_s: float
    acc_mm_s2: float = ACC_MM_S2


def turning_leg(start_mm, end_mm, angle_deg, vel_ori_deg_s, acc_ori_deg_s2, speed_mm_s, dwell_s) -> Leg:
    """A line on which the tool turns: angle and path progress by the same fraction."""
    points = np.array([start_mm, end_mm], dtype=float)
    mm_per_deg = np.linalg.norm(points[1] - points[0]) / angle_deg
    speed = min(speed_mm_s, vel_ori_deg_s * mm_per_deg)
    return Leg(points, (speed,), dwell_s, min(ACC_MM_S2, acc_ori_deg_s2 * mm_per_deg))


def legs_of(text: str, start_mm=(100.0, 0.0, 100.0)) -> list[Leg]:
    """Read the few words that the test program uses."""
    legs, here = [], np.array(start_mm)
    points, speeds, feed, blended = [here], [], 0.0, False

    def close(dwell_s: float) -> None:
        nonlocal points, speeds
        if speeds:
            legs.append(Leg(np.array(points), tuple(speeds), dwell_s))
        points, speeds = [here], []

    for line in text.splitlines():
        words = dict(re.findall(r"([A-Z])(-?[0-9.]+)", re.sub(r"\(.*\)", "", line)))
        if line.startswith(("G0", "G1")):
            here = np.array([float(words.get(axis, old)) for axis, old in zip("XYZ", here, strict=True)])
            feed = float(words["F"]) / 60.0 if "F" in words else feed
            speed = RAPID_MM_S if line.startswith("G0") else feed
            points.append(here)
            speeds.append(speed)
            if not blended:
                close(0.0 if legs else 0.5)
        elif line.startswith("G64"):
            blended = True
        elif line.startswith("G61"):
            blended = False
        elif line.startswith("G4"):
            last = legs.pop()
            legs.append(Leg(last.points_mm, last.speeds_mm_s, last.dwell_s + float(words["P"])))
    return [leg for leg in legs if np.linalg.norm(leg.points_mm[-1] - leg.points_mm[0]) > 0]


def averaged(t: np.ndarray, values: np.ndarray, width_s: float) -> np.ndarray:
    """Moving average over the past ``width_s``; before the grid the values are 0."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
    return (integral - np.interp(t - width_s, t, integral, left=0.0)) / width_s


def path_of(leg: Leg, controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    """Return fine times and the way along the lines, from rest to rest."""
    lengths = np.linalg.norm(np.diff(leg.points_mm, axis=0), axis=1)
    v = leg.speeds_mm_s
    if v[0] > v[-1]:
        reverse = Leg(leg.points_mm[::-1], v[::-1], 0.0)
        t, way = path_of(reverse, controller)
        return t[-1] - t[::-1], lengths.sum() - way[::-1]
    d = min(controller.cdis_mm, *(lengths / 2)) if len(v) == 2 else 0.0
    if v[0] < v[-1]:
        before = lengths[0] + d + v[0] * controller.k_s / 2.0
        knots = speed_knots(before, lengths.sum() - before, *v)
        t, speed = ramps(knots, controller)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    elif controller.law == "averages":
        total = lengths.sum()
        t = grid(total / v[0] + v[0] / leg.acc_mm_s2 + controller.k_s)
        way = averaged(t, np.minimum(v[0] * t, total), v[0] / leg.acc_mm_s2)
    else:
        total = lengths.sum()
        top = min(v[0], np.sqrt(leg.acc_mm_s2 * total))
        rise = top / leg.acc_mm_s2
        level = (total - top * rise) / top
        t, speed = ramps([(0, 0), (rise, top), (rise + level, top), (2 * rise + level, 0)], controller)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    return t, averaged(t, way, controller.k_s)


def grid(duration_s: float) -> np.ndarray:
    return np.arange(int(np.ceil(duration_s / FINE_S)) + 2) * FINE_S


def ramps(knots: list[tuple[float, float]], controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    times, speeds = zip(*knots, strict=True)
    t = np.union1d(grid(times[-1] + controller.k_s), np.array(times))
    return t, np.interp(t, times, speeds)


def speed_knots(before_mm: float, after_mm: float, slow: float, fast: float) -> list[tuple[float, float]]:
    """Run up to ``slow``, keep it for ``before_mm``, then on to ``fast`` and down to rest."""
    knots = [(0.0, 0.0), (slow / ACC_MM_S2, slow)]
    level = (before_mm - slow**2 / (2 * ACC_MM_S2)) / slow
    knots.append((knots[-1][0] + level, slow))
    knots.append((knots[-1][0] + (fast - slow) / ACC_MM_S2, fast))
    level = (after_mm - (2 * fast**2 - slow**2) / (2 * ACC_MM_S2)) / fast
    knots.append((knots[-1][0] + level, fast))
    knots.append((knots[-1][0] + fast / ACC_MM_S2, 0.0))
    return knots


def place(leg: Leg, way: np.ndarray, cdis_mm: float) -> np.ndarray:
    """Return positions on the lines, in the corner on the parabola (C1, P2, C2) as a Bezier curve."""
    points = leg.points_mm
    sizes = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.diff(points, axis=0) / sizes[:, None]
    if len(sizes) == 1:
        return points[0] + way[:, None] * u[0]
    d = min(cdis_mm, *(sizes / 2))
    beyond = way > sizes[0]
    result = np.where(
        beyond[:, None], points[1] + (way - sizes[0])[:, None] * u[1], points[0] + way[:, None] * u[0]
    )
    share = (way - sizes[0] + d) / (2 * d)
    inside = (share > 0) & (share < 1)
    s = share[inside, None]
    c1, c2 = points[1] - d * u[0], points[1] + d * u[1]
    result[inside] = (1 - s) ** 2 * c1 + 2 * s * (1 - s) * points[1] + s**2 * c2
    return result


def simulate(
    legs: list[Leg],
    controller: Controller,
    rng: np.random.Generator,
    *,
    noise_mm: float = 0.0,
    rounding_mm: float = 0.001,
    cycle_s: float = CYCLE_S,
) -> tuple[np.ndarray, np.ndarray]:
    """Return sample times and recorded positions; the first sample falls anywhere in a cycle."""
    times, positions = [np.zeros(1)], [legs[0].points_mm[:1]]
    now = 0.2 + rng.uniform(0.0, cycle_s)
    for leg in legs:
        t, way = path_of(leg, controller)
        times.append(now + t)
        positions.append(place(leg, way, controller.cdis_mm))
        now += t[-1] + leg.dwell_s + FINE_S
    times.append(np.array([now]))
    positions.append(positions[-1][-1:])
    fine_t, fine = np.concatenate(times), np.concatenate(positions)
    t = np.arange(0.0, now, cycle_s)
    position = np.stack([np.interp(t, fine_t, fine[:, axis]) for axis in range(3)], axis=1)
    if noise_mm:
        position = position + rng.normal(0.0, noise_mm, position.shape)
    if rounding_mm:
        position = np.round(position / rounding_mm) * rounding_mm
    return t, position


def draw(rng: np.random.Generator) -> tuple[Controller, float]:
    controller = Controller(
        k_s=int(rng.integers(8, 21)) * CYCLE_S,
        cdis_mm=float(rng.uniform(2.0, 12.0)),
        law=("averages", "trapezoid")[int(rng.integers(2))],
    )
    return controller, float(np.exp(rng.uniform(np.log(0.002), np.log(0.020))))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=2022)
    arguments = parser.parse_args()
    cell = load_cell()
    text = controller_test_program(cell)
    targets = set_targets(read_stream(io.BytesIO(text.encode()), "test program", cell), cell)
    legs = legs_of(text)
    rng = np.random.default_rng(arguments.seed)
    rows, seconds, failed, warned = [], [], 0, 0
    for _ in range(arguments.draws):
        controller, noise_mm = draw(rng)
        t, position = simulate(legs, controller, rng, noise_mm=noise_mm)
        trace = ControllerTrace(t, position, np.arange(len(t)), 0, "trace")
        start = time.perf_counter()
        try:
            found = identify_controller(trace, targets, cell)
        except Gcode2KrlError as error:
            failed += 1
            print(f"failed: {controller}: {error}", file=sys.stderr)
            continue
        seconds.append(time.perf_counter() - start)
        warned += any(issue.severity == "warning" for issue in found.issues)
        k, cdis = found.k_s, found.cdis_mm
        rows.append(
            (
                k.contains(controller.k_s),
                k.value - controller.k_s,
                (k.high - k.low) / 2,
                cdis is not None and cdis.contains(controller.cdis_mm),
                cdis.value - controller.cdis_mm if cdis else np.nan,
                (cdis.high - cdis.low) / 2 if cdis else np.nan,
                found.law == controller.law,
                found.k_best_s == controller.k_s,
            )
        )
    table = np.array(rows, dtype=float)
    covered_k, covered_cdis = table[:, 0].mean(), table[:, 3].mean()
    print(f"{arguments.draws} draws, {len(t)} samples a trace (the last), {failed} without a result")
    print(
        f"  90 % interval of k     covers {covered_k:6.1%}   bias {table[:, 1].mean() * 1e6:+8.2f} us"
        f"   half-width {np.median(table[:, 2]) * 1e6:8.2f} us (median)"
    )
    print(
        f"  90 % interval of CDIS  covers {covered_cdis:6.1%}   bias {table[:, 4].mean() * 1e3:+8.2f} um"
        f"   half-width {np.median(table[:, 5]) * 1e3:8.2f} um (median)"
    )
    z_k, z_cdis = (1.6449 * table[:, i] / table[:, i + 1] for i in (1, 4))
    print(
        f"  errors in sigma        k {z_k.mean():+.2f} +- {z_k.std():.2f}, "
        f"CDIS {z_cdis.mean():+.2f} +- {z_cdis.std():.2f} (right: 0 +- 1)"
    )
    print(
        f"  right law {table[:, 6].mean():.1%}, right whole cycles applied {table[:, 7].mean():.1%}, "
        f"warnings {warned}, {np.median(seconds):.3f} s a fit"
    )


if __name__ == "__main__":
    main()
