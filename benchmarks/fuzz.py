"""Fuzz what comes from outside: programs, cells, predictions, meshes, telegrams, KRL programs.

    python benchmarks/fuzz.py predictions --count 10000 --seed 1
    GCODE2KRL_CORE=checked python benchmarks/fuzz.py gcode --count 100000

Hypothesis draws a sound input and edits of it, and makes what fails as small as it can. An input is
*accepted*, *refused* (one of our errors, of one line, exit code 2), or it is a *failure*: another exception,
several lines, a word on standard error, a process that ends, hangs or takes more than 1 GB. The cases run in
a child process; the one under way is kept in a file, so that it can be named where the child dies. The
checked core (``python native/build.py --checked``) ends the process at the first index outside an array.
"""

import argparse
import io
import json
import multiprocessing
import os
import re
import resource
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[1]
LONGEST_S, MOST_MB = 60.0, 1000.0
ADDRESS_SPACE = 16 * 2**30
"""A child that asks for more fails instead of taking the machine with it."""
Prepared = tuple[st.SearchStrategy[Any], Callable[[Any], None]]
"""What draws a case, and what tries it and raises what the package raises."""


def words(text: str) -> tuple[bytes, ...]:
    """Return what stands between the marks ~ of a text."""
    return tuple(word.strip().encode() for word in text.split(" ~"))


NUMBERS = (
    *words(
        "nan ~ -inf ~ -1e308 ~ 1e999 ~ abc ~ ~ - ~ . ~ 1..2 ~ +-1 ~ 0x10 ~ 1,5 ~ 1_0 ~ -1 ~ -0 ~ 1000000000"
    ),
    *words('4294967295 ~ true ~ "text" ~ [] ~ {} ~ 1979-05-27 ~ [[[[1]]]] ~ \u0661'),
    *(b" 1 ", b"9" * 15, b"9" * 16, b"9" * 200, b"0." + b"0" * 14, b'"' + b"x" * 5000 + b'"'),
)
ABSURD = (
    *(n.to_bytes(8, "little", signed=True) for n in (-1, 0, 2**31 - 1, 2**31, 2**53, 2**63 - 1, -(2**63))),
    *(np.array(value).tobytes() for value in (np.nan, np.inf, 1e308, 1e-320)),
)


@st.composite
def edited(draw: Any, sound: Sequence[bytes], lines: Sequence[bytes], most: int = 4) -> bytes:
    """Draw a sound input with some edits: bits, cuts, copies, other inputs, numbers, lines, capitals."""
    data = draw(st.sampled_from(sound))
    for _ in range(draw(st.integers(0, most))):
        at = draw(st.integers(0, len(data)))
        behind = at + draw(st.integers(1, 400))
        kind = draw(st.integers(0, 10))
        if kind == 0 and at < len(data):
            data = data[:at] + bytes([data[at] ^ 1 << draw(st.integers(0, 7))]) + data[at + 1 :]
        elif kind == 1:
            data = data[: -behind if draw(st.booleans()) else at]  # footers stand at the end
        elif kind == 2:
            data = data[:at] + data[behind:]
        elif kind == 3:
            data = data[:behind] + data[at:]
        elif kind == 4:
            data = data[:at] + draw(st.sampled_from(sound))[at:behind] + data[behind:]
        elif kind == 5:
            data = data[:at] + draw(st.sampled_from(ABSURD)) + data[at + 8 :]
        elif kind == 6:
            data = data[:at] + draw(st.binary(max_size=60)) + data[behind:]
        elif kind == 7:
            numbers = list(re.finditer(rb"-?\d+\.?\d*", data))
            if numbers:
                number = numbers[at % len(numbers)]
                digits = b"%d" % draw(st.integers(0, 99))
                other = digits if draw(st.booleans()) else draw(st.sampled_from(NUMBERS))
                data = data[: number.start()] + other + data[number.end() :]
        elif kind == 8 and lines:
            at = data.rfind(b"\n", 0, at) + 1
            data = data[:at] + draw(st.sampled_from(lines)) + b"\n" + data[at:]
        elif kind == 9:
            data = data.swapcase() if draw(st.booleans()) else data.replace(b"\r\n", b"\n")
        else:
            kept = data.split(b"\n")
            del kept[at % len(kept)]
            data = b"\n".join(kept)
    return data


def of_lines(known: Sequence[bytes], head: bytes = b"") -> st.SearchStrategy[bytes]:
    """Draw a text of words alone."""
    lines = st.lists(st.sampled_from(known), min_size=1, max_size=30)
    return lines.map(lambda drawn: head + b"\n".join(drawn) + b"\n")


# --- what is tried ----------------------------------------------------------------------------------------

