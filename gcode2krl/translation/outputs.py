"""Refusals before the work begins: outputs that are inputs, that have no folder, or a wrong ending."""

from collections.abc import Iterable
from pathlib import Path

from gcode2krl.errors import input_error
from gcode2krl.translation.inputs import cell_files, existing

FIGURES = ("png", "svg", "pdf")
PAGES = (".html", ".htm")


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


def require_figure(name: str | Path | None) -> None:
    """Refuse the name of a figure that cannot be drawn."""
    if name is not None and Path(name).suffix.lower().removeprefix(".") not in FIGURES:
        sentence = f"figure {Path(name).name!r}: allowed endings {', '.join(FIGURES)}"
        raise input_error("option-value", sentence, "name it figure.png", source=str(name))


def require_fit_outputs(plot: str | None, apply_to: str | None, cell: str | None, *data: str | None) -> None:
    """Refuse outputs of a fit: a figure over any input, a cell file over the data (over the cell it may)."""
    require_figure(plot)
    if apply_to is not None:
        require_other(Path(apply_to), *data)
    if plot is not None:
        require_other(Path(plot), apply_to, *data, *cell_files(cell))
