"""Entry point ``gcode2krl``: the commands, the default command, and how errors leave the program."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.on_use import CommandsOnUse
from gcode2krl.cli.record_head import Heading
from gcode2krl.cli.standard_files import flushed, reserve_standard_files
from gcode2krl.codes import closest
from gcode2krl.compiled import MATRIX_VARIABLES
from gcode2krl.errors import Gcode2KrlError, input_error
from gcode2krl.version import __version__

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_COMMANDS = {
    "init": "Write the cell file of your robot from your answers and the controller's archive.",
    "translate": "Translate G-code into a KRL program, verify it, and print a summary.",
    "inspect": "Show what a program is: control, CAM, unit, tools, offsets, extents, what the cell must say.",
    "batch": "Translate many parts: folders, patterns, files, @lists, or a TOML file with a cell a folder.",
    "predict": "Predict what the robot will do: path, timing, joints, cutting forces, deflection.",
    "verify": "Read a KRL program back, compare it with its G-code, and judge its hazards anew.",
    "report": "Show a prediction as one page for a browser: 3D path, robot, plots and G-code, linked.",
    "diagnose": "Say where measured runs differ from their prediction, which effects explain it, "
    "and how far it shrinks.",
    "runs": "Measured runs: make one of a log.",
    "identify": "Fit the cell to measurements: controller, stiffness, sensor, kinematics, cutting force.",
    "online": "Compensate online: the twin, the RSI server, replay.",
    "stiffness-map": "Draw how far the robot bends under a load: over $BASE's plane, over the spin, "
    "and joint by joint.",
    "runkit": "Write what a program is accepted with: a variant in air, its prediction, a trace set-up, "
    "a check list.",
    "make-test": "Write a test program of air moves.",
    "cache": "What a batch has computed before: show, clear.",
    "tools": "Cutters: take them from the library of a CAM system.",
    "models": "Robots, controllers, tools and cells: list, show, check, confirm, schema.",
    "install-hook": "Put gcode2krl into a CAM system's list of post processors.",
    "completion": "Print the script that completes commands, options and files in a shell.",
    "explain": "Explain a finding by its code, as printed: spindle-off or spindle-off:12.",
}
_OWN_OPTIONS = ("-h", "--help", "--version")


class _Commands(CommandsOnUse):
    """The commands; a first word that is none of them is a part to translate."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args and not ctx.resilient_parsing:
            args = ["--help"]
        if args and args[0] not in _COMMANDS and args[0] not in _OWN_OPTIONS:
            if not ctx.resilient_parsing:  # while a shell completes, a word may be half written
                _refuse_mistyped(args[0])
            args = ["translate", *args]
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> "list[CompletionItem]":
        """Return commands and options, and files: the first word may be a part."""
        from click.shell_completion import CompletionItem

        files = [] if incomplete.startswith("-") else [CompletionItem(incomplete, type="file")]
        return [*super().shell_complete(ctx, incomplete), *files]


def _refuse_mistyped(word: str) -> None:
    """Raise if a first word is neither a command nor a part: no option, no ending, no such file."""
    from gcode2krl.files.there import is_there

    if word.startswith("-") or Path(word).suffix or is_there(word, Path.exists):
        return
    near = closest(word.lower(), _COMMANDS)
    if near:
        sentence = f"no command {word!r}: did you mean {near!r}?"
        raise input_error("command-unknown", sentence, "`gcode2krl --help` lists the commands")
    raise input_error("file-unreadable", f"no such file {word!r}", "`gcode2krl --help` lists the commands")


@click.command(
    cls=_Commands,
    epilog=examples(
        "gcode2krl part.nc -o part.src",
        "gcode2krl part.nc --cell cell.toml",
        "gcode2krl predict part.nc -o prediction/ --plot",
        "gcode2krl models check cell.toml",
    ),
    summaries=_COMMANDS,
    module="gcode2krl.cli.{}",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="gcode2krl")
def commands() -> None:
    """G-code in, a verified KUKA KRL program out.

    `gcode2krl part.nc -o part.src` translates; `gcode2krl COMMAND --help` explains a command. The program and
    what it writes are not safety functions.
    """


