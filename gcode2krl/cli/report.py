"""``gcode2krl report prediction/ -o report.html``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcode2krl.cli.allowed import as_allowed
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import VERBOSE, existing
from gcode2krl.cli.nominal import HASH_KEY, KEY, compared, on_page
from gcode2krl.errors import Gcode2KrlError, input_error
from gcode2krl.translation.page import part_of, require_report, stock_corners_mm, text_of

if TYPE_CHECKING:
    from gcode2krl.prediction import Prediction


@click.command("report", epilog=examples("gcode2krl report prediction/ -o report.html"))
@click.argument("folder", metavar="PREDICTION")
@click.option("-o", "--output", metavar="REPORT.html", help="The page; default: beside the prediction.")
@click.option(
    "--gcode", metavar="PART.nc", help="The G-code, where it no longer lies where it was predicted from."
)
@click.option(
    "--nominal", metavar="PART.stl", help="The nominal part, where it no longer lies where it was given."
)
@VERBOSE
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def command(
    folder: str,
    output: str | None,
    gcode: str | None,
    nominal: str | None,
    quiet: bool,
    as_json: bool,
) -> int:
    """Show a prediction as one page for a browser: 3D path, robot, plots and G-code, linked.

    The page needs no network. It is written by `gcode2krl part.nc --report part.html` too.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(folder, gcode, nominal)
        place = Path(folder)
        file = Path(output) if output is not None else place.with_name(f"{place.resolve().name}.html")
        files = [*place.glob("*")] if place.is_dir() else []
        require_report(str(file), existing(gcode, nominal, *files))
        from gcode2krl.clearance import obstacle_meshes
        from gcode2krl.prediction import Prediction
        from gcode2krl.report.page import content_of, write_page

        with console.stage("drawing"):
            prediction = Prediction.load(place)
            console.heading.has_cell(prediction.cell, None)
            text = text_of(_gcode_file(prediction, place, gcode))
            stock_mm = stock_corners_mm(prediction.toolpath, prediction.cell)
            mesh = _nominal_file(prediction, place, nominal)
            nominal_on_page = on_page(compared(prediction, mesh)) if mesh is not None else None
            meshes_mm = obstacle_meshes(prediction.cell)
            part = part_of(prediction)
            content = content_of(
                prediction,
                issues=as_allowed(prediction),
                text=text,
                stock_mm=stock_mm,
                meshes_mm=meshes_mm,
                nominal=nominal_on_page,
                part=part,
            )
            write_page(content, file, files)
    except Gcode2KrlError as error:
        return console.refused(error)
    if as_json:
        return console.record({}, as_allowed(prediction), files=[file])
    if mesh is None and KEY in prediction.inputs:
        console.hint(
            f"{prediction.inputs[KEY]} is not at hand: the page does not compare with it; --nominal names it"
        )
    if text is None:
        console.hint(
            f"{prediction.toolpath.source or 'the G-code'} is not at hand: the page has no G-code text"
        )
    console.say(f"{folder} -> {file} ({file.stat().st_size / 1e6:.2f} MB): open it in a browser")
    return 0


def _gcode_file(prediction: "Prediction", folder: Path, given: str | None) -> str | None:
    """Return the file with the program's G-code: as given, or where it was predicted from if unchanged."""
    if given is not None:
        if not Path(given).is_file():
            raise input_error("file-unreadable", "cannot read: no such file", "name the G-code", source=given)
        return given
    return _unchanged(prediction.toolpath.source, folder, prediction.inputs.get("program_sha256"))


def _nominal_file(prediction: "Prediction", folder: Path, given: str | None) -> str | None:
    """Return the mesh of the nominal part: as given, or that of the prediction if unchanged."""
    named = prediction.inputs.get(KEY, "")
    return given or _unchanged(str(named), folder, prediction.inputs.get(HASH_KEY))


def _unchanged(named: str, folder: Path, wanted_sha256: object) -> str | None:
    """Return a file where it is named, or beside the prediction, if its content is still the same."""
    from hashlib import sha256

    for file in (Path(named), folder.parent / Path(named).name) if named else ():
        if file.is_file() and wanted_sha256 in (None, sha256(file.read_bytes()).hexdigest()):
            return str(file)
    return None
