"""Damaged and made-up G-code: the scanner and the interpreter of the core, in pieces and with little room.

    python native/build.py --checked
    GCODE2KRL_CORE=checked python benchmarks/fuzz_gcode.py --count 100000 --seed 1
    python benchmarks/fuzz_gcode.py --minutes 10 --seed 1

The checked core ends the process at the first index outside an array, and at what is undefined in C. With
--minutes random valid programs, one-letter slips of them, and random blocks are read beside LinuxCNC's
rs274 (Debian package linuxcnc-uspace): both must accept them, or a row of docs/gcode.md must say why one does
not, and both must move alike. Without rs274 the valid programs must be read, and nothing may end otherwise
than in a table or in findings.
"""

import argparse
import io
import sys
from pathlib import Path

import fuzz_gcode_beside
import numpy as np
from fuzz_common import Try, main_of, mutated

ROOT = Path(__file__).resolve().parents[1]
HEAD = b"G21 G17 G90 G94 F500\nT1 M6\nS1000 M3\nG0 X0 Y0 Z5\nG1 Z1\n"
LINES = (
    b"$H",
    b"$32=1",
    b":1234 (HEAD)",
    b"/2 G1 X1. F100",
    b"G4 P1500",
    b"G4 X1.5 S3",
    b"G65 P9010 A1.",
    b"G54.1 P3 G5.1 Q1",
    b"G83 X5. Z-5. R1. Q2000 P500 K3 F100",
    b"X=IC(5) Y=AC(-2.5) F=500",
    b"G3 X10 Y0 I=AC(5) J-1 TURN=2",
    b"G2 X20 Y0 CR=5",
    b'MSG("A (b) ; c")',
    b'WORKPIECE(,"",,"BOX",112,0,-20)',
    b"CYCLE832(0.01,_FINISH,1)",
    b"TRANS X10 Y=5",
    b"G0 SUPA Z0 D0",
    b'T="MILL" D1 M6',
    b"START: GOTOF ENDE",
    b"R1=5 X=R1",
    b"R2=R1+1 R3=-2*(SIN(30)-R1)",
    b"X=R2*2 Y=IC(R3) Z=ATAN2(R1,1)",
    b"AA: R1=R1+1",
    b"IF R1<5 GOTOB AA",
    b"IF (R2>=3)==1 GOTOF ENDE",
    b"N10 GOTO N10",
    b"ENDE: G2 X=R1 Y0 CR=R2/2 TURN=R3",
    b"ATRANS X=R1 Z-1",
    b"TRAORI",
    b"TRAFOOF",
    b"G1 X5 A3=.1 C3=R1",
    b"G0 A3=-.2 B3=.3 C3=1",
    b"C=DC(5) A=ACP(-3)",
    b"FGROUP(X,Y,Z)",
    b"%_N_PART_MPF",
    b"N10 G21 G90 G17 G94 (MSG, hello) (a comment)",
    b"O1234",
    b"G43 H1 Z20.",
    b"G64 P0.05 Q.01",
    b"G1 X1 Y2 F100 ; tail",
    b"G2 X10 Y0 I5 J-1 P2",
    b"G2 I5 P3",
    b"G3 X10 Y10 R8",
    b"G18 G2 X0 Z0 I-5 K-5",
    b"G19 G3 Y4 Z3 R-6",
    b"G91 G1 X1 Y1",
    b"G90.1 G2 X3 Y3 I2 J2",
    b"G41.1 D6",
    b"G42 D1 G1 X30",
    b"G41.1 D-2.5 G1 X-20 Y5",
    b"G40",
    b"G40 G1 X-5",
    b"G28 G91 Z0.",
    b"G30.1",
    b"G53 G0 X0",
    b"G92 X1 Z2",
    b"G92.2 G0 X3",
    b"G92.3",
    b"G52 X5 Y-1",
    b"G10 L2 P1 X1 R30",
    b"G10 L20 P0 Y2",
    b"G10 L1 P1 Z20",
    b"G10 L11 P2 Z3",
    b"G10 L2 P99999 X1",
    b"G43.1 Z5",
    b"G43.2 H2",
    b"G4 P1.5",
    b"M62 P1",
    b"M3 M8 M7 M5",
    b"G20 X1.0001 Y-.5",
    b"G93 G1 X5 F2",
    b"G95 G1 X6 F.1",
    b"G59.3 Y2",
    b"/G1 X100",
    b"G0 A0 B1 X3",
    b"G1 X1 A30 C-370 F500",
    b"G43.4 H1",
    b"G43.5 H1",
    b"G1 X2 I.3 J-.2 K.9",
    b"G93 G1 A-20 F7",
    b"G2 X10 Y0 I5 A40",
    b"G28 A0 C0",
    b"G53 G0 C5",
    b"#1 = [2 * ABS[#3]] X#<name>",
    b"X[1+2] Y2 ATAN[1]/[2]",
    b"O1 while [#1 LT 5]",
    b"#1 = [#1 + 1] #<_g> = #5403",
    b"O1 endwhile",
    b"O2 do",
    b"O2 continue",
    b"O1 break",
    b"O2 while [#2 GT 3]",
    b"O3 repeat [3.4]",
    b"O3 endrepeat",
    b"O4 if [EXISTS[#<_g>]]",
    b"O4 elseif [#5221 EQ #<_feed>]",
    b"O4 else",
    b"O4 endif",
    b"O<side> sub",
    b"O<side> return [#1 * 2]",
    b"O<side> endsub [#<_value>]",
    b"O<side> call [1] [-#2] [SIN[30]]",
    b"O[#1] call",
    b"M98 P1234 L2",
    b"M99",
    b"G1 X#<_x> Y[#5421 + 1] F[#<_feed> ** 2]",
    b"X[[[[1] MOD 0] XOR 2] ** -400]",
    b"#[#1] = #[#2 + 5161] ##3 = 7",
    b"M70 G20 F#<_feed>",
    b"M70",
    b"M72",
    b"M73",
    b"M68 E1 Q2 G4 P1",
    b"M61 Q1",
    b"#1=#2*[3-ATAN[1.]/[#3]]",
    b"#100=#100+1",
    b"#[#1+100]=#0",
    b"N10 IF [#100 LT 5] GOTO 10",
    b"N20IF[[#1EQ#0]AND[#2NE3]]THEN#3=FUP[-1.5]",
    b"GOTO 20",
    b"GOTO [#1*10]",
    b"/3 WHILE [#100 LE 20] DO1",
    b"WHILE[#2 GT -3]DO2",
    b"END2",
    b"END1",
    b"DO3",
    b"G65 P1234 A1. B-2.5 I3. J#1 K[#2]",
    b"G65 P1234 H5 X1 Z2.",
    b"M98 P31234",
    b"X5. M98 P1234 L3",
    b"G0 X#24 Y-#25 M99",
    b"G#9 X[#1 MOD 2] F[#2 XOR 7]",
    b"O1234 (MACRO)",
    b":7",
    b"#3000=1 (ALARM)",
    b"POPEN",
    b"G81 X1 Y1 Z-1 R2",
    b"G98 G83 X2 Z-3 R1 Q.7 L2",
    b"G99 G73 X2 Z-3 R1 Q.1 D.2",
    b"G91 G84 X1 Z-2 R-1 P.1 L3",
    b"G90 G18 G86 Y-1 R2 P1",
    b"M4 G74 X1 Z-1 R2",
    b"G85 Z-1 R2 L99999",
    b"G83 X1 Z-5 R2 Q.00000001",
    b"G89 X1 Z-1 R2 P0",
    b"X3 Y4",
    b"G17 G0 @10 ^30",
    b"^45 @3 Z2",
    b"G91 G81 @2 ^20 Z-3 R-5 L4",
    b"@ ^ @1",
    b"G2 @5 ^-90 I-5",
    b"@#1 ^[2]",
    b"G96 D100 S30",
    b"G33.1 Z-3 K1",
    b"G38.2 Z-5",
    b"G80 M48 M60",
    b"G1 X1 2 3 Y 4 . 5",
    b"\xc3\xa9 X1 \xe2\x82\xac \xf0\x9f\x98\x80",
    b"G1 X- Y X1 X2",
    b"G99.95 M99999",
    b"X123456789012345.1 Y.0000000000000000000001",
    b"(unclosed",
    b"(nested (a) b)",
    b"G2 X20 Y0 I10 J0.01",
    b"G2 I99999999999 J0",
    b"(MSG,a)" * 300,
    b"[" * 4097,
    b"%",
    b"M30",
)
"""What the interpreter takes, and what it has a finding for."""
_LENGTHS = {"pivot_mm": 150.0, "centre_mm": (10.0, 0.0, -50.0)}
OPTIONS = ({}, {}, {"block_delete": True}, {"chord_tolerance_mm": 0.0005}, {"chord_tolerance_mm": 10.0})


