"""What a CAM system knows of a job, laid over a cell: its cutters and its stock.

Only the prediction depends on these values. Where the tip of a tool is (its length, its frame, its number on
the controller) stays with the cell: a tool that the cell does not have is not added, and a program that uses
it is refused. That is why a confirmed cell stays confirmed under a job.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

from pydantic import Field, ValidationError

from gcode2krl.cell import library
from gcode2krl.cell.contradictions import contradictory
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.ranges import range_issues
from gcode2krl.cell.sections import Section, Stock, Tool, ToolNumber, Unconfirmed
from gcode2krl.cell.sections.fields import Finite, NotNegative, Positive
from gcode2krl.cell.tool_files import read_tools, sections_of
from gcode2krl.errors import Issue, NotUnderstoodError

_Model = TypeVar("_Model", bound=Section)
SHAPE = ("kind", "diameter_mm", "corner_radius_mm", "taper_deg", "point_deg")
"""Keys that make a cutter what it is."""
_OF_THE_CELL = [
    "teeth",
    "helix_deg",
    "length_mm",
    "stick_out_mm",
    "holder_diameter_mm",
    "centre_cutting",
    "max_force_N",
    "max_rpm",
    "tool_data",
    "frame",
    "axis",
]
"""Keys of the cell's tool that stay where the job has another cutter in its place."""
_SLACK_MM = 0.01
"""Sizes that differ by less are the same: CAM systems round."""
_REMEDY = "see docs/cam.md for the job file"


class JobTool(Section):
    """A cutter as the CAM system has it; what it does not know is left out."""

    kind: Literal["flat", "bull-nose", "ball", "tapered", "drill"] = "flat"
    diameter_mm: Positive
    teeth: int | None = Field(default=None, strict=True, ge=1, le=50)
    corner_radius_mm: NotNegative = 0.0
    flute_length_mm: Positive | None = None
    shank_diameter_mm: Positive | None = None
    overall_length_mm: Positive | None = None
    """Of the whole cutter: it cannot stick out of the holder farther than this."""
    taper_deg: NotNegative = 0.0
    point_deg: Positive | None = None


class JobStock(Section):
    """The raw part in the coordinates of the program."""

    box_mm: tuple[tuple[Finite, Finite, Finite], tuple[Finite, Finite, Finite]] | None = None
    mesh: str | None = None
    """STL, PLY or 3MF in mm, relative to the job file."""


class Job(Section):
    """A job file."""

    name: str = ""
    work_offset: str = "G54"
    """The offset under which the program runs; it says where the stock is in ``$BASE``."""
    stock: JobStock | None = None
    tool: dict[ToolNumber, JobTool] = Field(default_factory=dict)


class UnderJob(NamedTuple):
    """A cell with a job laid over it."""

    cell: Cell
    issues: tuple[Issue, ...]
    """Where the cell has something else, or a value of the job could not be taken over."""


def lay_job_over(cell: Cell, path: Path) -> UnderJob:
    """Return the cell with the cutters and the stock of a job file, and what a person should know of it.

    Raises `NotUnderstoodError` where the file cannot be read, or a cutter contradicts the cell's tool.
    """
    source = str(path)
    job = _checked(Job, library.read_toml(path), "", source)
    tools = dict(cell.tool)
    issues: list[Issue] = []
    for number, cutter in job.tool.items():
        if number in tools:
            issues += _differences(number, tools[number], cutter)
            tools[number] = _tool_with(tools[number], cutter, number, source)
    stock, doubts = _stock_of(job, cell, path.parent, source)
    under = cell.under(tool=tools, stock=stock)
    judged = (*range_issues(under, set(job.tool)), *contradictory(under, set(job.tool)))
    wrong = [issue for issue in judged if issue.severity == "error"]
    if wrong:
        raise NotUnderstoodError(wrong, source)
    return UnderJob(under, (*issues, *doubts))


def with_tools(cell: Cell, path: Path) -> UnderJob:
    """Return the cell with the tools of a library that it does not have, and what a person should know.

    Only tools whose length from the spindle's gauge line the library states are added; none of them is
    confirmed. A tool that the cell has stays as it is.

    Raises `NotUnderstoodError` where the file is no library, or a tool of it cannot be.
    """
    sections, left_out = sections_of(read_tools(path), {}, path.name)
    tools, added = dict(cell.tool), []
    issues: list[Issue] = []
    for number, keys in sections.items():
        if number in cell.tool:
            issues += differences(number, cell.tool[number], keys)
        elif "length_mm" in keys:
            tools[number] = _checked(Tool, keys, f"tool.{number}.", str(path))
            added.append(number)
    under = cell.under(tool=tools)
    wrong = [issue for issue in range_issues(under, set(added)) if issue.severity == "error"]
    if wrong:
        raise NotUnderstoodError(wrong, str(path))
    if left_out:
        sentence = f"{path.name}: {len(left_out)} tools are not taken, or have no length"
        remedy = f"`gcode2krl tools import {path.name}` says which, and why"
        issues.append(Issue("note", "tool-file", 0, sentence, remedy))
    if added:
        names = ", ".join(f"T{number}" for number in added)
        sentence = f"{names} from {path.name}: length and cutter are those of the CAM system, not confirmed"
        remedy = f"`gcode2krl tools import {path.name} --cell CELL.toml` keeps them; measure the lengths"
        issues.append(Issue("warning", "tool-file", 0, sentence, remedy))
        if under.unconfirmed is not None:
            new = (Unconfirmed(key=f"tool.{number}", kind="unsigned") for number in added)
            under = under.model_copy(update={"unconfirmed": (*under.unconfirmed, *new)})
    return UnderJob(under, tuple(issues))


