"""``gcode2krl install-hook freecad``: a post processor in FreeCAD's list."""

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import VERBOSE, read_cell
from gcode2krl.errors import input_error

POST = "gcode2krl_post.py"
_SOURCE = Path(__file__).parent / "hooks" / "freecad_post.py"
_MACRO_PATH = re.compile(r'<FCText Name="MacroPath">([^<]+)</FCText>')


@click.command(
    "install-hook",
    epilog=examples(
        "gcode2krl install-hook freecad --cell cell.toml",
        "gcode2krl install-hook freecad --folder macros/",
        "gcode2krl install-hook freecad --remove",
    ),
)
@click.argument("cam", type=click.Choice(["freecad"]))
@click.option(
    "--cell", "cell_path", type=click.Path(), help="Cell file of the programs; absolute or from here."
)
@click.option("--folder", metavar="DIR", help="FreeCAD's macro folder, where it is not found.")
@click.option("--remove", is_flag=True, help="Remove the hook again.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings.")
@VERBOSE
def command(cam: str, cell_path: str | None, folder: str | None, remove: bool, quiet: bool) -> int:
    """Put gcode2krl into a CAM system's list of post processors.

    FreeCAD's own LinuxCNC post writes the G-code, the job's cutters and stock are handed over, findings stand
    in the report view, and the post fails where the program is refused.
    """
    console = Console(quiet)
    folders = [_stated(folder)] if folder is not None else list(macro_folders())
    if remove:
        return _remove(folders, console)
    if not folders:
        sentence = "no FreeCAD of this user was found"
        remedy = "start FreeCAD once, or give --folder, the macro folder of its settings"
        raise input_error("option-value", sentence, remedy)
    cell = ""
    if cell_path is not None:
        read_cell(cell_path)
        cell = str(Path(cell_path).resolve())
    text = hook_text(sys.executable, Path(__file__).resolve().parents[2], cell)
    for place in folders:
        place.mkdir(exist_ok=True)
        (place / POST).write_text(text, encoding="utf-8", newline="\n")
        console.say(f"{place / POST} written")
    console.say("Choose the post processor gcode2krl in the job's output settings; docs/cam.md shows how.")
    if not cell:
        console.hint("no --cell: programs are made for the demonstration cell and begin with a HALT")
    return 0


def hook_text(python: str, packages: Path, cell: str) -> str:
    """Return the post with the Python that runs gcode2krl, the folder of its packages, and the cell."""
    text = _SOURCE.read_text(encoding="utf-8")
    for name, value in (("PYTHON", python), ("PACKAGES", str(packages)), ("CELL", cell)):
        empty = f'\n{name} = ""\n'
        if text.count(empty) != 1:
            raise AssertionError(f"the hook has no setting {name}")
        text = text.replace(empty, f"\n{name} = {value!a}\n")
    return text


def macro_folders() -> Iterator[Path]:
    """Yield the macro folders of the FreeCAD versions that this user has started."""
    for data, settings in _homes():
        versions = sorted(data.glob("v*-*")) if data.is_dir() else []
        for folder in (data, *versions):
            below = folder.relative_to(data)
            config = settings / below / "user.cfg"
            if config.is_file() or (folder / "Macro").is_dir():
                yield _macro_path(config) or folder / "Macro"


def _homes() -> Iterator[tuple[Path, Path]]:
    """Yield where FreeCAD keeps data and settings: Windows, macOS, Linux."""
    home = Path.home()
    if sys.platform == "win32":
        data = Path(os.environ.get("APPDATA") or home / "AppData" / "Roaming") / "FreeCAD"
        yield data, data
    elif sys.platform == "darwin":
        data = home / "Library" / "Application Support" / "FreeCAD"
        yield data, home / "Library" / "Preferences" / "FreeCAD"
    else:
        share = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
        config = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config")
        yield share / "FreeCAD", config / "FreeCAD"


def _macro_path(config: Path) -> Path | None:
    """Return the macro folder that the user has set in FreeCAD's preferences."""
    try:
        macro_path = _MACRO_PATH.search(config.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    place = Path(macro_path[1]) if macro_path is not None else None
    return place if place is not None and place.is_dir() else None


def _stated(folder: str) -> Path:
    place = Path(folder)
    if not place.is_dir():
        raise input_error("option-value", "--folder: there is no such folder", "name it", source=folder)
    return place


def _remove(folders: list[Path], console: Console) -> int:
    """Remove the hook where it is."""
    there = [place / POST for place in folders if (place / POST).is_file()]
    for file in there:
        file.unlink()
        console.say(f"{file} removed")
    if not there:
        console.say("no hook was there")
    return 0