G_HEAD = b"G21 G17 G90 G94 F500\nT1 M6\nS1000 M3\nG0 X0 Y0 Z5\nG1 Z1\n"
G_LINES = (
    *words("""
$H ~ $32=1 ~ :1234 (HEAD) ~ /2 G1 X1. F100 ~ G4 P1500 ~ G4 X1.5 S3 ~ G65 P9010 A1. ~ G54.1 P3 G5.1 Q1 ~
G83 X5. Z-5. R1. Q2000 P500 K3 F100 ~ X=IC(5) Y=AC(-2.5) F=500 ~ G3 X10 Y0 I=AC(5) J-1 TURN=2 ~
G2 X20 Y0 CR=5 ~ MSG("A (b) ; c") ~ WORKPIECE(,"",,"BOX",112,0,-20) ~ CYCLE832(0.01,_FINISH,1) ~
TRANS X10 Y=5 ~ G0 SUPA Z0 D0 ~ T="MILL" D1 M6 ~ START: GOTOF ENDE ~ R1=5 X=R1 ~
R2=R1+1 R3=-2*(SIN(30)-R1) ~ X=R2*2 Y=IC(R3) Z=ATAN2(R1,1) ~ AA: R1=R1+1 ~ IF R1<5 GOTOB AA ~
IF (R2>=3)==1 GOTOF ENDE ~ N10 GOTO N10 ~ ENDE: G2 X=R1 Y0 CR=R2/2 TURN=R3 ~ ATRANS X=R1 Z-1 ~ TRAORI ~
TRAFOOF ~ G1 X5 A3=.1 C3=R1 ~ G0 A3=-.2 B3=.3 C3=1 ~ C=DC(5) A=ACP(-3) ~ FGROUP(X,Y,Z) ~ %_N_PART_MPF ~
N10 G21 G90 G17 G94 (MSG, hello) (a comment) ~ O1234 ~ G43 H1 Z20. ~ G64 P0.05 Q.01 ~ G1 X1 Y2 F100 ; tail ~
G2 X10 Y0 I5 J-1 P2 ~ G2 I5 P3 ~ G3 X10 Y10 R8 ~ G18 G2 X0 Z0 I-5 K-5 ~ G19 G3 Y4 Z3 R-6 ~ G91 G1 X1 Y1 ~
G90.1 G2 X3 Y3 I2 J2 ~ G41.1 D6 ~ G42 D1 G1 X30 ~ G41.1 D-2.5 G1 X-20 Y5 ~ G40 ~ G40 G1 X-5 ~ G28 G91 Z0. ~
G30.1 ~ G53 G0 X0 ~ G92 X1 Z2 ~ G92.2 G0 X3 ~ G92.3 ~ G52 X5 Y-1 ~ G10 L2 P1 X1 R30 ~ G10 L20 P0 Y2 ~
G10 L1 P1 Z20 ~ G10 L11 P2 Z3 ~ G10 L2 P99999 X1 ~ G43.1 Z5 ~ G43.2 H2 ~ G4 P1.5 ~ M62 P1 ~ M3 M8 M7 M5 ~
G20 X1.0001 Y-.5 ~ G93 G1 X5 F2 ~ G95 G1 X6 F.1 ~ G59.3 Y2 ~ /G1 X100 ~ G0 A0 B1 X3 ~ G1 X1 A30 C-370 F500 ~
G43.4 H1 ~ G43.5 H1 ~ G1 X2 I.3 J-.2 K.9 ~ G93 G1 A-20 F7 ~ G2 X10 Y0 I5 A40 ~ G28 A0 C0 ~ G53 G0 C5 ~
#1 = [2 * ABS[#3]] X#<name> ~ X[1+2] Y2 ATAN[1]/[2] ~ O1 while [#1 LT 5] ~ #1 = [#1 + 1] #<_g> = #5403 ~
O1 endwhile ~ O2 do ~ O2 continue ~ O1 break ~ O2 while [#2 GT 3] ~ O3 repeat [3.4] ~ O3 endrepeat ~
O4 if [EXISTS[#<_g>]] ~ O4 elseif [#5221 EQ #<_feed>] ~ O4 else ~ O4 endif ~ O<side> sub ~
O<side> return [#1 * 2] ~ O<side> endsub [#<_value>] ~ O<side> call [1] [-#2] [SIN[30]] ~ O[#1] call ~
M98 P1234 L2 ~ M99 ~ G1 X#<_x> Y[#5421 + 1] F[#<_feed> ** 2] ~ X[[[[1] MOD 0] XOR 2] ** -400] ~
#[#1] = #[#2 + 5161] ##3 = 7 ~ M70 G20 F#<_feed> ~ M70 ~ M72 ~ M73 ~ M68 E1 Q2 G4 P1 ~ M61 Q1 ~
#1=#2*[3-ATAN[1.]/[#3]] ~ #100=#100+1 ~ #[#1+100]=#0 ~ N10 IF [#100 LT 5] GOTO 10 ~
N20IF[[#1EQ#0]AND[#2NE3]]THEN#3=FUP[-1.5] ~ GOTO 20 ~ GOTO [#1*10] ~ /3 WHILE [#100 LE 20] DO1 ~
WHILE[#2 GT -3]DO2 ~ END2 ~ END1 ~ DO3 ~ G65 P1234 A1. B-2.5 I3. J#1 K[#2] ~ G65 P1234 H5 X1 Z2. ~
M98 P31234 ~ X5. M98 P1234 L3 ~ G0 X#24 Y-#25 M99 ~ G#9 X[#1 MOD 2] F[#2 XOR 7] ~ O1234 (MACRO) ~ :7 ~
#3000=1 (ALARM) ~ POPEN ~ G81 X1 Y1 Z-1 R2 ~ G98 G83 X2 Z-3 R1 Q.7 L2 ~ G99 G73 X2 Z-3 R1 Q.1 D.2 ~
G91 G84 X1 Z-2 R-1 P.1 L3 ~ G90 G18 G86 Y-1 R2 P1 ~ M4 G74 X1 Z-1 R2 ~ G85 Z-1 R2 L99999 ~
G83 X1 Z-5 R2 Q.00000001 ~ G89 X1 Z-1 R2 P0 ~ X3 Y4 ~ G17 G0 @10 ^30 ~ ^45 @3 Z2 ~
G91 G81 @2 ^20 Z-3 R-5 L4 ~ @ ^ @1 ~ G2 @5 ^-90 I-5 ~ @#1 ^[2] ~ G96 D100 S30 ~ G33.1 Z-3 K1 ~ G38.2 Z-5 ~
G80 M48 M60 ~ G1 X1 2 3 Y 4 . 5 ~ G1 X- Y X1 X2 ~ G99.95 M99999 ~
X123456789012345.1 Y.0000000000000000000001 ~ (unclosed ~ (nested (a) b) ~ G2 X20 Y0 I10 J0.01 ~
G2 I99999999999 J0 ~ % ~ M30
"""),
    *(b"\xc3\xa9 X1 \xe2\x82\xac \xf0\x9f\x98\x80", b"(MSG,a)" * 300, b"[" * 4097),
)
"""What the interpreter takes, and what it has a finding for."""


