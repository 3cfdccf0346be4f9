"""``gcode2krl batch parts/ -o out/``: many parts on all cores or on a cluster, each computed once."""

import signal
import threading
import time
from pathlib import Path
from typing import Any, Self

import click

from gcode2krl.cli.batch_lines import Told, as_record, shown, table_lines
from gcode2krl.cli.cache import cache_options, chosen_cache
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    dialect_option,
    isolated_option,
    search_option,
    simplify_option,
    stated_options,
)

INTERRUPTED = 130


@click.command(
    "batch",
    epilog=examples(
        "gcode2krl batch parts/ -o out/",
        'gcode2krl batch "parts/**/*.nc" --cell cell.toml -o out/ --report',
        "gcode2krl batch parts/ -o out/ --processes 2 --strict --json",
    ),
)
@click.argument("parts", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="FOLDER", help="Where everything is written.")
@click.option(
    "--processes",
    type=click.IntRange(1, 1024),
    help="Worker processes; default: one a core, as memory allows.",
)
@click.option("--scheduler", metavar="tcp://…", help="Let the workers of a Dask cluster translate.")
@cache_options
@click.option("--against", metavar="FOLDER", help="Compare with the output of an earlier batch.")
@click.option("--cell", "cell_path", type=click.Path(), help="Cell file; default: the demonstration cell.")
@click.option("--job", "job_path", type=click.Path(), metavar="JOB.toml", help="Laid over the cell.")
@click.option("--tolerance", "tolerance_mm", type=float, metavar="MM", help="Blend corners within this.")
@click.option(
    "--chord-tolerance",
    "chord_tolerance_mm",
    default=0.01,
    show_default=True,
    metavar="MM",
    help="Largest error of the chords of an arc.",
)
@simplify_option
@dialect_option
@search_option
@isolated_option
@click.option("--block-delete", is_flag=True, help="Skip lines that begin with /.")
@click.option("--allow", multiple=True, metavar="CODE", help="Allow all findings of a code; may be repeated.")
@click.option("--strict", is_flag=True, help="Warnings refuse a program too.")
@click.option("--no-guard", is_flag=True, help="Leave out the checks at a program's start.")
@click.option(
    "--split",
    type=click.Choice(["defs", "files"]),
    default="defs",
    show_default=True,
    help="How a long program is split.",
)
@click.option("--max-lines", type=click.IntRange(100), help="Motions in a part; default: the cell's.")
@click.option(
    "--compensate", type=click.Choice(["offline"]), help="Move the targets against the predicted deflection."
)
@click.option(
    "--no-forces", is_flag=True, help="Leave out material removal, forces, deflection and their findings."
)
@click.option(
    "--pilot", type=click.Choice(["index", "values", "none"]), help="How a program carries the pilot."
)
@click.option(
    "--comment-every", type=click.IntRange(0, 10**9), help="Motions between comments with the G-code line."
)
@click.option("--report", is_flag=True, help="Write a page to look at beside each program.")
@click.option("-v", "--verbose", is_flag=True, help="Show details of an internal error.")
@click.option(
    "-q", "--quiet", is_flag=True, help="Print nothing but the findings of parts that were not written."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def command(
    parts: tuple[str, ...],
    output: str,
    processes: int | None,
    scheduler: str | None,
    no_cache: bool,
    cache_folder: str | None,
    cache_gb: float,
    against: str | None,
    cell_path: str | None,
    job_path: str | None,
    report: bool,
    isolated: bool,
    verbose: bool,
    quiet: bool,
    as_json: bool,
    **options: Any,
) -> int:
    """Translate many parts: folders, patterns, files, @lists, or a TOML file with a cell a folder.

    A bad part does not stop the others, and what was computed before is taken from the cache. Exit code 0:
    every part was written; 1: some were not; 2: an option or a cell is not understood.
    """
    began_s = time.perf_counter()
    from gcode2krl.batch.parts import find_parts
    from gcode2krl.batch.planning import plan
    from gcode2krl.batch.results import earlier_files, read_results, remove_outdated, write_results
    from gcode2krl.batch.run import cluster_at, crew_for, run_batch
    from gcode2krl.files import make_folder, watched
    from gcode2krl.translation import Order

    console = Console(quiet, as_json)
    before = read_results(Path(against)) if against is not None else None
    cell, job = (None if path is None else Path(path) for path in (cell_path, job_path))
    stated = None if isolated else stated_options(click.get_current_context())
    planned = plan(find_parts(parts, cell, job), Order("", **options), report, stated)
    cache = None if no_cache else chosen_cache(cache_folder, cache_gb)
    out = Path(output)
    make_folder(out)
    workers = crew_for(processes) if scheduler is None else cluster_at(scheduler)
    click.get_current_context().with_resource(watched(folder=out))
    earlier, batch, stopped = earlier_files(out), Told(len(planned)), False
    with _Stops() as stops:
        try:
            with shown(console, batch) as show:
                for line in run_batch(planned, out, workers, cache):
                    remove_outdated(out, earlier.get(line.record["part"], {}), line.record)
                    show(line)
            stops.are_heeded = False
        except KeyboardInterrupt:
            stops.are_heeded, stopped = False, True
        files = write_results(out, batch.records, before)
    seconds = time.perf_counter() - began_s
    code = INTERRUPTED if stopped else batch.exit_code
    if as_json:
        given = Order("", **options).options() | ({"report": True} if report else {})
        console.json(as_record(batch, files, seconds, given))
    for text in table_lines(batch, out, seconds, stopped):
        console.say(text)
    return code


class _Stops:
    """Ctrl-C, and the signal with which a CI service ends a job: they stop the batch, not its results."""

    def __init__(self) -> None:
        self.are_heeded = True
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is not threading.main_thread():  # only that one may
            return self
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:  # as a shell leaves it in the background
                self._before[number] = signal.signal(number, self._stop)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _stop(self, _number: int, _frame: object) -> None:
        if self.are_heeded:
            raise KeyboardInterrupt
