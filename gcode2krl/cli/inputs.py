"""Reading the inputs that several commands share: the part and the cell."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.compiled.threads import THREADS_VARIABLE
from gcode2krl.errors import Gcode2KrlError, Issue, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.tables import Toolpath

STANDARD = "-"
FIGURES = ("png", "svg", "pdf")
_LONGEST_PATH = 1000


def _use_threads(_context: click.Context, _option: click.Parameter, count: int | None) -> None:
    """Let every stage use so many threads."""
    if count is not None:
        os.environ[THREADS_VARIABLE] = str(count)


def common_options(function: Any) -> Any:
    """Add --cell, --json, --threads, -q and -v to a command."""
    for option in (
        click.option(
            "--threads",
            type=click.IntRange(1, 1024),
            expose_value=False,
            callback=_use_threads,
            help="Threads to use; default: one a core.",
        ),
        click.option("-v", "--verbose", is_flag=True, help="Show details of an internal error."),
        click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings."),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output."),
        click.option(
            "--cell", "cell_path", type=click.Path(), help="Cell file; default: the demonstration cell."
        ),
    ):
        function = option(function)
    return function


def gcode_options(function: Any) -> Any:
    """Add the options that say how G-code is read."""
    for option in (
        click.option("--block-delete", is_flag=True, help="Skip lines that begin with /."),
        click.option(
            "--chord-tolerance",
            default=0.01,
            show_default=True,
            metavar="MM",
            help="Largest error of the chords of an arc.",
        ),
        click.option(
            "--tolerance", type=float, metavar="MM", help="Blend corners within this (below G64 P)."
        ),
    ):
        function = option(function)
    return function


def job_option(function: Any) -> Any:
    """Add --job to a command that reads a part."""
    option = click.option(
        "--job",
        "job_path",
        type=click.Path(),
        metavar="JOB.toml",
        help="What the CAM knows: its cutters and stock, laid over the cell.",
    )
    return option(function)


def read_part(
    part: str, cell: "Cell", console: Console, chord_tolerance_mm: float, block_delete: bool
) -> "Toolpath":
    """Read the G-code of a command, from a file or from standard input."""
    from gcode2krl.gcode import read_gcode, read_stream

    size = Path(part).stat().st_size if part != STANDARD and Path(part).is_file() else 0
    read = 0
    with console.stage("reading") as progress:

        def advance(amount: int) -> None:
            nonlocal read
            read += amount
            progress(read, size)

        if part == STANDARD:
            if sys.stdin is None:
                raise input_error("file-unreadable", "standard input is closed", "name a file")
            try:
                return read_stream(
                    sys.stdin.buffer,
                    "stdin",
                    cell,
                    chord_tolerance_mm=chord_tolerance_mm,
                    block_delete=block_delete,
                    progress=advance,
                )
            except OSError as error:
                sentence = f"cannot read standard input: {error.strerror}"
                raise input_error("file-unreadable", sentence, "name a file") from None
        return read_gcode(
            part, cell, chord_tolerance_mm=chord_tolerance_mm, block_delete=block_delete, progress=advance
        )


def read_cell(path: str | None) -> "Cell":
    """Read the cell of a command."""
    from gcode2krl.cell import load_cell

    return load_cell(path)


def read_cell_under_job(path: str | None, job_path: str | None) -> "tuple[Cell, tuple[Issue, ...]]":
    """Read the cell of a command and lay a job over it; the findings say where the two differ."""
    cell = read_cell(path)
    if job_path is None:
        return cell, ()
    from gcode2krl.cell.job import lay_job_over

    return lay_job_over(cell, Path(job_path))


def files_of_job(job_path: str | None) -> list[Path]:
    """Return the files of a job, which are inputs."""
    if job_path is None:
        return []
    from gcode2krl.cell.job import job_files

    return job_files(Path(job_path))


def require_other(output: Path, *inputs: str | Path | None) -> None:
    """Refuse an output that is one of the inputs (files, folders), or whose folder does not exist."""
    require_outputs([output], *inputs)


def require_outputs(outputs: list[Path], *inputs: str | Path | None) -> None:
    """Refuse an output that is an input, another output or a folder, or whose folder does not exist."""
    from gcode2krl.files import refuse_inputs

    for output in outputs:
        if not output.parent.is_dir():
            sentence = f"cannot write: the folder {str(output.parent)!r} does not exist"
            raise input_error("output-unwritable", sentence, "create it first", source=str(output))
        if output.is_dir():
            remedy = "name a file, or remove the folder"
            raise input_error("output-unwritable", "this is a folder", remedy, source=str(output))
    refuse_inputs(outputs, existing(*inputs))


def require_folder(folder: str | Path | None, names: Iterable[str], inputs: Iterable[Path]) -> None:
    """Refuse an output folder that cannot be made, or in which an input has the name of an output."""
    if folder is None:
        return
    place = Path(folder)
    if place.is_dir():
        require_outputs([place / name for name in names], *inputs)
        return
    require_outputs([place], *inputs)
    if place.exists():
        raise input_error("output-unwritable", "this is a file", "name a folder", source=str(place))


def require_figure(name: str | None) -> None:
    """Refuse the name of a figure that cannot be drawn."""
    if name is not None and Path(name).suffix.lower().removeprefix(".") not in FIGURES:
        sentence = f"figure {Path(name).name!r}: allowed endings {', '.join(FIGURES)}"
        raise input_error("option-value", sentence, "name it figure.png", source=name)


def require_fit_outputs(plot: str | None, apply_to: str | None, cell: str | None, *data: str | None) -> None:
    """Refuse outputs of a fit: a figure over any input, a cell file over the data (over the cell it may)."""
    require_figure(plot)
    if apply_to is not None:
        require_other(Path(apply_to), *data)
    if plot is not None:
        require_other(Path(plot), apply_to, *data, *cell_files(cell))


def require_part(part: str) -> None:
    """Refuse a folder where G-code is wanted."""
    if part != STANDARD and Path(part).is_dir():
        raise input_error(
            "file-unreadable", "this is a folder, not G-code", "name the file", source=part or "the input"
        )


def existing(*inputs: str | Path | None) -> list[Path]:
    """Return the inputs that are files or folders, without those that are not given."""
    return [Path(path) for path in inputs if path is not None and path != STANDARD]


def effect_files(folders: Iterable[str]) -> list[Path]:
    """Return the files of folders with effects."""
    return [file for folder in folders for file in Path(folder).glob("*.py")]


def cell_files(path: str | None) -> list[Path]:
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
            waiting += (file.parent / name for name in _names_in(file) if (file.parent / name).is_file())
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