def gcode(_: Path) -> Prepared:
    """Programs, in pieces and with little room: the scanner and the interpreter of the core."""
    from gcode2krl import load_cell
    from gcode2krl.cell.sections import Machine
    from gcode2krl.errors import NotUnderstoodError, input_error
    from gcode2krl.gcode import read, text
    from gcode2krl.gcode.dialects import DIALECTS

    files = (*ROOT.glob("examples/*.nc"), *ROOT.glob("tests/golden/programs/*.nc"))
    sound = [file.read_bytes()[:8000] for file in sorted(files)]
    lengths = {"pivot_mm": 150.0, "centre_mm": (10.0, 0.0, -50.0)}
    machine = Machine(kind="table-head", axes=("C", "A"), signs=(-1, 1), tcpm=False, **lengths)
    cells = (None, load_cell(), load_cell().model_copy(update={"machine": machine}))
    options = ({}, {"block_delete": True}, {"chord_tolerance_mm": 0.0005}, {"chord_tolerance_mm": 10.0})
    room = st.tuples(*map(st.sampled_from, ((300, 5000, 1_000_000), (1, 20, 8192), (0, 17, 256))))
    dialects = st.sampled_from((None, *DIALECTS))
    programs = edited(sound, G_LINES) | of_lines(G_LINES, G_HEAD)
    how = st.tuples(st.sampled_from(range(3)), st.sampled_from(options), dialects)

    def attempt(case: Any) -> None:
        program, (cell, chosen, dialect), (text._PIECE_BYTES, read._FIRST_ROWS, read._FIRST_EVENTS) = case
        if dialect is not None:
            chosen = {**chosen, "dialect": dialect}
        try:
            toolpath = read.read_stream(io.BytesIO(program), "part.nc", cells[cell], **chosen)
        except NotUnderstoodError as error:
            if any(len(str(issue).splitlines()) != 1 for issue in error.issues):
                raise ValueError("a finding of several lines") from error
            raise input_error(error.issues[0].code, error.issues[0].message) from None
        assert np.isfinite(toolpath.position_mm).all()
        assert np.abs((toolpath.axis**2).sum(axis=1) - 1.0).max() < 1e-9
        assert (np.diff(toolpath.source_line) >= 0).all() or b"O" in program.upper()  # jumps

    return st.tuples(programs, how, room), attempt


