"""``gcode2krl report prediction/ -o report.html``, and the page beside a translation."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcode2krl.cli.console import Console, issue_dicts
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import STANDARD, cell_files, existing, require_outputs
from gcode2krl.cli.nominal import HASH_KEY, KEY, compared, on_page
from gcode2krl.errors import Gcode2KrlError, Issue, input_error

if TYPE_CHECKING:
    from gcode2krl.arrays import Floats
    from gcode2krl.cell import Cell
    from gcode2krl.prediction import Prediction
    from gcode2krl.report.page import Content
    from gcode2krl.tables import Toolpath

ENDINGS = (".html", ".htm")
_LARGEST_TEXT = 400_000_000


@click.command("report", epilog=examples("gcode2krl report prediction/ -o report.html"))
@click.argument("folder", metavar="PREDICTION")
@click.option("-o", "--output", metavar="REPORT.html", help="The page; default: beside the prediction.")
@click.option(
    "--gcode", metavar="PART.nc", help="The G-code, where it no longer lies where it was predicted from."
)
@click.option(
    "--nominal", metavar="PART.stl", help="The nominal part, where it no longer lies where it was given."
)
@click.option("-v", "--verbose", is_flag=True, help="Show details of an internal error.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
def command(
    folder: str,
    output: str | None,
    gcode: str | None,
    nominal: str | None,
    verbose: bool,
    quiet: bool,
    as_json: bool,
) -> int:
    """Show a prediction as one page for a browser: 3D path, robot, plots and G-code, linked.

    The page needs no network. It is written by `gcode2krl part.nc --report part.html` too.
    """
    console = Console(quiet, as_json)
    try:
        place = Path(folder)
        file = Path(output) if output is not None else place.with_name(f"{place.resolve().name}.html")
        files = [*place.glob("*")] if place.is_dir() else []
        require_report(str(file), existing(gcode, nominal, *files))
        from gcode2krl.prediction import Prediction
        from gcode2krl.report.page import content_of, write_page

        with console.stage("drawing"):
            prediction = Prediction.load(place)
            text = _text_of(_gcode_file(prediction, place, gcode))
            stock_mm = _stock_mm(prediction.toolpath, prediction.cell)
            mesh = _nominal_file(prediction, place, nominal)
            beside = on_page(compared(prediction, mesh)) if mesh is not None else None
            content = content_of(prediction, text=text, stock_mm=stock_mm, nominal=beside)
            write_page(content, file, files)
    except Gcode2KrlError as error:
        if not as_json:
            raise
        console.json({"files": [], "issues": issue_dicts(error.issues)})
        return error.exit_code
    if as_json:
        console.json({"files": [str(file)], "issues": issue_dicts(prediction.issues)})
        return 0
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


def require_report(report: str | None, inputs: list[Path]) -> None:
    """Refuse the name of a page that cannot be written."""
    if report is None:
        return
    if Path(report).suffix.lower() not in ENDINGS:
        sentence = f"report {Path(report).name!r}: allowed endings {', '.join(ENDINGS)}"
        raise input_error("option-value", sentence, "name it report.html", source=report)
    require_outputs([Path(report)], *inputs)


def report_written(
    report: str | None,
    part: str,
    prediction: "Prediction",
    issues: tuple[Issue, ...],
    inputs: list[Path],
    console: Console,
) -> None:
    """Write the page of a program that was written; nothing where none is asked for."""
    if report is None:
        return
    from gcode2krl.report.page import content_of

    stock_mm = _stock_mm(prediction.toolpath, prediction.cell)
    content = content_of(prediction, verdict="written", issues=issues, text=_text_of(part), stock_mm=stock_mm)
    _write(content, report, inputs, console)


def report_refused(
    report: str | None,
    part: str,
    error: Gcode2KrlError,
    toolpath: "Toolpath | None",
    cell: "Cell | None",
    cell_path: str | None,
    console: Console,
) -> None:
    """Write the page of a program that was not written, with as much of its path as is known.

    Nothing is written where none is asked for, or where the page itself cannot be.
    """
    inputs = existing(part, *cell_files(cell_path))
    if report is None or not _is_writable(report, inputs):
        return
    from gcode2krl.report.page import content_of, content_of_refused

    verdict = "refused" if error.exit_code == 1 else "not understood"
    text = _text_of(part)
    stock_mm = _stock_mm(toolpath, cell) if toolpath is not None and cell is not None else None
    prediction = _predicted(toolpath, cell)
    if prediction is not None:
        content = content_of(prediction, verdict=verdict, issues=error.issues, text=text, stock_mm=stock_mm)
    else:
        content = content_of_refused(
            error.issues,
            title="standard input" if part == STANDARD else Path(part).name,
            verdict=verdict,
            toolpath=toolpath,
            cell=cell,
            text=text,
            stock_mm=stock_mm,
        )
    _write(content, report, inputs, console)


def _is_writable(report: str, inputs: list[Path]) -> bool:
    try:
        require_report(report, inputs)
    except Gcode2KrlError:
        return False
    return True


def _write(content: "Content", report: str, inputs: list[Path], console: Console) -> None:
    from gcode2krl.report.page import write_page

    write_page(content, Path(report), inputs)
    console.hint(f"{report} written: open it in a browser")


def _predicted(toolpath: "Toolpath | None", cell: "Cell | None") -> "Prediction | None":
    """Return what the robot would do with a program that is refused; None where that cannot be said."""
    if toolpath is None or cell is None:
        return None
    from gcode2krl.pipeline import predict_toolpath

    try:
        return predict_toolpath(toolpath, cell)
    except Gcode2KrlError:
        return None


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


def _text_of(part: str | None) -> str | None:
    """Return the text of a G-code file, None where there is none or it cannot be shown."""
    if part is None or part == STANDARD:
        return None
    try:
        if Path(part).stat().st_size > _LARGEST_TEXT:
            return None
        content = Path(part).read_bytes()
    except OSError:
        return None
    return None if b"\0" in content else content.decode("utf-8-sig", "replace")


def _stock_mm(toolpath: "Toolpath", cell: "Cell") -> "Floats | None":
    """Return the corners (2, 3) of the raw part in ``$BASE``: stated, around the mesh, or as guessed."""
    import numpy as np

    from gcode2krl.cutting.cutter import shape_of
    from gcode2krl.cutting.guess import guessed_box
    from gcode2krl.cutting.raw_part import load_mesh

    if cell.stock is not None and cell.stock.box_mm is not None:
        return np.array(cell.stock.box_mm)
    if cell.stock is not None and cell.stock.mesh is not None:
        try:
            return np.array(load_mesh(Path(cell.stock.mesh)).bounds)
        except Gcode2KrlError:
            return None
    tools = [cell.tool[int(number)] for number in np.unique(toolpath.tool) if int(number) in cell.tool]
    upright = bool(np.all(toolpath.axis[:, 2] > 1.0 - 1e-9))
    cuts = (~toolpath.rapid & toolpath.is_position()).any()
    if not tools or not upright or not cuts:
        return None
    radius_mm = max(tool.diameter_mm for tool in tools) / 2.0
    box = guessed_box(toolpath, np.eye(3), radius_mm, max(shape_of(tool).flute_mm for tool in tools))
    return box if bool(np.all(np.isfinite(box)) and np.all(box[1] > box[0])) else None
