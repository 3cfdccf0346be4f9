"""Random programs, slips and blocks, read by this reader and by LinuxCNC's interpreter."""

import shutil
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from gcode_beside_rs274 import ENDLESS, Beside, Read, by_us, difference, is_known
from gcode_draws import blocks, drawn, slipped
from gcode_rules import why_lost, why_refused_here, why_refused_there, why_unknown

VALID, SLIPS = 0.35, 0.45
"""Shares of the programs that are valid, and that have a slip; the others are of random blocks."""
MOST_SHOWN = 10


@dataclass
class Tally:
    """What came of the programs."""

    kinds: Counter[str] = field(default_factory=Counter)
    explained: Counter[str] = field(default_factory=Counter)
    moves: int = 0
    faults: list[str] = field(default_factory=list)

    def fault(self, number: int, what: str, program: bytes) -> None:
        """Keep a difference that no rule explains, with its program."""
        text = program.decode("latin-1").replace("\n", "\n      ")
        self.faults.append(f"program {number}: {what}\n      {text}")


def run(seconds: float, seed: int) -> int:
    """Read programs for so long; print the counts, and each unexplained difference with its program."""
    tally, number, began_s = Tally(), 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        other = Beside(Path(folder)) if shutil.which("rs274") else None
        if other is None:
            print("no rs274 (Debian package linuxcnc-uspace): programs are read by this reader alone")
        while time.monotonic() - began_s < seconds:
            one(np.random.default_rng([seed, number]), number, other, tally)
            number += 1
    print(f"{number} programs in {time.monotonic() - began_s:.0f} s, seed {seed}: " + _told(tally.kinds))
    if other is not None:
        print(f"  {tally.moves} moves compared; explained differences: {_told(tally.explained) or 'none'}")
    print(f"  unexplained: {len(tally.faults)}")
    for fault in tally.faults[:MOST_SHOWN]:
        print(f"    {fault}")
    return 1 if tally.faults or number == 0 else 0


def _told(counts: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.most_common())


def one(rng: np.random.Generator, number: int, other: Beside | None, tally: Tally) -> None:
    """Draw a program, and read it."""
    program, share = drawn(rng), float(rng.random())
    if share >= VALID:
        program = slipped(rng, program) if share < VALID + SLIPS else blocks(rng)
    ours, toolpath = by_us(program)
    if ours.refused and share < VALID:
        tally.fault(number, f"valid, refused here: {ours.refused}", program)
    if other is None:
        tally.kinds["refused" if toolpath is None else "read"] += 1
        return
    theirs = other.read(program)
    if toolpath is not None and not theirs.refused:
        tally.kinds["both read"] += 1
        tally.moves += len(theirs.moves)
        off = difference(toolpath, theirs.moves)
        known = not off or is_known(toolpath, theirs.moves)
        row = why_lost(program, off) or why_unknown(program, known) if off else ""
        if row:
            tally.explained[row] += 1
        elif off:
            tally.fault(number, off, program)
        return
    if toolpath is None and theirs.refused:
        tally.kinds["both refuse"] += 1
        return
    tally.kinds["one refuses"] += 1
    row = _row(ours, theirs)
    if row:
        tally.explained[row] += 1
    else:
        who = f"refused here ({ours.refused})" if ours.refused else f"refused by rs274 ({theirs.refused})"
        tally.fault(number, who, program)


def _row(ours: Read, theirs: Read) -> str:
    """Return the words of the row that explains why one refuses."""
    if ours.issue is not None:
        return why_refused_here(ours.issue)
    return "" if theirs.refused == ENDLESS else why_refused_there(theirs.refused)
