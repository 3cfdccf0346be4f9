"""A raster of a million lines: time and memory of each stage and the whole process, beside other programs.

The yardstick is LinuxCNC's stand-alone interpreter, ``rs274 -g``, which reads the same file in the same run.
Every figure is a whole process, start-up included, unless the table says otherwise. The row that a user
meets is ``translate, as typed``: the command of the README with the built-in cell. It is typed for two
rasters: that of the README with a ball of 8 mm, and one of a flat mill of 16 mm on a part of 140 x 74 mm.
Processor time stands beside the wall's, which rewards overlap too; it is the measure on a machine that does
something else as well. Last comes what the removal does: cells looked at for each that is lowered (counted
by the checked build), how fast, and how fast FreeCAD's path simulator, which predicts no forces, removes the
same moves from cells of the same size. Nothing is judged here: the figures are printed.

    python benchmarks/throughput.py                               a million lines, all peers, 3 rounds
    python benchmarks/throughput.py --lines 100000 --peers rs274  smaller, the yardstick only
    python benchmarks/throughput.py --scaling                     also 10^4, 10^5 and 10^6 lines
    python benchmarks/throughput.py --scaling 10000000            up to 10^7 (needs minutes)
    python benchmarks/throughput.py --parts 2,8                   several parts at once, a thread each
    python benchmarks/throughput.py --kinds                       also arcs, a macro program, five axes
"""

import argparse
import importlib.util
import itertools
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "examples"))

from make_raster import Raster, raster_program  # noqa: E402
from throughput_kinds import Kind, write_kinds  # noqa: E402

import gcode2krl  # noqa: E402

# This process stays small (no numpy): Linux counts the parent's pages at the start of a child as its own.

PEERS = ("rs274", "gcodeparser", "pygcode", "freecad")
YARDSTICK = "LinuxCNC rs274 -g, interprets only"
AS_TYPED = "translate, as typed"
AS_TYPED_FLAT = "translate, as typed, flat mill"
PYGCODE_LINES = 20_000
WARM_UP_LINES = 2_000
CYCLE_S = 0.012
CELL_LINES = 30_000
"""Lines of the parts whose cells are counted: the build that counts is slow."""
SMALLEST_SCALE = 10_000
KIND_LINES = 200_000
HAS_MOTION = "plan_motion" in gcode2krl.__all__

READ = "from gcode2krl import read_gcode; read_gcode({part!r})"
CHAIN = """
from gcode2krl import load_cell, plan_motion, read_gcode, set_targets, solve_joints, write_krl
cell = load_cell({cell!r})
toolpath = read_gcode({part!r}, cell)
targets = set_targets(toolpath, cell)
motion = plan_motion(targets, cell, dt_s={cycle})
joints = solve_joints(motion, cell)
write_krl(targets, {out!r}, cell)
"""
READ_FIVE_AXES = (
    "from gcode2krl import load_cell, read_gcode; read_gcode({part!r}, load_cell('five_axes.toml'))"
)
COMPLIANCE = CHAIN.replace(
    "write_krl(targets",
    """import numpy as np
from gcode2krl.compliance import deflection_of, feed_direction
feed = feed_direction(joints.q_rad, joints.qd_rad_s, cell, motion.tool)
load_N = np.array([100.0, 200.0, -50.0])
deflection_of(joints.q_rad, load_N, np.zeros(3), feed, cell, motion.tool)
write_krl(targets""",
)
WHOLE = """
from gcode2krl import cut, deflect, load_cell, plan_motion, read_gcode, set_targets, solve_joints, write_krl
from gcode2krl.prediction import Prediction
cell = load_cell({cell!r})
toolpath = read_gcode({part!r}, cell)
targets = set_targets(toolpath, cell)
motion = plan_motion(targets, cell, dt_s={cycle})
joints = solve_joints(motion, cell)
forces = cut(toolpath, motion, cell)
deflection = deflect(joints, forces, cell)
prediction = Prediction(toolpath, targets, cell, motion, joints, {{}}, forces, deflection)
write_krl(prediction, {out!r}, pilot="none")
"""
# --- one process, measured -------------------------------------------------------------------------


