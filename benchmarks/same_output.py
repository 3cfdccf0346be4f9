"""Does a change of the code change what it computes? The same commands by two trees, byte for byte.

    git archive HEAD~5 | tar x -C /tmp/before && (cd /tmp/before && python native/build.py)
    python benchmarks/same_output.py /tmp/before .
    python benchmarks/same_output.py /tmp/before . --only offline --programs 0

The examples by every cell among them, drawn programs, and one command of each kind: programs, records,
predictions, pages, what is printed. Of the trees only the command line is used, so that modules may move
between them. Exit code 1 where anything differs. Each tree works in one process of its own.
"""

import argparse
import contextlib
import hashlib
import io
import json
import os
import random
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PARTS = (*sorted((ROOT / "examples").glob("*.nc")), ROOT / "tests" / "golden" / "programs" / "everything.nc")
CELLS = {
    "built-in": None,
    **{path.stem: f"examples/cells/{path.name}" for path in sorted((ROOT / "examples/cells").glob("*.toml"))},
    "rail": "examples/external/robot_on_rail.toml",
    "golden": "tests/golden/programs/everything.toml",
    "five axes": "examples/five_axis/cell.toml",
}
DRAWN_CELLS = len(CELLS) - 2
"""The first so many cells take drawn programs, the very first with two tools."""
OF_CELLS = {
    "auto": '[frames]\nspin = "auto"\n',
    "stiffest": '[frames]\nspin = "stiffest"\n',
    "circ": "[controller]\ncirc = true\n",
    "spline": "[controller]\nspline = true\n",
    "obstacle": '[[obstacle]]\nname = "post"\nframe = "base"\nbox_mm = [[300, 0, 0], [340, 40, 300]]\n',
    "loose": '[[effects]]\nname = "backlash"\ntarget = "A2"\nparameters = { gap_deg = 0.02 }\n',
}
"""Cells that differ from the demonstration in what the chain asks for."""
ONLINE = '[online]\nmost_mm = 1.5\n[online.link]\naddress = "192.168.7.3"\nport = 50001\n'
DIGEST_CHARACTERS = 16
TIMED = ("results.jsonl", "junit.xml", "summary.md", "index.html")
"""Files of a batch that say how long each part took."""


class Job(NamedTuple):
    """Commands that run one after the other in a folder of their own, into ``out/``."""

    name: str
    commands: tuple[str, ...]


def jobs(programs: int) -> Iterator[Job]:
    """Yield every job; the drawn programs take the cells and forms in turn."""
    for part in PARTS:
        named = part.relative_to(ROOT).as_posix()
        for cell, file in CELLS.items():
            by = f" --cell {file}" if file else ""
            yield Job(f"{part.stem} {cell} translate", (f"translate {named} --json -o out/part.src{by}",))
            if cell in ("built-in", "golden", "rail"):
                yield Job(f"{part.stem} {cell} predict", (f"predict {named} --json -o out/p{by}",))
    piece = "examples/test_piece.nc"
    for cell in OF_CELLS:
        yield Job(f"cell {cell}", (f"translate {piece} --json -o out/part.src --cell {cell}.toml",))
        yield Job(f"cell {cell} predict", (f"predict {piece} --json -o out/p --cell {cell}.toml",))
    written = f"translate {piece} -o out/part.src"
    for words in (
        "--no-forces",
        "--pilot values",
        "--pilot none",
        "--simplify 0.02",
        "--split files --max-lines 100",
        "--tolerance 0.05 --comment-every 1",
        "--from-line 60",
        "--from-line 60 --report out/part.html",
        "--report out/part.html",
        "--online PIECE --cell online.toml",
        "--compensate offline",
        "--strict",
        "--name PART",
    ):
        yield Job(f"option {words}", (f"{written} --json {words}", f"{written} {words}"))
    arcs = "examples/contour_arcs.nc"
    offline = f"translate {arcs} -o out/part.src --compensate offline --json"
    yield Job("offline", (offline, f"verify out/part.src {arcs} --json --compensate offline"))
    yield Job("standard output", (f"{arcs} -o -", f"{arcs} -o - --pilot values"))
    yield Job("verify", (written, f"verify out/part.src {piece} --json", f"verify out/part.src {arcs}"))
    yield Job("runkit", (written, "runkit out/part.src -o out/kit --json"))
    yield Job("batch", ("batch examples/contour_arcs.nc examples/cam_style.nc -o out/b --processes 1 -q",))
    yield Job("report", (f"predict {piece} -o out/p", "report out/p -o out/part.html"))
    dry = f"predict {piece} -o out/p --no-forces"
    yield Job(
        "diagnosis",
        (dry, "diagnose out/p examples/runs/run-1 examples/runs/run-2 examples/runs/run-3 --json"),
    )
    yield Job("make-test", ("make-test controller -o out/test.src --json",))
    yield Job("nominal", (f"predict {piece} -o out/p --json --no-forces", f"predict {piece} -o out/q --csv"))
    for k in range(programs):
        file = list(CELLS.values())[k % DRAWN_CELLS]
        by = f" --cell {file}" if file else ""
        forms = (
            f"translate drawn_{k}.nc --json -o out/part.src{by}",
            f"predict drawn_{k}.nc --json -o out/p{by}",
        )
        yield Job(f"drawn {k}", (forms[0], forms[1]) if k % 3 == 0 else (forms[0],))


