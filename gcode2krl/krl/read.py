"""KRL in: reads the subset that is written, in the order in which the controller would execute it."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.errors import MOST_PLACES, Issue, input_error
from gcode2krl.krl import scan as sc
from gcode2krl.units import MM_PER_M

_DEF = re.compile(rf"(?:{w.GLOBAL}\s+)?{w.DEF}\s+([A-Z_$][A-Z0-9_$]*)\s*\(([^)]*)\)\s*$", re.IGNORECASE)
_CALL = re.compile(r"([A-Z_][A-Z0-9_]*)\s*\(\s*\)\s*$", re.IGNORECASE)
_DECLARATION = re.compile(rf"(?:{'|'.join(w.DECLARING)})\b", re.IGNORECASE)
_EXT = w.EXT.encode("ascii")
_EXTERNAL = re.compile(rb"\s*%b\s+([A-Z_][A-Z0-9_]*)\s*\(" % _EXT, re.IGNORECASE)
_COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);.*$')
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
    position_mm: Floats
    """(p, 3), NaN where a component is missing."""
    abc_deg: Floats
    """(p, 3)"""
    status_turn: Floats
    """(p, 2) S and T, NaN where absent."""
    q_deg: Floats
    """(p, 6) joint targets, NaN on Cartesian motions."""
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


def read_krl(path: str | Path) -> KrlProgram:
    """Read a ``.src`` and the ``.src`` files beside it that it calls.

    Raises `NotUnderstoodError` where a file cannot be read.
    """
    main = Path(path)
    texts = {main.name: _read_bytes(main)}
    beside = {file.stem.upper(): file for file in main.parent.glob("*.[sS][rR][cC]")}
    for name in _externals(texts[main.name]):
        file = beside.get(name.upper())
        if file is not None and file.name not in texts:
            texts[file.name] = _read_bytes(file)
    return read_texts(texts, main.name)


def _read_bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None


def _externals(text: bytes) -> Iterator[str]:
    """Yield the names that a program declares by EXT, at the beginning of a line."""
    upper = text.upper()
    at = upper.find(_EXT)
    while at >= 0:
        found = _EXTERNAL.match(text, upper.rfind(b"\n", 0, at) + 1)
        if found:
            yield found[1].decode("ascii")
        line_end = upper.find(b"\n", at)
        at = upper.find(_EXT, line_end) if line_end >= 0 else -1


def read_texts(texts: Mapping[str, bytes], main: str) -> KrlProgram:
    """Read a program from file name → bytes; ``main`` names the main file."""
    sources = [name for name in texts if name.lower().endswith(w.SOURCE_SUFFIX)]
    sources.sort(key=lambda name: name != main)
    return _Reader({name: texts[name] for name in sources}, main).read()


class _Block(NamedTuple):
    file: int
    start: int
    end: int


class _Reader:
    def __init__(self, texts: Mapping[str, bytes], main: str) -> None:
        self.texts, self.main = texts, main
        self.names = tuple(texts)
        self.scanned = [sc.scan_krl(text) for text in texts.values()]
        self.issues: list[Issue] = []
        self.blocks: dict[tuple[int, str], _Block] = {}
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
        runs = list(self._execute(main, 0))
        if not runs:
            runs = [_Block(0, 0, 0)]
        kind = np.concatenate([self.scanned[f].kind[a:b] for f, a, b in runs])
        line = np.concatenate([self.scanned[f].line[a:b] for f, a, b in runs])
        value = np.concatenate([self.scanned[f].value[a:b] for f, a, b in runs])
        blend = np.concatenate([self.scanned[f].blend[a:b] for f, a, b in runs])
        file_of = np.repeat(np.array([f for f, _, _ in runs], dtype=np.int32), [b - a for _, a, b in runs])
        where = np.concatenate([np.arange(a, b) for _, a, b in runs])
        axes = kind == w.KIND_PTP_AXES
        motion = (kind == w.KIND_LIN) | (kind == w.KIND_PTP) | axes
        for row in np.flatnonzero(blend == w.MALFORMED)[:MOST_PLACES]:
            self._issue(
                "krl-malformed",
                int(line[row]),
                f"cannot read {self._statement(int(file_of[row]), int(where[row]))!r}",
                int(file_of[row]),
            )
        before = np.cumsum(motion)
        statements = tuple(
            Statement(
                int(before[row]),
                self._statement(int(file_of[row]), int(where[row])),
                self.names[file_of[row]],
                int(line[row]),
            )
            for row in np.flatnonzero((kind == w.KIND_OTHER) | (kind == w.KIND_WAIT_SEC))
        )
        rows = np.flatnonzero(motion)
        speed = _in_force(np.flatnonzero(kind == w.KIND_VEL_CP), value[:, 0], rows) * MM_PER_M
        cdis = _in_force(np.flatnonzero(kind == w.KIND_APO_CDIS), value[:, 0], rows)
        cdis[blend[rows] != 1] = 0.0
        ptp = kind[rows] != w.KIND_LIN
        speed[ptp] = np.nan
        joint_rows = np.flatnonzero(axes[rows])
        pose = value.take(rows, axis=0)
        q_deg = np.full((len(rows), 6), np.nan)
        q_deg[joint_rows] = pose[joint_rows, :6]
        pose[joint_rows] = np.nan
        guard = w.NO_GUARD.encode("ascii") not in b"".join(text[:6000] for text in self.texts.values())
        return KrlProgram(
            name=main[1],
            position_mm=pose[:, 0:3],
            abc_deg=pose[:, 3:6],
            status_turn=pose[:, 6:8],
            q_deg=q_deg,
            ptp=ptp,
            speed_mm_s=speed,
            cdis_mm=cdis,
            wait_s=_dwells((kind == w.KIND_WAIT_SEC) & (blend == 1), value[:, 0], before, len(rows)),
            line=line[rows],
            file=self.names,
            file_of=file_of[rows],
            statements=statements,
            triggers=self._triggers(kind, value, blend, before, line, file_of),
            uncalled={
                f"{self.names[key[0]]}/{key[1]}": self._texts_of(block)
                for key, block in self.blocks.items()
                if key not in self.executed
            },
            declarations=tuple(self.declarations),
            issues=tuple(self.issues),
            guard=guard,
            def_line=self.def_lines[main[1]],
            texts=self.texts,
        )

    def _triggers(
        self,
        kind: NDArray[np.int8],
        value: Floats,
        blend: NDArray[np.int8],
        before: Ints,
        line: Ints32,
        file_of: Ints32,
    ) -> ReadTriggers:
        rows = np.flatnonzero(kind == w.KIND_TRIGGER)
        values = value[rows]
        return ReadTriggers(
            motion=before[rows].astype(np.int64),
            distance=values[:, w.TRIGGER_DISTANCE],
            delay_ms=values[:, w.TRIGGER_DELAY],
            written=values[:, w.TRIGGER_WRITTEN : w.TRIGGER_WRITTEN + w.TRIGGER_NUMBERS],
            calls=blend[rows] == w.CALLS,
            names=self._names_written(values[:, w.TRIGGER_NAME :].astype(np.int64), file_of[rows]),
            line=line[rows],
            file_of=file_of[rows],
        )

    def _names_written(self, place: Ints, file_of: Ints32) -> tuple[str, ...]:
        """Return the names that stand at first bytes and lengths (k, 2), each once."""
        found: set[str] = set()
        for file in np.unique(file_of).tolist():
            data = np.frombuffer(self.texts[self.names[file]], dtype=np.uint8)
            own = place[file_of == file]
            for size in np.unique(own[:, 1]).tolist():
                first = own[own[:, 1] == size, 0]
                letters = data[first[:, None] + np.arange(size)]
                found |= {row.tobytes().decode("ascii", "replace") for row in np.unique(letters, axis=0)}
        return tuple(sorted({re.sub(r"\s+", "", name).upper() for name in found}))

    def _texts_of(self, block: "_Block") -> tuple[str, ...]:
        rows = range(block.start, block.end)
        return tuple(re.sub(r"\s+", "", self._statement(block.file, row)).upper() for row in rows)

    def _statement(self, file: int, row: int) -> str:
        a, b = self.scanned[file].span[row]
        text = self.texts[self.names[file]][a:b].decode("ascii", "replace")
        return _COMMENT.sub(r"\1", text).strip()

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
            found = _DEF.match(text)
            if found:
                if name:
                    self._issue("krl-structure", int(scanned.line[row]), f"DEF {name} has no END", file)
                name, start = found.group(1).upper(), int(row) + 1
                self.def_lines.setdefault(name, int(scanned.line[row]))
            elif text.upper() == w.END:
                if not name:
                    self._issue("krl-structure", int(scanned.line[row]), "END without DEF", file)
                    continue
                if (file, name) in self.blocks:
                    self._issue("krl-structure", int(scanned.line[row]), f"DEF {name} stands twice", file)
                self.blocks.setdefault((file, name), _Block(file, start, int(row)))
                name = ""
        if name:
            self._issue("krl-structure", int(scanned.line[-1]), f"DEF {name} has no END", file)
            self.blocks.setdefault((file, name), _Block(file, start, len(scanned.kind)))

    def _called(self, file: int, name: str) -> tuple[int, str] | None:
        """Return the subprogram that a file means by a name: its own, else the one a file is named after."""
        name = name.upper()
        if (file, name) in self.blocks:
            return file, name
        others = (k for k, other in enumerate(self.names) if Path(other).stem.upper() == name)
        return next(((k, name) for k in others if (k, name) in self.blocks), None)

    def _execute(self, block: tuple[int, str], depth: int) -> Iterator[_Block]:
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
                yield _Block(file, at, int(row))
                at = int(row) + 1
            elif call and (called := self._called(file, call.group(1))):
                yield _Block(file, at, int(row))
                at = int(row) + 1
                if depth > 20:
                    self._issue("krl-structure", int(scanned.line[row]), "calls nest too deeply", file)
                    return
                yield from self._execute(called, depth + 1)
        yield _Block(file, at, end)

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


def _in_force(settings: Ints, values: Floats, rows: Ints) -> Floats:
    """Return what is in force at rising rows: the value of the last setting before, NaN before the first."""
    valid = settings[~np.isnan(values[settings])]
    borders = [0, *np.searchsorted(rows, valid), len(rows)]
    return np.repeat(np.concatenate([[np.nan], values[valid]]), np.diff(borders))


def _dwells(marked: Bools, seconds: Floats, motions_before: Ints, count: int) -> Floats:
    """Return the dwell (p,) behind each motion: the waits that are marked as such."""
    dwell = np.zeros(count)
    rows = np.flatnonzero(marked & (motions_before > 0))
    np.add.at(dwell, motions_before[rows] - 1, np.nan_to_num(seconds[rows]))
    return dwell