def main(args: list[str] | None = None) -> None:
    """Run the command line and leave with the exit code: 0 done, 1 refused, 2 not understood."""
    reserve_standard_files()
    for variable in MATRIX_VARIABLES:  # matrices are small: threads that wait took half of a diagnosis
        os.environ.setdefault(variable, "1")
    if "_GCODE2KRL_COMPLETE" in os.environ:
        import gcode2krl.cli.completion  # noqa: F401  (PowerShell is added to click's shells)
    code = _run(args)
    sys.exit(code if flushed() else 2)


def _run(args: list[str] | None) -> int:
    words = sys.argv[1:] if args is None else args
    head = Heading()
    console = Console("-q" in words or "--quiet" in words, "--json" in words, head)
    try:
        result: Any = commands.main(args=args, prog_name="gcode2krl", standalone_mode=False, obj=head)
        return int(result) if isinstance(result, int) else 0
    except Gcode2KrlError as error:
        console.findings(error.issues, error.source)
        console.explain_hint(error.issues)
        return _recorded(console, error, words)
    except click.exceptions.Abort:
        return console.failed("stopped", 130)
    except BrokenPipeError:
        return 2
    except Exception as error:
        if not _is_foreseen(error) and ("-v" in words or "--verbose" in words):
            raise
        ours = _as_ours(error)
        issue = ours.issues[0]
        console.failed(f"{issue.message} -> {issue.remedy}" if issue.remedy else issue.message, 2)
        return _recorded(console, ours, words)


def _recorded(console: Console, error: Gcode2KrlError, words: list[str]) -> int:
    """Print the record of a command that an error ended, under ``--json``; return the exit code."""
    if console.as_json and not console.heading.command:  # it ended before the command began
        console.heading.command = _command_in(words)
    return console.record({}, error.issues, exit_code=error.exit_code)


def _is_foreseen(error: Exception) -> bool:
    return isinstance(error, (click.ClickException, OSError, MemoryError, RecursionError))


def _as_ours(error: Exception) -> Gcode2KrlError:
    """Return the one line that a user gets of an error that is none of ours."""
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        return input_error("option-value", *_missing_subcommand(error))
    if isinstance(error, click.ClickException):
        return input_error("option-value", error.format_message(), _remedy(error))
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else "standard input or output: "
        sentence = f"{place}{error.strerror or error}"
        return input_error("output-unwritable", sentence, "check path, rights and space")
    if isinstance(error, (MemoryError, RecursionError)):
        return input_error("no-memory", f"not enough memory for this input ({type(error).__name__})")
    # a defect of the program: one line for the user, the rest on request
    sentence = f"internal error, please report it: {type(error).__name__}: {error}"
    return input_error("internal-error", sentence, "-v shows the details")


def _remedy(error: click.ClickException) -> str:
    """Return what to do about wrong words; several parts are what people try first."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    one_part = context is not None and context.info_name == "translate"
    if one_part and "unexpected extra argument" in error.format_message():
        return "`gcode2krl batch PARTS -o out/` translates several"
    return "`gcode2krl --help` lists the options"


def _command_in(words: list[str]) -> str:
    """Return the command that words name, ``translate`` where the first is none."""
    named = [word for word in words[:2] if not word.startswith("-")]
    if not named or named[0] not in _COMMANDS:
        return "translate"
    group = commands.get_command(click.Context(commands), named[0]) if len(named) > 1 else None
    is_of_group = isinstance(group, click.Group) and named[1] in group.list_commands(click.Context(group))
    return " ".join(named[: 2 if is_of_group else 1])


def _missing_subcommand(error: click.exceptions.NoArgsIsHelpError) -> tuple[str, str]:
    """Return message and remedy for a command without its subcommand."""
    context = error.ctx
    path = context.command_path if context is not None else "gcode2krl"
    command = context.command if context is not None else commands
    words = command.list_commands(context) if context and isinstance(command, click.Group) else []
    return f"{path}: name one of {', '.join(words)}", f"`{path} --help` tells more"


if __name__ == "__main__":
    main()
