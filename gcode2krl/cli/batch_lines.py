"""What a batch prints: a line a finished part, one bar, and the table at the end."""

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.batch import VERDICTS
from gcode2krl.cli.console import Console
from gcode2krl.cli.standard_files import tell
from gcode2krl.errors import Issue, told
from gcode2krl.progress import Progress, unheard

if TYPE_CHECKING:
    from gcode2krl.batch.run import Line

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
        Issue(each["severity"], each["code"], each["line"], each["message"], each["remedy"])
        for each in record["issues"]
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
    found = record_of(
        "batch", figures, exit_code=batch.exit_code, options=options, files=hashes_of(map(str, files))
    )
    kinds = ("errors", "warnings", "notes")
    return found | {
        "counts": {kind: sum(record["counts"][kind] for record in batch.records) for kind in kinds}
    }