def prepare(place: Path) -> Try:
    """Read the sound programs; return the function that tries a case."""
    from gcode2krl import load_cell
    from gcode2krl.cell.sections import Machine
    from gcode2krl.errors import NotUnderstoodError, input_error
    from gcode2krl.gcode import read, text
    from gcode2krl.gcode.dialects import DIALECTS

    files = (*ROOT.glob("examples/*.nc"), *ROOT.glob("tests/golden/programs/*.nc"))
    sound = [file.read_bytes()[:8000] for file in sorted(files)]
    machine = Machine(kind="table-head", axes=("C", "A"), signs=(-1, 1), tcpm=False, **_LENGTHS)
    cells = (None, load_cell(), load_cell().model_copy(update={"machine": machine}))

    def attempt(rng: np.random.Generator, _: Path) -> str:
        text._PIECE_BYTES = int(rng.choice((300, 5000, 1_000_000)))
        read._FIRST_ROWS, read._FIRST_EVENTS = int(rng.choice((1, 20, 8192))), int(rng.choice((0, 17, 256)))
        stream, cell = io.BytesIO(damaged(rng, sound)), cells[int(rng.integers(len(cells)))]
        options = OPTIONS[int(rng.integers(len(OPTIONS)))]
        if rng.integers(2):
            options = {**options, "dialect": str(rng.choice(list(DIALECTS)))}
        try:
            toolpath = read.read_stream(stream, "part.nc", cell, **options)
        except NotUnderstoodError as error:
            if any(len(str(issue).splitlines()) != 1 for issue in error.issues):
                raise ValueError("a finding of several lines") from error
            raise input_error(error.issues[0].code, error.issues[0].message) from None
        assert np.isfinite(toolpath.position_mm).all()
        assert np.abs((toolpath.axis**2).sum(axis=1) - 1.0).max() < 1e-9
        assert (np.diff(toolpath.source_line) >= 0).all() or b"O" in stream.getvalue().upper()  # jumps
        return f"{len(toolpath)} rows"

    return attempt


