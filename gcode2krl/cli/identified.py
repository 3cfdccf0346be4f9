"""What commands of `identify` share: an option, the section of a cell file that they write, their figure."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.errors import input_error
from gcode2krl.files import write_together

if TYPE_CHECKING:
    from matplotlib.figure import Figure


gravity_option = click.option(
    "--gravity",
    nargs=3,
    type=float,
    default=(0.0, 0.0, -1.0),
    show_default=True,
    metavar="X Y Z",
    help="Direction of gravity in the robot root.",
)


def section_in(file: Path, name: str, table: str = "") -> dict[str, Any]:
    """Return a section of a cell file, empty where it has none; raises where it or ``table`` is no table."""
    from gcode2krl.cell import library

    section = (library.read_toml(file) if file.exists() else {}).get(name, {})
    if not isinstance(section, dict) or not isinstance(section.get(table, {}), dict):
        raise input_error("cell-key", f"{name}: found no table", f"write [{name}]", source=str(file))
    return section


def write_section(file: Path, name: str, section: dict[str, Any]) -> Path:
    """Write a section into a cell file and keep its other keys; comments are lost.

    Raises `NotUnderstoodError` where that is no cell file, or cannot be written.
    """
    import tomli_w

    from gcode2krl.cell import library, resolve_cell

    data = (library.read_toml(file) if file.exists() else {}) | {name: section}
    resolve_cell(data, folder=file.parent, source=str(file))
    write_together({file: tomli_w.dumps(data).encode("utf-8")})
    return file


def save_figure(figure: "Figure", file: Path) -> Path:
    """Write a figure in the format of the file's ending."""
    picture = io.BytesIO()
    figure.savefig(picture, format=file.suffix.lower().removeprefix("."), dpi=130)
    write_together({file: picture.getvalue()})
    return file