def differences(number: int, tool: Tool, keys: Mapping[str, Any]) -> Iterator[Issue]:
    """Yield a finding where a library's tool is another cutter than the cell's, which stays."""
    wrong = [key for key in SHAPE if key in keys and differs(getattr(tool, key), keys[key])]
    if wrong:
        words = ", ".join(f"{key} {keys[key]} and {getattr(tool, key)} in the cell" for key in wrong)
        remedy = f"correct [tool.{number}] of the cell, or renumber the tool in the CAM system"
        yield Issue("warning", "tool-differs", 0, f"T{number}: {words}; the cell's stays", remedy)


def job_files(path: Path) -> list[Path]:
    """Return a job file and the mesh that it names; none of them may be an output."""
    try:
        stock = library.read_toml(path).get("stock")
    except NotUnderstoodError:  # reading the job reports it
        return [path]
    mesh = stock.get("mesh") if isinstance(stock, dict) else None
    return [path, path.parent / mesh] if isinstance(mesh, str) else [path]


def _differences(number: int, tool: Tool, cutter: JobTool) -> Iterator[Issue]:
    """Yield where the job's cutter is not that of the cell; its own is used in both cases."""
    remedy = f"correct [tool.{number}] of the cell, or put the right tool into the magazine"
    if tool.kind != cutter.kind or abs(tool.diameter_mm - cutter.diameter_mm) > _SLACK_MM:
        sentence = (
            f"T{number} is a {cutter.kind} cutter of {cutter.diameter_mm:g} mm in the job and "
            f"{tool.kind} of {tool.diameter_mm:g} mm in the cell; the job's is used"
        )
        yield Issue("warning", "tool-differs", 0, sentence, remedy)
    out_mm, whole_mm = tool.stick_out_mm, cutter.overall_length_mm
    if out_mm is not None and whole_mm is not None and out_mm > whole_mm + _SLACK_MM:
        sentence = (
            f"T{number} sticks out {out_mm:g} mm in the cell, and the whole cutter of the job has "
            f"{whole_mm:g} mm"
        )
        yield Issue("warning", "tool-differs", 0, sentence, remedy)


def _tool_with(tool: Tool, cutter: JobTool, number: int, source: str) -> Tool:
    """Return the cell's tool with the job's cutter in it."""
    stated = tool.model_dump(exclude_none=True)
    given = cutter.model_dump(exclude_none=True, exclude={"overall_length_mm"})
    if cutter.kind == "ball":
        given["corner_radius_mm"] = 0.0
    if any(differs(stated.get(key), given.get(key)) for key in SHAPE):
        stated = {key: value for key, value in stated.items() if key in _OF_THE_CELL}
        stated["model"] = f"{cutter.kind} {cutter.diameter_mm:g} of the job"
    if tool.stick_out_mm is None and tool.length_mm is not None and cutter.overall_length_mm is not None:
        given["stick_out_mm"] = min(cutter.overall_length_mm, tool.length_mm)
    given["source"] = f"the job {Path(source).name}"
    return _checked(Tool, stated | given, f"tool.{number}.", source)


def differs(stated: Any, given: Any) -> bool:
    """Tell whether two values of a key of a tool are not the same but for rounding."""
    if isinstance(stated, float) and isinstance(given, float):
        return abs(stated - given) > _SLACK_MM
    return bool(stated != given)


def _stock_of(job: Job, cell: Cell, folder: Path, source: str) -> tuple[Stock | None, list[Issue]]:
    """Return the job's stock in ``$BASE``, by default the cell's, and a doubt where it cannot be placed."""
    if job.stock is None or (job.stock.box_mm is None and job.stock.mesh is None):
        return cell.stock, []
    kept = cell.stock.model_dump(include={"resolution_mm", "through_mm"}) if cell.stock is not None else {}
    offset = next((frame for name, frame in cell.work_offsets.items() if name == job.work_offset), None)
    shift_mm = (offset.x_mm, offset.y_mm, offset.z_mm) if offset is not None else (0.0, 0.0, 0.0)
    remedy = "state [stock] in the cell, or program in $BASE"
    if offset is not None and any((offset.a_deg, offset.b_deg, offset.c_deg)):
        sentence = f"{job.work_offset} of the cell is rotated, and the stock of the job with it"
        return cell.stock, [Issue("warning", "job-stock", 0, sentence, remedy)]
    if job.stock.mesh is not None:
        if any(shift_mm):
            sentence = f"the stock of the job is a mesh, and {job.work_offset} of the cell shifts the program"
            return cell.stock, [Issue("warning", "job-stock", 0, sentence, remedy)]
        shape: dict[str, Any] = {"mesh": str(folder / job.stock.mesh), "box_mm": None}
    else:
        box = job.stock.box_mm or ()
        shape = {"box_mm": tuple(tuple(map(sum, zip(corner, shift_mm, strict=True))) for corner in box)}
    return _checked(Stock, kept | shape, "stock.", source), []


def _checked(model: type[_Model], values: dict[str, Any], place: str, source: str) -> _Model:
    """Return the values as a section; raises `NotUnderstoodError` that names each wrong key."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        issues = [
            Issue(
                "error", "job-key", 0, f"{place}{'.'.join(map(str, detail['loc']))}: {detail['msg']}", _REMEDY
            )
            for detail in error.errors(include_url=False)[:20]
        ]
        raise NotUnderstoodError(issues, source) from None