def damaged(rng: np.random.Generator, sound: list[bytes]) -> bytes:
    """Return a program as it may come."""
    kind = int(rng.integers(6))
    data = sound[int(rng.integers(len(sound)))]
    if kind == 0:
        return mutated(rng, data, sound[int(rng.integers(len(sound)))])
    if kind < 3:
        return other_digits(rng, data)
    lines = [LINES[k] for k in rng.integers(len(LINES), size=int(rng.integers(1, 30)))]
    made_up = HEAD + b"\n".join(lines) + b"\n"
    return made_up if kind == 3 else mutated(rng, made_up, data) if kind == 4 else with_line(rng, data)


def other_digits(rng: np.random.Generator, data: bytes) -> bytes:
    """Return a program with some digits changed: mostly one that is understood."""
    text = bytearray(data)
    places = [at for at, byte in enumerate(text) if byte in b"0123456789"]
    for at in rng.choice(places, size=int(rng.integers(1, 6))):
        text[at] = ord("0") + int(rng.integers(10))
    return bytes(text)


def with_line(rng: np.random.Generator, data: bytes) -> bytes:
    """Return a program with one line more."""
    lines = data.split(b"\n")
    lines.insert(int(rng.integers(len(lines))), LINES[int(rng.integers(len(LINES)))])
    return b"\n".join(lines)


damaged_main = main_of("programs", prepare, __doc__, 20_000)


def main(argv: list[str] | None = None) -> int:
    """Run so many damaged programs, or for so many minutes beside rs274."""
    words = sys.argv[1:] if argv is None else argv
    if not any(word.partition("=")[0] == "--minutes" for word in words):
        return damaged_main(argv)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args(words)
    return fuzz_gcode_beside.run(chosen.minutes * 60.0, chosen.seed)


if __name__ == "__main__":
    sys.exit(main())
