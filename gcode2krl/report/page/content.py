"""What the page shows, from the tables of a prediction or from what is known of a refused program."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import standing
from gcode2krl.cell.carriers import base_in_world, root_in_world
from gcode2krl.cell.checked_parts import collision_scope
from gcode2krl.errors import Issue, Told, told
from gcode2krl.frames import invert, quaternion_from_rotation
from gcode2krl.prediction import Prediction
from gcode2krl.report.page.losses import (
    NotableSample,
    Window,
    is_worth_saying,
    lost_parts,
    lost_time,
    time_shares,
    worst_places,
    worst_windows,
)
from gcode2krl.report.page.packing import packed, packed_text
from gcode2krl.report.page.part import drawn_part
from gcode2krl.report.page.passes import passes_of
from gcode2krl.report.page.samples import PageSamples, Quantity, samples_of, samples_of_path, thinned
from gcode2krl.report.page.sketch import robot_sketch
from gcode2krl.report.part_error import above_on, error_on
from gcode2krl.report.tool_axes import drawn_tools
from gcode2krl.tables import PartHistory, SurfaceHistory, Toolpath
from gcode2krl.units import MM_PER_M, S_PER_MIN

# A mesh with few triangles, to be looked at: what lies in one cell of a grid becomes one corner.
#
# Not for distances: a corner moves by up to the diagonal of a cell.

MOST_DATA = 2_900_000
"""Letters of the samples of a page, which has some 6 MB then; of more fewer are drawn."""
MOST_TRIANGLES = 4000
"""Triangles that a page draws of one mesh, some 30 kB."""
_FINEST = 256
"""Cells along the longest side of the finest grid."""
_COARSER = 0.8


def drawn_mesh(triangles_mm: Floats, most: int = MOST_TRIANGLES) -> Floats:
    """Return triangles (t, 3, 3) of a mesh (n, 3, 3), at most so many; all of them where they are few."""
    cells = float(_FINEST)
    drawn = triangles_mm
    while len(drawn) > most and cells >= 2.0:
        drawn = _clustered(triangles_mm, cells)
        cells *= _COARSER
    return drawn


def _clustered(triangles_mm: Floats, cells: float) -> Floats:
    """Return the triangles whose corners are in three cells of a grid with so many along its longest side."""
    corners = triangles_mm.reshape(-1, 3)
    low = corners.min(axis=0)
    side_mm = max(float(np.ptp(corners, axis=0).max()), 1e-9) / cells
    place = np.floor((corners - low) / side_mm).astype(np.int64)
    number = (place[:, 0] * (_FINEST + 1) + place[:, 1]) * (_FINEST + 1) + place[:, 2]
    _, cell, count = np.unique(number, return_inverse=True, return_counts=True)
    middle = np.stack([np.bincount(cell, corners[:, k]) / count for k in range(3)], axis=1)
    faces = cell.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    drawn: Floats = middle[faces[np.sort(first)]]
    return drawn


NO_COLLISIONS = (
    "Collisions of arm, spindle, holder and cables with anything: look along the path with the slider.",
    "Clamps and fixtures, unless the cell states them.",
)
NOT_CHECKED = ("Chatter, run-out of the cutter, and vibration of robot and part.",)


@dataclass(frozen=True)
class Worst:
    """The worst places of a quantity."""

    label: str
    unit: str
    places: list[NotableSample]


@dataclass(frozen=True)
class Deviation:
    """A gouge, or a place with rest."""

    kind: str
    volume_mm3: float
    depth_mm: float
    place_mm: list[float]
    row: int
    line: int


@dataclass(frozen=True)
class Compared:
    """The finished part against the nominal one."""

    deviations: list[Deviation]
    left_out: int
    """Smaller ones."""
    volume_mm3: dict[str, float]
    how: str
    """How both were compared."""


@dataclass(frozen=True)
class Content:
    """One page."""

    title: str
    verdict: str
    """``written``, ``predicted``, ``refused`` or ``not understood``."""
    sentence: str
    facts: list[tuple[str, str]] = field(default_factory=list)
    shares: list[tuple[str, float]] = field(default_factory=list)
    lost_s: float = 0.0
    lost_parts: list[tuple[str, float]] = field(default_factory=list)
    is_slow: bool = False
    """True where so much time is lost that it is worth a word."""
    windows: list[Window] = field(default_factory=list)
    worst: list[Worst] = field(default_factory=list)
    reported: Told = field(default_factory=lambda: told(()))
    not_checked: list[str] = field(default_factory=list)
    head: dict[str, Any] = field(default_factory=dict)
    """What `page.js` reads; ``rows`` is 0 where no path is known."""
    data: str = ""
    text: str = ""
    compared: Compared | None = None
    solids: str = ""
    meshes: str = ""
    part: str = ""
    part_cells: str = ""


def content_of(
    prediction: Prediction,
    *,
    verdict: str = "predicted",
    issues: Iterable[Issue] | None = None,
    text: str | None = None,
    stock_mm: Floats | None = None,
    meshes_mm: Mapping[str, Floats] | None = None,
    nominal: dict[str, Any] | None = None,
    part: PartHistory | SurfaceHistory | None = None,
) -> Content:
    """Return the page of a prediction.

    Parameters
    ----------
    verdict : what became of the program.
    issues : its findings; default: those of the prediction.
    text : the G-code; None where it is not at hand.
    stock_mm : (2, 3) low and high corner of the raw part in ``$BASE``, None where it is not known.
    meshes_mm : name of an obstacle → its triangles (t, 3, 3) in its frame; those left out are not drawn.
    nominal : how the finished part differs from the nominal one: ``volume_mm3`` and ``left_out`` by kind, and
        ``differences`` with ``kind`` (gouge, rest), ``volume_mm3``, ``depth_mm``, ``place_mm``, ``row`` and
        ``triangles_mm`` (t, 3, 3), and ``above_mm`` and ``at_mm`` as in `part_error.above_on`. None where
        nobody compared.
    part : how the part comes about, None where nothing is cut or that is not known.
    """
    listed = tuple(prediction.issues if issues is None else issues)
    whole = samples_of(prediction)
    if whole is None or len(whole) == 0:
        return content_of_refused(
            listed,
            title=_name(prediction.toolpath),
            verdict=verdict,
            toolpath=prediction.toolpath,
            text=text,
        )
    rows = thinned(whole)
    drawn = (listed, prediction.cell, text, stock_mm, _facts(prediction))
    made = _content(_name(prediction.toolpath), verdict, whole, rows, *drawn)
    if len(made.data) > MOST_DATA:
        rows = thinned(whole, len(rows) // 2)
        made = _content(_name(prediction.toolpath), verdict, whole, rows, *drawn)
    made = _with_meshes(_with_tool_axes(made, prediction.toolpath), meshes_mm or {})
    made = made if nominal is None else _with_nominal(made, nominal, whole, rows)
    return made if part is None else _with_part(made, part, prediction, rows, nominal)


def content_of_refused(
    issues: Iterable[Issue],
    *,
    title: str,
    verdict: str = "refused",
    toolpath: Toolpath | None = None,
    cell: Cell | None = None,
    text: str | None = None,
    stock_mm: Floats | None = None,
) -> Content:
    """Return the page of a program of which no motion is known: findings, text, and the programmed path."""
    listed = tuple(issues)
    rapid_mm_s = cell.controller.rapid_m_s * MM_PER_M if cell is not None else None
    whole = samples_of_path(toolpath, rapid_mm_s) if toolpath is not None else None
    if toolpath is not None and whole is not None and len(whole) > 1:
        made = _content(title, verdict, whole, thinned(whole), listed, cell, text, stock_mm, [])
        return _with_tool_axes(made, toolpath)
    shown = told(listed)
    return Content(
        title=title,
        verdict=verdict,
        sentence=_refusal(shown, verdict),
        reported=shown,
        not_checked=["Everything after the reading of the program: path, time, forces, deflection."],
        head=_head_without_path(listed, text),
        text=packed_text(text or ""),
    )


def _content(
    title: str,
    verdict: str,
    whole: PageSamples,
    rows: Ints,
    issues: tuple[Issue, ...],
    cell: Cell | None,
    text: str | None,
    stock_mm: Floats | None,
    facts: list[tuple[str, str]],
) -> Content:
    """Return the page of samples; the figures come from all of them, also where only ``rows`` are drawn."""
    shown = whole.at(rows)
    number, passes = passes_of(shown.position_mm[:, 2], shown.rapid, shown.tool, shown.line)
    tools = sorted({int(tool) for tool in np.unique(shown.tool)})
    drawn, moving = _carried(whole, shown, cell)
    data, columns = packed(_columns(shown, number) | moving)
    lost_s = lost_time(whole.time_s, whole.speed_mm_s, whole.feed_mm_s)
    is_timed = whole.is_timed
    windows = worst_windows(whole.time_s, lost_s, whole.line) if is_timed else []
    head = _head_without_path(issues, text) | {
        "rows": len(shown),
        "all": len(whole),
        "timed": is_timed,
        "columns": columns,
        "quantities": [quantity.described(shown.rapid) for quantity in shown.quantities],
        "passes": [{"name": one.name, "tool": one.tool} for one in passes],
        "tools": tools,
        "robot": robot_sketch(drawn, tools) if shown.q_rad is not None else None,
        "near": _near(shown, cell),
        "stock": None if stock_mm is None else stock_mm.tolist(),
        "palette": _palette(),
    }
    findings = told(issues)
    lost_whole_s = float(lost_s.sum()) if is_timed else 0.0
    return Content(
        title=title,
        verdict=verdict,
        sentence=_sentence(whole, lost_whole_s, findings, verdict),
        facts=facts,
        shares=time_shares(whole.time_s, whole.speed_mm_s, whole.rapid, whole.cutting) if is_timed else [],
        lost_s=lost_whole_s,
        lost_parts=lost_parts(lost_s, whole.speed_mm_s) if is_timed else [],
        is_slow=is_timed and is_worth_saying(lost_whole_s, float(whole.time_s[-1] - whole.time_s[0])),
        windows=[_on_page(window, rows) for window in windows],
        worst=[_worst(quantity, whole, rows) for quantity in whole.quantities if quantity.name != "speed"],
        reported=findings,
        not_checked=[*_not_known(whole, cell), *_collisions(whole, cell), *NOT_CHECKED],
        head=head,
        data=data,
        text=packed_text(text or ""),
    )


def _with_tool_axes(content: Content, toolpath: Toolpath) -> Content:
    """Return a page with the tool along the path, where the tool ever leans."""
    tools = drawn_tools(toolpath)
    if not (np.abs(toolpath.axis[tools.rows] - (0.0, 0.0, 1.0)) > 1e-6).any():
        return content
    return replace(content, head=content.head | {"axes": np.round(tools.ends_mm, 3).tolist()})


def _with_meshes(content: Content, meshes_mm: Mapping[str, Floats]) -> Content:
    """Return a page with the meshes of its obstacles, where it draws the robot."""
    robot = content.head.get("robot")
    named = [one["name"] for one in robot["obstacles"] if one["name"] in meshes_mm] if robot else []
    if not named:
        return content
    corners = [drawn_mesh(meshes_mm[name]).reshape(-1, 3) for name in named]
    points = np.concatenate(corners)
    meshes, described = packed({axis: (points[:, k], 1e-2) for k, axis in enumerate("xyz")})
    counts = {name: len(own) for name, own in zip(named, corners, strict=True)}
    return replace(
        content, head=content.head | {"meshes": {"columns": described, "counts": counts}}, meshes=meshes
    )


def _with_nominal(content: Content, nominal: dict[str, Any], whole: PageSamples, rows: Ints) -> Content:
    """Return a page with the differences to the nominal part, as a table and as solids."""
    deviations = [
        Deviation(
            **{key: deviation[key] for key in ("kind", "volume_mm3", "depth_mm", "place_mm")},
            row=_nearest(rows, deviation["row"]),
            line=int(whole.line[deviation["row"]]),
        )
        for deviation in nominal["differences"]
    ]
    corners = [deviation["triangles_mm"].reshape(-1, 3) for deviation in nominal["differences"]]
    counts = [len(part) for part in corners]
    points = np.concatenate(corners) if corners else np.empty((0, 3))
    solids, described = packed({axis: (points[:, k], 1e-2) for k, axis in enumerate("xyz")})
    head = content.head | {
        "solids": {
            "columns": described,
            "counts": counts,
            "kinds": [deviation.kind for deviation in deviations],
        },
    }
    how = "as seen from the tool" if nominal["at_mm"] is None else "by the distance from the nominal surface"
    compared = Compared(deviations, sum(nominal["left_out"].values()), nominal["volume_mm3"], how)
    return replace(content, head=head, solids=solids, compared=compared)


def _with_part(
    content: Content,
    part: PartHistory | SurfaceHistory,
    prediction: Prediction,
    rows: Ints,
    nominal: dict[str, Any] | None,
) -> Content:
    """Return a page with the part as it is cut."""
    above_mm = None if nominal is None else above_on(part, nominal["above_mm"], nominal["at_mm"])
    head, events, cells = drawn_part(part, rows, error_on(part, prediction), above_mm)
    return replace(content, head=content.head | {"part": head}, part=events, part_cells=cells)


def _carried(
    whole: PageSamples, shown: PageSamples, cell: Cell | None
) -> tuple[Cell | None, dict[str, tuple[Any, float]]]:
    """Return the cell as it is drawn, and columns with what external axes move: robot root and ``$WORLD``.

    Where they stay, the cell stands there and nothing moves.
    """
    if cell is None or not cell.external or whole.external is None or shown.external is None:
        return cell, {}
    if (whole.external == whole.external[0]).all():
        return standing(cell, whole.external[0]), {}
    robroot = np.eye(4) if cell.frames.robroot is None else cell.frames.robroot.matrix()
    base = base_in_world(cell.external, shown.external, cell.stated_base(), cell.frames.base_on)
    root = invert(base) @ root_in_world(cell.external, shown.external, robroot)
    columns: dict[str, tuple[Any, float]] = {}
    for name, frame in (("root", root), ("world", invert(base))):
        turned = quaternion_from_rotation(frame[:, :3, :3])
        columns |= {f"{name}{k}": (frame[:, k, 3], 1e-2) for k in range(3)}
        columns |= {f"{name}{k + 3}": (turned[:, k], 1e-7) for k in range(4)}
    return cell, columns


def _near(shown: PageSamples, cell: Cell | None) -> dict[str, Any] | None:
    """Return who may be near what, and up to which distance that is a warning."""
    if shown.near is None or cell is None:
        return None
    names = {"links": shown.near.links, "obstacles": shown.near.obstacles}
    return {**names, "clearance": cell.collision.clearance_mm}


def _columns(shown: PageSamples, number: Ints) -> dict[str, tuple[Any, float]]:
    """Return the columns that the page carries, with the steps to which they are rounded."""
    columns: dict[str, tuple[Any, float]] = {"time": (shown.time_s, 1e-4)}
    columns |= {axis: (shown.position_mm[:, k], 1e-3) for k, axis in enumerate("xyz")}
    columns |= {q.name: (q.values, q.step) for q in shown.quantities}
    columns |= {"line": (shown.line, 1.0), "pass": (number, 1.0), "tool": (shown.tool, 1.0)}
    if shown.q_rad is not None:
        columns |= {f"q{k + 1}": (shown.q_rad[:, k], 1e-5) for k in range(6)}
    if shown.near is not None:
        columns |= {"nearLink": (shown.near.clearance_link, 1.0)}
        columns |= {"nearObstacle": (shown.near.clearance_obstacle, 1.0)}
    return columns


def _head_without_path(issues: Sequence[Issue], text: str | None) -> dict[str, Any]:
    marked: dict[int, str] = {}
    for issue in issues:
        if issue.line > 0 and marked.get(issue.line) != "error":
            marked[issue.line] = issue.severity
    return {"rows": 0, "has_text": text is not None, "marked": [[k, v] for k, v in sorted(marked.items())]}


def _on_page(window: Window, rows: Ints) -> Window:
    """Return a window whose row is one of those on the page."""
    return replace(window, row=_nearest(rows, window.row))


def _worst(quantity: Quantity, whole: PageSamples, rows: Ints) -> Worst:
    sign = -1.0 if quantity.is_low_bad else 1.0
    considered = np.where(whole.rapid & (not quantity.is_margin), np.nan, sign * quantity.values)
    if not quantity.is_margin:
        considered = np.where(considered > 0.0, considered, np.nan)
    places = worst_places(considered, whole.time_s, whole.line)
    samples = [NotableSample(_nearest(rows, p.row), sign * p.value, p.time_s, p.line) for p in places]
    return Worst(quantity.label, quantity.unit, samples)


def _nearest(rows: Ints, row: int) -> int:
    at = int(np.searchsorted(rows, row))
    before = max(at - 1, 0)
    at = min(at, len(rows) - 1)
    return at if abs(int(rows[at]) - row) <= abs(int(rows[before]) - row) else before


def _facts(prediction: Prediction) -> list[tuple[str, str]]:
    """Return figures with their bands."""
    cell, toolpath = prediction.cell, prediction.toolpath
    facts = [("robot", cell.robot.title or "not named"), ("G-code moves", f"{len(toolpath) - 1:,}")]
    if prediction.forces is not None:
        size = np.linalg.norm(prediction.forces.force_base_N, axis=1)
        band = f"± {prediction.forces.relative_band:.0%} (90 %)"
        facts.append(("force up to", f"{np.fmax.reduce(size, initial=0.0):.0f} N {band}"))
    if prediction.deflection is not None:
        size = np.linalg.norm(prediction.deflection.deflection_base_mm, axis=1)
        band = f"± {prediction.deflection.relative_band:.0%} (90 %)"
        facts.append(("deflection up to", f"{np.fmax.reduce(size, initial=0.0):.2f} mm {band}"))
    return facts


def _not_known(whole: PageSamples, cell: Cell | None) -> list[str]:
    known = {quantity.name for quantity in whole.quantities}
    missing = []
    if not whole.is_timed:
        missing.append("Time and speed: what is drawn is the programmed path at the programmed feed.")
    if "force" not in known:
        missing.append("Cutting forces and the deflection that they cause.")
    elif "deflection" not in known:
        missing.append("Deflection: the cell states no compliance, or the forces are not known.")
    if "margin" not in known:
        missing.append("Joint limits along the path.")
    if cell is not None and not cell.is_confirmed:
        missing.append("The cell's own numbers: nobody has confirmed all of them.")
    return missing


def _collisions(whole: PageSamples, cell: Cell | None) -> list[str]:
    """Return what is not checked for collisions; where something is, also what."""
    tools = [int(number) for number in np.unique(whole.tool)]
    scope = None
    if cell is not None and whole.q_rad is not None:
        is_cut = any(quantity.name == "force" for quantity in whole.quantities)
        scope = collision_scope(cell, tools, is_cut=is_cut)
    if scope is None:
        return list(NO_COLLISIONS)
    return [
        f"Collisions of {'; '.join(scope.unchecked)}: look along the path with the slider.",
        f"Checked are {'; '.join(scope.movers)} against {'; '.join(scope.obstacles) or 'nothing'}.",
    ]


def _sentence(whole: PageSamples, lost_s: float, findings: Told, verdict: str) -> str:
    if verdict in ("refused", "not understood"):
        return _refusal(findings, verdict)
    length_m = float(np.linalg.norm(np.diff(whole.position_mm, axis=0), axis=1).sum()) / MM_PER_M
    if not whole.is_timed:
        return f"{length_m:.2f} m of programmed path"
    time_s = float(whole.time_s[-1] - whole.time_s[0])
    lost = (
        f"{duration(lost_s)} ({lost_s / time_s:.0%}) are lost where it is slower than programmed"
        if is_worth_saying(lost_s, time_s)
        else "nearly all of it as fast as programmed"
    )
    return f"{duration(time_s)} for {length_m:.2f} m; {lost}"


def _refusal(findings: Told, verdict: str) -> str:
    first = findings.findings[0] if findings.findings else None
    why = f": {first.first.message}" if first is not None else ""
    place = f" (line {first.first.line})" if first is not None and first.first.line > 0 else ""
    listed = [issue for one in findings.findings for issue in one.issues]
    more = sum(issue.severity == "error" for issue in (*listed, *findings.left_out)) - 1
    place += f", and {more} more error{'s' if more > 1 else ''}" if more > 0 else ""
    start = "No program was written" if verdict == "refused" else "The input is not understood"
    return f"{start}{why}{place}"


def duration(seconds: float) -> str:
    """Return a time as a person reads it."""
    if seconds < S_PER_MIN:
        return f"{seconds:.1f} s"
    minutes, seconds_left = divmod(round(seconds), int(S_PER_MIN))
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds_left} s"


def _name(toolpath: Toolpath) -> str:
    return PurePath(toolpath.source.replace("\\", "/")).name or "program"


def _palette() -> list[str]:
    """Return viridis from what is fine to what is worth a look, which is dark on the page's light ground."""
    from matplotlib import colormaps

    colours = colormaps["viridis"](np.linspace(0.97, 0.0, 17))[:, :3]
    return ["#" + "".join(f"{round(255 * part):02x}" for part in colour) for colour in colours]
