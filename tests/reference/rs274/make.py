"""Run LinuxCNC's stand-alone interpreter over the corpus and write ``expected.json``.

    apt-get install linuxcnc-uspace
    python tests/reference/rs274/make.py            # or: make.py /path/to/rs274

``README.md`` says how the canonical commands are turned into tool tip moves.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).parent
MM_PER_INCH = 25.4
SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
PLANES = {"CANON_PLANE_XY": "xy", "CANON_PLANE_XZ": "zx", "CANON_PLANE_YZ": "yz"}
AXES = {"xy": (0, 1, 2), "zx": (2, 0, 1), "yz": (1, 2, 0)}
CALL = re.compile(r"^\s*\d+ N[\s\d.]*([A-Z][A-Z0-9_]*)\((.*)\)$")
TOOL_SIZE = re.compile(r"([ZD])([-+]?\d*\.?\d+)")
COMPENSATED = re.compile(rb"G4[12]", re.IGNORECASE)
UNFINISHED = "File ended with no percent sign"
Call = tuple[str, list[str]]


class Interpreter:
    """``rs274`` in a scratch folder, printing nine decimals instead of four."""

    def __init__(self, binary: Path, folder: Path):
        self.folder = folder
        self.binary = folder / "rs274"
        self.binary.write_bytes(binary.read_bytes().replace(b"%.4f", b"%.9f"))
        self.binary.chmod(0o755)
        (folder / "tool.tbl").write_text(_tool_table_in_inches(), encoding="ascii")

    def run(self, program: bytes, parameters: str, block_delete: bool) -> tuple[list[Call], str]:
        """Return the canonical calls up to the program end, and the error message ('' = none)."""
        (self.folder / "program.nc").write_bytes(program)
        (self.folder / "rs274.var").write_text(parameters, encoding="ascii")
        options = ["-g", "-n", "2", "-t", "tool.tbl", "-v", "rs274.var", *(["-b"] if block_delete else [])]
        done = subprocess.run(
            [self.binary, *options, "program.nc"],
            cwd=self.folder,
            env={**os.environ, "HOME": str(self.folder)},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=30,
        )
        calls = []
        for line in done.stdout.splitlines():
            match = CALL.match(line)
            if not match:
                sys.exit(f"cannot read what rs274 printed: {line}")
            if match[1] == "PROGRAM_END":
                break
            calls.append((match[1], re.split(r",\s*|\s+", match[2])))
        messages = [line for line in done.stderr.splitlines() if line != "executing"]
        return calls, messages[0] if done.returncode and messages else ""


@dataclass
class Canon:
    """The state behind the canonical calls; every length in mm."""

    unit_mm: float = 1.0
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    shift: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rotation_deg: float = 0.0
    length: float = 0.0
    tip: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    plane: str = "xy"
    per_revolution: bool = False
    feed: float = 0.0
    rpm: float = 0.0
    start_dwell_s: float = 0.0
    moves: list[dict] = field(default_factory=list)

    def take(self, name: str, args: list[str]) -> None:
        """Apply one canonical call."""
        match name:
            case "USE_LENGTH_UNITS":
                self.unit_mm = MM_PER_INCH if args[0] == "CANON_UNITS_INCHES" else 1.0
            case "SET_G5X_OFFSET":
                self.offset = [float(value) * self.unit_mm for value in args[1:4]]
            case "SET_G92_OFFSET":
                self.shift = [float(value) * self.unit_mm for value in args[:3]]
            case "SET_XY_ROTATION":
                self.rotation_deg = float(args[0])
            case "USE_TOOL_LENGTH_OFFSET":
                self._set_length(float(args[2]) * self.unit_mm)
            case "SELECT_PLANE":
                self.plane = PLANES[args[0]]
            case "SET_FEED_MODE":
                self.per_revolution = args[1] == "1"
            case "SET_FEED_RATE":
                self.feed = float(args[0]) * self.unit_mm
            case "SET_SPINDLE_SPEED":
                self.rpm = float(args[1])
            case "DWELL":
                self._dwell(float(args[0]))
            case "STRAIGHT_TRAVERSE":
                self._move("rapid", self._tip(args))
            case "STRAIGHT_FEED":
                self._move("feed", self._tip(args))
            case "ARC_FEED":
                self._arc(args)

    def _tip(self, args: list[str]) -> list[float]:
        programmed = [float(value) * self.unit_mm for value in args[:3]]
        return self._rotated([value + shift for value, shift in zip(programmed, self._base(), strict=True)])

    def _base(self) -> list[float]:
        """Return where the programmed numbers have their zero, but for the rotation."""
        return [offset + shift for offset, shift in zip(self.offset, self.shift, strict=True)]

    def _rotated(self, point: list[float], sign: float = 1.0) -> list[float]:
        """Return a point rotated about the work offset, or back with the other sign."""
        if self.rotation_deg == 0.0:
            return point
        angle = sign * math.radians(self.rotation_deg)
        x, y = point[0] - self.offset[0], point[1] - self.offset[1]
        cos, sin = math.cos(angle), math.sin(angle)
        return [self.offset[0] + cos * x - sin * y, self.offset[1] + sin * x + cos * y, point[2]]

    def _set_length(self, length: float) -> None:
        """Change the length offset: the machine stands still, so the tip is now elsewhere."""
        self.tip = [self.tip[0], self.tip[1], self.tip[2] - (length - self.length)]
        self.length = length

    def _move(self, kind: str, end: list[float], **more: object) -> None:
        move = {"kind": kind, "end": [_rounded(value) for value in end], "line": 0}
        if kind != "rapid":
            move["feed_mm_s"] = _rounded(self.feed * (self.rpm if self.per_revolution else 1.0) / 60.0)
        self.moves.append({**move, **more, "dwell_s": 0.0})
        self.tip = end

    def _arc(self, args: list[str]) -> None:
        first, second, normal = AXES[self.plane]
        values = [float(value) * self.unit_mm for value in args[:4]]
        end, base = [0.0, 0.0, 0.0], self._base()
        end[first] = values[0] + base[first]
        end[second] = values[1] + base[second]
        end[normal] = float(args[5]) * self.unit_mm + base[normal]
        centre = [_rounded(values[2] + base[first]), _rounded(values[3] + base[second])]
        start = [_rounded(value) for value in self.tip]
        arc = {"start": start, "plane": self.plane, "centre": centre, "rotation": int(args[4])}
        if self.rotation_deg != 0.0:
            arc["about"] = [*(_rounded(value) for value in self.offset[:2]), self.rotation_deg]
        self._move("arc", self._rotated(end), **arc)

    def _dwell(self, seconds: float) -> None:
        if self.moves:
            self.moves[-1]["dwell_s"] += seconds
        else:
            self.start_dwell_s += seconds


def _rounded(value: float) -> float:
    """Round to what rs274 printed; plain zero for minus zero."""
    return round(value, 9) + 0.0


def _tool_table_in_inches() -> str:
    """Return ``tool.tbl`` with Z and D in inches: stand-alone rs274 takes its files to be in inches."""
    text = (HERE / "tool.tbl").read_text(encoding="ascii")
    return TOOL_SIZE.sub(lambda match: f"{match[1]}{float(match[2]) / MM_PER_INCH:.12f}", text)


def _parameters(offsets: dict[str, list[float]]) -> str:
    """Return a parameter file with work offsets given in mm (G54 is 5221-5223, G55 5241-5243, ...).

    A fourth number is the rotation about Z in degrees (G54: 5230).
    """
    values = {}
    for system, (x, y, z, *rotation) in offsets.items():
        first = 5221 + 20 * SYSTEMS.index(system)
        for axis, value in enumerate((x, y, z)):
            values[first + axis] = value / MM_PER_INCH
        if rotation:
            values[first + 9] = rotation[0]
    return "".join(f"{number}\t{value:.12f}\n" for number, value in sorted(values.items()))


def _canon(calls: list[Call]) -> Canon:
    canon = Canon()
    for name, args in calls:
        canon.take(name, args)
    return canon


def _prefixes(program: bytes) -> list[bytes]:
    """Return the beginnings of a program; under cutter compensation M2 brings out the last move."""
    lines = program.splitlines(keepends=True)
    end = b"\nM2\n" if COMPENSATED.search(program) else b""
    return [b"".join(lines[:count]) + end for count in range(1, len(lines) + 1)]


def _program(rs274: Interpreter, file: Path, offsets: dict, block_delete: bool) -> dict:
    """Return the moves of a program; a move's line is the shortest beginning of the file that has it."""
    program, parameters = file.read_bytes(), _parameters(offsets)
    calls, message = rs274.run(program, parameters, block_delete)
    if message:
        sys.exit(f"{file.name}: {message}")
    canon = _canon(calls)
    for line, beginning in enumerate(_prefixes(program), start=1):
        count = len(_canon(rs274.run(beginning, parameters, block_delete)[0]).moves)
        for move in canon.moves[:count]:
            move["line"] = move["line"] or line
    return {
        "file": f"{file.parent.name}/{file.name}",
        "block_delete": block_delete,
        "start_dwell_s": canon.start_dwell_s,
        "moves": canon.moves,
    }


