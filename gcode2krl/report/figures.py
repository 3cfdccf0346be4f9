"""Figures to files and to notebooks."""

from collections.abc import Iterable, Mapping
from functools import partial
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from gcode2krl.files import make_folder, write_together
from gcode2krl.report.drawing import look

_DPI = 150


def save_figures(
    figures: Mapping[str, Figure], folder: Path, inputs: Iterable[str | Path] = ()
) -> list[Path]:
    """Write each figure as ``<name>.png`` at 150 dpi and return the paths, in the order of ``figures``.

    The folder is made if its parent exists. The same figures give the same bytes: no date is written.
    ``inputs`` are never overwritten.
    """
    make_folder(folder)
    files = {
        folder / f"{name}.png": partial(figure.savefig, format="png", dpi=_DPI, metadata={"Software": None})
        for name, figure in figures.items()
    }
    with look():
        write_together(files, inputs)
    return list(files)


def shown_in_notebooks(figure: Figure) -> Figure:
    """Return a figure that a notebook shows as a picture, also where nobody has imported pyplot.

    Jupyter learns to draw figures when pyplot is imported; until then it would print the figure's size.
    """
    vars(figure)["_repr_png_"] = partial(_as_png, figure)
    return figure


def _as_png(figure: Figure) -> bytes:
    buffer = BytesIO()
    with look():
        figure.savefig(buffer, format="png")
    return buffer.getvalue()