class Run(NamedTuple):
    """Time and memory of one process; ``problem`` is empty if it ended well."""

    seconds: float
    processor_s: float
    """User and system time, over all its threads."""
    peak_mb: float
    output: str
    problem: str


def run(command: Sequence[str], folder: Path, more: dict[str, str] | None = None) -> Run:
    """Run a process to its end, with ``more`` in its environment: its times and its own peak memory."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.perf_counter()
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment(folder) | (more or {}),
            stdout=out,
            stderr=err,
            stdin=subprocess.DEVNULL,
        )
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        said = err.read().decode("utf-8", "replace").strip().splitlines()
        problem = f"exit code {process.returncode}: {said[-1] if said else ''}" if process.returncode else ""
        processor_s = used.ru_utime + used.ru_stime
        return Run(
            seconds, processor_s, used.ru_maxrss / 1024, out.read().decode("utf-8", "replace"), problem
        )


def environment(folder: Path) -> dict[str, str]:
    """Return the environment of a process: Python keeps its bytecode, as it does unless it is told not to."""
    named = dict(os.environ)
    if named.pop("PYTHONDONTWRITEBYTECODE", ""):
        named["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    return named


@dataclass
class Work:
    """A row of the table."""

    name: str
    command: list[str]
    to_reach: float | None = None
    seconds_of: Callable[[Run], float] = lambda run: run.seconds
    runs: list[Run] = field(default_factory=list)
    problem: str = ""

    def repeat(self, folder: Path) -> None:
        """Run once more, unless it has failed."""
        if self.problem:
            return
        once = run(self.command, folder)
        self.problem = once.problem
        self.runs.append(once)

    def seconds(self) -> list[float]:
        return [self.seconds_of(once) for once in self.runs]

    def processor_s(self) -> float:
        """Return the least processor time, scaled as the wall's is."""
        return min(once.processor_s * self.seconds_of(once) / once.seconds for once in self.runs)


# --- files -----------------------------------------------------------------------------------------


def make_raster(folder: Path, lines: int) -> Path:
    """Write the raster of so many lines and return its file."""
    script = HERE.parent / "examples" / "make_examples.py"
    options = ["--out", str(folder), "--raster-lines", str(lines)]
    subprocess.run([sys.executable, str(script), *options], check=True, stdout=subprocess.DEVNULL)
    return folder / f"raster_{lines}.nc"


def make_flat_raster(folder: Path, lines: int) -> Path:
    """Write a raster of about so many lines for a flat mill and return its file."""
    rows = max(1, round(lines / 251))  # 250 steps and the link to the next row
    raster = Raster(rows, row_mm=150.0, stepover_mm=0.75, x_mm=-75.0, y_mm=-37.5, rows_per_layer=100)
    part = folder / f"flat_raster_{lines}.nc"
    with part.open("w", encoding="ascii", newline="\n") as file:
        for line in raster_program(raster):
            flat = line.replace("T13 BALL NOSE D8", "T1 FLAT D16").replace("T13 ", "T1 ").replace("H13", "H1")
            file.write(f"{flat}\n")
    return part


def rewrite(part: Path, name: str, change: Callable[[str], str], most: int | None = None) -> Path:
    """Write a changed copy of a part, line by line, at most so many lines."""
    copy = part.with_name(name)
    with part.open(encoding="ascii") as source, copy.open("w", encoding="ascii", newline="\n") as target:
        for number, line in enumerate(source):
            if number == most:
                break
            target.write(change(line))
    return copy


def with_rotary_words(part: Path) -> Path:
    """Write a part with A and C in every block that has an X word, as a post for five axes does."""
    blocks = itertools.count()

    def turned(line: str) -> str:
        if "X" not in line or "(" in line:
            return line
        k = next(blocks)
        a_deg, c_deg = 15.0 + 10.0 * math.sin(0.01 * k), 40.0 * math.sin(0.003 * k)
        return f"{line.rstrip()} A{a_deg:.3f} C{c_deg:.3f}\n"

    return rewrite(part, f"five_axes_{part.name}", turned)


