"""Is the stiffness of A1 to A6 found by pulls at the flange, and do the intervals contain the truth?

First the estimate: each published robot predicted from the others. Then arms of the library with a stiffness
drawn around it; the pulls that the command proposes for each; readings with the noise of a dial (rounded to
0.01 mm, 5 um) and of a balance (1 %), made by a chain of rotations of this file, which shares no code with
the package. Every form goes through the text and the reader. Last, arms whose links and bearings bend too:
how far off the displacement is at poses that were not measured.

    python benchmarks/identify_pulls.py [--robots 100] [--poses 10] [--seed 43]
"""

import argparse
import tempfile
import tomllib
from pathlib import Path

import numpy as np

from gcode2krl.cell import library, resolve_cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import displace
from gcode2krl.compliance.estimate import estimated, left_out
from gcode2krl.identify import pulls as asked

AXIS_ROWS = [VIRTUAL_JOINTS.index(f"A{n}") for n in range(1, 7)]
SIGNS = (-1, 1, 1, -1, 1, -1)
TURNS = "zyyxyx"


def turn(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def point_and_axes(q, lengths, point) -> tuple[np.ndarray, list, list]:
    """Return the point in the root, and direction and place of each axis, positive as the display counts."""
    a1, a2, c1, c2, c3, c4 = lengths
    before = ((0, 0, 0), (a1, 0, c1), (c2, 0, 0), (c3, 0, -a2), (0, 0, 0), (0, 0, 0))
    rotation, place, axes, places = np.eye(3), np.zeros(3), [], []
    for k in range(6):
        place = place + rotation @ np.array(before[k], float)
        axes.append(SIGNS[k] * rotation[:, "xyz".index(TURNS[k])])
        places.append(place)
        rotation = rotation @ turn(TURNS[k], SIGNS[k] * q[k])
    flange = rotation @ turn("y", np.pi / 2)
    return place + rotation @ np.array([c4, 0, 0.0]) + flange @ point, axes, places


def moved(pulls, row, lengths, k) -> float:
    """Return how far the point moves along the dial, with springs k (6,) in N·mm/rad on the axes."""
    q, point = pulls.q_rad[row], pulls.point_mm[row]
    at, axes, places = point_and_axes(q, lengths, point)
    torque = [
        axis @ np.cross(at - place, pulls.force_N[row]) for axis, place in zip(axes, places, strict=True)
    ]
    bent, _, _ = point_and_axes(q + np.array(torque) / k, lengths, point)
    return float(pulls.dial[row] @ (bent - at))


def filled(pulls, truth_mm, rng, balance: float) -> str:
    """Return the form with readings; the balance shows a force that is off by its share."""
    lines = asked.form(pulls).splitlines()
    done = [lines[0]]
    for row, line in enumerate(lines[1:]):
        words = line.split(",")
        words[-3] = repr(float(words[-3]) * (1 + balance * rng.normal()))
        zero = rng.uniform(0, 5)
        for column, value in ((-2, zero), (-1, zero + truth_mm[row])):
            words[column] = f"{np.round(value + rng.normal(0, asked.DIAL_SIGMA_MM), 2):.2f}"
        done.append(",".join(words))
    return "\n".join(done) + "\n"


def cell_of(model: str):
    return resolve_cell({"name": model, "robot": {"model": model}})


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--poses", type=int, default=10)
    parser.add_argument("--seed", type=int, default=43)
    options = parser.parse_args()
    estimate()
    rng = np.random.default_rng(options.seed)
    spread = np.sqrt(np.nanmean(np.concatenate([r for _, r in left_out()]) ** 2))
    cells = [cell_of(name) for name in library.names("robots")]
    cells = [cell for cell in cells if cell.robot.limits.q_deg is not None]
    inside, off, half = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.robots):
            cell = cells[number % len(cells)]
            k = expected(cell) * np.exp(spread * rng.normal(size=6))
            pulls = asked.propose(cell, None, options.poses, None, None)
            lengths = cell.robot.geometry.array()
            truth = [moved(pulls, row, lengths, k) for row in range(len(pulls.q_rad))]
            file = Path(folder) / "form.csv"
            file.write_text(filled(pulls, truth, rng, asked.BALANCE), "utf-8")
            fit = asked.fit(asked.read_form(file), cell)
            for found, true in zip(fit.k_Nmm_rad, k, strict=True):
                inside.append(np.nan if found is None else found.contains(true))
                off.append(np.nan if found is None else abs(found.value / true - 1))
                half.append(np.nan if found is None else 0.5 * true * (1 / found.low - 1 / found.high))
    inside, off, half = (np.array(values, float).reshape(-1, 6) for values in (inside, off, half))
    known = np.isfinite(inside)
    sharp = known & (half <= 0.15)
    print(f"{options.robots} arms, {options.poses} poses, {len(asked.PULLS)} pulls each")
    print(f"  determined {known.mean():.3f} of the stiffnesses, {sharp.mean():.3f} to +-15 % or better")
    print(f"  90 % intervals contain the truth: {inside[known].mean():.3f} (aim .87 to .93)")
    print(
        f"  of these within 15 %: {(off[sharp] <= 0.15).mean():.3f}, median off {np.median(off[sharp]):.3f}"
    )
    for axis in range(6):
        rows = known[:, axis]
        print(
            f"    A{axis + 1} determined {rows.mean():.2f}, median off {np.median(off[rows, axis]):.3f}, "
            f"contain {inside[rows, axis].mean():.2f}"
        )
    bending(cells, options, rng)