def _error(rs274: Interpreter, file: Path) -> dict:
    """Return where and why rs274 refuses a program: the shortest beginning of the file that it refuses."""
    for line, beginning in enumerate(_prefixes(file.read_bytes()), start=1):
        message = rs274.run(beginning, "", False)[1]
        if message and not message.startswith(UNFINISHED):
            return {"file": f"{file.parent.name}/{file.name}", "line": line, "message": message}
    sys.exit(f"{file.name}: rs274 accepts it")


def _has_deletable_lines(file: Path) -> bool:
    return any(line.lstrip().startswith(b"/") for line in file.read_bytes().splitlines())


def _programs(rs274: Interpreter) -> list[dict]:
    offsets = json.loads((HERE / "offsets.json").read_text(encoding="ascii"))
    found = []
    for folder, shifts in (("programs", {}), ("programs_offsets", offsets)):
        for file in sorted((HERE / folder).glob("*.nc")):
            for block_delete in (False, True) if _has_deletable_lines(file) else (False,):
                found.append(_program(rs274, file, shifts, block_delete))
    return found


def _check(programs: list[dict]) -> None:
    for program in programs:
        for move in program["moves"]:
            numbers = [*move["end"], move.get("feed_mm_s", 0.0)]
            if not move["line"] or not all(map(math.isfinite, numbers)):
                sys.exit(f"{program['file']}: cannot use {move}")