def count_lines(part: Path) -> int:
    with part.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b""))


def write_inputs(folder: Path) -> None:
    """Write the tool table and parameters of rs274, and the two cells."""
    (folder / "tool.tbl").write_text("T13 P13 Z0 D8\n", encoding="ascii")
    (folder / "vars.var").write_text("", encoding="ascii")
    (folder / "unlimited.toml").write_text(
        'based_on = "demonstration"\n[controller]\nadvance = "unlimited"\n', encoding="ascii"
    )
    material = (
        'based_on = "demonstration"\n[controller]\nadvance = "unlimited"\n[stock]\nresolution_mm = 0.25\n'
    )
    (folder / "material.toml").write_text(material, encoding="ascii")
    (folder / "five_axes.toml").write_text(
        'based_on = "demonstration"\n[machine]\nkind = "table-table"\naxes = ["A", "C"]\n'
        "signs = [-1, -1]\ntcpm = true\n",
        encoding="ascii",
    )
    (folder / "look_ahead.toml").write_text('based_on = "demonstration"\n', encoding="ascii")


# --- the work: peers -------------------------------------------------------------------------------


def rs274_command(binary: str, part: Path, output: str) -> list[str]:
    return [binary, "-g", "-n", "2", "-t", "tool.tbl", "-v", "vars.var", str(part), output]


def rs274_problem(binary: str, folder: Path) -> str:
    """Return why rs274 cannot be compared here: it must report each move of a short raster ('' = it does)."""
    short = folder / f"raster_{WARM_UP_LINES}.nc"
    once = run(rs274_command(binary, short, "moves.txt"), folder)
    if once.problem:
        return once.problem
    moves = len(re.findall(r"STRAIGHT_(?:FEED|TRAVERSE)\(", (folder / "moves.txt").read_text("ascii")))
    wanted = len(re.findall(r"^[^(\n]*[XYZ]-?\d.*$", short.read_text("ascii"), re.MULTILINE))
    return "" if moves == wanted else f"rs274 made {moves} moves of {wanted}: the figure would be wrong"


def yardstick(part: Path, folder: Path) -> Work | str:
    """Return rs274 as work, or the word why not."""
    binary = shutil.which("rs274")
    if binary is None:
        return "rs274: not found (Debian package linuxcnc-uspace)"
    problem = rs274_problem(binary, folder)
    return problem or Work(YARDSTICK, rs274_command(binary, part, "/dev/null"))


def peer_script(name: str, part: Path) -> list[str]:
    return [sys.executable, str(HERE / "peers" / name), str(part)]


def gcodeparser(part: Path) -> Work:
    named = rewrite(part, "named.nc", lambda line: f"G1 {line}" if line[0] in "XYZ" else line)
    return Work("gcodeparser, G1 on every line", peer_script("parse_gcodeparser.py", named))


def pygcode(part: Path, lines: int) -> Work:
    """A piece of the file; start-up counts once, the rest in proportion."""
    piece = rewrite(part, "piece.nc", lambda line: line, PYGCODE_LINES)
    factor = max(1.0, lines / PYGCODE_LINES)

    def scaled(once: Run) -> float:
        worked = float(once.output.split()[0])
        return once.seconds + worked * (factor - 1.0)

    name = "pygcode" + (f", {PYGCODE_LINES:,} lines, scaled" if factor > 1 else "")
    return Work(name, peer_script("parse_pygcode.py", piece), seconds_of=scaled)


def peers(wanted: Sequence[str], part: Path, lines: int) -> tuple[list[Work], list[str]]:
    """Return the parsers that are installed, and a word on each that is not."""
    makers = {"gcodeparser": lambda: gcodeparser(part), "pygcode": lambda: pygcode(part, lines)}
    chosen = [name for name in makers if name in wanted]
    missing = [name for name in chosen if importlib.util.find_spec(name) is None]
    found = [makers[name]() for name in chosen if name not in missing]
    return found, [f"{name}: not installed (pip install {name})" for name in missing]


# --- the work: ours --------------------------------------------------------------------------------