def expected(cell) -> np.ndarray:
    payload = cell.robot.payload
    soft = estimated(payload.mass_kg, payload.reach_mm).softness[AXIS_ROWS, 2]
    factor = 0.5 * (np.exp(1.6449 * 0.83) + np.exp(-1.6449 * 0.83))  # back from the middle to the typical arm
    return factor / soft


def bending(cells, options, rng) -> None:
    """Print how far off the displacement of an arm with soft links is, at poses that were not measured."""
    shares = []
    for cell in cells:
        soft = estimated(cell.robot.payload.mass_kg, cell.robot.payload.reach_mm).softness
        joints = {
            name: dict(zip(("k_c", "k_b", "k_a"), 1 / row, strict=True))
            for name, row in zip(VIRTUAL_JOINTS[:8], soft, strict=True)
        }
        rigid = dict.fromkeys(("k_c", "k_b", "k_a"), 9.9e99)
        pulls = asked.propose(cell, None, options.poses, None, None)
        x, y, z = pulls.point_mm[0]
        frame = {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
        true = resolve_cell(
            {
                "robot": {"model": cell.robot.model},
                "tool": {"1": {"diameter_mm": 10.0, "teeth": 2, "frame": frame}},
                "compliance": {"virtual_joints": {**joints, "sensor": rigid, "spindle": rigid}},
            }
        )
        shift, _ = displace(pulls.q_rad, pulls.force_N, np.zeros(3), true, 1)
        fit = asked.fit(
            asked.Pulls(*list(vars(pulls).values())[:4], np.sum(shift * pulls.dial, axis=1), "made up"), cell
        )
        if fit.errors():
            continue
        low, high = np.radians(np.array(cell.robot.limits.q_deg)).T
        q = rng.uniform(np.maximum(low, -3), np.minimum(high, 3), (300, 6))
        way = rng.normal(size=(300, 3))
        force = 500 * way / np.linalg.norm(way, axis=1)[:, None]
        real, _ = displace(q, force, np.zeros(3), true, 1)
        lengths, k = cell.robot.geometry.array(), np.array([each.value for each in fit.k_Nmm_rad])
        other = asked.Pulls(q, np.tile(pulls.point_mm[0], (300, 1)), force, way, np.zeros(300), "")
        foreseen = np.array([moved_whole(other, row, lengths, k) for row in range(300)])
        shares.append(np.linalg.norm(real - foreseen, axis=1).mean() / np.linalg.norm(real, axis=1).mean())
    print(
        f"arms whose links and bearings bend too ({len(shares)}): at other poses the displacement is off by "
        f"{np.median(shares):.0%} of it (median arm), {max(shares):.0%} at most"
    )


def moved_whole(pulls, row, lengths, k) -> np.ndarray:
    """Return how far the point moves (3,), to first order."""
    q, point = pulls.q_rad[row], pulls.point_mm[row]
    at, axes, places = point_and_axes(q, lengths, point)
    turns = np.array([np.cross(axis, at - place) for axis, place in zip(axes, places, strict=True)])
    return turns.T @ (turns @ pulls.force_N[row] / k)


def estimate() -> None:
    """Print how well the published sets are predicted from each other, and for how many arms there is one."""
    rows = [(each.robot, residual) for each, residual in left_out()]
    residuals = np.concatenate([residual for _, residual in rows])
    residuals = residuals[np.isfinite(residuals)]
    factor = np.exp(1.6449 * np.sqrt(np.mean(residuals**2)))
    print(f"published: {len(residuals)} joint stiffnesses of {len({name for name, _ in rows})} robots")
    for name, residual in rows:
        print(
            f"  {name:20}", *(f"{np.exp(r):6.2f}" for r in residual), " published / predicted from the others"
        )
    covered, widths = nested()
    print(
        f"  90 %: a factor of {factor:.2f} either way, covers {np.mean(abs(residuals) <= np.log(factor)):.3f}"
    )
    print(
        f"  width from the others alone: factors {min(widths):.1f} to {max(widths):.1f}, covers {covered:.3f}"
    )
    models = [tomllib.loads(file.read_text("utf-8")) for file in library.names("robots").values()]
    known = sum({"mass_kg", "reach_mm"} <= model.get("payload", {}).keys() for model in models)
    print(f"  deflection for {known} of {len(models)} arms of the library")


def nested() -> tuple[float, list[float]]:
    """Return the coverage of a left-out robot by the band of the others' residuals, and those factors."""
    from gcode2krl.compliance.estimate import predicted, published

    sets, inside, widths = published(), [], []
    for robot in {each.robot for each in sets}:
        others = tuple(each for each in sets if each.robot != robot)
        spread = []
        for each in others:
            rest = tuple(s for s in others if s.robot != each.robot)
            spread.append(each.log_k - predicted(rest, each.class_kgm))
        width = 1.6449 * np.sqrt(np.nanmean(np.concatenate(spread) ** 2))
        widths.append(float(np.exp(width)))
        for each in sets:
            if each.robot == robot:
                off = each.log_k - predicted(others, each.class_kgm)
                inside += list(np.abs(off[np.isfinite(off)]) <= width)
    return float(np.mean(inside)), widths


if __name__ == "__main__":
    main()
