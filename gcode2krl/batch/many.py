"""Predictions of many parts from Python: `predict` in several processes, in the order of the parts."""

from collections.abc import Iterable, Iterator
from inspect import signature
from pathlib import Path
from typing import Any, Literal, overload

from gcode2krl.batch.crew import crew_of
from gcode2krl.batch.free_memory import expected_mb
from gcode2krl.batch.parts import find_parts
from gcode2krl.batch.results import why_failed
from gcode2krl.cell import Cell, load_cell
from gcode2krl.errors import Gcode2KrlError, NotUnderstoodError
from gcode2krl.files.program_names import likely_text_bytes
from gcode2krl.prediction import Prediction
from gcode2krl.translation.from_python import predict

_AHEAD = 2
"""So many predictions for each process wait at most until it is their turn."""
_Task = tuple[Path, Cell | None, dict[str, Any]]


@overload
def predict_many(
    parts: str | Path | Iterable[str | Path],
    cell: Cell | None = ...,
    *,
    processes: int | None = ...,
    errors: Literal["raise"] = ...,
    **options: Any,
) -> Iterator[Prediction]: ...


@overload
def predict_many(
    parts: str | Path | Iterable[str | Path],
    cell: Cell | None = ...,
    *,
    processes: int | None = ...,
    errors: Literal["keep"],
    **options: Any,
) -> Iterator[Prediction | Gcode2KrlError]: ...


def predict_many(
    parts: str | Path | Iterable[str | Path],
    cell: Cell | None = None,
    *,
    processes: int | None = None,
    errors: Literal["raise", "keep"] = "raise",
    **options: Any,
) -> Iterator[Prediction] | Iterator[Prediction | Gcode2KrlError]:
    """Yield the prediction of each part, in the order of the parts; several are computed at once.

    ``parts`` are files, or one folder or pattern, whose files come sorted by name. ``processes`` is by
    default one a core, as far as the memory suffices; ``options`` are those of `predict`. A part that cannot
    be predicted raises its `Gcode2KrlError` when it is its turn; with ``errors="keep"`` the error takes the
    place of the prediction, and the parts after it follow. Only few predictions wait in memory.

    >>> from gcode2krl import load_cell, predict_many
    >>> for prediction in predict_many("*.nc", load_cell("cell.toml"), processes=2):
    ...     print(prediction.toolpath.source, f"{prediction.forces.peak_N.max():.0f} N")
    part.nc ... N
    """
    if isinstance(parts, str | Path):
        files = [part.file for part in find_parts([str(parts)])]
    else:
        files = [Path(part) for part in parts]
    signature(predict).bind("", cell, **options)  # a wrong option is an error here, not in every worker
    shared = load_cell() if cell is None and not options.get("project") else cell
    return _predictions([(file, shared, options) for file in files], processes, errors == "keep")


def _predictions(tasks: list[_Task], processes: int | None, keep: bool) -> Iterator[Any]:
    costs_mb = [expected_mb(_size_bytes(file), whole_tables=True) for file, _, _ in tasks]
    with crew_of(processes, costs_mb) as crew:
        for answer in crew.answers(_predicted, tasks, costs_mb, ahead=_AHEAD * crew.processes):
            source = str(tasks[answer.task][0])
            value = NotUnderstoodError(why_failed(answer.failure), source) if answer.failure else answer.value
            if isinstance(value, Gcode2KrlError) and not keep:
                raise value
            yield value


def _predicted(task: _Task) -> Prediction | Gcode2KrlError:
    """Carry out a task in a worker."""
    file, cell, options = task
    try:
        return predict(file, cell, **options)
    except Gcode2KrlError as error:
        return error


def _size_bytes(file: Path) -> int:
    try:
        return likely_text_bytes(file)
    except OSError:  # reading it reports it
        return 0