def chain_work(name: str, part: Path, cell: str, to_reach: float | None = None, chain: str = CHAIN) -> Work:
    code = chain.format(cell=cell, part=str(part), cycle=CYCLE_S, out=str(part.with_name("chain.src")))
    return Work(name, [sys.executable, "-c", code], to_reach)


def translate(part: Path, out: str) -> list[str]:
    """Return the command of the README, which says nothing on standard error here."""
    return [sys.executable, "-m", "gcode2krl", str(part), "-o", out, "-q"]


def our_work(part: Path, lines: int) -> list[Work]:
    """Return reading, translating and, where it exists, the chain with the time law."""
    out = str(part.with_name("out.src"))
    read = [sys.executable, "-c", READ.format(part=str(part))]
    flat = make_flat_raster(part.parent, lines)
    work = [
        Work("read into a Toolpath", read, 0.2),
        Work(AS_TYPED, translate(part, out), 2.5),
        Work(AS_TYPED_FLAT, translate(flat, str(part.with_name("flat.src"))), 2.5),
    ]
    turned = with_rotary_words(part)
    work.append(
        Work(
            "read with A and C in every block",
            [sys.executable, "-c", READ_FIVE_AXES.format(part=str(turned))],
        )
    )
    if HAS_MOTION:
        work.append(chain_work("read, 12 ms plan, joints, KRL verified", part, "unlimited.toml", 0.6))
        work.append(chain_work("the same with compliance", part, "unlimited.toml", 0.7, COMPLIANCE))
        work.append(chain_work("whole chain, material at 0.25 mm cells", part, "material.toml", 1.8, WHOLE))
        work.append(chain_work("12 ms plan, joints, with look-ahead on", part, "look_ahead.toml"))
    return work


def warm_up(folder: Path) -> None:
    """Bring what is imported into the machine's memory: everything once on a short raster."""
    for work in our_work(make_raster(folder, WARM_UP_LINES), WARM_UP_LINES):
        work.repeat(folder)


# --- stage by stage (a child process runs this) ----------------------------------------------------


def stages(part: str, cell_path: str, out: str) -> list[tuple[str, float, int]]:
    """Return (stage, seconds, rows it made) of one chain in this process."""
    cell = gcode2krl.load_cell(cell_path)
    times: list[tuple[str, float, int]] = []

    def timed(name: str, stage: Callable, *arguments: object, **options: object) -> object:
        start = time.perf_counter()
        made = stage(*arguments, **options)
        times.append((name, time.perf_counter() - start, len(made) if hasattr(made, "__len__") else 0))
        return made

    toolpath = timed("read_gcode", gcode2krl.read_gcode, part, cell)
    targets = timed("set_targets", gcode2krl.set_targets, toolpath, cell)
    followed = targets
    if HAS_MOTION:
        followed = timed("plan_motion", gcode2krl.plan_motion, targets, cell, dt_s=CYCLE_S)
    timed("solve_joints", gcode2krl.solve_joints, followed, cell)
    timed("write_krl", gcode2krl.write_krl, targets, out, cell)
    return times


def run_stages(part: str, folder: Path) -> None:
    """Print the stages as JSON, once everything is imported."""
    out = str(folder / "stages.src")
    stages(str(folder / f"raster_{WARM_UP_LINES}.nc"), "unlimited.toml", out)
    print(json.dumps(stages(part, "unlimited.toml", out)))


def print_stages(part: Path, lines: int, folder: Path) -> None:
    once = run([sys.executable, str(Path(__file__).resolve()), "--stages-of", str(part)], folder)
    print("\nstage by stage, one process, all imported, look-ahead unlimited; write_krl verifies too")
    if once.problem:
        print(f"  {once.problem}")
        return
    print(f"  {'':<14}{'s':>8}{'lines/s':>14}{'rows':>13}")
    table = json.loads(once.output)
    table.append(("together", sum(seconds for _, seconds, _ in table), 0))
    for name, seconds, rows in table:
        print(f"  {name:<14}{seconds:8.2f}{lines / seconds:14,.0f}{f'{rows:,}' if rows else '':>13}")


# --- removal, cell by cell (a child process runs this) ---------------------------------------------