def drawn(seed: int, tools: int) -> str:
    """Return a random program that a mill could run: passes, waves, arcs, holes, so many tools."""
    draw = random.Random(seed)
    lines = ["%", "G21 G90 G17 G40 G49 G80 G94", "G54", f"G64 P{draw.choice((0.01, 0.05, 0.2))}"]
    for tool in range(1, tools + 1):
        lines += [f"T{tool} M6", f"S{draw.randrange(6000, 12000, 500)} M3", f"G0 G43 H{tool} Z50"]
        for _ in range(draw.randint(2, 5)):
            x, y, z = draw.uniform(0, 60), draw.uniform(0, 60), -draw.uniform(0.2, 2)
            lines += [f"G0 X{x:.3f} Y{y:.3f}", "G0 Z2", f"G1 Z{z:.3f} F{draw.randrange(300, 900, 100)}"]
            lines += draw.choice((_wave, _arcs, _box))(draw, x, y)
            lines += ["G0 Z5"]
        if draw.random() < 0.5:
            lines += [f"G81 X{draw.uniform(0, 80):.2f} Y20 Z-3 R2 F400", "Y35", "G80", "G0 Z20"]
        lines += ["G4 P0.5", "G0 Z50", "M5"]
    return "\n".join([*lines, "M30", "%", ""])


def _wave(draw: random.Random, x: float, y: float) -> list[str]:
    steps = [draw.uniform(0.2, 3.0) for _ in range(draw.randint(10, 60))]
    feed = draw.randrange(600, 4000, 200)
    return [
        f"G1 X{x + sum(steps[: k + 1]):.3f} Y{y + draw.uniform(-2, 2):.3f} F{feed}" for k in range(len(steps))
    ]


def _arcs(draw: random.Random, x: float, y: float) -> list[str]:
    radius = draw.uniform(2, 12)
    return [
        f"G{draw.choice((2, 3))} X{x + (2 * radius) * (k % 2 == 0):.4f} Y{y:.4f} "
        f"I{radius if k % 2 == 0 else -radius:.4f} J0 F{draw.randrange(500, 2500, 100)}"
        for k in range(draw.randint(1, 4))
    ]


def _box(draw: random.Random, x: float, y: float) -> list[str]:
    side = draw.uniform(5, 30)
    corners = ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
    return [f"G1 X{x + a:.3f} Y{y + b:.3f} F{draw.randrange(600, 3000, 300)}" for a, b in corners]


def worked(only: str, programs: int) -> dict[str, str]:
    """Return the digest of everything that each job prints and writes, by the package that is imported."""
    digests: dict[str, str] = {}
    for job in jobs(programs):
        if only not in job.name:
            continue
        with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
            _lay_out(programs, Path(scratch))
            for k, command in enumerate(job.commands):
                code, printed = _called(command.split())
                digests[f"{job.name} | {k} exit code {code}"] = _digest(printed.encode(), scratch)
            for file in sorted(path for path in Path("out").rglob("*") if path.is_file()):
                if file.name in TIMED:
                    continue
                digests[f"{job.name} | {file.as_posix()}"] = _digest(file.read_bytes(), scratch)
    return digests


def _lay_out(programs: int, folder: Path) -> None:
    for name in ("examples", "tests"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "out").mkdir()
    for name, text in {**OF_CELLS, "online": ONLINE}.items():
        whole = f'based_on = "demonstration"\n{text}'
        (folder / f"{name}.toml").write_text(whole, encoding="utf-8", newline="\n")
    for k in range(programs):
        (folder / f"drawn_{k}.nc").write_text(
            drawn(k, 1 + (k % DRAWN_CELLS == 0)), encoding="ascii", newline="\n"
        )


def _digest(data: bytes, scratch: str) -> str:
    data = data.replace(scratch.encode(), b".")  # a project file is named by its whole path
    return hashlib.sha256(data).hexdigest()[:DIGEST_CHARACTERS]


def _called(words: list[str]) -> tuple[int, str]:
    """Return the exit code of a command, and what it prints."""
    said, before, code = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline=""), sys.argv, 0
    sys.argv = ["gcode2krl", *words]
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            runpy.run_module("gcode2krl", run_name="__main__")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        sys.argv = before
    said.flush()
    return code, said.buffer.getvalue().decode("utf-8", "replace")


def by_tree(tree: Path, only: str, programs: int) -> dict[str, str]:
    """Return what `worked` says of a tree, in a process of its own."""
    if not (tree / "gcode2krl" / "__init__.py").exists():
        raise SystemExit(f"same_output: {tree} holds no package gcode2krl")
    environment = {**os.environ, "PYTHONPATH": str(tree.resolve()), "MPLBACKEND": "Agg"}
    environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, __file__, "--worker", "--only", only, "--programs", str(programs)]
        done = subprocess.run(
            command,
            env=environment | {"GCODE2KRL_CACHE": cache},
            cwd=cache,
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        raise SystemExit(f"same_output: {tree}: {done.stderr[-2000:]}")
    said: dict[str, str] = json.loads(done.stdout)
    return said


def main() -> int:
    """Compare two trees; exit code 0 where all is the same."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("trees", nargs="*", type=Path, metavar="TREE", help="folders that hold gcode2krl/")
    parser.add_argument("--only", default="", metavar="WORD", help="only jobs with this in their name")
    parser.add_argument("--programs", type=int, default=60, help="drawn programs (default: 60)")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        print(json.dumps(worked(options.only, options.programs)))
        return 0
    if len(options.trees) != 2:
        parser.error("name two trees")
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda tree: by_tree(tree, options.only, options.programs), options.trees)
    other = [name for name in sorted(first.keys() | second.keys()) if first.get(name) != second.get(name)]
    for name in other:
        print(f"differs: {name}: {first.get(name, 'missing')} {second.get(name, 'missing')}")
    done = sum(name.endswith("exit code 0") for name in second)
    commands = sum("exit code" in name for name in second)
    print(f"{commands} commands ({done} with exit code 0), {len(second)} outputs, {len(other)} differ")
    return 1 if other else 0


if __name__ == "__main__":
    raise SystemExit(main())
