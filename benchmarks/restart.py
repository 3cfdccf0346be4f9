"""Restarts at random lines: the same path from there on, no rapid in stock, the guard intact.

``python benchmarks/restart.py FOLDER [FOLDER …] [--lines 50] [--most N] [--seed 1] [--json]`` draws lines
with a motion from the G-code files below the folders, at most so many of a file that all files are asked, and
begins each program there. Programs are put where the demonstration cell reaches them, and what the whole
program is refused for is released, as its own mistakes are not those of a restart. Judged by reading the
written text back, beside that of the whole program:

- path: positions, angles, speeds and waits behind the start are the last ones of the whole program;
- corners: so are the approximations behind the first motion. Where they are not, they are within the
  tolerance asked for all the same: a corner keeps the CDIS of the one before while its tolerance allows it;
- rapid: no rapid, and no way down, meets material that is not named for the whole program too;
- guard: what stands before the first motion is the same, but for the restart's own message.

A line that is refused is counted by its code. The exit code is 1 where a check fails.
"""

import argparse
import json
import random
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.strangers import _into_reach, programs
from gcode2krl import Gcode2KrlError, load_cell, read_gcode, write_krl
from gcode2krl.cell import Cell
from gcode2krl.krl.read import KrlProgram, read_texts
from gcode2krl.krl.release import NEVER_RELEASED
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.prediction import Prediction
from gcode2krl.restart.material import restarted
from gcode2krl.tables import Toolpath

COLLISIONS = frozenset({"rapid-in-stock", "shank-in-stock", "holder-in-stock"})
_OWN_MESSAGE = "NR 7,"


@dataclass(frozen=True)
class Trial:
    """One restart; each check is True where it holds, None where the line was refused."""

    program: str
    line: int
    begins_line: int
    refused: str
    path: bool | None
    corners: bool | None
    rapid: bool | None
    guard: bool | None
    cpu_s: float


def cell_for(part: Path, tools: Path) -> Cell:
    """Return the demonstration cell with a ``$BASE`` within reach, and a mill for tools it does not know."""
    tools.write_text(
        'based_on = "demonstration"\n[program]\ntool_length = "from_table"\n' + _into_reach(part), "utf-8"
    )
    return load_cell(tools)


def text_of(prediction: Prediction) -> KrlProgram:
    """Return a prediction's program, composed and read back; its errors are released where possible."""
    errors = {i.code for i in prediction.issues if i.severity == "error"} | {
        i.code
        for i in prediction.issues
        if i.code in ("h-differs", "work-offset-unknown", "unit-doubtful", "cut-off")
    }
    allow = sorted(errors - NEVER_RELEASED)
    written = write_krl(prediction, None, name="PART", allow=allow, pilot="none")
    return read_texts(written.texts, "PART.src")


def same_path(whole: KrlProgram, begun: KrlProgram, way: int) -> bool:
    """Tell whether the motions of a restart, behind HOME and its way down, are the whole program's last."""
    count = len(begun.ptp) - 1 - way
    return 0 < count <= len(whole.ptp) and all(
        np.array_equal(getattr(whole, name)[-count:], getattr(begun, name)[-count:], equal_nan=True)
        for name in ("position_mm", "abc_deg", "q_deg", "ptp", "speed_mm_s", "wait_s")
    )


def same_corners(whole: KrlProgram, begun: KrlProgram, way: int) -> bool:
    """Tell whether they are approximated alike, too, behind the first."""
    count = len(begun.ptp) - 2 - way
    return count < 1 or np.array_equal(whole.cdis_mm[-count:], begun.cdis_mm[-count:])


def guard_of(program: KrlProgram) -> list[str]:
    """Return the statements before the first motion, without the restart's message and its HALT."""
    texts = [s.text for s in program.statements if s.motion == 0]
    own = next((k for k, text in enumerate(texts) if _OWN_MESSAGE in text), None)
    return texts if own is None else texts[:own] + texts[own + 3 :]


def has_pose_guard(program: KrlProgram) -> bool:
    """Tell whether the axes are compared behind the first PTP that is not HOME."""
    return any("$AXIS_ACT" in s.text for s in program.statements if s.motion == 2)