class Cells(NamedTuple):
    """What the removal of a part does."""

    looked_at: int
    lowered: int
    """Both 0 where nothing counts."""
    samples: int
    seconds: float
    """Processor time of removal and reading, the commands' other stages left out."""
    lowest_per_s: float
    """Cells a second that ``np.minimum`` takes on the same field."""
    cell_mm: float


def cells_of(part: str) -> Cells:
    """Cut a part with the built-in cell in this process and return what its removal does."""
    import numpy as np

    from gcode2krl.cutting import engagement, height_field, milling

    grids, seconds, samples = [], [], []
    new_grid, cut_strip = height_field.HeightField.grid, engagement.cut_strip

    def kept_grid(*given):
        grids.append(new_grid(*given))
        return grids[-1]

    def timed_strip(*given):
        start = time.process_time()
        cut_strip(*given)
        seconds.append(time.process_time() - start)

    height_field.HeightField.grid, engagement.cut_strip = kept_grid, timed_strip
    cell = gcode2krl.load_cell()
    toolpath = gcode2krl.read_gcode(part, cell)
    motion = gcode2krl.plan_motion(gcode2krl.set_targets(toolpath, cell), cell)
    removal = milling.remove(toolpath, motion, cell)
    samples.append(len(motion))
    height = np.ascontiguousarray(removal.material.height_mm)
    lower, best_s = height - 1.0, math.inf
    for _ in range(5):
        start = time.process_time()
        np.minimum(height, lower, out=lower)
        best_s = min(best_s, time.process_time() - start)
    looked_at, lowered = (int(sum(grid.counted[k] for grid in grids)) for k in (0, 1))
    lowest_per_s = height.size / max(best_s, 1e-6)
    return Cells(looked_at, lowered, sum(samples), sum(seconds), lowest_per_s, removal.material.cell_mm[0])


def print_cells(part: Path, name: str, folder: Path) -> Cells | None:
    """Print and return what a part's removal does: counted by the checked build, timed with the usual."""
    command = [sys.executable, str(Path(__file__).resolve()), "--cells-of", str(part)]
    usual, whole = run(command, folder), run(translate(part, str(folder / "cells.src")), folder)
    counting = run(command, folder, {"GCODE2KRL_CORE": "checked"})
    if problem := usual.problem or whole.problem:
        print(f"  {name:<8}{problem}")
        return None
    timed = Cells(*json.loads(usual.output))
    whole_ns, own_ns = (seconds / timed.samples * 1e9 for seconds in (whole.processor_s, timed.seconds))
    line = f"  {name:<8}{whole_ns:16.0f}{own_ns:14.0f}"
    if counting.problem:
        print(f"{line}  not counted: `python native/build.py --checked` makes the build that counts")
        return timed
    counted = Cells(*json.loads(counting.output))
    per_s = counted.lowered / timed.seconds
    looked_at = counted.looked_at / max(counted.lowered, 1)
    print(f"{line}{looked_at:12.2f}{per_s / 1e6:14.1f}{per_s / timed.lowest_per_s:14.2%}")
    return timed


def freecad_line(part: Path, name: str, ours: Cells, folder: Path) -> str:
    """Return the sentence on FreeCAD's simulator with our size of cells; its Python is the system's."""
    if shutil.which("freecadcmd") is None:
        return "FreeCAD's simulator: not found (Debian packages freecad, freecad-python3)"
    cutter = {"ball": ["8", "ball"], "flat": ["16", "flat"]}[name]
    script = str(HERE / "peers" / "time_freecad.py")
    once = run(["/usr/bin/python3", script, str(part), *cutter, str(ours.cell_mm)], folder)
    if once.problem:
        return f"FreeCAD's simulator: {once.problem}"
    seconds, moves = (float(word) for word in once.output.split()[-2:])
    its_us, own_us = seconds / moves * 1e6, ours.seconds / moves * 1e6
    return (
        f"{name}, cells of {ours.cell_mm:.3g} mm: FreeCAD's simulator {its_us:.1f} us a move, removal only; "
        f"ours with forces {own_us:.1f} us, {its_us / own_us:.1f} x as fast"
    )


