"""Targets to the text of a KRL program: head, guard, motions, events, subprograms."""

import itertools
import re
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from gcode2krl import compliance
from gcode2krl import frames as fr
from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell, controller_axes, template_rules
from gcode2krl.cell.checked_parts import CollisionScope
from gcode2krl.cell.confirmation import signers
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import distinct
from gcode2krl.compiled.threads import in_threads
from gcode2krl.krl import controller_state as cs
from gcode2krl.krl import statements as st
from gcode2krl.krl.cell_hashes import hash_lines
from gcode2krl.krl.external_words import external_lines
from gcode2krl.krl.names import part_name
from gcode2krl.krl.number_text import NOTHING_BEFORE, fixed, motion_lines
from gcode2krl.krl.pilot_text import PilotText, checksum
from gcode2krl.krl.provenance import provenance_lines, unconfirmed_lines
from gcode2krl.krl.rsi_text import DECLARATIONS as RSI_DECLARATIONS
from gcode2krl.krl.rsi_text import RsiText, rsi_rows
from gcode2krl.krl.versions import version_lines
from gcode2krl.program.arcs import Arc
from gcode2krl.program.splines import SplineBlock
from gcode2krl.tables import Joints, Targets
from gcode2krl.units import DEG_PER_RAD, MM_PER_M
from gcode2krl.version import __version__

NEWLINE = b"\r\n"
_WIDTH = 76
"""Of comment lines that are wrapped."""
DECLARATIONS = """DECL KRLMSG_T GK_MSG
DECL KRLMSGPAR_T GK_PAR[3]
DECL KRLMSGOPT_T GK_OPT
DECL INT GK_HANDLE"""
MESSAGE_SETUP = """GK_PAR[1]={PAR_TYPE #EMPTY}
GK_PAR[2]={PAR_TYPE #EMPTY}
GK_PAR[3]={PAR_TYPE #EMPTY}
GK_OPT={VL_STOP TRUE,CLEAR_P_RESET TRUE,CLEAR_P_SAW FALSE,LOG_TO_DB FALSE}"""
FRAME_DECLARATIONS = """DECL FRAME GK_INV
DECL FRAME GK_DIFF"""
_T_GRID_RAD = 1e-4 / DEG_PER_RAD
_LOOK_BACK = 0.2
"""Share of a subprogram within which a standstill is preferred as its end."""


_NOTHING_IN_FORCE = (-1.0, -1.0, 0.0)
"""The state of `motion_lines` at the beginning of a program or a part."""
_MESSAGE = b"GK_MSG"
_LIN = f"{w.LIN} {{".encode("ascii")
PIECE_ROWS = 262_144
"""Motions whose text is made at a time, some 25 MB of it: enough for all cores."""


class _Part(NamedTuple):
    """A subprogram: its name and its motions, from a row of Targets to the one behind its last."""

    name: str
    start: int
    end: int


@dataclass(frozen=True)
class TextLayout:
    """How the text is laid out; what the header must say of the options."""

    guard: bool = True
    split: Literal["defs", "files"] = "defs"
    single_file: bool = False
    """Declarations inside the .src, no .dat (standard output)."""
    options: str = ""
    allowed: tuple[str, ...] = ()
    forces: bool = False
    """True where material removal and cutting forces have been predicted."""
    online: str = ""
    """Name of the RSI files of a program that is corrected online."""
    collisions: CollisionScope | None = None
    """What was checked for collisions; None: nothing."""
    arcs: tuple[Arc, ...] = ()
    """Rows that are written as CIRC."""
    splines: tuple[SplineBlock, ...] = ()
    """Rows that are written as SPLINE blocks."""


def compose(
    targets: Targets,
    joints: Joints,
    cell: Cell,
    name: str,
    layout: TextLayout,
    pilot: PilotText | None = None,
) -> dict[str, Iterable[bytes]]:
    """Return file name → text of the program ``name``, in pieces that are made as they are asked for.

    ``.src``, ``.dat``, split ``name_001.src`` …, ``.pilot.csv`` where there is a pilot force, and the RSI
    files where the program is corrected online.
    """
    writer = _Composer(targets, joints, cell, name, layout, pilot)
    return writer.files()