PART = (
    "G21 G90\nT1 M6\nS9000 M3\nM8\nG0 G43 H1 Z30\nX0 Y0\nG1 Z-2 F600\nX20 F1500\nY10\nG2 X30 Y20 I10 J0\n"
    "G4 P0.5\nG0 Z30\nM9\nM30\n"
)
KRL_LINES = (
    *words("""
LIN {X 1,Y 2,Z 3,A 4,B 5,C 6} C_DIS ~ lin { z -1.5 , a +4. , x .5 } c_dis ; text ~ LIN {A1 0,A2 -90} ~
WAITSEC 1 ~
PTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0} ~ PTP {X 1.0,Y 2.0,Z 3.0,A 0,B 90,C 0,S 2,T 10} ~ LIN {X 1,X 2} ~ ~
WAIT SEC 0.5 ; dwell ~ $VEL.CP 0.1 ~ $APO.CDIS ~ ;FOLD text ~ ;ENDFOLD ~ &ACCESS RVP ~ LIN {X 1} C_DIS C_DIS ~
TRIGGER WHEN DISTANCE=0 DELAY=124 DO $SEN_PINT[1]=7 ~ trigger when distance=1 delay=0 do $OUT[3] = 1 ; text ~
TRIGGER WHEN DISTANCE = 0 DELAY=-3 DO GK_PILOT(1.25,-2.5,0.0,12.0) PRIO=-1 ~
TRIGGER WHEN DISTANCE=0 DELAY=1 DO ~
TRIGGER WHEN DISTANCE=0 DELAY=1 DO =1 ~ TRIGGER WHEN DISTANCE=0 DELAY=1 DO GK_PILOT(1,2,3
"""),
    *(
        b"\t LIN {X 1}",
        b"LIN {X " + b"1" * 600 + b"}",
        b"LIN {X 1" + b" " * 480 + b"}",
        b"; " + b"x" * 70_000,
    ),
    *(b" \t ", b"\xff\xfe"),
)


