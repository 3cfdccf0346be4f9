"""The twin and the offline compensation where the tool's axis turns: what the bent tool leaves on the part.

Four programs: the example (a tilted face, the swarf cut of a cone), a slot whose tool leans from one side to
the other, a ball that nods while its middle goes straight, rings of a dome by a ball with lead. Each row has
the deviation normal to the feed where the cutter touches the finished part, RMS and largest: without
compensation, by the online compensator without and with pilot, by axes; and by targets moved offline, with
exact forces and stiffness. Nothing is judged here.

    python benchmarks/five_axis_twin.py            below a minute
    python benchmarks/five_axis_twin.py --small    the slot alone
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import five_axis_programs as programs  # noqa: E402

from gcode2krl import compliance, load_cell, read_gcode  # noqa: E402
from gcode2krl.cell.sections import Machine, Stock  # noqa: E402
from gcode2krl.compensation.iteration import compensate  # noqa: E402
from gcode2krl.cutting.milling import tool_axes  # noqa: E402
from gcode2krl.online.judge import judged  # noqa: E402
from gcode2krl.online.outcome import simulate_all  # noqa: E402
from gcode2krl.online.twin import World, twin_of  # noqa: E402
from gcode2krl.pipeline import predict_toolpath  # noqa: E402

HEAD = {"kind": "head-head", "axes": ["C", "A"], "signs": [1, 1]}
BALL = {"kind": "ball", "diameter_mm": 12.0, "corner_radius_mm": 6.0, "teeth": 2, "flute_length_mm": 26.0}
EXAMPLE = ROOT / "examples" / "five_axis"
LONG = ((-50.0, -30.0, -30.0), (50.0, 30.0, 0.0))
DOME = ((-60.0, -60.0, -50.0), (60.0, 60.0, 0.0))
FACE = ((-43.0, -62.0, -25.0), (45.0, 45.0, 0.0))


def leaning(count=25):
    """Yield a straight slot 8 mm deep whose tool leans from 15° to one side to 15° to the other."""
    points = []
    for share in np.linspace(0.0, 1.0, count):
        lean = math.radians(30.0 * share - 15.0)
        points.append(
            (np.array([120.0 * share - 60.0, 0.0, -8.0]), np.array([0.0, math.sin(lean), math.cos(lean)]))
        )
    yield from programs._cut(points)


def nodding(count=49):
    """Yield a ball 2 mm deep whose middle goes straight while it nods by 20° to and fro, twice."""
    points = []
    for share in np.linspace(0.0, 1.0, count):
        nod = math.radians(20.0 * math.sin(4.0 * math.pi * share))
        axis = np.array([math.sin(nod), 0.0, math.cos(nod)])
        points.append((np.array([120.0 * share - 60.0, 0.0, 4.0]) - 6.0 * axis, axis))
    yield from programs._cut(points)


def cases():
    """Yield name, text and cell of each program."""
    cell = load_cell()
    head = cell.model_copy(update={"machine": Machine(**HEAD, tcpm=True)})
    ball = head.model_copy(update={"tool": {**cell.tool, 1: cell.tool[1].model_copy(update=BALL)}})
    programs.SOUND |= {"leaning slot": leaning, "nodding ball": nodding}
    for name, made_for, box in (
        ("leaning slot", head, LONG),
        ("nodding ball", ball, LONG),
        ("sphere with lead", ball, DOME),
    ):
        yield name, programs.posted(name, HEAD), made_for.model_copy(update={"stock": Stock(box_mm=box)})
    example = load_cell(EXAMPLE / "cell.toml").model_copy(update={"stock": Stock(box_mm=FACE)})
    yield "example", (EXAMPLE / "five_axis.nc").read_text(), example


def figures(size_mm):
    """Return RMS and largest of deviations (n,) as a cell of the table."""
    return f"{np.sqrt(np.mean(size_mm**2)):.3f} / {size_mm.max():.2f}"


def row_of(name, text, cell, folder):
    """Return a row of the table, and what the text says beside it."""
    part = folder / "part.nc"
    part.write_text(text, encoding="utf-8")
    toolpath = read_gcode(part, cell)
    seen = predict_toolpath(toolpath, cell, dt_s=cell.online.cycle_s)
    judgement = judged(seen, cell.online.memory_s)
    runs = simulate_all(twin_of(seen, cell.online, World()))
    sure = cell.model_copy(update={"material": cell.material.model_copy(update={"relative_band": 0.15})})
    plain = predict_toolpath(toolpath, sure)
    done = compensate(toolpath, plain.targets, sure, plain.motion, plain.forces)
    left = np.linalg.norm(done.after.offset_mm[done.after.cuts], axis=1)
    columns = [figures(run.normal_mm[judgement.counts]) for run in runs.values()]
    print(f"| {name} | {' | '.join(columns)} | {figures(left)} | {done.after.steady_max_mm:.3f} |")
    rate = np.linalg.norm(np.gradient(tool_axes(plain.motion), plain.motion.time_s, axis=0), axis=1)
    base = cell.base_matrix()[:3, :3].T
    load = (seen.forces.force_base_N @ base, seen.forces.moment_base_Nmm @ base)
    turn = compliance.displace(seen.joints.q_rad, *load, cell, seen.motion.tool)[1] @ base.T
    row, point, normal = judgement.touching
    moved = np.cross(turn[row], point - seen.motion.position_mm[row])
    by_tilt = np.abs(np.einsum("ij,ij->i", moved, normal))
    size_N = np.linalg.norm(plain.forces.force_base_N, axis=1)
    return (
        f"{name}: up to {size_N.max():.0f} N; the axis turns by up to "
        f"{np.degrees(rate[size_N > 0.0].max()):.1f} deg/s; the arm tilts the tool by up to "
        f"{1000.0 * np.linalg.norm(turn, axis=1).max():.1f} mrad, which moves the surface by "
        f"{np.sqrt(np.mean(by_tilt**2)):.3f} mm RMS, {by_tilt.max():.3f} at most; "
        f"rounds {done.figures['rounds']:.0f}"
    )


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--small", action="store_true", help="the slot alone")
    small = parser.parse_args().small
    print("| RMS / largest, mm | without | Cartesian | with pilot | by axes | offline | steady |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        listed = [row_of(*case, Path(folder)) for case in list(cases())[: 1 if small else None]]
    print("\n" + "\n".join(listed))


if __name__ == "__main__":
    main()
