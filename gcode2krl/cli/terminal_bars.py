"""Bars of a terminal: one a stage, with its share and remaining time."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

from rich.console import Console as Terminal
from rich.progress import (
    BarColumn,
    ProgressColumn,
    Task,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.progress import Progress as Bars
from rich.text import Text

from gcode2krl.progress import Begin, Paced, Progress

_A_SECOND = 5
"""Updates while nothing is told, for the time that has passed."""


class _Left(ProgressColumn):
    """Remaining time of a stage that says how far it is."""

    def render(self, task: Task) -> Text:
        """Return the text of a bar."""
        left_s = task.time_remaining
        if left_s is None or task.finished:
            return Text("")
        return Text(f"{timedelta(seconds=round(left_s))} left")


@contextmanager
def bars(terminal: Terminal | None = None) -> Iterator[Begin]:
    """Show the stages of a command on standard error; yields the function that begins one.

    A stage that does not say how far it is has a moving bar and the time since its beginning.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        _Left(),
    )
    shown = Bars(
        *columns, console=terminal or Terminal(stderr=True), transient=True, refresh_per_second=_A_SECOND
    )
    running: list[TaskID] = []

    def begin(stage: str) -> Progress:
        for task in running:
            shown.update(task, completed=1.0, total=1.0)
            shown.stop_task(task)
        task = shown.add_task(stage, total=None)
        running[:] = [task]
        return Paced(lambda done, total: shown.update(task, completed=done, total=total or None))

    with shown:
        yield begin