def krl(place: Path) -> Prepared:
    """KRL: rows lie in order, are the same in short chunks as in one piece, and alone as among others."""
    from gcode2krl import krl_words, load_cell, read_gcode, set_targets, write_krl
    from gcode2krl.errors import input_error
    from gcode2krl.krl.read import read_texts
    from gcode2krl.krl.scan import scan_krl

    part, cell = place / "part.nc", load_cell()
    part.write_text(PART, encoding="ascii")
    program = write_krl(set_targets(read_gcode(part, cell), cell), place / "PART.src", cell)
    motions = (krl_words.KIND_LIN, krl_words.KIND_PTP, krl_words.KIND_PTP_AXES)

    def scanned(text: bytes) -> None:
        whole = scan_krl(text)
        for one_piece, chunks in zip(whole, scan_krl(text, 64), strict=True):
            assert np.array_equal(one_piece, chunks, equal_nan=np.ndim(chunks) == 2), "chunks differ"
        lines = text.split(b"\n")
        assert (np.diff(whole.line) > 0).all(), "lines out of order"
        is_motion = np.isin(whole.kind, motions)
        place = np.where(is_motion, np.cumsum(is_motion), np.cumsum(~is_motion)) - 1
        for row in range(0, len(whole.line), 1 + len(whole.line) // 20):
            statement, k = lines[whole.line[row] - 1].strip(b" \t").rstrip(b" \t\r"), place[row]
            alone = scan_krl(statement)
            assert (alone.kind[0], alone.blend[0]) == (whole.kind[row], whole.blend[row]), "another statement"
            if is_motion[row]:
                assert np.array_equal(alone.pose[0], whole.pose[k], equal_nan=True), "other components"
                continue
            first, last = whole.span[k]
            assert statement == text[first:last], "another line"
            value = alone.value[0].copy()
            if np.isfinite(value[6]) and statement[:1] in b"Tt":
                value[6] += first  # the place of the name in the whole text
            assert np.array_equal(value, whole.value[k], equal_nan=True), "other numbers"

    def attempt(text: bytes) -> None:
        scanned(text)
        read = read_texts({"PART.src": text}, "PART.src")
        if read.issues:
            assert read.issues[0].message.isprintable(), "more than a line"
            raise input_error(read.issues[0].code, read.issues[0].message[:200])

    good = program.texts["PART.src"]
    made_up = of_lines(KRL_LINES, good[: good.index(b"LIN")])
    return edited([good], KRL_LINES) | edited([good], KRL_LINES, 1) | made_up, attempt


VALUES = (
    *(0, 1, -1, 0.12, 200, 1e9, 1e300, -1e-300, 2**63, 10**40, float("inf"), float("nan"), True, False),
    *("", "120", "none", "auto", "x\n$BASE=$NULLFRAME", "\x00", "é", "a" * 5000, "KR 300 R2500 ultra"),
    *("KRC4", "../x.toml", "demonstration", "cell.toml", [], {}, [1, 2, 3], [[0, 0], [1, 1]], {"x_mm": 1.0}),
    [[[[1]]]],
)
TEMPLATES = (
    *("", "HALT", "$OUT[1]=TRUE", "$OUT[{{ spindle.run_cw_output }}]=TRUE", "$BASE=$NULLFRAME", "PTP HOME"),
    *("{{ cell }}", "{{ cell.m_code.update({}) }}", "{{ 'x' * 3000000000 }}", "{{ '%999999999d' % 1 }}"),
    *("{% for i in range(999999999) %}x{% endfor %}", "{{ " + "(" * 900 + "1" + ")" * 900 + " }}"),
    *("{{", "IF X THEN", "GOTO A", "{{ cell.tool[1].teeth }}", "{{ 9**9**9 }}", "{{ rpm | round | int }}"),
    *("\r\x0b", "{{ self }}", "{{ p }}", "{% if %}"),
)
HOSTILE = (b"[" * 100_000, b"a." * 50_000 + b"a=1", b"{a=" * 20_000, b"\x00", b"a=" + b"[" * 500, b"\xff\xfe")


def cells(place: Path) -> Prepared:
    """Cell files; one that is accepted is used: templates rendered, what is missing and doubtful listed."""
    import tomli_w

    from gcode2krl import load_cell
    from gcode2krl.cell import as_toml, cell_from_resolved
    from gcode2krl.cli.cell_list import findings, missing_keys, to_confirm
    from gcode2krl.errors import Gcode2KrlError, input_error
    from gcode2krl.krl.provenance import provenance_lines
    from gcode2krl.krl.statements import render

    path = place / "cell.toml"
    whole = as_toml(load_cell())
    whole = {key: value for key, value in whole.items() if key not in ("taken_over", "defaults")}
    whole["tool"] = dict(list(whole["tool"].items())[:3])

    def paths_of(value: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        inner = value.items() if isinstance(value, dict) else ()
        return [above, *(path for key, below in inner for path in paths_of(below, (*above, key)))]

    paths = paths_of(whole)[1:]
    templates = [path for path in paths if path[0] == "m_code" and len(path) == 2]
    change = st.one_of(
        st.tuples(st.sampled_from(paths), st.sampled_from(VALUES)),
        st.tuples(st.sampled_from(templates), st.sampled_from(TEMPLATES)),
        st.tuples(st.sampled_from([path for path in paths if len(path) == 1]), st.just(...)),
        st.tuples(st.sampled_from(paths), st.just(...)),  # left out
    )

    def text_of(changes: list[tuple[tuple[Any, ...], Any]]) -> bytes:
        data = json.loads(json.dumps(whole))
        for (*above, key), value in changes:
            inner = data
            for name in map(str, above):
                inner = inner.get(name, {}) if isinstance(inner, dict) else {}
            if isinstance(inner, dict):
                if value is ...:
                    inner.pop(key, None)
                else:
                    inner[str(key)] = value
        try:
            return tomli_w.dumps(data).encode("utf-8", "replace")
        except (TypeError, ValueError, AttributeError):
            return b"[frames]\n"

    texts = st.lists(change, max_size=4).map(text_of)
    damaged = texts.flatmap(lambda text: edited([text], HOSTILE, 2))

    def checked(call: Callable[..., Any], *values: Any, **named: Any) -> Any:
        """Call; a finding must be one line with a code and a remedy."""
        try:
            return call(*values, **named)
        except Gcode2KrlError as error:
            for issue in error.issues:
                is_whole = issue.code and issue.message and issue.remedy
                if not is_whole or len(issue.text()) > 2000 or "\n" in issue.text():
                    raise ValueError(f"no finding for a person: {issue!r:.300}") from error
            return input_error(error.issues[0].code, error.issues[0].message[:200])

    def attempt(text: bytes) -> None:
        path.write_bytes(text)
        cell = checked(load_cell, path)
        if isinstance(cell, Gcode2KrlError):
            raise cell
        list(to_confirm(cell)), missing_keys(cell), findings(cell), provenance_lines(cell, [1], True, True)
        cell_from_resolved(as_toml(cell), "again")
        for key in cell.templates():
            checked(render, cell, key, rpm=1000.0, m=3, p=None, text="x", line=1, tool=1)
        for number in [0, *cell.tool]:
            for call in (cell.base_matrix, cell.home_q_rad, lambda number=number: cell.tool_matrix(number)):
                checked(call)

    return texts | damaged, attempt


MESH_LINES = (
    *words("""
solid a ~ facet normal 0 0 1 ~ outer loop ~ element vertex 1 ~ element vertex 99999999999999999999999 ~
end_header ~
property list uint uint x ~ property list uchar double x ~ property foo x ~ format ascii 1.0 ~ f 1 2 3 ~
v nan 1 1 ~
format binary_big_endian 1.0
"""),
    *(b"<" * 5000, b'<!DOCTYPE a [<!ENTITY b "' + b"c" * 50 + b'"><!ENTITY d "' + b"&b;" * 50 + b'">]>'),
    b'<object id="100" type="model"><components>' + b'<component objectid="100"/>' * 9,
)
TRICKS = (
    *(
        b"",
        b"\n" * 1000,
        bytes(84),
        b"solid a\n" * 4000,
        b"solid\n" + b"facet normal 0 0 1\nouter loop\n" * 500,
    ),
    *(b"ply\nformat ascii 1.0\n" + b"property float x\n" * 500 + b"end_header\n", b"PK\x05\x06" + bytes(18)),
    *(bytes(80) + b"\xff\xff\xff\xff" + bytes(50), b"solid a\nendsolid a\n" * 2000),
    b"solid " + b"facet " * 4000,
)


def meshes(place: Path) -> Prepared:
    """Meshes of a raw part: STL, PLY, 3MF, and other files with their names."""
    import trimesh

    from gcode2krl.cutting.raw_part import load_mesh

    solid = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    kinds = ("stl", "ply", "3mf", "glb", "off", "obj")
    files = [(solid.export(file_type=kind), kind) for kind in kinds]
    files += [(solid.export(file_type="stl_ascii"), "stl")]
    files += [(solid.export(file_type="ply", encoding="ascii"), "ply")]
    sound = [(data.encode() if isinstance(data, str) else data, ending) for data, ending in files]
    with zipfile.ZipFile(io.BytesIO(sound[2][0])) as archive:
        parts = {info.filename: archive.read(info) for info in archive.infolist()}
    model = next(name for name in parts if name.endswith(".model"))

    def packed(case: tuple[bytes, str, int]) -> tuple[bytes, str]:
        text, encoding, bomb = case
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as target:
            for name, data in {**parts, model: text, **({"bomb": bytes(bomb)} if bomb else {})}.items():
                is_text = name == model and encoding
                target.writestr(name, data.decode("latin-1").encode(encoding) if is_text else data)
        return out.getvalue(), "3mf"

    encodings = st.sampled_from(("", "", "", "utf-16", "utf-32"))
    bombs = st.sampled_from((0, 0, 0, 10**6, 10**8))
    archives = st.tuples(edited([parts[model]], MESH_LINES), encodings, bombs).map(packed)
    plain = [data for data, _ in sound]

    def damaged(file: tuple[bytes, str]) -> st.SearchStrategy[tuple[bytes, str]]:
        data = edited([file[0]], MESH_LINES, 2) | edited([file[0], *plain], MESH_LINES)
        return st.tuples(data, st.just(file[1]))

    endings = st.sampled_from((*kinds, "dae", "xyz", "STL", ""))
    misnamed = st.tuples(st.sampled_from((*plain, *TRICKS)) | st.binary(max_size=2000), endings)

    def attempt(case: tuple[bytes, str]) -> None:
        file = place / f"raw.{case[1]}"
        file.write_bytes(case[0])
        mesh = load_mesh(file)
        assert np.isfinite(mesh.bounds).all()
        assert len(mesh.triangles) > 0

    of_all = st.sampled_from(sound).flatmap(damaged)
    return of_all | of_all | archives | misnamed, attempt


def predictions(place: Path) -> Prepared:
    """Prediction folders: bytes of a file, the record, whole tables that do not fit, files missing."""
    import polars as pl

    from gcode2krl import Prediction, predict

    part = place / "part.nc"
    part.write_text(PART, encoding="ascii")
    predict(part, dt_s=0.05).save(place / "good")
    files = {file.name: file.read_bytes() for file in (place / "good").iterdir()}
    names, folder = sorted(files), place / "case"
    folder.mkdir()
    named = ("toolpath", "targets", "motion")
    tables = {name: pl.read_parquet(io.BytesIO(files[f"{name}.parquet"])) for name in named}
    odd = (None, -1, 0, 99, 2**31 - 1, -(2**31), np.nan, np.inf, -np.inf, 1e308, True)
    types = (pl.String, pl.Float32, pl.Int64, pl.UInt32, pl.Boolean, pl.Int8, pl.Date, pl.List(pl.Float64))

    @st.composite
    def table(draw: Any) -> tuple[str, bytes]:
        name = draw(st.sampled_from(named))
        frame = tables[name]
        column, other = draw(st.sampled_from(frame.columns)), draw(st.sampled_from(frame.columns))
        kind = draw(st.integers(0, 7))
        if kind == 0:
            frame = frame.drop(column)
        elif kind == 1:
            frame = frame.head(draw(st.integers(0, frame.height)))
        elif kind == 2:
            new = draw(st.sampled_from(("a", "phi_0_rad", "phi_9_rad", "q1_act_rad", column * 2)))
            frame = frame if new in frame.columns else frame.rename({column: new})
        elif kind == 3:
            frame = frame.with_columns(pl.lit(None).cast(draw(st.sampled_from(types))).alias(column))
        elif kind == 4:
            frame = frame.reverse() if draw(st.booleans()) else pl.concat([frame] * 3)
        elif kind == 5 and column != other:
            frame = frame.with_columns(pl.col(other).alias(column), pl.col(column).alias(other))
        elif kind == 6:
            frame = pl.DataFrame({"a": [1]})
        else:
            values = frame[column].to_list()
            values[draw(st.integers(0, len(values) - 1))] = draw(st.sampled_from(odd))
            try:
                frame = frame.with_columns(pl.Series(column, values, dtype=frame[column].dtype))
            except (TypeError, OverflowError, pl.exceptions.PolarsError):  # not a value of this column's type
                frame = frame.drop(column)
        out = io.BytesIO()
        frame.write_parquet(out, compression=draw(st.sampled_from(("zstd", "snappy", "uncompressed"))))
        return f"{name}.parquet", out.getvalue()

    sound = [files[name] for name in names]
    spoiled = st.sampled_from(names).flatmap(lambda n: st.tuples(st.just(n), edited([files[n], *sound], ())))
    record = st.tuples(st.just("prediction.toml"), edited([files["prediction.toml"]], HOSTILE))
    gone = st.tuples(st.sampled_from(names), st.sampled_from((None, "a folder")))

    def attempt(case: tuple[str, bytes | str | None]) -> None:
        for name in names:
            (folder / name).write_bytes(files[name])
        changed, data = case
        (folder / changed).unlink()
        if isinstance(data, str):
            (folder / changed).mkdir()
        elif data is not None:
            (folder / changed).write_bytes(data)
        try:
            used(Prediction.load(folder))
        finally:
            if isinstance(data, str):
                (folder / changed).rmdir()

    def used(prediction: Prediction) -> None:
        """Read everything that a command reads."""
        for issue in prediction.issues:
            issue.text("part.nc")
        if prediction.motion is not None:
            prediction.toolpath.source_line[prediction.motion.move].max()
            for number in np.unique(prediction.motion.tool):
                prediction.cell.tool_matrix(int(number))
        for event in prediction.toolpath.events:
            assert 0 <= event.row < len(prediction.toolpath)
            assert event.values["line"] >= 0

    return table() | spoiled | record | gone, attempt


TELEGRAM = (
    b'<Rob Type="KUKA"><RIst X="50.1111" Y="0.2222" Z="40.3333" A="0.0" B="0.0" C="0.0"/>'
    b'<RSol X="50.0000" Y="0.0000" Z="40.0000" A="0.0" B="0.0" C="0.0"/>'
    b'<AIPos A1="0.2" A2="-80.5" A3="95.1" A4="0.0" A5="45.3" A6="10.0"/>'
    b'<ASPos A1="0.2" A2="-80.5" A3="95.1" A4="0.0" A5="45.3" A6="10.0"/><Delay D="0"/>'
    b'<Force X="150.0" Y="10.0" Z="-5.0" MX="1.0" MY="2.0" MZ="3.0"/>'
    b"<SenPInt1>3</SenPInt1><OvPro>100</OvPro><IPOC>1234567</IPOC></Rob>"
)
"""The places that a robot that follows its corrections reports, and its IPOC, are filled in."""
TAGS = (
    *(b"<Rob>" + b" " * 8000 + b"</Rob>", b"<A/>" * 1500, b"</Rob>" * 1000, b'<A B="1"' + b" C" * 3000),
    *(b'<!DOCTYPE a [<!ENTITY b "cc">]><Rob>&b;</Rob>', b"<Rob " * 1500, b" " * 8192, b"<A \t" * 2000),
    *(b"\xff\xfe<\x00R\x00", b'<Rob Type="KUKA">' * 400, b"\n" * 4000 + b"<A>" + b" " * 4000, b"x" * 70_000),
    *(b"<A>" * 2000, b'<AAAAAAAA X="1" ' + b"Y =\t" * 1900, b'<Sen Type="ImFree"><IPOC>1</IPOC></Sen>'),
)


def telegrams(_: Path) -> Prepared:
    """Telegrams: parser, session and answer, which is finite and at most one step from the one before."""
    from gcode2krl import load_cell
    from gcode2krl.cell.sections.online import Online, Probe
    from gcode2krl.errors import input_error
    from gcode2krl.online.compensator import build_compensator
    from gcode2krl.online.server import warm_up
    from gcode2krl.online.session import Phase, begin, exchange
    from gcode2krl.online.telegram import MalformedError, answer_text, parse

    probe = Probe(rest_cycles=5, settle_cycles=5)
    settings_of = [Online(mode=mode, probe=probe) for mode in ("cartesian", "axis")]
    devices = [build_compensator(load_cell(), online, load_frame="sensor") for online in settings_of]
    for device in devices:
        warm_up(device)
    state, ipoc = [begin(device) for device in devices], [1000, 1000]

    def attempt(case: tuple[bytes, int, int]) -> None:
        data, which, anew = case
        device, session = devices[which], state[which]
        ipoc[which] += 4
        sent = session.sent
        shift = sent if len(sent) == 3 else np.array([0.0, 0.0, 0.1 * bool(sent.any())])
        filled = zip((b"50.1111", b"0.2222", b"40.3333"), shift + np.array([50.0, 0.0, 40.0]), strict=True)
        for place, value in (*filled, (b"1234567", ipoc[which])):
            data = data.replace(place, b"%d" % value if place == b"1234567" else b"%.4f" % value)
        try:
            telegram = parse(data)
        except MalformedError as error:
            if len(str(error)) >= 200 or not str(error).isprintable():
                raise ValueError("more than a line") from error
            raise input_error("malformed", str(error)) from None
        session, answer = exchange(session, telegram, telegram.load, device)
        if answer is not None:
            step = (answer.correction - sent) / device.bounds.step
            size = np.linalg.norm(step) if device.bounds.is_vector else np.abs(step).max()
            assert size <= 1.0 + 1e-9, f"a step of {size}"
            assert f"<IPOC>{telegram.ipoc}</IPOC>".encode() in answer_text(answer, device.settings)
        over = session.phase in (Phase.CLOSED, Phase.ZERO, Phase.HELD) and anew == 0
        state[which] = begin(device) if over else session
        ipoc[which] = 1000 if over else max(ipoc[which], min(telegram.ipoc, 10**17))

    text = edited([TELEGRAM], TAGS) | edited([TELEGRAM], TAGS, 1) | st.binary(max_size=300)
    return st.tuples(st.just(TELEGRAM) | text, st.integers(0, 1), st.integers(0, 9)), attempt


KINDS: dict[str, tuple[Callable[[Path], Prepared], int]] = {
    "gcode": (gcode, 20_000),
    "cells": (cells, 1_000),
    "predictions": (predictions, 10_000),
    "meshes": (meshes, 10_000),
    "telegrams": (telegrams, 100_000),
    "krl": (krl, 20_000),
}
"""What makes its cases, and how many there are unless --count says so."""

# --- how it is tried --------------------------------------------------------------------------------------


@dataclass
class Tally:
    """Results of the cases."""

    count: int = 0
    accepted: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    peak_mb: float = 0.0
    start_mb: float = 0.0
    """Memory before the first case, used by the imports."""
    codes: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)


def run(prepare: Callable[[Path], Prepared], count: int, number: int) -> Tally:
    """Try so many cases in a child process; the number is the seed."""
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
        under_way = Path(folder) / "case"
        here, there = context.Pipe(duplex=False)
        began = context.Value("d", time.monotonic() + 60.0, lock=False)  # imports take their time
        child = context.Process(target=_work, args=(prepare, count, number, folder, began, there))
        child.start()
        there.close()
        while not here.poll(0.5):
            if time.monotonic() - began.value > LONGEST_S:
                child.kill()
                child.join()
                return Tally(1, failures=[f"hangs: {_said(under_way)}"])
        try:
            tally: Tally = here.recv()
        except EOFError:
            child.join()
            return Tally(1, failures=[f"the process ended with {child.exitcode}: {_said(under_way)}"])
        child.join()
        return tally


def _said(file: Path) -> str:
    return file.read_text("utf-8")[:4000] if file.exists() else "before the first case"


def _work(
    prepare: Callable[[Path], Prepared], count: int, number: int, folder: str, began: Any, out: Any
) -> None:
    """Try cases in this process, and send their results."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    under_way, place = Path(folder) / "case", Path(tempfile.mkdtemp(dir=folder))
    errors = os.open(Path(folder) / "stderr", os.O_RDWR | os.O_CREAT)
    os.dup2(errors, 2)
    os.dup2(errors, 1)
    strategy, attempt = prepare(place)
    tally, said = Tally(start_mb=peak_mb()), os.fstat(errors).st_size

    @seed(number)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
    )
    @given(strategy)
    def check(case: Any) -> None:
        nonlocal said
        under_way.write_text(repr(case), "utf-8")
        began.value = time.monotonic()
        tally.count += 1
        _try(attempt, case, tally)
        tally.slowest_s = max(tally.slowest_s, time.monotonic() - began.value)
        if os.fstat(errors).st_size != said:
            tally.failures.append(f"on standard error: {os.pread(errors, 300, said)!r}: {case!r:.500}")
            said = os.fstat(errors).st_size
        peak = peak_mb()
        if peak > max(MOST_MB, tally.peak_mb):
            tally.failures.append(f"{peak:.0f} MB: {case!r:.500}")
        tally.peak_mb = max(tally.peak_mb, peak)

    try:
        check()
    except BaseException as error:
        words = f"{type(error).__name__}: {error}"[:500]
        tally.failures.append("\n".join([words, *getattr(error, "__notes__", [])])[:3000])
    out.send(tally)


def _try(attempt: Callable[[Any], None], case: Any, tally: Tally) -> None:
    from gcode2krl.errors import Gcode2KrlError

    try:
        attempt(case)
        tally.accepted += 1
    except Gcode2KrlError as error:
        tally.refused += 1
        tally.codes[error.issues[0].code] += 1
        if len(str(error).splitlines()) != 1 or error.exit_code != 2:
            raise AssertionError(f"exit code {error.exit_code}, several lines, or none") from error


def peak_mb() -> float:
    """Return the largest memory of this program; `getrusage` keeps that of the parent, over fork and exec."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:  # not Linux: the parent's counts
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024.0


def main(argv: list[str] | None = None) -> int:
    """Try cases of a kind, and print what came of them; exit code 1 where one failed."""
    as_written = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=as_written)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--count", type=int, help="cases; default: that of the kind")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args(argv)
    prepare, usual = KINDS[chosen.kind]
    began_s = time.monotonic()
    tally = run(prepare, usual if chosen.count is None else chosen.count, chosen.seed)
    took_s = time.monotonic() - began_s
    outcome = f"{tally.accepted} accepted, {tally.refused} refused"
    print(f"{tally.count} {chosen.kind}: {outcome}, {took_s:.0f} s")
    print("  refused as: " + ", ".join(f"{code} {times}" for code, times in tally.codes.most_common()))
    memory = f"peak {tally.peak_mb:.0f} MB, {tally.start_mb:.0f} before"
    print(f"  slowest {tally.slowest_s * 1e3:.0f} ms; {memory}")
    print(f"  failures: {len(tally.failures)}", *tally.failures[:20], sep="\n    ")
    return 1 if tally.failures or tally.count == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
