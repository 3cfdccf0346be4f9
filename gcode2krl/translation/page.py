"""The page beside a program: written with it, or of a program that was refused."""

import gzip
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

from gcode2krl.errors import Gcode2KrlError, Issue, input_error
from gcode2krl.translation.inputs import STANDARD
from gcode2krl.translation.outputs import PAGES, require_outputs

if TYPE_CHECKING:
    from gcode2krl.arrays import Floats
    from gcode2krl.cell import Cell
    from gcode2krl.prediction import Prediction
    from gcode2krl.tables import PartHistory, SurfaceHistory, Toolpath

_LARGEST_TEXT = 400_000_000
_GZIP = b"\x1f\x8b"


def require_report(report: str | Path | None, inputs: list[Path]) -> None:
    """Refuse the name of a page that cannot be written."""
    if report is None:
        return
    if Path(report).suffix.lower() not in PAGES:
        sentence = f"report {Path(report).name!r}: allowed endings {', '.join(PAGES)}"
        raise input_error("option-value", sentence, "name it report.html", source=str(report))
    require_outputs([Path(report)], *inputs)


def write_page_of_written(
    page: Path, part: str, prediction: "Prediction", issues: tuple[Issue, ...], inputs: list[Path]
) -> None:
    """Write the page of a program that was written."""
    from gcode2krl.clearance import obstacle_meshes
    from gcode2krl.report.page import content_of, write_page

    stock_mm = stock_corners_mm(prediction.toolpath, prediction.cell)
    content = content_of(
        prediction,
        verdict="written",
        issues=issues,
        text=text_of(part),
        stock_mm=stock_mm,
        meshes_mm=obstacle_meshes(prediction.cell),
        part=part_of(prediction),
    )
    write_page(content, page, inputs)


def write_page_of_refused(
    page: Path,
    part: str,
    error: Gcode2KrlError,
    toolpath: "Toolpath | None",
    cell: "Cell | None",
    inputs: list[Path],
    simplify_mm: float | None = None,
) -> "Prediction | None":
    """Write the page of a program that was not written, with as much of its path as is known.

    Returns what the robot would do with it, None where that cannot be said.
    """
    from gcode2krl.clearance import obstacle_meshes
    from gcode2krl.report.page import content_of, content_of_refused, write_page

    verdict = "refused" if error.exit_code == 1 else "not understood"
    text = text_of(part)
    stock_mm = stock_corners_mm(toolpath, cell) if toolpath is not None and cell is not None else None
    prediction = _predicted(toolpath, cell, simplify_mm)
    if prediction is not None:
        content = content_of(
            prediction,
            verdict=verdict,
            issues=error.issues,
            text=text,
            stock_mm=stock_mm,
            meshes_mm=obstacle_meshes(prediction.cell),
            part=part_of(prediction),
        )
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
    write_page(content, page, inputs)
    return prediction


def can_be_written(report: str | Path, inputs: list[Path]) -> bool:
    """Tell whether a page of that name may be written."""
    try:
        require_report(report, inputs)
    except Gcode2KrlError:
        return False
    return True


def _predicted(
    toolpath: "Toolpath | None", cell: "Cell | None", simplify_mm: float | None
) -> "Prediction | None":
    """Return what the robot would do with a program that is refused; None where that cannot be said."""
    if toolpath is None or cell is None:
        return None
    from gcode2krl.pipeline import predict_toolpath

    try:
        return predict_toolpath(toolpath, cell, simplify_mm=simplify_mm)
    except Gcode2KrlError:
        return None


def part_of(prediction: "Prediction") -> "PartHistory | SurfaceHistory | None":
    """Return how the part comes about, None where nothing is cut or where that is not known."""
    import numpy as np

    from gcode2krl.cutting import history_of

    motion, forces = prediction.motion, prediction.forces
    if motion is None or forces is None or not np.isfinite(forces.phi_rad[:, 0]).any():
        return None
    try:
        return history_of(prediction.toolpath, motion, prediction.cell)
    except Gcode2KrlError:
        return None


def text_of(part: str | None) -> str | None:
    """Return the text of a G-code file, None where there is none or it cannot be shown."""
    if part is None or part == STANDARD:
        return None
    try:
        if Path(part).stat().st_size > _LARGEST_TEXT:
            return None
        with Path(part).open("rb") as stream:
            packed = stream.read(len(_GZIP)) == _GZIP
        with gzip.open(part) if packed else Path(part).open("rb") as stream:
            content = stream.read(_LARGEST_TEXT + 1)
    except (OSError, EOFError, zlib.error):
        return None
    if len(content) > _LARGEST_TEXT:
        return None
    return None if b"\0" in content else content.decode("utf-8-sig", "replace")


def stock_corners_mm(toolpath: "Toolpath", cell: "Cell") -> "Floats | None":
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
