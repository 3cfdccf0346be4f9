"""What several commands share: options, and reading the part with a bar on the terminal."""

import os
from collections.abc import Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.record_head import heading
from gcode2krl.compiled.threads import THREADS_VARIABLE
from gcode2krl.errors import input_error
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.translation import inputs as reading
from gcode2krl.translation.inputs import (
    STANDARD,
    StandardInput,
    cell_files,
    effect_files,
    existing,
    files_of_job,
    require_part,
)
from gcode2krl.translation.outputs import (
    require_fit_outputs,
    require_folder,
    require_other,
    require_outputs,
)

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.errors import Issue
    from gcode2krl.tables import Toolpath

__all__ = [
    "STANDARD",
    "VERBOSE",
    "allow_option",
    "cell_files",
    "common_options",
    "effect_files",
    "existing",
    "files_of_job",
    "gcode_options",
    "isolated_option",
    "job_option",
    "named_values",
    "options_of_project",
    "read_cell",
    "read_cell_under_job",
    "read_part",
    "require_fit_outputs",
    "require_folder",
    "require_other",
    "require_outputs",
    "require_part",
    "search_option",
    "simplify_option",
]


VERBOSE = click.option(
    "-v", "--verbose", is_flag=True, expose_value=False, help="Show details of an internal error."
)
"""`main` looks for it in the words of the command line."""


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
        VERBOSE,
        click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings."),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output."),
        click.option(
            "--cell", "cell_path", type=click.Path(), help="Cell file; default: the demonstration cell."
        ),
    ):
        function = option(function)
    return function


def dialect_option(function: Any) -> Any:
    """Add the option that names the dialect of the G-code."""
    return click.option(
        "--dialect",
        type=click.Choice(DIALECT_NAMES),
        default=DIALECT_NAMES[0],
        show_default=True,
        help="What the post wrote the G-code for.",
    )(function)


def search_option(function: Any) -> Any:
    """Add the option that names folders with subprograms."""
    return click.option(
        "--search",
        multiple=True,
        metavar="FOLDER",
        help="Where subprograms are, beside the part's own folder; may be repeated.",
    )(function)


def gcode_options(function: Any) -> Any:
    """Add the options that say how G-code is read."""
    for option in (
        search_option,
        dialect_option,
        click.option("--block-delete", is_flag=True, help="Skip lines that begin with /."),
        click.option(
            "--chord-tolerance",
            "chord_tolerance_mm",
            default=0.01,
            show_default=True,
            metavar="MM",
            help="Largest error of the chords of an arc.",
        ),
        click.option(
            "--tolerance",
            "tolerance_mm",
            type=float,
            metavar="MM",
            help="Blend corners within this (below G64 P).",
        ),
    ):
        function = option(function)
    return function


def allow_option(function: Any) -> Any:
    """Add --allow to a command that judges what it found."""
    return click.option(
        "--allow",
        multiple=True,
        metavar="CODE[:[FILE:]LINE]",
        help="Allow one finding, or all of a code; may be repeated.",
    )(function)


def simplify_option(function: Any) -> Any:
    """Add --simplify to a command that sets targets."""
    option = click.option(
        "--simplify",
        "simplify_mm",
        type=float,
        metavar="MM",
        help="Merge feed moves into straight ones within this; 0.01 is usual.",
    )
    return option(function)


def job_option(function: Any) -> Any:
    """Add --job and --tools to a command that reads a part."""
    for option in (
        click.option(
            "--tools",
            "tools_path",
            type=click.Path(),
            metavar="LIBRARY",
            help="Tools that the cell does not have, as `tools import` reads them, for this call.",
        ),
        click.option(
            "--job",
            "job_path",
            type=click.Path(),
            metavar="JOB.toml",
            help="What the CAM knows: its cutters and stock, laid over the cell.",
        ),
    ):
        function = option(function)
    return function


def isolated_option(function: Any) -> Any:
    """Add the option that takes no options from a project file."""
    option = click.option("--isolated", is_flag=True, help="Take no options from a gcode2krl.toml.")
    return option(function)


def stated_options(context: click.Context) -> frozenset[str]:
    """Return the names of the options that a command line states."""
    default = click.core.ParameterSource.DEFAULT
    return frozenset(name for name in context.params if context.get_parameter_source(name) is not default)


def options_of_project(function: Any) -> Any:
    """Let a command of one ``part`` take options from its project file: those that its line does not state.

    The command gets what it took as ``project``.
    """

    @isolated_option
    @wraps(function)
    def command(part: str, isolated: bool, **options: Any) -> Any:
        from gcode2krl.translation.project import Project, project_of

        context = click.get_current_context()
        stated = stated_options(context)
        place = Path("part") if part == STANDARD else Path(part)
        project = Project() if isolated else project_of(place).without(stated, options)
        context.params.update(project.options)
        return function(part=part, **(options | dict(project.options)), project=project)

    return command


def named_values(words: Sequence[str], option: str) -> dict[str, str]:
    """Return the NAME=VALUE words of an option as a mapping; a name may hold an = itself."""
    pairs = {}
    for word in words:
        name, equals, value = word.rpartition("=")
        if not equals or not name:
            raise input_error("option-value", f"{option} {word!r}: no NAME=VALUE", f"{option} NAME=VALUE")
        pairs[name] = value
    return pairs


def read_cell(path: str | None) -> "Cell":
    """Read the cell of a command; its record names it."""
    cell = reading.read_cell(path)
    heading().has_cell(cell, path)
    return cell


def read_cell_under_job(
    path: str | None, job_path: str | None, tools_path: str | None = None
) -> "tuple[Cell, tuple[Issue, ...]]":
    """Read the cell of a command under a library of tools and a job, see `translation.inputs`."""
    cell, issues = reading.read_cell_under_job(path, job_path, tools_path)
    heading().has_cell(cell, path)
    return cell, issues


def read_part(
    part: str,
    cell: "Cell",
    console: Console,
    chord_tolerance_mm: float,
    block_delete: bool,
    dialect: str = DIALECT_NAMES[0],
    search: Sequence[str] = (),
) -> "Toolpath":
    """Read the G-code of a command with a bar on the terminal, see `translation.inputs.read_part`."""
    standard = StandardInput() if part == STANDARD else None
    console.heading.reads(part)
    with console.stages() as begin:
        toolpath = reading.read_part(
            part, cell, chord_tolerance_mm, block_delete, begin, standard, dialect, search
        )
    if standard is not None:
        console.heading.inputs[part] = standard.as_input()
    return toolpath
