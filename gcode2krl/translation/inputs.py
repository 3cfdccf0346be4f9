"""Reading what a command is given: part, cell and job, and the files that they name."""

import hashlib
import io
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from gcode2krl.errors import Gcode2KrlError, Issue, input_error
from gcode2krl.files.program_names import DIALECT_NAMES, PACKED_ENDING
from gcode2krl.files.there import is_there
from gcode2krl.progress import Begin, unseen

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Toolpath

STANDARD = "-"
_LONGEST_PATH = 1000


class StandardInput(io.RawIOBase):
    """Standard input, hashed as it is read."""

    def __init__(self) -> None:
        """Begin before the first byte; raises `NotUnderstoodError` where standard input is closed."""
        if sys.stdin is None:
            raise input_error("file-unreadable", "standard input is closed", "name a file")
        self._stream, self._hash, self._size_bytes = sys.stdin.buffer, hashlib.sha256(), 0

    def read(self, size: int = -1) -> bytes:
        """Read so many bytes; raises `NotUnderstoodError` where that fails."""
        try:
            content = self._stream.read(size)
        except OSError as error:
            sentence = f"cannot read standard input: {error.strerror}"
            raise input_error("file-unreadable", sentence, "name a file") from None
        self._hash.update(content)
        self._size_bytes += len(content)
        return content

    def fileno(self) -> int:
        """Return the file's number, by which its size is asked for."""
        return self._stream.fileno()

    def as_input(self) -> dict[str, Any]:
        """Return what a record says of the bytes that were read."""
        return {"file": "stdin", "sha256": self._hash.hexdigest(), "size_bytes": self._size_bytes}


def read_part(
    part: str,
    cell: "Cell",
    chord_tolerance_mm: float,
    block_delete: bool,
    begin: Begin = unseen,
    standard: StandardInput | None = None,
    dialect: str = DIALECT_NAMES[0],
    search: Sequence[str | Path] = (),
) -> "Toolpath":
    """Read G-code from a file, or from standard input (which may be given, to ask it for its hash)."""
    from gcode2krl.gcode import read_gcode, read_stream

    require_search(search)

    whole = part != STANDARD and Path(part).is_file() and not part.lower().endswith(PACKED_ENDING)
    size = Path(part).stat().st_size if whole else 0
    read, progress = 0, begin("reading")

    def advance(amount: int) -> None:
        nonlocal read
        read += amount
        progress(read, size)

    if part != STANDARD:
        return read_gcode(
            part,
            cell,
            dialect=dialect,
            chord_tolerance_mm=chord_tolerance_mm,
            block_delete=block_delete,
            search=search,
            progress=advance,
        )
    return read_stream(
        cast(BinaryIO, standard or StandardInput()),
        "stdin",
        cell,
        dialect=dialect,
        chord_tolerance_mm=chord_tolerance_mm,
        block_delete=block_delete,
        folders=tuple(map(Path, search)),
        progress=advance,
    )


def read_from_line(
    part: str,
    cell: "Cell",
    chord_tolerance_mm: float,
    block_delete: bool,
    tolerance_mm: float | None,
    from_line: int | None,
    begin: Begin = unseen,
    standard: StandardInput | None = None,
    dialect: str = DIALECT_NAMES[0],
    search: Sequence[str | Path] = (),
) -> "Toolpath":
    """Read G-code, from a line on where one is named; see `read_part`."""
    toolpath = read_part(part, cell, chord_tolerance_mm, block_delete, begin, standard, dialect, search)
    if from_line is None:
        return toolpath
    from gcode2krl.restart.material import restarted

    begin("cutting the lines before")
    return restarted(toolpath, from_line, cell, tolerance_mm)


def require_search(folders: Sequence[str | Path]) -> None:
    """Refuse what is no folder where folders with subprograms are wanted."""
    for folder in folders:
        if not Path(folder).is_dir():
            raise input_error("option-value", f"--search {folder}: this is not a folder", "name a folder")


def subprogram_files(part: str | Path, search: Sequence[str | Path]) -> tuple[Path, ...]:
    """Return the files whose content a part may take in as subprograms; none where it calls none."""
    from gcode2krl.gcode.dependencies import possible_files

    return possible_files(Path(part), tuple(map(Path, search)))


def require_part(part: str) -> None:
    """Refuse a folder where G-code is wanted."""
    if part != STANDARD and Path(part).is_dir():
        raise input_error(
            "file-unreadable", "this is a folder, not G-code", "name the file", source=part or "the input"
        )


def read_cell(path: str | Path | None) -> "Cell":
    """Read the cell of a command."""
    from gcode2krl.cell import load_cell

    return load_cell(path)


def read_cell_under_job(
    path: str | Path | None, job_path: str | Path | None, tools_path: str | Path | None = None
) -> "tuple[Cell, tuple[Issue, ...]]":
    """Read the cell of a command, add the tools of a library, and lay a job over it.

    The findings say where they differ.
    """
    return under_job(read_cell(path), job_path, tools_path)


def under_job(
    cell: "Cell", job_path: str | Path | None, tools_path: str | Path | None = None
) -> "tuple[Cell, tuple[Issue, ...]]":
    """Return a cell with the tools of a library, under a job; the findings say where they differ."""
    issues: tuple[Issue, ...] = ()
    if tools_path is not None:
        from gcode2krl.cell.job import with_tools

        cell, issues = with_tools(cell, Path(tools_path))
    if job_path is None:
        return cell, issues
    from gcode2krl.cell.job import lay_job_over

    under = lay_job_over(cell, Path(job_path))
    return under.cell, (*issues, *under.issues)


def files_of_job(job_path: str | Path | None, tools_path: str | Path | None = None) -> list[Path]:
    """Return the files of a job and of a library of tools, which are inputs."""
    files = [] if tools_path is None else [Path(tools_path)]
    if job_path is None:
        return files
    from gcode2krl.cell.job import job_files

    return [*files, *job_files(Path(job_path))]


def existing(*inputs: str | Path | None) -> list[Path]:
    """Return the inputs that are files or folders, without those that are not given."""
    return [Path(path) for path in inputs if path is not None and path != STANDARD]


def effect_files(folders: Iterable[str]) -> list[Path]:
    """Return the files of folders with effects."""
    return [file for folder in folders for file in Path(folder).glob("*.py")]


def cell_files(path: str | Path | None) -> list[Path]:
    """Return a cell file and every file that it names, however deep: models, bases, meshes, calibration.

    A file that cannot be read is left out: reading the cell reports it.
    """
    files: list[Path] = []
    waiting = [Path(path)] if path is not None else []
    while waiting:
        file = waiting.pop()
        if file in files:
            continue
        files.append(file)
        if file.suffix.lower() == ".toml" or len(files) == 1:
            waiting += (file.parent / name for name in _names_in(file) if is_there(file.parent / name))
    return files


def _names_in(file: Path) -> list[str]:
    """Return the texts of a TOML file that may be names of files."""
    from gcode2krl.cell.library import read_toml

    try:
        values: list[Any] = [read_toml(file)]
    except (Gcode2KrlError, RecursionError):
        return []
    names = []
    while values:
        value = values.pop()
        if isinstance(value, dict):
            values += value.values()
        elif isinstance(value, list):
            values += value
        elif isinstance(value, str) and 0 < len(value) < _LONGEST_PATH and "\0" not in value:
            names.append(value)
    return names
