"""Programs for industrial controls, read twice: by the package, and by ``tests/reference/controls.py``.

``python benchmarks/controls_twice.py FOLDER [FOLDER …]`` takes every file below the folders that has the
marks of a Fanuc, a Sinumerik or a Heidenhain, reads it in that dialect for a cell that knows the tools T1 to
T99, follows one remedy where it is refused (a key of the cell; then F, where a Sinumerik's program has none),
and compares the places with the other reading within 1e-6 mm. Subprograms of a Sinumerik are looked for
beside a program and in the other folders with such files. Printed is for each file: read, after remedies, or
not and why; and for those that are read: same, another place, or why they are not compared. The exit code is
1 where a place differs.
"""

import io
import re
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.gcode import read_stream
from gcode2krl.gcode.origin import control_of
from tests.cells import over_demonstration
from tests.reference import contour, controls

_RADIUS_MM = 3.0
_TOOLS = {n: {"diameter_mm": 2 * _RADIUS_MM, "teeth": 2, "length_mm": 60.0} for n in range(1, 100)}
_STATED = {
    "fanuc": {"program": {"cutter": {"lead_in": "a", "d": "radius"}}},
    "sinumerik": {"program": {"start": {"motion": "G1"}}},
}
_FIRST = over_demonstration({"tool": _TOOLS})
_NAMED_TOOL = re.compile(r'\bT\s*=\s*"([^"]+)"|TOOL CALL "([^"]+)"')
_OTHER_DIALECT = {"fanuc": "fanuc-calculator"}


def remedied(path, dialect):
    """Return a cell that states what refusals ask for: the cutter, the start, the names of tools."""
    names = dict.fromkeys(name for pair in _NAMED_TOOL.findall(text_of(path)) for name in pair if name)
    tools = {n: {**_TOOLS[n], "name": name} for n, name in zip(range(99, 0, -1), names, strict=False)}
    return over_demonstration({"tool": {**_TOOLS, **tools}, **_STATED.get(dialect, {})})


def reading(path, dialect, search):
    """Return how a program was read, the reading, and why not."""
    why = ""
    for how in ("read", "one remedy", "two remedies"):
        cell = _FIRST if how == "read" else remedied(path, dialect)
        spoken = dialect if how == "read" else _OTHER_DIALECT.get(dialect, dialect)
        feed = b"F1000\n" if how == "two remedies" else b""
        try:
            if not feed:
                return how, read_gcode(path, cell, dialect=spoken, search=search), ""
            stream = io.BytesIO(feed + path.read_bytes())
            return (
                how,
                read_stream(stream, str(path), cell, dialect=spoken, folders=[path.parent, *search]),
                "",
            )
        except Gcode2KrlError as error:
            first = next(issue for issue in error.issues if issue.severity == "error")
            why = f"line {first.line}: {first.message} [{first.code}]"
            if how == "one remedy" and (first.code != "no-feed" or dialect != "sinumerik"):
                break
    return "not", None, why


def text_of(path):
    """Return the text of a file."""
    return path.read_text(encoding="utf-8", errors="replace")


def compared(path, dialect, toolpath, search):
    """Return what comparing a reading with the other one says."""
    near = {p.stem.upper(): text_of(p) for folder in search for p in folder.glob("*.[sS][pP][fF]")}
    beside = {
        "fanuc": {},
        "sinumerik": {"programs": near, "radius": _RADIUS_MM},
        "heidenhain": {"radius": _RADIUS_MM},
    }
    try:
        theirs = controls.READERS[dialect](text_of(path), **beside[dialect])
    except controls.Unknown as unknown:
        return f"not compared ({str(unknown)[:40]})"
    except (KeyError, IndexError, TypeError, ValueError, contour.OffPathError) as error:
        return f"not compared ({type(error).__name__})"
    found = controls.difference(controls.columns(controls.places_of(toolpath)), controls.columns(theirs))
    return "same" if found is None else f"DIFFERS at {found}"


def main():
    """Read, compare and print."""
    counts = Counter()
    for folder in sys.argv[1:]:
        search = sorted({p.parent for p in Path(folder).rglob("*") if p.suffix.lower() == ".spf"})
        for path in sorted(p for p in Path(folder).rglob("*") if p.is_file()):
            mark = control_of(path.read_bytes()[:20000])
            dialect = mark.control.dialects[0] if mark is not None else ""
            if dialect not in controls.READERS:
                continue
            how, toolpath, why = reading(path, dialect, search)
            said = compared(path, dialect, toolpath, search) if toolpath is not None else why
            counts[dialect, how] += 1
            counts[dialect, said.split(" ")[0] if toolpath is not None else "refused"] += 1
            print(f"{dialect:10} {how:12} {path.name}: {said}")
    for key, count in sorted(counts.items()):
        print(*key, count)
    return int(any(what == "DIFFERS" for _, what in counts))


if __name__ == "__main__":
    sys.exit(main())