class _Composer:
    def __init__(
        self,
        targets: Targets,
        joints: Joints,
        cell: Cell,
        name: str,
        layout: TextLayout,
        pilot: PilotText | None,
    ) -> None:
        self.targets, self.joints, self.cell, self.name, self.layout = targets, joints, cell, name, layout
        self.source = st.ascii_text(_file_name(targets.source), 40)
        self.position, self.abc_deg = written_poses(targets, cell)
        self.state = np.array(_NOTHING_IN_FORCE)
        self.guarded_pose = False
        self.on_the_way = False
        self.pilot = pilot
        self.checksum = 0
        if pilot is not None:
            self.checksum = self._checksum(pilot)
        self.rsi = self._rsi(layout.online) if layout.online else None
        most, count = cell.program.max_lines, len(targets)
        is_one = count <= most and layout.split == "defs"
        self.chunks = [(0, count, False)] if is_one else self._chunks(most)
        self.curves = self._curves()
        self.curve_firsts = np.array([curve.first for curve in self.curves], dtype=np.int64)
        self.standing = targets.external[np.argmin(targets.home)]
        self.disturbed_rows: set[int] = set()
        self.events = self._event_texts()
        rows = [*self.events, self.rsi.off] if self.rsi is not None else [*self.events]
        self.event_rows = np.array(sorted(rows), dtype=np.int64)

    def _curves(self) -> list[Arc | SplineBlock]:
        """Return the arcs and splines that are written as such: one over the end of a part stays chords."""
        starts, ends = np.array([(start, end) for start, end, _ in self.chunks]).T
        curves: list[Arc | SplineBlock] = [*self.layout.arcs, *self.layout.splines]
        curves.sort(key=lambda curve: curve.first)
        of_chunk = np.searchsorted(starts, [curve.first for curve in curves], side="right") - 1
        return [curve for curve, k in zip(curves, of_chunk, strict=True) if curve.end < ends[k]]

    def _event_texts(self) -> dict[int, list[tuple[float, str]]]:
        """Return row → (dwell before it, KRL) of the events at its end, and fill ``disturbed_rows``.

        Behind a statement that may have moved the arm or changed a setting, both are made sure of.
        """
        events: dict[int, list[tuple[float, str]]] = {}
        tool = int(self.targets.tool[0])
        for event in self.targets.events:
            text = st.event_statements(event, self.cell)
            changes_tool = event.kind == "tool" and event.values["tool"] in self.cell.tool
            if changes_tool:
                tool = event.values["tool"]
            is_last = event.row == len(self.targets) - 1  # nothing moves behind it
            if cs.may_disturb(text) and not is_last:
                self.disturbed_rows.add(event.row)
                line = event.values["line"]
                text = self._made_sure(text, f"Line {line}" if line else "Program end", tool)
            elif changes_tool:
                text = f"{text}\n{st.tool_statements(self.cell, tool)}"
            events.setdefault(event.row, []).append((event.values.get("dwell_s", 0.0), text))
        return events

    def _made_sure(self, text: str, place: str, tool: int) -> str:
        """Return KRL that may disturb, with what finds the arm moved and sets everything again."""
        if self.layout.guard:
            text = f"{cs.arm_before()}\n{text}\n{cs.arm_guard(place, self.cell)}"
        return f"{text}\n{cs.settings_again(self._settings(tool))}"

    def _settings(self, tool: int) -> str:
        base = st.base_statement(self.cell, self.standing)
        return cs.settings(self.cell, base, tool, has_arcs=any(isinstance(c, Arc) for c in self.curves))

    def _rsi(self, name: str) -> RsiText:
        on, off = rsi_rows(self.targets)
        form = self.pilot.header.form if self.pilot is not None else "none"
        return RsiText(name, self.cell, form, on, off, int(self.targets.tool[off]))

    def files(self) -> dict[str, Iterable[bytes]]:
        """Return the main program, its subprograms and what stands beside them."""
        whole = [(start, end) for start, end, is_part in self.chunks if is_part]
        parts = [_Part(part_name(self.name, k), *rows) for k, rows in enumerate(whole, start=1)]
        files: dict[str, Iterable[bytes]] = {f"{self.name}{w.SOURCE_SUFFIX}": self._main(parts)}
        if self.layout.split == "files":
            files |= {f"{part.name}{w.SOURCE_SUFFIX}": self._part_file(part) for part in parts}
        return files | self._side_files()

    def _main(self, parts: list[_Part]) -> Iterator[bytes]:
        """Yield the main program; where the parts are not files, they stand behind it."""
        yield self._head(parts)
        names = iter(parts)
        for start, end, is_part in self.chunks:
            if is_part:
                yield _text(f"{next(names).name}( )")
                self.state[:] = _NOTHING_IN_FORCE
            else:
                yield from self._motions(start, end, self.state)
        yield self._foot()
        if self.layout.split == "defs":
            yield from self._subprograms(parts)
        yield from self._called()
        if self.rsi is not None:
            yield from (NEWLINE, _text(self.rsi.lost))

    def _subprograms(self, parts: list[_Part]) -> Iterator[bytes]:
        """Yield the parts, some at a time on all cores."""
        for together in _groups(parts):
            if len(together) == 1:  # it may be long
                yield from self._subprogram(together[0])
                continue
            yield from in_threads(lambda part: b"".join(self._subprogram(part)), together)

    def _subprogram(self, part: _Part) -> Iterator[bytes]:
        """Yield a part, which states its speed and CDIS."""
        first = self._first_message(part)
        yield from (
            NEWLINE,
            _text("\n".join([f"{w.DEF} {part.name}( )", *self._declarations_of(part, first)])),
        )
        state, begin = np.array(_NOTHING_IN_FORCE), part.start
        if first is not None:  # set up where the robot stands anyway: the part may begin in a blended corner
            yield from self._motions(begin, first, state)
            yield from self._lines(first, first + 1, state)
            yield from (_text(MESSAGE_SETUP), self._around(first))
            begin = first + 1
            if first in self.disturbed_rows:
                state[:] = _NOTHING_IN_FORCE
        yield from self._motions(begin, part.end, state)
        yield _text(w.END)

    def _declarations_of(self, part: _Part, first_message: int | None) -> Iterator[str]:
        """Yield what a part declares: what it calls where it is a file, and its own variables."""
        rows = [row for row in self.events if part.start <= row < part.end]
        if self.layout.split == "files":
            text = "\n".join(event_text for row in rows for _, event_text in self.events[row])
            called = set(template_rules.calls(text))
            if w.BAS in called:
                yield w.EXT_BAS
            for external in self.cell.program.externals:
                if external.split("(")[0].strip().upper() in called:
                    yield f"{w.EXT} {external}"
        if first_message is not None:
            yield DECLARATIONS
        if self.layout.guard and not self.disturbed_rows.isdisjoint(rows):
            yield cs.STOOD_DECLARATION

    def _part_file(self, part: _Part) -> Iterator[bytes]:
        """Yield a part as a file of its own."""
        yield _text(f"&ACCESS RVP\n&REL 1\n&COMMENT part of {self.name} by gcode2krl")
        yield from itertools.islice(self._subprogram(part), 1, None)  # without the line before it
        if self.pilot is not None and self.pilot.calls_in(part.start, part.end):
            yield from self._called()  # a local subprogram is known in its file only

    def _called(self) -> Iterator[bytes]:
        """Yield the subprogram that triggers call."""
        if self.pilot and self.pilot.subprogram:
            yield from (NEWLINE, _text(self.pilot.subprogram))

    def _first_message(self, part: _Part) -> int | None:
        """Return the first row of a part with a message, whose variables are those of the part."""
        rows = self._with_events(part.start, part.end).tolist()
        return next((row for row in rows if _MESSAGE in self._around(row)), None)

    def _with_events(self, start: int, end: int) -> Ints:
        """Return the rows of start..end at which something stands beside a motion and its dwell."""
        first, behind = np.searchsorted(self.event_rows, (start, end))
        return self.event_rows[first:behind]

    def _chunks(self, most: int) -> list[tuple[int, int, bool]]:
        """Cut the LIN motions into parts of at most ``most``; PTP motions stay in the main program.

        So does the motion at whose end RSI is switched off: its variables are those of the main program.
        """
        chunks: list[tuple[int, int, bool]] = []
        start, count = 0, len(self.targets)
        is_alone = np.array(self.targets.ptp)
        if self.rsi is not None:
            is_alone[self.rsi.off] = True
        borders = np.append(np.flatnonzero(is_alone), count)
        while start < count:
            if is_alone[start]:
                chunks.append((start, start + 1, False))
                start += 1
                continue
            end = int(borders[np.searchsorted(borders, start)])
            if end - start > most:
                end = start + most
                standing = np.flatnonzero(self.targets.cdis_mm[end - int(most * _LOOK_BACK) : end] == 0)
                if len(standing):
                    end = end - int(most * _LOOK_BACK) + int(standing[-1]) + 1
            chunks.append((start, end, True))
            start = end
        return chunks

    def _motions(self, start: int, end: int, state: Floats) -> Iterator[bytes]:
        """Yield the text of rows start..end, with their waits and events; ``state`` is updated."""
        ptp = self.targets.ptp
        special = ptp[start:end] | (self.targets.wait_s[start:end] > 0)
        special[self._with_events(start, end) - start] = True
        at = start
        for row in [*(np.flatnonzero(special) + start).tolist(), end]:
            stop = row + 1 if row < end and not ptp[row] else row
            yield from self._ways(at, stop, state)
            if row < end:
                yield self._around(row)
                if row in self.disturbed_rows:
                    state[:] = _NOTHING_IN_FORCE
            at = row + 1

    def _ways(self, start: int, end: int, state: Floats) -> Iterator[bytes]:
        """Yield the text of rows that follow each other without anything between them, curves as such."""
        at = start
        for curve in self.curves[slice(*np.searchsorted(self.curve_firsts, (start, end)))]:
            if curve.first < at or curve.end >= end:
                continue
            yield from self._straight(at, curve.first, state)
            yield self._arc(curve, state) if isinstance(curve, Arc) else self._spline(curve, state)
            at = curve.end + 1
        yield from self._straight(at, end, state)

    def _straight(self, start: int, end: int, state: Floats) -> Iterator[bytes]:
        for first in range(start, end, PIECE_ROWS):
            yield from self._lines(first, min(first + PIECE_ROWS, end), state)

    def _arc(self, arc: Arc, state: Floats) -> bytes:
        """Return the CIRC to the end of an arc, with what is set before it as before a LIN."""
        head, _, end = b"".join(self._lines(arc.end, arc.end + 1, state)).rpartition(_LIN)
        via = ",".join(
            f"{key} {fixed(v, 3)}" for key, v in zip(w.POSE_KEYS, self.position[arc.via], strict=False)
        )
        return head + f"{w.CIRC} {{{via}}},{{".encode("ascii") + end

    def _spline(self, chain: SplineBlock, state: Floats) -> bytes:
        """Return a SPLINE block, with what is set before it as before a LIN."""
        text = b"".join(self._lines(chain.first, chain.end + 1, state, passes=True))
        head, _, points = text.partition(_LIN)
        spl = f"{w.SPL} {{".encode("ascii")
        block = spl + points.replace(b"\r\n" + _LIN, b"\r\n" + spl)
        return head + w.SPLINE.encode("ascii") + NEWLINE + block + w.ENDSPLINE.encode("ascii") + NEWLINE

    def _lines(self, start: int, end: int, state: Floats, *, passes: bool = False) -> list[bytes]:
        rows = slice(start, end)
        cdis_mm = self.targets.cdis_mm[rows]
        return motion_lines(
            self.position[rows],
            self.abc_deg[rows],
            self.targets.speed_mm_s[rows] / MM_PER_M,
            np.zeros_like(cdis_mm) if passes else cdis_mm,
            self.targets.source_line[rows],
            state,
            self.cell.program.comment_every,
            self.pilot.before(start, end) if self.pilot is not None else NOTHING_BEFORE,
            (self.targets.external[rows], st.external_bits(self.cell)),
        )

    def _checksum(self, pilot: PilotText) -> int:
        if pilot.stated is not None:
            return pilot.stated
        targets, rows = self.targets, np.flatnonzero(self.targets.home)
        return checksum(
            self.position,
            self.abc_deg,
            rows,
            self.joints.q_rad[rows] * DEG_PER_RAD,
            targets.ptp,
            targets.speed_mm_s,
            targets.cdis_mm,
            pilot.rows,
            targets.home,
            targets.external,
        )

    def _around(self, row: int) -> bytes:
        """Return the PTP, dwell and events of a row; where the row switches RSI, it is off during them."""
        lines: list[str] = []
        targets = self.targets
        if targets.ptp[row]:
            if targets.restart is not None and not targets.home[row] and not self.on_the_way:
                lines.append(f"; restart: from above down to the start of line {targets.restart.begins_line}")
                self.on_the_way = True
            lines.append(self._ptp(row))
            if not targets.home[row] and self.layout.guard and not self.guarded_pose:
                self.guarded_pose = True
                q_deg = self.joints.q_rad[row] * DEG_PER_RAD
                external = zip(w.EXTERNAL_KEYS, targets.external[row], strict=True)
                template = st.environment().get_template("pose_guard.j2")
                lines.append(cs.arm_before())
                lines.append(
                    template.render(
                        q_deg=q_deg,
                        external={key: at for key, at in external if key in self.cell.external},
                        root=st.root_check(self.cell, targets.external[row]),
                    )
                )
                # Jogged to the predicted axes the arm would pass, but not stand where the motion begins.
                lines.append(cs.arm_guard("First position", self.cell))
                lines.append(cs.settings_again(self._settings(int(targets.tool[row]))))
        if self.rsi is not None and row == self.rsi.off:
            lines.append(self.rsi.end)
        waited_s = 0.0
        for dwell_s, text in self.events.get(row, []):
            lines += _dwell(dwell_s - waited_s)
            waited_s = max(waited_s, dwell_s)
            lines.append(text)
        lines += _dwell(targets.wait_s[row] - waited_s)
        if self.rsi is not None and row == self.rsi.on:
            lines.append(self.rsi.start)
        return _text("\n".join(lines))

    def _ptp(self, row: int) -> str:
        external = st.external_text(self.targets.external[row], self.cell)
        if self.targets.home[row]:
            return f"{w.PTP} {st.axes_text(self.joints.q_rad[row] * DEG_PER_RAD, external)}"
        values = [*(fixed(v, 3) for v in self.position[row]), *(fixed(v, 4) for v in self.abc_deg[row])]
        pose = ",".join(f"{key} {value}" for key, value in zip(w.POSE_KEYS, values, strict=True))
        turn = turn_bits(self.joints.q_rad[row])
        return f"{w.PTP} {{{pose},S {int(self.joints.status[row])},T {turn}{external}}}"

    def _head(self, parts: list[_Part]) -> bytes:
        tools = [int(number) for number in distinct(self.targets.tool)]
        checks = st.frame_checks(self.cell, tools, self.standing) if self.layout.guard else []
        declarations = [w.EXT_BAS] if self.layout.single_file else []
        if self.layout.split == "files":
            declarations += [f"{w.EXT} {part.name}( )" for part in parts]
        declarations.append(DECLARATIONS)
        if checks or (self.layout.guard and st.has_coupled_rail(self.cell)):
            declarations.append(FRAME_DECLARATIONS)
        if st.coupled_table(self.cell) is not None and self.cell.frames.base_data is None:
            declarations.append("DECL FRAME GK_BASE")
        if self.layout.guard:
            declarations.append(cs.STOOD_DECLARATION)
        if self.rsi is not None:
            declarations.append(RSI_DECLARATIONS)
        arcs = [curve for curve in self.curves if isinstance(curve, Arc)]
        options = st.ascii_text(self.layout.options, 200) or "none"
        allowed = ", ".join(st.ascii_text(word, 120) for word in self.layout.allowed) or "none"
        render = partial(
            st.environment().get_template("head.src.j2").render,
            source=self.source,
            name=self.name,
            version=__version__,
            cell=self.cell,
            motions=len(self.targets) - sum(arc.end - arc.first for arc in arcs),
            arcs=len(arcs),
            splines=sum(isinstance(curve, SplineBlock) for curve in self.curves),
            options=options,
            allowed=allowed,
            cell_hashes=hash_lines(
                self.cell,
                tools,
                options,
                allowed,
                pilot=self.pilot is not None,
                online=self.rsi is not None,
            ),
            guard=self.layout.guard,
            forces=self.layout.forces,
            assumed=_assumed_words(self.cell),
            collisions=self._collision_lines(),
            provenance=provenance_lines(self.cell, tools, self.pilot is not None, self.rsi is not None),
            restart=self.targets.restart,
            simplified=self.targets.simplified,
            pilot=self.pilot,
            rsi=self.rsi,
            pilot_start=self.pilot.start_statements(self.checksum) if self.pilot is not None else "",
            frame_checks=checks,
            robot_names=st.robot_names(self.cell),
            load_checks=st.load_checks(self.cell, tools),
            not_compared=st.not_compared_loads(self.cell, tools) if self.layout.guard else [],
            signers=signers(self.cell.verified) if self.cell.verified is not None else [],
            changed=unconfirmed_lines(self.cell),
            unnumbered=st.unnumbered(self.cell, tools),
            no_guard=w.NO_GUARD,
            declarations="\n".join(declarations),
            message_setup=MESSAGE_SETUP,
            settings=self._settings(int(self.targets.tool[0])),
            external_lines=external_lines(self.targets, self.cell),
            external_axes=max((int(name[1]) for name in self.cell.external), default=0),
        )
        texts = [render(versions=[]), *self._statement_texts()]
        text = render(versions=version_lines(self.cell, self.rsi is not None, texts))
        prologue = st.render(self.cell, "program.prologue")
        if cs.may_disturb(prologue):
            prologue = f"{prologue}\n{cs.settings_again(self._settings(int(self.targets.tool[0])))}"
        return _text(text) + _text(prologue)

    def _statement_texts(self) -> Iterator[str]:
        """Yield each kind of statement behind the head, once: for what the header says of them."""
        for key in ("program.prologue", "program.epilogue"):
            yield st.render(self.cell, key)
        yield from (text for events in self.events.values() for _, text in events)
        away = int(np.argmin(self.targets.home))
        yield self._ptp(away)
        if any(isinstance(curve, SplineBlock) for curve in self.curves):
            yield w.SPLINE
        if self.pilot is not None and self.pilot.triggers is not None and len(self.pilot.triggers.row):
            first = int(self.pilot.triggers.row[0])
            yield bytes(self.pilot.before(first, first + 1)[0]).decode("ascii")
        if self.rsi is not None:
            yield from (self.rsi.start, self.rsi.lost, *self.rsi.files.values())

    def _collision_lines(self) -> list[str]:
        scope = self.layout.collisions
        return [] if scope is None else _words_of(scope, is_corrected=self.rsi is not None)

    def _foot(self) -> bytes:
        return _text(st.render(self.cell, "program.epilogue")) + _text(w.END)

    def _side_files(self) -> dict[str, Iterable[bytes]]:
        """Return the data list, the sidecar and the files of RSI."""
        files: dict[str, Iterable[bytes]] = {}
        if not self.layout.single_file:
            data = st.environment().get_template("data.dat.j2")
            files[f"{self.name}{w.DATA_SUFFIX}"] = [_text(data.render(source=self.source, name=self.name))]
        if self.pilot is not None and self.pilot.sidecar:
            files[f"{self.name}{w.SIDECAR_SUFFIX}"] = [self.pilot.file(self.checksum)]
        if self.rsi is not None:
            files |= {name: [_text(text)] for name, text in self.rsi.files.items()}
        return files


