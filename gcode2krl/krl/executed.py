"""The statements of a program in the order in which the controller would execute them, as one table."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.krl.scan import Scanned


class StatementRun(NamedTuple):
    """A run of statements of a file: its number, the first statement and the one behind the last."""

    file: int
    start: int
    end: int


class Executed(NamedTuple):
    """The statements (k) of runs, one behind the other; the numbers of motions and of the others apart."""

    files: Ints32
    """(r,) file of each run."""
    starts: Ints
    """(r,) its first statement in that file."""
    begins: Ints
    """(r + 1,) its first statement here, and how many there are."""
    kind: NDArray[np.int8]
    blend: NDArray[np.int8]
    line: Ints32
    others: Ints
    """(k - m,) statements that are no motion."""
    pose: Floats
    """(m, 8)"""
    value: Floats
    """(k - m, 8)"""
    external: Floats
    """(m, 6) one row in memory where no motion has any."""

    def places(self, rows: Ints) -> tuple[Ints32, Ints]:
        """Return the file of each of the statements (s,), and its number there."""
        run = np.searchsorted(self.begins, rows, side="right") - 1
        return self.files[run], self.starts[run] + rows - self.begins[run]

    def motions_before(self, rows: Ints) -> Ints:
        """Return how many motions there are before each of the statements (s,)."""
        return rows - np.searchsorted(self.others, rows)

    def file_of_motions(self) -> Ints32:
        """Return the file (m,) of each motion."""
        return np.repeat(self.files, np.diff(self.motions_before(self.begins)))


def executed_in(runs: Sequence[StatementRun], scanned: Sequence[Scanned], others: Sequence[Ints]) -> Executed:
    """Return the statements of runs; rows that stand together in a file are views of what was scanned.

    ``others`` are the statements of each file that are no motion.
    """
    runs = [run for run in runs if run.end > run.start] or [StatementRun(0, 0, 0)]
    files, statements = [run.file for run in runs], [(run.start, run.end) for run in runs]
    places = [np.searchsorted(others[run.file], (run.start, run.end)).tolist() for run in runs]
    no_motions = [(first, behind) for first, behind in places]
    motions = [
        (start - first, end - behind)
        for (start, end), (first, behind) in zip(statements, no_motions, strict=True)
    ]

    def joined(column: str, rows: Sequence[tuple[int, int]]) -> NDArray[Any]:
        parts = [getattr(scanned[file], column)[a:b] for file, a, b in _merged(files, rows)]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    kind = joined("kind", statements)
    count = sum(end - start for start, end in motions)
    external = np.broadcast_to(np.nan, (count, w.EXTERNAL_COLUMNS))
    if any(len(each.external) for each in scanned):
        known = [_external_of(scanned[run.file], rows) for run, rows in zip(runs, motions, strict=True)]
        external = np.concatenate(known)
    return Executed(
        files=np.array(files, dtype=np.int32),
        starts=np.array([start for start, _ in statements]),
        begins=np.cumsum([0, *(end - start for start, end in statements)]),
        kind=kind,
        blend=joined("blend", statements),
        line=joined("line", statements),
        others=np.flatnonzero(~is_motion(kind)),
        pose=joined("pose", motions),
        value=joined("value", no_motions),
        external=external,
    )


def _external_of(scanned: Scanned, motions: tuple[int, int]) -> Floats:
    """Return E1 to E6 of some motions of a file, NaN where none of that file has any."""
    start, end = motions
    if len(scanned.external):
        return scanned.external[start:end]
    return np.full((end - start, w.EXTERNAL_COLUMNS), np.nan)


def _merged(files: Sequence[int], rows: Sequence[tuple[int, int]]) -> list[tuple[int, int, int]]:
    """Return (file, first, behind) of rows of files, as few as can be."""
    merged: list[tuple[int, int, int]] = []
    for file, (first, behind) in zip(files, rows, strict=True):
        if merged and merged[-1][0] == file and merged[-1][2] == first:
            merged[-1] = file, merged[-1][1], behind
        else:
            merged.append((file, first, behind))
    return merged


def is_motion(kind: NDArray[np.int8]) -> Bools:
    """Tell which statements (k,) are motions."""
    result: Bools = (kind == w.KIND_LIN) | (kind == w.KIND_PTP) | (kind == w.KIND_PTP_AXES)
    result |= (kind == w.KIND_CIRC) | (kind == w.KIND_SPL)
    return result
