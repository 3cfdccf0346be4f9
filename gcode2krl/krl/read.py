"""KRL in: reads the subset that is written, in the order in which the controller would execute it."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.core import (
    BYTES,
    FLOATS,
    INTS32,
    OUT_BOOLS,
    OUT_FLOATS,
    OUT_INTS,
    OUT_INTS32,
    core_function,
)
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue, input_error
from gcode2krl.krl import scan as sc
from gcode2krl.krl.controller_state import may_disturb
from gcode2krl.krl.executed import Executed, StatementRun, executed_in, is_motion

# Statements in the order of execution to columns of motions: speed and approximation in force, line.

_pass = core_function("krl_pass", BYTES, FLOATS, OUT_FLOATS, OUT_INTS)
_motions = core_function(
    "krl_motions", BYTES, BYTES, INTS32, FLOATS, FLOATS, OUT_BOOLS, OUT_FLOATS, OUT_FLOATS, OUT_INTS32
)


def motion_columns(
    kind: NDArray[np.int8], blend: NDArray[np.int8], line: Ints32, number: Floats
) -> tuple[Bools, Floats, Floats, Ints32]:
    """Return PTP, speed in mm/s, approximation in mm and line (p,) of the motions among statements (k,).

    ``number`` (k - p,) is the first number of each statement that is no motion. Speed and approximation are
    those of the last setting that has one, NaN before the first and behind `KIND_FORGETS`; the speed of a PTP
    is NaN, the approximation of a motion without ``C_DIS`` is 0.
    """
    kinds, blends = kind.view(np.uint8), blend.view(np.uint8)
    borders = chunk_borders(len(kind))
    in_force, counts = np.full(2, np.nan), np.zeros(2, dtype=np.int64)
    before = {0: (in_force.copy(), (0, 0))}
    for start, end in pairwise(borders):
        _pass(kinds[start:end], number, in_force, counts)
        before[end] = in_force.copy(), (int(counts[0]), int(counts[1]))
    count = before[borders[-1]][1][0]
    ptp, motion_line = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.int32)
    speed_mm_s, cdis_mm = np.empty((2, count))

    def part(start: int, end: int) -> None:
        (settings, (motion, other)), (_, (last_motion, last_other)) = before[start], before[end]
        rows, motions = slice(start, end), slice(motion, last_motion)
        columns = ptp[motions], speed_mm_s[motions], cdis_mm[motions], motion_line[motions]
        _motions(kinds[rows], blends[rows], line[rows], number[other:last_other], settings, *columns)

    in_chunks(part, borders)
    return ptp, speed_mm_s, cdis_mm, motion_line


_DEF = re.compile(rf"(?:{w.GLOBAL}\s+)?{w.DEF}\s+([A-Z_$][A-Z0-9_$]*)\s*\(([^)]*)\)\s*$", re.IGNORECASE)
_CALL = re.compile(r"([A-Z_][A-Z0-9_]*)\s*\(\s*\)\s*$", re.IGNORECASE)
_DECLARATION = re.compile(rf"(?:{'|'.join(w.DECLARING)})\b", re.IGNORECASE)
_EXT = w.EXT.encode("ascii")
_EXTERNAL = re.compile(rb"\s*%b\s+([A-Z_][A-Z0-9_]*)\s*\(" % _EXT, re.IGNORECASE)
_COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);.*$')
_COMPONENT = re.compile(r"\b([XYZ])\s+([-+.\d]+(?:E[-+]?\d+)?)", re.IGNORECASE)
_COUNTED = ("WHILE", "IF", "FOR", "LOOP")
"""Blocks whose ends are counted in a file."""


class Statement(NamedTuple):
    """A statement that is no motion, and where it stands."""

    motion: int
    """Number of motions before it."""
    text: str
    file: str
    line: int


class ReadTriggers(NamedTuple):
    """The triggers of the two forms in which a pilot force is announced, a row each."""

    motion: Ints
    """(k,) number of motions before it: the row of the motion that carries it."""
    distance: Floats
    delay_ms: Floats
    written: Floats
    """(k, 4) what it writes, NaN behind the first where that is one number."""
    calls: Bools
    """(k,) True where it calls a subprogram with four numbers, False where it assigns one."""
    names: tuple[str, ...]
    """What is written or called, each name once."""
    line: Ints32
    file_of: Ints32


@dataclass(frozen=True)
class KrlProgram:
    """A KRL program as executed: a row per motion, and the statements in between."""

    name: str
    pose: Floats
    """(p, 8) X, Y, Z in mm, A, B, C in degrees, S and T, NaN where absent and in motions to joint targets."""
    joint_rows: Ints
    """(j,) motions to joint targets."""
    joint_deg: Floats
    """(j, 6) A1 to A6 of these motions, NaN where absent."""
    circ_rows: Ints
    """(c,) motions along an arc."""
    circ_via_mm: Floats
    """(c, 3) a point that each passes."""
    external: Floats
    """(p, 6) E1 to E6, NaN where absent; one row in memory where no motion has any."""
    spl_rows: Ints
    """(s,) points of splines."""
    ptp: Bools
    speed_mm_s: Floats
    cdis_mm: Floats
    wait_s: Floats
    line: Ints32
    file: tuple[str, ...]
    """Names of the files; ``file_of`` (p,) points into it."""
    file_of: Ints32
    statements: tuple[Statement, ...]
    triggers: ReadTriggers
    uncalled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Statements of the subprograms that only triggers can call, by file and name."""
    declarations: tuple[Statement, ...] = ()
    """Declarations of the main program."""
    issues: tuple[Issue, ...] = ()
    guard: bool = True
    def_line: int = 0
    """Line of the main DEF."""
    texts: Mapping[str, bytes] = field(default_factory=dict)
    """File name → what it says."""

    @property
    def position_mm(self) -> Floats:
        """The positions (p, 3)."""
        return self.pose[:, 0:3]

    @property
    def abc_deg(self) -> Floats:
        """The angles A, B, C (p, 3)."""
        return self.pose[:, 3:6]

    @property
    def status_turn(self) -> Floats:
        """S and T (p, 2)."""
        return self.pose[:, 6:8]

    @cached_property
    def q_deg(self) -> Floats:
        """The joint targets (p, 6), NaN in Cartesian motions."""
        q_deg = np.full((len(self.ptp), 6), np.nan)
        q_deg[self.joint_rows] = self.joint_deg
        return q_deg


