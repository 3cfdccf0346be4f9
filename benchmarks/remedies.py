"""The advice of refusals, carried out: a program is read, a refusal's remedy followed, and it is read again.

``python benchmarks/remedies.py FOLDER [FOLDER …]`` reads every file below the folders as LinuxCNC's and as
its marks say. Of the refusals the first is taken whose advice can be carried out without knowing the part:
another dialect, a key of the cell, a code or a number written otherwise, a line removed. Then it must have
ended; ``--dialect X reads it`` must read, and ``what it then refuses stands in line N`` must name that line.
So it goes on, ten times at most. A program that is read at the end is compared with what
`tests/reference/controls.py` makes of the mended text. Printed is how many remedies of each kind were tried,
and each that did not help; the exit code is 1 where one did not.
"""

import functools
import io
import json
import re
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gcode import read_stream
from gcode2krl.gcode.origin import control_of
from gcode2krl.gcode.other_control import doubts_of_control, with_other_control
from tests.cells import over_demonstration
from tests.reference import controls
from tests.reference.controls import places_of

MOST, MOST_BYTES, NO_PROGRAMS = 10, 400_000, (".toml", ".py", ".json", ".md", ".tbl")
_TOOL = {"diameter_mm": 6.0, "teeth": 2, "length_mm": 60.0}
_CUTTER = {"program": {"cutter": {"lead_in": "a", "d": "radius"}}}
_LINES = (
    ("write G700", r"G7([01])\b", r"G7\g<1>0"),
    ("remove (?:the|this) (?:line|block)|remove it", r"^.*$", ""),
    ("program F before the first", r"[ \t\r]*(?:;.*)?$", " F100"),
    ("without the inner \\( and \\)", r"\((.*)\)", lambda m: f"({re.sub('[()]', ' ', m[1])})"),
)
"""What is said, and what is then written in the line that is named."""


@functools.cache
def cell_of(stated):
    """Return a cell with the tools T1 to T99, and what is stated beside them, as JSON."""
    sections = json.loads(stated)
    tools = {n: dict(_TOOL) for n in range(1, 100)}
    for number, name in zip(range(99, 0, -1), sections.pop("names", []), strict=False):
        tools[number]["name"] = name
    return over_demonstration({"tool": tools, **sections})


class Attempt:
    """A program as it stands, with the dialect and the cell in which it is read."""

    def __init__(self, path, dialect):
        self.path, self.dialect = path, dialect
        self.lines = path.read_bytes().decode("utf-8", "replace").replace("\r", "").split("\n")
        self.stated = {}
        """Sections of the cell beside its tools, and names of tools, as remedies ask for them."""

    def text(self):
        """Return the text as it stands."""
        return "\n".join(self.lines)

    def read(self, dialect=None):
        """Return the reading, or raise."""
        stream = io.BytesIO(self.text().encode())
        cell, folders = cell_of(json.dumps(self.stated)), (self.path.parent,)
        return read_stream(stream, str(self.path), cell, dialect=dialect or self.dialect, folders=folders)

    def refusals(self):
        """Return the errors, as a user is told them; none where it is read."""
        mark = control_of(self.text().encode())
        try:
            toolpath = self.read()
        except Gcode2KrlError as error:
            told = with_other_control(error, mark, self.dialect, self.read)
            return [issue for issue in told.issues if issue.severity == "error"]
        if self.dialect != "linuxcnc":
            return []
        return [
            i for i in doubts_of_control(toolpath, mark, self.dialect, self.read) if i.code == "other-dialect"
        ]

    def follow(self, issue):
        """Carry out the advice of a refusal; return its kind, empty where it takes a person."""
        said = issue.remedy
        if (dialect := re.match(r"--dialect ([a-z-]+)", said)) is not None:
            self.dialect = dialect[1]
            self.stated |= _CUTTER if "[program.cutter]" in said else {}
            return "another dialect"
        if issue.code == "decimal-point":
            self.dialect = "fanuc-calculator"
            return "another dialect"
        if "[program.cutter]" in said:
            self.stated |= _CUTTER
            return "a key of the cell"
        if 'name = "' in said and (name := re.search(r'"([^"]+)"', self.lines[issue.line - 1])) is not None:
            self.stated["names"] = [*self.stated.get("names", []), name[1]]
            return "a key of the cell"
        for pattern, old, new in _LINES:
            if re.search(pattern, said) and 0 < issue.line <= len(self.lines):
                self.lines[issue.line - 1] = re.sub(old, new, self.lines[issue.line - 1], count=1)
                return f"a line: {pattern[:24]}"
        return ""


def promised(issue, after):
    """Return what is wrong with an advice after it was followed, empty where nothing is."""
    if issue.remedy.endswith("reads it") and after:
        return "it was to be read"
    named = re.search(r"what it then refuses stands in line (\d+)", issue.remedy)
    if named is not None and (not after or int(named[1]) not in [found.line for found in after]):
        return "another line was named"
    same = [
        found
        for found in after
        if (found.code, found.line, found.message) == (issue.code, issue.line, issue.message)
    ]
    return "the same refusal stays" if same else ""


def carried_out(path, dialect, counts):
    """Follow what is said of one program; yield what did not help."""
    attempt = Attempt(path, dialect)
    refused = attempt.refusals()
    for step in range(MOST):
        followed, kind = next(((i, k) for i in refused if (k := attempt.follow(i))), (None, ""))
        if followed is None:
            counts["taken by a person" if refused else "read after others" if step else "read at once"] += 1
            break
        counts["tried", kind] += 1
        refused = attempt.refusals()
        wrong = promised(followed, refused)
        if wrong:
            yield f"{path.name}:{followed.line}: {wrong}: {followed.message} -> {followed.remedy}"
            break
    if not refused and step and attempt.dialect in controls.READERS:
        try:
            theirs = controls.columns(controls.READERS[attempt.dialect](attempt.text()))
        except (controls.Unknown, KeyError, IndexError, TypeError, ValueError):
            return
        counts["compared with the other reading"] += 1
        found = controls.difference(controls.columns(places_of(attempt.read())), theirs)
        if found is not None:
            yield f"{path.name}: read, with another meaning: {found}"


def main():
    """Follow, count and print."""
    counts, wrong = Counter(), []
    for folder in sys.argv[1:]:
        for path in sorted(p for p in Path(folder).rglob("*") if p.is_file()):
            head = path.read_bytes()[:20000]
            if b"\0" in head or path.stat().st_size > MOST_BYTES or path.suffix in NO_PROGRAMS:
                continue
            mark = control_of(head)
            for dialect in dict.fromkeys(("linuxcnc", mark.control.dialects[0] if mark else "linuxcnc")):
                counts["programs"] += dialect == "linuxcnc"
                for what in carried_out(path, dialect, counts):
                    print(what, flush=True)
                    wrong.append(what)
    for key, count in sorted(counts.items(), key=str):
        print(*(key if isinstance(key, tuple) else (key,)), count)
    tried = sum(count for key, count in counts.items() if isinstance(key, tuple))
    print(f"advices tried {tried}, not as promised {len(wrong)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
