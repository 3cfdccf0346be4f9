"""Damaged, made-up and sound KRL programs: the scanner and the reader behind it.

    python native/build.py --checked
    GCODE2KRL_CORE=checked python benchmarks/fuzz_krl.py --count 20000 --seed 1

With the checked build an index outside the text or a table ends the process, which is a failure. Besides, the
rows must lie in the text in order and be the same in short chunks as in one piece, and a line alone must be
read as it is among others.
"""

import re
import sys
from pathlib import Path

import numpy as np
from fuzz_common import Try, main_of, mutated

PART = (
    "G21 G90\nT1 M6\nS9000 M3\nM8\nG0 G43 H1 Z30\nX0 Y0\nG1 Z-2 F600\nX20 F1500\nY10\nG2 X30 Y20 I10 J0\n"
    "G4 P0.5\nG0 Z30\nM9\nM30\n"
)
TRIGGERS = (
    b"TRIGGER WHEN DISTANCE=0 DELAY=124 DO $SEN_PINT[1]=7",
    b"TRIGGER WHEN DISTANCE = 0 DELAY=-3 DO GK_PILOT(1.25,-2.5,0.0,12.0) PRIO=-1",
    b"trigger when distance=1 delay=0 do $OUT[3] = 1 ; text",
)
LINES = (
    b"LIN {X 1,Y 2,Z 3,A 4,B 5,C 6} C_DIS",
    b"\tlin { z -1.5 , a +4. , x .5 } c_dis ; text",
    b"PTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}",
    b"PTP {X 1.0,Y 2.0,Z 3.0,A 0,B 90,C 0,S 2,T 10}",
    b"LIN {A1 0,A2 -90}",
    b"LIN {X 1,X 2}",
    b"WAIT SEC 0.5 ; dwell",
    b"WAITSEC 1",
    b"$VEL.CP 0.1",
    b"$APO.CDIS",
    b";FOLD text",
    b";ENDFOLD",
    b"&ACCESS RVP",
    b"",
    b" \t ",
    b"LIN {X " + b"1" * 600 + b"}",
    b"LIN {X 1" + b" " * 480 + b"}",
    b"; " + b"x" * 70_000,
    b"LIN {X 1} C_DIS C_DIS",
    b"\xff\xfe",
    b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO",
    b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO GK_PILOT(1,2,3",
    b"TRIGGER WHEN DISTANCE=0 DELAY=1 DO =1",
)
NUMBERS = (
    b"",
    b"-",
    b".",
    b"1..2",
    b"+-1",
    b"1e5",
    b"nan",
    b"9" * 15,
    b"9" * 16,
    b"0." + b"0" * 14,
    b"-0",
    b"1,5",
)
SHORT_CHUNK = 64


def prepare(place: Path) -> Try:
    """Write a good program once; return the function that tries a case."""
    from gcode2krl import load_cell, read_gcode, set_targets, write_krl
    from gcode2krl.errors import input_error
    from gcode2krl.krl.read import read_texts

    part = place / "part.nc"
    part.write_text(PART, encoding="ascii")
    cell = load_cell()
    program = write_krl(set_targets(read_gcode(part, cell), cell), place / "PART.src", cell)
    good = program.texts["PART.src"]

    def attempt(rng: np.random.Generator, _: Path) -> str:
        what, text = damaged(rng, good)
        _scanned(rng, text)
        read = read_texts({"PART.src": text}, "PART.src")
        if read.issues:
            words = read.issues[0].message
            assert words.isprintable(), "more than a line"
            raise input_error(read.issues[0].code, words[:200])
        return what

    return attempt


def _scanned(rng: np.random.Generator, text: bytes) -> None:
    """Scan a text as a whole, in short chunks, and some of its lines alone."""
    from gcode2krl import krl_words
    from gcode2krl.krl.scan import scan_krl

    whole = scan_krl(text)
    for one, other in zip(whole, scan_krl(text, SHORT_CHUNK), strict=True):
        assert np.array_equal(one, other, equal_nan=np.ndim(other) == 2), "chunks differ"
    lines = text.split(b"\n")
    assert (np.diff(whole.line) > 0).all(), "lines out of order"
    motions = (krl_words.KIND_LIN, krl_words.KIND_PTP, krl_words.KIND_PTP_AXES)
    is_motion = np.isin(whole.kind, motions)
    place = np.where(is_motion, np.cumsum(is_motion), np.cumsum(~is_motion)) - 1
    for row in rng.permutation(len(whole.line))[:20]:
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


def damaged(rng: np.random.Generator, good: bytes) -> tuple[str, bytes]:
    """Return what was done, and a program as it may come."""
    kinds = (sound, sound, _bytes, _number, _number, _lines, _lines, _case, _end, _noise)
    kind = kinds[int(rng.integers(len(kinds)))]
    return kind.__name__.strip("_"), kind(rng, with_triggers(rng, good))


def with_triggers(rng: np.random.Generator, text: bytes) -> bytes:
    """Return the program with triggers before some of its motions."""
    return re.sub(
        rb"^LIN",
        lambda _: (_pick(rng, TRIGGERS) + b"\r\n" if rng.random() < 0.3 else b"") + b"LIN",
        text,
        flags=re.MULTILINE,
    )


def sound(rng: np.random.Generator, text: bytes) -> bytes:
    """Change only what means nothing: line ends, blanks, capitals."""
    blank = _pick(rng, (b" ", b"  ", b"\t"))
    text = text.replace(b"\r\n", _pick(rng, (b"\n", b"\r\n", b" \t\r\n"))).replace(
        b" C_DIS", blank + b"c_dis"
    )
    return text.replace(b"LIN {X ", _pick(rng, (b"LIN{X ", b"lin {  x\t", b"Lin \t{X ")))


def _bytes(rng: np.random.Generator, text: bytes) -> bytes:
    return mutated(rng, text, text)


def _number(rng: np.random.Generator, text: bytes) -> bytes:
    places = list(re.finditer(rb"-?\d+\.?\d*", text))
    at = places[int(rng.integers(len(places)))]
    return text[: at.start()] + _pick(rng, NUMBERS) + text[at.end() :]


def _lines(rng: np.random.Generator, text: bytes) -> bytes:
    lines = text.split(b"\r\n")
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(len(lines)))
        lines[at : at + int(rng.integers(2))] = [_pick(rng, LINES)]
    return b"\r\n".join(lines)


def _case(rng: np.random.Generator, text: bytes) -> bytes:
    return text.swapcase() if rng.random() < 0.5 else text.lower()


def _end(rng: np.random.Generator, text: bytes) -> bytes:
    """Cut the text somewhere, or leave out the end of its last line."""
    return text.rstrip() if rng.random() < 0.3 else text[: int(rng.integers(len(text) + 1))]


def _noise(rng: np.random.Generator, text: bytes) -> bytes:
    letters = np.frombuffer(b"LINPTP {}XYZABC,.-+0123456789;=()&\r\n\t$DISTANCE\xff", dtype=np.uint8)
    noise = rng.choice(letters, int(rng.integers(0, 3000))).tobytes()
    return text[:200] + noise if rng.random() < 0.5 else noise


def _pick(rng: np.random.Generator, among: tuple[bytes, ...]) -> bytes:
    return among[int(rng.integers(len(among)))]


main = main_of("krl", prepare, __doc__, 20_000)

if __name__ == "__main__":
    sys.exit(main())