def read_krl(path: str | Path) -> KrlProgram:
    """Read a ``.src`` and the ``.src`` files beside it that it calls.

    Raises `NotUnderstoodError` where a file cannot be read.
    """
    main = Path(path)
    texts = {main.name: _text_in(main)}
    neighbours = {file.stem.upper(): file for file in main.parent.glob("*.[sS][rR][cC]")}
    for name in _externals(texts[main.name]):
        file = neighbours.get(name.upper())
        if file is not None and file.name not in texts:
            texts[file.name] = _text_in(file)
    return read_texts(texts, main.name)


def _text_in(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None


def _externals(text: bytes) -> Iterator[str]:
    """Yield the names that a program declares by EXT, at the beginning of a line."""
    upper = text.upper()
    at = upper.find(_EXT)
    while at >= 0:
        external = _EXTERNAL.match(text, upper.rfind(b"\n", 0, at) + 1)
        if external:
            yield external[1].decode("ascii")
        line_end = upper.find(b"\n", at)
        at = upper.find(_EXT, line_end) if line_end >= 0 else -1


def read_texts(texts: Mapping[str, bytes], main: str) -> KrlProgram:
    """Read a program from file name → text; ``main`` names the main file."""
    sources = [name for name in texts if name.lower().endswith(w.SOURCE_SUFFIX)]
    sources.sort(key=lambda name: name != main)
    read = _Reader({name: np.frombuffer(texts[name], dtype=np.uint8) for name in sources}, main).read()
    return replace(read, texts={name: texts[name] for name in sources})


class _Reader:
    def __init__(self, texts: Mapping[str, NDArray[np.uint8]], main: str) -> None:
        self.texts, self.main = texts, main
        self.names = tuple(texts)
        self.scanned = [sc.scan_krl(text) for text in texts.values()]
        self.others = [np.flatnonzero(~is_motion(scanned.kind)) for scanned in self.scanned]
        self.line_starts: dict[int, Ints] = {}
        self.issues: list[Issue] = []
        self.blocks: dict[tuple[int, str], StatementRun] = {}
        self.executed: set[tuple[int, str]] = set()
        self.declarations: list[Statement] = []
        self.def_lines: dict[str, int] = {}
        for index in range(len(self.names)):
            self._find_blocks(index)

    def read(self) -> KrlProgram:
        for index in range(len(self.names)):
            self._text_rules(index)
        if not self.blocks:
            raise input_error("no-def", "no DEF … END in the file", "is this a KRL source?", source=self.main)
        main = next(iter(self.blocks))
        executed = executed_in(list(self._execute(main, 0)), self.scanned, self.others)
        kind, others, value = executed.kind, executed.others, executed.value
        other_kind = kind[others]
        self._malformed(executed)
        first_number = np.ascontiguousarray(value[:, 0])
        forgetting = self._forgetting(executed)
        ptp, speed, cdis, line = motion_columns(forgetting, executed.blend, executed.line, first_number)
        dwells = np.flatnonzero((other_kind == w.KIND_WAIT_SEC) & (executed.blend[others] == 1))
        joint_rows = executed.motions_before(np.flatnonzero(kind == w.KIND_PTP_AXES))
        circ_rows = executed.motions_before(np.flatnonzero(kind == w.KIND_CIRC))
        pose, joint_deg = executed.pose, executed.pose[joint_rows, :6]
        pose[joint_rows] = np.nan
        heads = b"".join(text[:6000].tobytes() for text in self.texts.values())
        return KrlProgram(
            name=main[1],
            pose=pose,
            joint_rows=joint_rows,
            joint_deg=joint_deg,
            circ_rows=circ_rows,
            circ_via_mm=self._via_mm(executed, len(circ_rows)),
            external=executed.external,
            spl_rows=executed.motions_before(np.flatnonzero(kind == w.KIND_SPL)),
            ptp=ptp,
            speed_mm_s=speed,
            cdis_mm=cdis,
            wait_s=_dwells(others[dwells] - dwells, first_number[dwells], len(ptp)),
            line=line,
            file=self.names,
            file_of=executed.file_of_motions(),
            statements=self._statements(executed),
            triggers=self._triggers(executed),
            uncalled={
                f"{self.names[key[0]]}/{key[1]}": self._texts_of(block)
                for key, block in self.blocks.items()
                if key not in self.executed
            },
            declarations=tuple(self.declarations),
            issues=tuple(self.issues),
            guard=w.NO_GUARD.encode("ascii") not in heads,
            def_line=self.def_lines[main[1]],
        )

    def _via_mm(self, executed: Executed, count: int) -> Floats:
        """Return the points (c, 3) that arcs pass; NaN where one cannot be read."""
        rows = np.flatnonzero(executed.kind == w.KIND_CIRC)
        via_mm = np.full((count, 3), np.nan)
        for number, place in enumerate(
            zip(*(column.tolist() for column in executed.places(rows)), strict=True)
        ):
            for key, value in _COMPONENT.findall(self._statement(*place).partition("}")[0]):
                via_mm[number, "XYZ".index(key.upper())] = float(value)
        return via_mm

    def _statements(self, executed: Executed) -> tuple[Statement, ...]:
        """Return what is neither motion nor setting nor a trigger that is understood."""
        kind = executed.kind[executed.others]
        rows = executed.others[(kind == w.KIND_OTHER) | (kind == w.KIND_WAIT_SEC)]
        motions, line = executed.motions_before(rows).tolist(), executed.line[rows].tolist()
        places = zip(*(column.tolist() for column in executed.places(rows)), strict=True)
        return tuple(
            Statement(motion, self._statement(*place), self.names[place[0]], number)
            for motion, place, number in zip(motions, places, line, strict=True)
        )

    def _forgetting(self, executed: Executed) -> NDArray[np.int8]:
        """Return the kinds (k,); what may change speed and approximation is a kind of its own."""
        kind = executed.kind
        rows = executed.others[kind[executed.others] == w.KIND_OTHER]
        places = zip(*(column.tolist() for column in executed.places(rows)), strict=True)
        disturbing = [may_disturb(self._statement(*place)) for place in places]
        if any(disturbing):
            kind = kind.copy()
            kind[rows[disturbing]] = w.KIND_FORGETS
        return kind

    def _triggers(self, executed: Executed) -> ReadTriggers:
        triggers = np.flatnonzero(executed.kind[executed.others] == w.KIND_TRIGGER)
        rows, values = executed.others[triggers], executed.value[triggers]
        file_of = executed.places(rows)[0]
        return ReadTriggers(
            motion=rows - triggers,
            distance=values[:, w.TRIGGER_DISTANCE],
            delay_ms=values[:, w.TRIGGER_DELAY],
            written=values[:, w.TRIGGER_WRITTEN : w.TRIGGER_WRITTEN + w.TRIGGER_NUMBERS],
            calls=executed.blend[rows] == w.CALLS,
            names=self._names_written(values[:, w.TRIGGER_NAME :].astype(np.int64), file_of),
            line=executed.line[rows],
            file_of=file_of,
        )

    def _malformed(self, executed: Executed) -> None:
        rows = np.flatnonzero(executed.blend == w.MALFORMED)[:MOST_PLACES]
        for line, file, row in zip(executed.line[rows], *executed.places(rows), strict=True):
            text = f"cannot read {self._statement(int(file), int(row))!r}"
            self._issue("krl-malformed", int(line), text, int(file))

    def _names_written(self, place: Ints, file_of: Ints32) -> tuple[str, ...]:
        """Return the names that stand at first bytes and lengths (k, 2), each once."""
        names: set[str] = set()
        for file in distinct(file_of).tolist():
            data = self.texts[self.names[file]]
            places = place[file_of == file]
            for size in distinct(places[:, 1]).tolist():
                first = places[places[:, 1] == size, 0]
                letters = data[first[:, None] + np.arange(size)]
                written = distinct(letters.view(f"S{size}")[:, 0])
                names |= {name.decode("ascii", "replace") for name in written.tolist()}
        return tuple(sorted({re.sub(r"\s+", "", name).upper() for name in names}))

    def _texts_of(self, block: StatementRun) -> tuple[str, ...]:
        rows = range(block.start, block.end)
        return tuple(re.sub(r"\s+", "", self._statement(block.file, row)).upper() for row in rows)

    def _statement(self, file: int, row: int) -> str:
        """Return the text of a statement, without its comment."""
        scanned, others = self.scanned[file], self.others[file]
        k = int(np.searchsorted(others, row))
        if k < len(others) and others[k] == row:
            start, end = scanned.span[k]
        else:  # a motion, whose text is asked for where it cannot be read
            start, end = self._lines(file)[scanned.line[row] - 1 : scanned.line[row] + 1]
        text = self.texts[self.names[file]][start:end].tobytes().decode("ascii", "replace")
        return (_COMMENT.sub(r"\1", text) if ";" in text else text).strip()

    def _lines(self, file: int) -> Ints:
        """Return where each line of a file begins, and the end; found once it is asked for."""
        if file not in self.line_starts:
            text = self.texts[self.names[file]]
            newline = np.flatnonzero(text == ord("\n"))
            self.line_starts[file] = np.concatenate([[0], newline + 1, [len(text)]])
        return self.line_starts[file]

    def _issue(self, code: str, line: int, message: str, file: int = 0, remedy: str = "") -> None:
        name = self.names[file]
        self.issues.append(
            Issue("error", code, line, f"{name}: {message}" if name != self.main else message, remedy)
        )

    def _find_blocks(self, file: int) -> None:
        scanned = self.scanned[file]
        name, start = "", 0
        for row in np.flatnonzero(scanned.kind == w.KIND_OTHER):
            text = self._statement(file, int(row))
            match = _DEF.match(text)
            if match:
                if name:
                    self._issue("krl-structure", int(scanned.line[row]), f"DEF {name} has no END", file)
                name, start = match.group(1).upper(), int(row) + 1
                self.def_lines.setdefault(name, int(scanned.line[row]))
            elif text.upper() == w.END:
                if not name:
                    self._issue("krl-structure", int(scanned.line[row]), "END without DEF", file)
                    continue
                if (file, name) in self.blocks:
                    self._issue("krl-structure", int(scanned.line[row]), f"DEF {name} stands twice", file)
                self.blocks.setdefault((file, name), StatementRun(file, start, int(row)))
                name = ""
        if name:
            self._issue("krl-structure", int(scanned.line[-1]), f"DEF {name} has no END", file)
            self.blocks.setdefault((file, name), StatementRun(file, start, len(scanned.kind)))

    def _called(self, file: int, name: str) -> tuple[int, str] | None:
        """Return the subprogram that a file means by a name: its own, else the one a file is named after."""
        name = name.upper()
        if (file, name) in self.blocks:
            return file, name
        others = (k for k, other in enumerate(self.names) if Path(other).stem.upper() == name)
        return next(((k, name) for k in others if (k, name) in self.blocks), None)

    def _execute(self, block: tuple[int, str], depth: int) -> Iterator[StatementRun]:
        """Yield the runs of statements in the order of execution; calls of known subprograms are followed."""
        self.executed.add(block)
        file, start, end = self.blocks[block]
        scanned = self.scanned[file]
        at = start
        for row in np.flatnonzero(scanned.kind[start:end] == w.KIND_OTHER) + start:
            text = self._statement(file, int(row))
            call = _CALL.match(text)
            if _DECLARATION.match(text):
                if depth == 0:
                    self.declarations.append(Statement(0, text, self.names[file], int(scanned.line[row])))
                if row > self._last_declaration(file, start, end):
                    self._issue(
                        "krl-structure", int(scanned.line[row]), f"{text[:40]!r} behind statements", file
                    )
                yield StatementRun(file, at, int(row))
                at = int(row) + 1
            elif call and (called := self._called(file, call.group(1))):
                yield StatementRun(file, at, int(row))
                at = int(row) + 1
                if depth > 20:
                    self._issue("krl-structure", int(scanned.line[row]), "calls nest too deeply", file)
                    return
                yield from self._execute(called, depth + 1)
        yield StatementRun(file, at, end)

    def _last_declaration(self, file: int, start: int, end: int) -> int:
        """Return the last row of the run of declarations with which a block begins."""
        kind, at = self.scanned[file].kind, start
        while at < end and kind[at] == w.KIND_OTHER and _DECLARATION.match(self._statement(file, at)):
            at += 1
        return at - 1

    def _text_rules(self, file: int) -> None:
        """Rules of the text itself: ASCII, line length, folds and loops closed."""
        scanned = self.scanned[file]
        if scanned.not_ascii:
            self._issue("krl-not-ascii", scanned.not_ascii, "a character that is not ASCII", file)
        if scanned.too_long:
            text = f"more than {w.LONGEST_LINE} characters"
            self._issue("krl-line-too-long", scanned.too_long, text, file)
        if scanned.open_folds:
            self._issue("krl-structure", 0, ";FOLD and ;ENDFOLD do not match", file)
        words = [
            self._statement(file, int(row)).split("(")[0].split()
            for row in np.flatnonzero(self.scanned[file].kind == w.KIND_OTHER)
        ]
        first = [word[0].upper() for word in words if word]
        for begin in _COUNTED:
            close = w.BLOCKS[begin]
            if first.count(begin) != first.count(close):
                self._issue("krl-structure", 0, f"{begin} and {close} do not match", file)


def _dwells(motions_before: Ints, seconds: Floats, count: int) -> Floats:
    """Return the dwell (p,) behind each motion, from marked waits and the motions before each."""
    dwell = np.zeros(count)
    behind_motions = motions_before > 0
    np.add.at(dwell, motions_before[behind_motions] - 1, np.nan_to_num(seconds[behind_motions]))
    return dwell