def _json(programs: list[dict], errors: list[dict]) -> str:
    """Return the result as JSON with a move, or an error, per line."""
    blocks = []
    for program in programs:
        head = json.dumps({key: value for key, value in program.items() if key != "moves"})[:-1]
        moves = ",\n   ".join(map(json.dumps, program["moves"]))
        blocks.append(f'{head}, "moves": [\n   {moves}]}}')
    refused = ",\n ".join(map(json.dumps, errors))
    return '{"programs": [\n ' + ",\n ".join(blocks) + '],\n"errors": [\n ' + refused + "]}\n"


def main() -> None:
    """Write ``expected.json``."""
    binary = sys.argv[1] if len(sys.argv) > 1 else shutil.which("rs274")
    if not binary:
        sys.exit("rs274 not found: apt-get install linuxcnc-uspace")
    with tempfile.TemporaryDirectory() as folder:
        rs274 = Interpreter(Path(binary), Path(folder))
        programs = _programs(rs274)
        errors = [_error(rs274, file) for file in sorted((HERE / "errors").glob("*.nc"))]
    _check(programs)
    (HERE / "expected.json").write_text(_json(programs, errors), encoding="ascii")
    print(f"{len(programs)} programs, {len(errors)} refused programs")


if __name__ == "__main__":
    main()
