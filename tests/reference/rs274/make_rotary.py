"""Write ``expected_rotary.json``: where LinuxCNC's ``rs274`` moves rotary axes, and how long each move takes.

    python tests/reference/rs274/make_rotary.py            # or: make_rotary.py /path/to/rs274

``rs274`` takes A, B and C as plain axes, so it is the reference for modes, units, homes and feeds, not for
kinematics. A move is [kind, X, Y, Z in mm, A, B, C in degrees, time in s]. The time is that of LinuxCNC's
motion side: F is the speed along X, Y, Z, or along A, B, C in degrees where X, Y, Z stand.
"""

import json
import math
import shutil
import sys
import tempfile
from pathlib import Path

from make import MM_PER_INCH, Interpreter

HERE = Path(__file__).resolve().parent


def moves_of(calls: list[tuple[str, list[str]]]) -> list[list]:
    """Return the moves of canonical calls."""
    unit_mm, feed, here, moves = 1.0, 0.0, [0.0] * 6, []
    for name, args in calls:
        if name == "USE_LENGTH_UNITS":
            unit_mm = MM_PER_INCH if args[0] == "CANON_UNITS_INCHES" else 1.0
        elif name == "SET_FEED_RATE":  # F as written, and the mm that a unit was then
            feed, feed_mm = float(args[0]), float(args[0]) * unit_mm
        elif name in ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "ARC_FEED"):
            is_arc = name == "ARC_FEED"
            values = [float(value) for value in args]
            xyz = [values[0], values[1], values[5]] if is_arc else values[:3]
            to = [value * unit_mm for value in xyz] + (values[6:9] if is_arc else values[3:6])
            steps = [new - old for new, old in zip(to, here, strict=True)]
            length_mm, turn_deg = math.hypot(*steps[:3]), math.hypot(*steps[3:])
            time_s = None
            if name == "STRAIGHT_FEED":
                time_s = 60.0 * (length_mm / feed_mm if length_mm > 1e-6 else turn_deg / feed)
            kind = "arc" if is_arc else "rapid" if name == "STRAIGHT_TRAVERSE" else "feed"
            moves.append([kind, *(round(value, 6) + 0.0 for value in to), time_s])
            here = to
    return moves


def main() -> None:
    """Run every program of ``programs_rotary``."""
    binary = sys.argv[1] if len(sys.argv) > 1 else shutil.which("rs274")
    if binary is None:
        sys.exit("rs274 not found: apt-get install linuxcnc-uspace")
    expected = {}
    with tempfile.TemporaryDirectory() as folder:
        rs274 = Interpreter(Path(binary), Path(folder))
        for file in sorted((HERE / "programs_rotary").glob("*.nc")):
            calls, message = rs274.run(file.read_bytes(), "", False)
            if message:
                sys.exit(f"{file.name}: {message}")
            expected[file.name] = moves_of(calls)
    texts = {name: ",\n ".join(map(json.dumps, moves)) for name, moves in expected.items()}
    lines = [f'"{name}": [\n {text}]' for name, text in texts.items()]
    (HERE / "expected_rotary.json").write_text("{" + ",\n".join(lines) + "}\n", encoding="ascii")
    print(sum(map(len, expected.values())), "moves")


if __name__ == "__main__":
    main()
