"""``gcode2krl diagnose prediction/ run/ [more runs]``: where reality differs, and why."""

from pathlib import Path
from typing import Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.inputs import common_options, effect_files, require_other
from gcode2krl.errors import Gcode2KrlError, input_error


@click.command("diagnose")
@click.argument("folders", nargs=-1, required=True, metavar="[PREDICTION] RUN…")
@click.option("--holdout", multiple=True, metavar="RUN", help="Run used for testing only; may be repeated.")
@click.option(
    "--effects", multiple=True, metavar="FOLDER", help="Folder with your own effects; may be repeated."
)
@click.option("--from-log", is_flag=True, help="No prediction: compare commanded and actual values of logs.")
@click.option("--apply", "apply_to", metavar="CELL.toml", help="Write the named causes into this cell file.")
@common_options
def command(
    folders: tuple[str, ...],
    holdout: tuple[str, ...],
    effects: tuple[str, ...],
    from_log: bool,
    apply_to: str | None,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> int:
    """Say where measured runs differ from their prediction, which effects explain it, and how far it shrinks.

    Each of several runs is held out in turn; those named with --holdout are used for testing only. Exit code
    0 whenever a diagnosis was made, whatever it found.
    """
    console = Console(quiet, as_json)
    try:
        if apply_to is not None:
            require_other(Path(apply_to), *folders, *holdout, *effect_files(effects))
        gap = _diagnosis(folders, holdout, effects, from_log, cell_path, console)
        added = _apply(
            gap, apply_to, cell_path, [Path(each).name for each in folders[0 if from_log else 1 :]]
        )
    except Gcode2KrlError as error:
        if not as_json:
            raise
        from gcode2krl.cli.console import issue_dicts

        console.json({"schema": "gcode2krl/gap/1", "verdict": None, "issues": issue_dicts(error.issues)})
        return error.exit_code
    if as_json:
        console.json(gap.as_dict())
        return 0
    from gcode2krl.gap import text_report

    console.findings(gap.issues, "")
    console.say(text_report(gap))
    if apply_to is not None:
        console.say(f"{apply_to}: {added} effect{'' if added == 1 else 's'} added")
    return 0


def _diagnosis(
    folders: tuple[str, ...],
    holdout: tuple[str, ...],
    effects: tuple[str, ...],
    from_log: bool,
    cell_path: str | None,
    console: Console,
) -> Any:
    from gcode2krl.gap import diagnose, diagnose_log
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs import load_run

    if not from_log and len(folders) < 2:
        raise input_error(
            "no-runs",
            "there is no run to diagnose",
            "name a prediction and its runs, or use --from-log",
            source=folders[0],
        )
    names = folders if from_log else folders[1:]
    with console.progress("reading", len(names) + len(holdout)) as advance:
        runs, held = [], []
        for name in names:
            runs.append(load_run(name, partial=from_log))
            advance(1)
        for name in holdout:
            held.append(load_run(name, partial=from_log))
            advance(1)
    if from_log:
        return diagnose_log(runs, _cell(cell_path), held, effects=effects)
    return diagnose(Prediction.load(folders[0]), runs, held, effects=effects)


def _cell(path: str | None) -> Any:
    if path is None:
        return None
    from gcode2krl.cell import load_cell

    return load_cell(path)


def _apply(gap: Any, apply_to: str | None, cell_path: str | None, sources: list[str]) -> int:
    if apply_to is None:
        return 0
    from gcode2krl.gap.tell.cell_effects import apply_to_cell

    return int(apply_to_cell(gap, Path(apply_to), Path(cell_path) if cell_path else None, sources))