def _groups(parts: list[_Part]) -> Iterator[list[_Part]]:
    """Yield parts that are written at the same time: as many as a piece of text has motions, at least one."""
    group: list[_Part] = []
    for part in parts:
        if group and part.end - group[0].start > PIECE_ROWS:
            yield group
            group = []
        group.append(part)
    if group:
        yield group


def turn_bits(q_rad: Floats) -> int:
    """Return KUKA's T of joint angles (6,): a bit for each angle that prints as negative."""
    return sum(1 << k for k, angle in enumerate(q_rad) if np.rint(angle / _T_GRID_RAD) < 0)


def written_poses(targets: Targets, cell: Cell) -> tuple[Floats, Floats]:
    """Return positions (p, 3) in mm and A, B, C (p, 3) in degrees in the controller's tool axes."""
    abc_deg = np.empty((len(targets), 3))

    def part(start: int, end: int) -> None:
        tool, rotation = targets.tool[start:end], targets.rotation[start:end]
        for number in distinct(tool):
            rows = slice(None) if tool[0] == number and (tool == number).all() else tool == number
            turn = controller_axes(cell.tool[int(number)].axis or "+z")[:3, :3].T
            first, run = fr.equal_runs(rotation[rows])
            turned = fr.rotation_from_quaternion(rotation[rows][first]) @ turn
            abc_deg[start:end][rows] = (fr.abc_from_rotation(turned) * DEG_PER_RAD)[run]

    in_chunks(part, chunk_borders(len(targets)))
    return targets.position_mm, abc_deg


