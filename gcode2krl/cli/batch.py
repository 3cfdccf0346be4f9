"""``gcode2krl batch parts/ -o out/``: many parts on all cores or on a cluster, each computed once."""

import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import click

from gcode2krl.batch import VERDICTS
from gcode2krl.cli.cache import cache_options, chosen_cache
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    VERBOSE,
    dialect_option,
    isolated_option,
    search_option,
    simplify_option,
    stated_options,
)
from gcode2krl.cli.standard_files import tell
from gcode2krl.errors import Issue, told
from gcode2krl.progress import Progress, unheard

if TYPE_CHECKING:
    from gcode2krl.batch.run import Line

# What a batch prints: a line a finished part, one bar, and the table at the end.

Record = dict[str, Any]
Show = Callable[["Line"], None]
_COLOURS = dict(zip(VERDICTS, ("green", "red", "red"), strict=True))
_MOST_FINDINGS = 3
"""Of a part that was not written; the rest is counted, and stands in ``results.jsonl``."""


class Told:
    """The finished parts of a batch."""

    def __init__(self, parts: int) -> None:
        """Take the number of parts."""
        self.parts = parts
        self.records: list[Record] = []

    @property
    def counts(self) -> Counter[str]:
        """How many there are of each verdict, and how many of them came from the cache."""
        verdicts = Counter(VERDICTS[record["exit_code"]] for record in self.records)
        verdicts["cached"] = sum(record["cached"] for record in self.records)
        return verdicts

    @property
    def exit_code(self) -> int:
        """0 where every part was written, else 1."""
        return 0 if self.counts["written"] == self.parts else 1


@contextmanager
def shown(console: Console, told_so_far: Told) -> Iterator[Show]:
    """Yield the function that shows a finished part, below which a terminal has a bar of the whole batch."""
    with _bar(console) as (say, progress):
        progress(0.0, 1.0)

        def show(line: "Line") -> None:
            told_so_far.records.append(line.record)
            if not console.quiet:
                say(part_line(line.record))
            for text in finding_lines(line.record):
                say(text)
            progress(line.share, 1.0)

        yield show


@contextmanager
def _bar(console: Console) -> Iterator[tuple[Callable[[str], None], Progress]]:
    """Yield how to print a line and how to move the bar; on a terminal lines appear above it."""
    if console.quiet or not sys.stderr.isatty():
        yield tell, unheard
        return
    from rich.console import Console as Terminal
    from rich.text import Text

    from gcode2krl.cli.terminal_bars import bars

    terminal = Terminal(stderr=True)
    with bars(terminal) as begin:
        yield (
            lambda text: terminal.print(Text.from_ansi(text), soft_wrap=True),
            begin("translating"),
        )


def part_line(record: Record) -> str:
    """Return the line of a part: what became of it, and its figures."""
    verdict = VERDICTS[record["exit_code"]]
    figures = [
        f"{record[key]:.{digits}f} {unit}"
        for key, digits, unit in (("time_s", 1, "s"), ("max_force_N", 0, "N"), ("max_deflection_mm", 3, "mm"))
        if record.get(key) is not None
    ]
    took = "cached" if record["cached"] else f"{record['seconds']:.1f} s"
    head = click.style(f"{verdict:<14}", fg=_COLOURS[verdict])
    return f"{head} {record['part']}  {', '.join(figures)}{'  ' if figures else ''}[{took}]"


def finding_lines(record: Record) -> Iterator[str]:
    """Yield the findings that kept a part from being written."""
    if record["exit_code"] == 0:
        return
    source = record["input"]["file"] if record["input"] else record["part"]
    issues = [
        Issue(issue["severity"], issue["code"], issue["line"], issue["message"], issue["remedy"])
        for issue in record["issues"]
    ]
    lines = told(issues).findings
    for finding in lines[:_MOST_FINDINGS]:
        yield f"  {finding.text(source)}"
    if len(lines) > _MOST_FINDINGS:
        yield f"  … and {len(lines) - _MOST_FINDINGS} more"


def table_lines(batch: Told, out: Path, seconds: float, stopped: bool) -> Iterator[str]:
    """Yield the table at the end."""
    counts = batch.counts
    computed_s = sum(record["seconds"] for record in batch.records if not record["cached"])
    yield f"{'parts':<14}{batch.parts:>7,}"
    for verdict in VERDICTS:
        yield f"{verdict:<14}{counts[verdict]:>7,}"
    if stopped:
        yield f"{'left':<14}{batch.parts - len(batch.records):>7,}   the same command goes on from here"
    yield f"{'cached':<14}{counts['cached']:>7,}"
    yield f"{'time':<14}{seconds:>7.1f} s, {computed_s:.1f} s of workers"
    yield f"{out / 'index.html'} shows all of them"
    # These import the report's page, which --help must not wait for.
    from gcode2krl.batch.written.part import parts_of
    from gcode2krl.batch.written.words import demonstration

    if warning := demonstration(parts_of(batch.records)):
        yield click.style(warning, fg="yellow")


def as_record(batch: Told, files: list[Path], seconds: float, options: Record) -> Record:
    """Return the object that ``--json`` prints."""
    from gcode2krl.result import hashes_of, record_of

    counts = batch.counts
    figures = {
        "parts": batch.parts,
        **{name.replace(" ", "_"): counts[name] for name in (*VERDICTS, "cached")},
        "left": batch.parts - len(batch.records),
        "seconds": round(seconds, 3),
    }
    whole = record_of(
        "batch", figures, exit_code=batch.exit_code, options=options, files=hashes_of(map(str, files))
    )
    kinds = ("errors", "warnings", "notes")
    return whole | {
        "counts": {kind: sum(record["counts"][kind] for record in batch.records) for kind in kinds}
    }


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
@click.option(
    "--tools",
    "tools_path",
    type=click.Path(),
    metavar="LIBRARY",
    help="Tools that the cells do not have, as `tools import` reads them.",
)
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
@VERBOSE
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