# --- tables ----------------------------------------------------------------------------------------


def print_table(table: Sequence[Work]) -> None:
    measure = next((w for w in table if w.name == YARDSTICK and not w.problem), None)
    unit_s = min(measure.seconds()) if measure else None
    unit_processor_s = measure.processor_s() if measure else None
    print(
        f"  {'':<40}{'best s':>9}{'median s':>10}{'x rs274':>9}{'to reach':>10}"
        f"{'processor s':>13}{'x rs274':>9}{'peak MB':>9}"
    )
    for work in table:
        if work.problem:
            print(f"  {work.name:<40}  {work.problem}")
            continue
        best = min(work.seconds())
        ratio = f"{best / unit_s:.2f}" if unit_s else "-"
        wanted = f"<= {work.to_reach:g}" if work.to_reach else ""
        peak_mb = max(once.peak_mb for once in work.runs)
        middle = statistics.median(work.seconds())
        processor_s = work.processor_s()
        share = f"{processor_s / unit_processor_s:.2f}" if unit_processor_s else "-"
        print(
            f"  {work.name:<40}{best:9.2f}{middle:10.2f}{ratio:>9}{wanted:>10}{processor_s:13.2f}{share:>9}"
            f"{peak_mb:9.0f}"
        )


def compare(arguments: argparse.Namespace, folder: Path) -> None:
    """Time the file with all programs in turn, round after round."""
    part = make_raster(folder, arguments.lines)
    lines, words = count_lines(part), []
    table, missing = peers(arguments.peers, part, lines)
    measure = yardstick(part, folder) if "rs274" in arguments.peers else "rs274: not asked for"
    if isinstance(measure, Work):
        table.insert(0, measure)
    else:
        words.append(measure)
    table += our_work(part, arguments.lines)
    for _ in range(arguments.repeats):
        for work in table:
            work.repeat(folder)
    megabytes = part.stat().st_size / 1e6
    print(f"{lines:,} lines, {megabytes:.1f} MB; {arguments.repeats} rounds, programs in turn;", end=" ")
    print(f"whole processes on {os.cpu_count()} processors; ratios of the best")
    print_table(table)
    words += missing
    if not HAS_MOTION:
        words.append("time law and joints along it: not in this version, row skipped")
    for word in words:
        print(f"  {word}")
    print_stages(part, lines, folder)
    few = min(arguments.lines, CELL_LINES)
    print(f"\n{few:,} lines: ns of processor time a sample, all of the command and its cutting alone;")
    print("cells looked at for each lowered; cells lowered a second, and as a share of np.minimum's")
    print(f"  {'':<8}{'command, ns':>16}{'cutting, ns':>14}{'looked at':>12}{'millions/s':>14}{'share':>14}")
    words = []
    for name, make in (("ball", make_raster), ("flat", make_flat_raster)):
        small = make(folder, few)
        ours = print_cells(small, name, folder)
        if ours is not None and "freecad" in arguments.peers:
            words.append(freecad_line(small, name, ours, folder))
    for word in dict.fromkeys(words):
        print(f"  {word}")


def kind_work(kind: Kind, arguments: argparse.Namespace, folder: Path) -> tuple[list[Work], list[str]]:
    """Return reading a program of a kind, the peers that can read it, and a word on each that is missing."""
    code = (READ_FIVE_AXES if kind.cell else READ).format(part=str(kind.part))
    table, words = [Work("read into a Toolpath", [sys.executable, "-c", code])], []
    binary = shutil.which("rs274")
    if "rs274" in arguments.peers and binary is not None:
        table.insert(0, Work(YARDSTICK, rs274_command(binary, kind.part, "/dev/null")))
    if kind.is_plain:
        found, words = peers(arguments.peers, kind.part, count_lines(kind.part))
        table += found
    return table, words


def print_kinds(arguments: argparse.Namespace, folder: Path) -> None:
    """Time programs that are no raster."""
    lines = min(arguments.lines, KIND_LINES)
    for kind in write_kinds(folder, lines, with_rotary_words(make_raster(folder, lines))):
        table, words = kind_work(kind, arguments, folder)
        for _ in range(arguments.repeats):
            for work in table:
                work.repeat(folder)
        print(f"\n{kind.name}, {kind.part.stat().st_size / 1e6:.1f} MB")
        print_table(table)
        for word in words:
            print(f"  {word}")


