"""``gcode2krl diagnose prediction/ run/ [more runs]``: where reality differs, why, and how far it shrinks."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    cell_files,
    common_options,
    effect_files,
    read_cell,
    require_folder,
    require_outputs,
)
from gcode2krl.errors import Gcode2KrlError, input_error

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.gap import Gap


@click.command(
    "diagnose",
    epilog=examples(
        "gcode2krl diagnose prediction/ run-1/ run-2/",
        "gcode2krl diagnose prediction/ run-1/ run-2/ --holdout run-3/ --html gap.html",
        "gcode2krl diagnose --from-log run-1/",
        "gcode2krl diagnose prediction/ my.csv",
    ),
)
@click.argument("folders", nargs=-1, required=True, metavar="[PREDICTION] RUN…")
@click.option("--holdout", multiple=True, metavar="RUN", help="Run that only tests; may be repeated.")
@click.option("--effects", multiple=True, metavar="FOLDER", help="Folder with your own effects; repeatable.")
@click.option("--from-log", is_flag=True, help="No prediction: compare the logged signals with one another.")
@click.option("--apply", "apply_to", metavar="CELL.toml", help="Write the named causes into this cell file.")
@click.option("--html", metavar="GAP.html", help="Write the answer as one page that needs no network.")
@click.option(
    "--plot", metavar="FOLDER", help="Draw each run: over time, on the path, by what it depends on."
)
@common_options
def command(
    folders: tuple[str, ...],
    holdout: tuple[str, ...],
    effects: tuple[str, ...],
    from_log: bool,
    apply_to: str | None,
    html: str | None,
    plot: str | None,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Say where measured runs differ from their prediction, which effects explain it, and how far it shrinks.

    A run is a folder, or a log of another program if its columns are certain: see `gcode2krl runs import`.
    Without --holdout each run is held out in turn; with it, the runs it names only test. Exit code 0 whenever
    a diagnosis was made, whatever it found.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(*folders, *holdout)
        data: list[str | Path] = [*folders, *holdout, *effect_files(effects)]
        _require_writable(apply_to, html, plot, data, cell_path)
        gap = _diagnosis(folders, holdout, effects, from_log, cell_path, console)
        sources = [Path(folder).name for folder in folders[0 if from_log else 1 :]]
        added = _apply(gap, apply_to, cell_path, sources)
        written = _written(gap, html, plot, [*data, *cell_files(cell_path)], console)
    except Gcode2KrlError as error:
        return console.refused(error, ["verdict"])
    if as_json:
        applied = [Path(apply_to)] if apply_to is not None else []
        return console.record(_figures(gap), gap.issues, files=[*written, *applied])
    from gcode2krl.gap import text_report

    console.findings(gap.issues, "")
    console.say(text_report(gap))
    if apply_to is not None:
        console.say(f"{apply_to}: {added} effect{'' if added == 1 else 's'} added")
    for file in written:
        console.hint(f"{file} written")
    return 0


def _figures(gap: "Gap") -> dict[str, Any]:
    """Return the object of a diagnosis as figures of a record, whose own schema the record names first."""
    figures = gap.as_dict()
    return {"gap_schema": figures.pop("schema"), **figures}


def _require_writable(
    apply_to: str | None, html: str | None, plot: str | None, data: list[str | Path], cell_path: str | None
) -> None:
    """Refuse outputs that cannot be written before the work begins, not after it."""
    require_outputs([Path(each) for each in (apply_to, html) if each is not None], *data)
    if html is not None:
        require_outputs([Path(html)], *cell_files(cell_path))
    require_folder(plot, (), ())


def _written(
    gap: "Gap", html: str | None, plot: str | None, inputs: list[str | Path], console: Console
) -> list[Path]:
    """Write the page and the pictures that are asked for; return the files."""
    if html is None and plot is None:
        return []
    from gcode2krl.gap.answer.drawing import write_page, write_pictures

    written = []
    with console.stage("drawing"):
        if plot is not None:
            written += write_pictures(gap, Path(plot), inputs)
        if html is not None:
            write_page(gap, Path(html), inputs)
            written.append(Path(html))
    return written


def _diagnosis(
    folders: tuple[str, ...],
    holdout: tuple[str, ...],
    effects: tuple[str, ...],
    from_log: bool,
    cell_path: str | None,
    console: Console,
) -> "Gap":
    """Return the diagnosis of the runs in some folders; without ``from_log`` the first is a prediction."""
    from gcode2krl.gap import diagnose, diagnose_log
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs.foreign import run_or_log

    if not from_log and len(folders) < 2:
        remedy = "name a prediction and its runs, or use --from-log"
        raise input_error("no-runs", "there is no run to diagnose", remedy, source=folders[0])
    names = folders if from_log else folders[1:]
    with console.stages() as begin:
        reading = begin("reading runs")
        prediction = None if from_log else Prediction.load(folders[0])
        read = []
        for name in (*names, *holdout):
            read.append(run_or_log(name, prediction, partial=from_log))
            reading(len(read), len(names) + len(holdout))
        runs, held = read[: len(names)], read[len(names) :]
        if prediction is None:
            return diagnose_log(runs, _cell(cell_path), held, effects=effects, begin=begin)
        console.heading.has_cell(prediction.cell, None)
        return diagnose(prediction, runs, held, effects=effects, begin=begin)


def _cell(path: str | None) -> "Cell | None":
    if path is None:
        return None
    return read_cell(path)


def _apply(gap: "Gap", apply_to: str | None, cell_path: str | None, sources: list[str]) -> int:
    """Write the named causes into a cell file, where one is given; return how many."""
    if apply_to is None:
        return 0
    from gcode2krl.gap.answer.result import apply_to_cell

    return apply_to_cell(gap, Path(apply_to), Path(cell_path) if cell_path else None, sources)