def _dwell(seconds: float) -> list[str]:
    """Return a dwell, marked so that it is not taken for a wait of a template."""
    return [f"{w.WAIT} {w.SEC} {fixed(seconds, 3)} ; {w.DWELL}"] if seconds > 0 else []


def _text(text: str) -> bytes:
    """Encode text with the controller's line ends; blank lines are dropped."""
    lines = [line.rstrip() for line in re.split(r"\r?\n", text)]
    return b"".join(line.encode("ascii", "replace") + NEWLINE for line in lines if line)


def _assumed_words(cell: Cell) -> str:
    """Return what of the stiffness nobody stated; empty where no deflection is predicted."""
    return "" if compliance.missing_stiffness(cell) else compliance.stiffness(cell).assumed


def _file_name(source: str) -> str:
    return re.split(r"[\\/]", source)[-1]


def _words_of(scope: CollisionScope, *, is_corrected: bool) -> list[str]:
    """Return what was checked for collisions and what not; ``is_corrected``: by an online correction."""
    unchecked = [*scope.unchecked, *(["the path as it is corrected online"] if is_corrected else [])]
    return [
        *_wrapped("COLLISIONS CHECKED, from HOME to HOME: ", scope.movers),
        *_wrapped("  against: ", scope.obstacles or ("nothing that the cell states",)),
        *_wrapped("NOT CHECKED for collisions: ", unchecked),
    ]


def _wrapped(head: str, words: Iterable[str]) -> list[str]:
    text = st.ascii_text(head.rstrip() + " " + "; ".join(words), 2000)
    indent = "  " if head.startswith("  ") else ""
    return textwrap.wrap(
        text, _WIDTH, initial_indent=indent, subsequent_indent=indent + "  ", break_on_hyphens=False
    )