def print_scaling(largest: int, repeats: int, folder: Path) -> None:
    """Print best time and peak memory over size, and the cost of each further line."""
    print("\ngrowth: best s, us and bytes for each line more than in the row above")
    before: dict[str, tuple[int, float, float]] = {}
    size = SMALLEST_SCALE
    while size <= largest:
        part = make_raster(folder, size)
        lines = count_lines(part)
        for work in our_work(part, size)[:3]:
            for _ in range(repeats):
                work.repeat(folder)
            if work.problem:
                print(f"  {lines:>10,}  {work.name:<38}{work.problem}")
                continue
            best, peak_mb = min(work.seconds()), max(once.peak_mb for once in work.runs)
            growth = ""
            if work.name in before:
                old_lines, old_s, old_mb = before[work.name]
                more = lines - old_lines
                growth = f"{(best - old_s) / more * 1e6:8.2f} us{(peak_mb - old_mb) * 2**20 / more:8.0f} B"
            before[work.name] = lines, best, peak_mb
            print(f"  {lines:>10,}  {work.name:<38}{best:8.2f} s{peak_mb:7.0f} MB{growth}")
        part.unlink()
        size *= 10


def print_parts(counts: Sequence[int], part: Path, repeats: int, folder: Path) -> None:
    """Print how much longer parts take one after the other than all at once, a thread each."""
    print(f"\nparts of {count_lines(part):,} lines, a process and a thread each, {os.cpu_count()} processors")
    for count in counts:
        commands = [[*translate(part, str(folder / f"p{k}.src")), "--threads", "1"] for k in range(count)]
        in_turn, at_once = [], []
        for _ in range(repeats):
            in_turn.append(sum(run(command, folder).seconds for command in commands))
            start = time.perf_counter()
            with ThreadPoolExecutor(count) as pool:
                problems = [once.problem for once in pool.map(lambda each: run(each, folder), commands)]
            at_once.append(time.perf_counter() - start)
            if any(problems):
                print(f"  {count} parts: {next(filter(None, problems))}")
                return
        one, all_ = min(in_turn), min(at_once)
        print(f"  {count} parts: {one:.2f} s one after the other, {all_:.2f} s at once, {one / all_:.2f} x")


# --- command ---------------------------------------------------------------------------------------


def peer_names(text: str) -> list[str]:
    names = [name for name in text.split(",") if name]
    unknown = sorted(set(names) - set(PEERS))
    if unknown:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}; known: {', '.join(PEERS)}")
    return names


def part_counts(text: str) -> list[int]:
    return [int(count) for count in text.split(",")]


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lines", type=int, default=1_000_000)
    parser.add_argument("--peers", type=peer_names, default=list(PEERS), help="default: all four")
    parser.add_argument("--repeats", type=int, default=3, help="rounds (default: 3)")
    parser.add_argument("--scaling", type=int, nargs="?", const=1_000_000, metavar="LARGEST")
    parser.add_argument("--parts", type=part_counts, default=[], help="2,8: so many parts at once")
    parser.add_argument("--kinds", action="store_true", help="also arcs, a macro program, five axes")
    parser.add_argument("--stages-of", help=argparse.SUPPRESS)
    parser.add_argument("--cells-of", help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> None:
    arguments = options()
    if arguments.stages_of:
        run_stages(arguments.stages_of, Path.cwd())
        return
    if arguments.cells_of:
        print(json.dumps(cells_of(arguments.cells_of)))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder)
        warm_up(folder)
        compare(arguments, folder)
        if arguments.parts:
            print_parts(arguments.parts, make_raster(folder, arguments.lines), arguments.repeats, folder)
        if arguments.kinds:
            print_kinds(arguments, folder)
        if arguments.scaling:
            print_scaling(arguments.scaling, arguments.repeats, folder)


if __name__ == "__main__":
    main()