def new_collisions(whole: Prediction, begun: Prediction) -> list[str]:
    """Return the collisions of a restart that the whole program does not have at their lines."""
    known = {(i.code, i.line) for i in whole.issues if i.code in COLLISIONS}
    return [i.text() for i in begun.issues if i.code in COLLISIONS and (i.code, i.line) not in known]


def lines_of(toolpath: Toolpath) -> list[int]:
    """Return the G-code lines that move the tool."""
    return np.unique(toolpath.source_line[1:][~toolpath.machine[1:]]).tolist()


def trial(
    part: Path, line: int, toolpath: Toolpath, cell: Cell, whole: Prediction, text: KrlProgram
) -> Trial:
    """Begin a program at a line and judge it."""
    started = time.process_time()
    try:
        begun = restarted(toolpath, line, cell)
        prediction = predict_toolpath(begun, cell)
        program = text_of(prediction)
    except Gcode2KrlError as error:
        first = next((i for i in error.issues if i.severity == "error"), error.issues[0])
        return Trial(part.name, line, 0, first.code, None, None, None, None, time.process_time() - started)
    cpu_s = time.process_time() - started
    assert begun.restart is not None
    way = int(
        np.count_nonzero((prediction.targets.move > 0) & (prediction.targets.move <= begun.restart.way_rows))
    )
    guard = guard_of(program) == guard_of(text) and has_pose_guard(program)
    return Trial(
        program=part.name,
        line=line,
        begins_line=begun.restart.begins_line,
        refused="",
        path=same_path(text, program, way),
        corners=same_corners(text, program, way),
        rapid=not new_collisions(whole, prediction),
        guard=guard,
        cpu_s=cpu_s,
    )


def drawn(parts: list[Path], count: int, seed: int, cell_file: Path) -> list[Trial]:
    """Return trials at ``count`` random lines of all programs; one that cannot be written is left out."""
    chance, trials = random.Random(seed), list[Trial]()
    chance.shuffle(parts)
    share = max(1, -(-2 * count // max(1, len(parts))))  # of some nothing can be asked
    for part in parts:
        if len(trials) >= count:
            break
        try:
            cell = cell_for(part, cell_file)
            toolpath = read_gcode(part, cell)
            whole = predict_toolpath(toolpath, cell)
            text = text_of(whole)
        except Gcode2KrlError as error:
            print(f"left out   {part.name}: {error.issues[0].code}", file=sys.stderr)
            continue
        lines = lines_of(toolpath)
        for line in chance.sample(lines, min(share, len(lines), count - len(trials))):
            trials.append(trial(part, line, toolpath, cell, whole, text))
    return trials


def main(argv: list[str] | None = None) -> int:
    """Run the restarts and print each, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--lines", type=int, default=50, help="Restarts in all.")
    parser.add_argument("--most", type=int, help="At most so many programs of each folder.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="One JSON object on standard output.")
    options = parser.parse_args(argv)
    parts = programs(options.folders, options.most, options.seed)
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        trials = drawn(parts, options.lines, options.seed, Path(folder) / "cell.toml")
    begun = [t for t in trials if not t.refused]
    figures = {
        "restarts asked for": len(trials),
        "programs": len({t.program for t in trials}),
        "begun": len(begun),
        "at the line before": sum(t.begins_line != t.line for t in begun),
        "same path from there on": sum(bool(t.path) for t in begun),
        "every corner rounded alike": sum(bool(t.corners) for t in begun),
        "no rapid in stock": sum(bool(t.rapid) for t in begun),
        "guard intact": sum(bool(t.guard) for t in begun),
        "refused": dict(Counter(t.refused for t in trials if t.refused)),
        "CPU s, median": float(np.median([t.cpu_s for t in begun])) if begun else None,
        "CPU s, largest": max((t.cpu_s for t in begun), default=None),
    }
    if options.json:
        json.dump({"restarts": [asdict(t) for t in trials], "totals": figures}, sys.stdout, indent=2)
    else:
        for t in trials:
            state = t.refused or " ".join(
                f"{name} {'yes' if value else 'NO'}"
                for name, value in (("path", t.path), ("rapid", t.rapid), ("guard", t.guard))
            )
            print(f"{t.program[:60]:<60} {t.line:>7} {t.cpu_s:6.2f} s  {state}")
        for name, value in figures.items():
            print(f"{name:<28} {value}")
    return 0 if all(t.path and t.rapid and t.guard for t in begun) else 1


if __name__ == "__main__":
    sys.exit(main())
