"""A small program and its cell, the edits that spoil and mend them, and what a command says of them."""

import contextlib
import functools
import io
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from gcode2krl.cell import Cell
from gcode2krl.cli.main import _run
from gcode2krl.errors import Gcode2KrlError
from tests.cell.sound_cells import MILL

HEAD = "G21 G90 G17 G94\nG54\nT1 M6\nG43 H1\nS8000 M3\nG0 X10 Y10 Z20\n"
CUT = "G1 Z-1 F300\nG1 X30 F600\n"
TAIL = "G0 Z20\nM5\nM30\n"
DRY = "translate part.nc --cell cell.toml --pilot none --no-forces -o out.src"
WET = "translate part.nc --cell cell.toml --pilot none -o out.src"
PREDICT = "predict part.nc --cell cell.toml -o prediction"
VERIFY = "verify out.src part.nc --cell cell.toml"
BASE = {"words": DRY, "options": "", "change": {}, "head": HEAD, "cut": CUT, "tail": TAIL, "cell.toml": MILL}
"""``words`` are commands that run one after the other, parted by ``; ``; the last is judged.

The step ``change`` among them edits files as ``change`` says: a pair is old and new text, None removes.
"""


UPRIGHT = [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]
"""Axes in deg of an arm that stands at its usual HOME."""
LIMITS_DEG = [
    [-185.0, 185.0],
    [-140.0, -5.0],
    [-120.0, 155.0],
    [-350.0, 350.0],
    [-122.5, 122.5],
    [-350.0, 350.0],
]
GONE = object()
SPACE = "~~"
"""A space within a word of a command."""


@dataclass(frozen=True)
class Case:
    """A code: the edits of the base that cause it, and each remedy as further edits."""

    wrong: dict
    remedies: tuple[dict, ...]
    then: tuple[str, ...] = ()
    """Errors that are next, in the open: where a remedy leads to another finding."""
    says: str = ""
    """Words by which the finding is told from others of its code."""


CALLS = {}
"""Functions of the Python interface that no command reaches alike: ``call NAME WORD…``."""


def call(function):
    """Make a function a step of `words`."""
    CALLS[function.__name__] = function
    return function


def block(x_mm, y_mm, low_mm=-10.0):
    """Return the box of a stock that lies at the zero of the part."""
    return [[0.0, 0.0, low_mm], [x_mm, y_mm, 0.0]]


def case(wrong, *remedies, then=(), says=""):
    return Case(wrong, remedies, (then,) if isinstance(then, str) else tuple(then), says)


def by_files(edit):
    """Return an edit with its keys of the cell, such as ``frames.base.x_mm``, as tables of cell.toml."""
    files = {}
    for key, value in edit.items():
        *path, last = key.split(".")
        if [*path, last][0] not in Cell.model_fields or last in ("toml", "csv", "tbl", "zip"):
            files[key] = value
            continue
        table = files.setdefault("cell.toml", {})
        for step in path:
            table = table.setdefault(step, {})
        table[last] = value
    return files


def laid(state, edit):
    """Return the state under an edit: a pair is old and new text, tables go key by key, None removes."""
    merged = dict(state)
    for key, value in (by_files(edit) if "cell.toml" in state else edit).items():
        old = state.get(key)
        if value is None:
            merged.pop(key, None)
        elif isinstance(value, tuple) and key != "change" and isinstance(old, str):
            assert value[0] in old, (key, value[0])
            merged[key] = old.replace(*value, 1)
        elif isinstance(value, dict) and isinstance(old, dict):
            merged[key] = laid(old, value)
        else:
            merged[key] = value
    return merged


def files_of(state):
    """Return the files of a state, name → bytes."""
    files = {"part.nc": state["head"] + state["cut"] + "\n" + state["tail"]}
    files |= {name: text for name, text in state.items() if "." in name}
    return {
        name: text
        if isinstance(text, bytes)
        else (tomli_w.dumps(text) if isinstance(text, dict) else text).encode()
        for name, text in files.items()
    }


@functools.cache
def _ran(command, files):
    """Return exit code, findings and the files after one command in a folder of these files."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for name, content in files:
                Path(name).parent.mkdir(parents=True, exist_ok=True)
                Path(name).write_bytes(content)
            if command.startswith("call "):
                name, *words = command.split()[1:]
                result = _called(CALLS[name], words)
                return *result, _files_here()
            out, err = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = _run([*(word.replace(SPACE, " ") for word in command.split()), "--json"])
            record = json.loads(out.getvalue())
            return code, tuple(map(tuple_of, record["issues"])), _files_here()
        finally:
            os.chdir(here)


def _files_here():
    paths = sorted(path for path in Path().rglob("*") if path.is_file())
    return tuple((path.as_posix(), path.read_bytes()) for path in paths)


def _called(function, words):
    try:
        issues = function(*words) or ()
    except Gcode2KrlError as error:
        return error.exit_code, tuple(map(tuple_of, error.issues))
    return 0, tuple(map(tuple_of, issues))


def changed(files, edits):
    """Return files under edits: a pair is old and new text, `GONE` removes, a function is applied."""
    files = dict(files)
    for name, edit in edits.items():
        if edit is GONE:
            del files[name]
        elif isinstance(edit, tuple):
            old, new = (text.encode() for text in edit)
            assert old in files[name], (name, edit[0], files[name].decode())
            files[name] = files[name].replace(old, new, 1)
        elif callable(edit):
            files[name] = edit(files[name])
        else:
            files[name] = edit.encode()
    return files


def tuple_of(issue):
    """Return what is asked of a finding, of an `Issue` or of one in a record."""
    get = issue.get if isinstance(issue, dict) else functools.partial(getattr, issue)
    return tuple(get(name) for name in ("severity", "code", "line", "message", "remedy"))


def outcome(state):
    """Return exit code, findings and files of the commands of a state."""
    files, result = files_of(state), None
    for command in f"{state['words']} {state['options']}".rstrip().split("; "):
        if command == "change":
            files = changed(files, state["change"])
        else:
            *result, after = _ran(command, tuple(sorted(files.items())))
            files = dict(after)
    return *result, files
