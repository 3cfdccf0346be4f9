"""The files beside a program's ``.src``: data list, parts, sidecar; which is missing or of another program.

A controller's Windows does not tell names by their case, so neither do we.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from gcode2krl import krl_words as w
from gcode2krl.errors import Issue, input_error
from gcode2krl.krl.read import KrlProgram

_PART = re.compile(rf"{w.EXT}\s+(\w+_\d{{3,}})\s*\(\s*\)", re.IGNORECASE)
_COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);.*$')
_KEEP = "keep it beside the program, or translate again"


def beside(path: Path, suffix: str) -> Path:
    """Return the file of another kind that belongs to a program, in whatever case its name is written."""
    file = path.with_suffix(suffix)
    if file.is_file():
        return file
    alike = (other for other in path.parent.iterdir() if other.name.casefold() == file.name.casefold())
    return next((other for other in alike if other.is_file()), file)


def declares_itself(program: KrlProgram) -> bool:
    """Tell whether a program brings its declarations, as on standard output, and needs no data list."""
    return any(_normal(statement.text).startswith(f"{w.EXT}{w.BAS}(") for statement in program.declarations)


def missing_parts(program: KrlProgram, externals: Iterable[str]) -> list[Issue]:
    """Return a finding for each part of a split program whose file is missing."""
    there = {Path(name).stem.casefold() for name in program.texts}
    there |= {external.split("(")[0].strip().casefold() for external in externals}
    named = ((_PART.match(statement.text), statement.line) for statement in program.declarations)
    return [
        missing(f"{match[1]}{w.SOURCE_SUFFIX}", "krl-part", line, "the program calls it")
        for match, line in named
        if match and match[1].casefold() not in there
    ]


def missing(name: str, code: str, line: int, why: str) -> Issue:
    """Return the finding that a file is missing; the program itself may be good."""
    return Issue("error", code, line, f"{name} is missing beside the program: {why}", _KEEP)


def data_issues(path: Path, program: KrlProgram, intended: bytes) -> Iterator[Issue]:
    """Compare the data list beside a program with the intended one; its layout does not matter."""
    file = beside(path, w.DATA_SUFFIX)
    if not file.is_file():
        yield missing(file.name, "krl-data", 0, "the program has no declarations without it")
        return
    try:
        text = file.read_bytes()
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    read, wanted = list(_statements(text)), list(_statements(intended))
    for k in range(max(len(read), len(wanted))):
        line, have = read[k] if k < len(read) else (read[-1][0] if read else 0, "nothing")
        want = wanted[k][1] if k < len(wanted) else "nothing"
        if _normal(have) != _normal(want):
            sentence = f"{file.name}: found {have[:60]!r}, intended {want[:60]!r}"
            yield Issue("error", "krl-data", line, sentence, "translate again")
            break
    if not text.isascii():
        yield Issue("error", "krl-not-ascii", 0, f"{file.name}: a character that is not ASCII")
    folds = [re.match(rb"\s*;(END)?FOLD\b", each.upper()) for each in text.splitlines()]
    if sum(-1 if fold[1] else 1 for fold in folds if fold):
        yield Issue("error", "krl-structure", 0, f"{file.name}: ;FOLD and ;ENDFOLD do not match")


def _statements(text: bytes) -> Iterator[tuple[int, str]]:
    """Yield line and text of each statement."""
    for number, line in enumerate(text.decode("ascii", "replace").splitlines(), start=1):
        statement = _COMMENT.sub(r"\1", line).strip()
        if statement and not statement.startswith("&"):
            yield number, statement


def _normal(text: str) -> str:
    return re.sub(r"\s+", "", text).upper()
