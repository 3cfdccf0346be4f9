"""Keys that a program needs and its cell does not state, and doubtful values that it states."""

from collections.abc import Iterator
from weakref import WeakKeyDictionary

from gcode2krl.cell import Cell, plain_view, ranges
from gcode2krl.cell.sections import missing_key
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Event, Toolpath

_USED: WeakKeyDictionary[Toolpath, list[int]] = WeakKeyDictionary()
_LEAST_WAIT_S = 0.5
"""Assumed: motor spindles start and stop in 1 to 15 s, the smallest in half a second."""
_LEAST_HELIX_DEG = 5.0
"""Catalogues: straight edges, or 10 to 60 degrees; 0.17 to 1.05 are those in radians."""


def lacks_geometry(toolpath: Toolpath, cell: Cell) -> bool:
    """Tell whether the cell lacks the geometry of arm, work or a tool, so that nothing can be planned."""
    return any(_geometry_keys(toolpath, cell))


def missing_issues(toolpath: Toolpath, cell: Cell) -> list[Issue]:
    """Return an error for each key that the program needs and the cell does not state."""
    keys = [*_geometry_keys(toolpath, cell), *_other_keys(toolpath, cell)]
    return [missing_key(key, reason) for key, reason in dict(keys).items()]


def doubtful_issues(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield warnings on stated values: beyond their usual range, or left at a default that matters."""
    from gcode2krl.cell.contradictions import contradictory

    used = set(used_tools(toolpath))
    yield from ranges.range_issues(cell, used)
    yield from contradictory(cell, used)
    yield from _doubtful_cutters(used, cell)
    yield from _short_waits(toolpath, cell)
    yield from _unread_pairs(toolpath, cell)
    centre = [f"load.{axis}_mm" for axis in "xyz"]
    if cell.load.mass_kg is not None and all(key in cell.defaults for key in centre):
        text = "the centre of the load is not stated: X 0, Y 0, Z 0 of the flange is written"
        yield Issue("warning", "load-centre", 0, text, "give load.x_mm, y_mm and z_mm in the cell file")
    for number in sorted(used):
        tool = cell.tool.get(number)
        if tool is None or not cell.is_confirmed or f"tool.{number}.length_mm" not in cell.defaults:
            continue
        text = f"the length of T{number}, {tool.length_mm:g} mm, is that of the library's {tool.model!r}"
        yield Issue(
            "warning", "tool-length-library", 0, text, f"measure it, and give tool.{number}.length_mm"
        )


def _doubtful_cutters(used: set[int], cell: Cell) -> Iterator[Issue]:
    for number, tool in cell.tool.items():
        if number not in used:
            continue
        key = f"tool.{number}"
        if tool.kind == "flat" and tool.corner_radius_mm > 0.0:
            text = f"{key} is flat and has corner_radius_mm = {tool.corner_radius_mm:g}: it is taken as round"
            remedy = f'write {key}.kind = "bull-nose" (or "ball"), or leave corner_radius_mm out'
            yield Issue("warning", "cell-doubtful", 0, text, remedy)
        if 0.0 < tool.helix_deg < _LEAST_HELIX_DEG:
            text = f"{key}.helix_deg = {tool.helix_deg:g} is not usual: 0 for straight edges, or 10 to 60"
            remedy = f"correct {key}.helix_deg: it counts degrees, not radians"
            yield Issue("warning", "cell-doubtful", 0, text, remedy)


def _short_waits(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield the waits for the spindle that the program's templates use and that are too short."""
    templates = cell.templates()
    used = [templates[key] for key in _used_templates(toolpath, templates)]
    waits = {"start_s": cell.spindle.start_s, "stop_s": cell.spindle.stop_s}
    if cell.spindle.at_speed_input is not None:
        del waits["start_s"]  # the program waits for the input
    for key, wait_s in waits.items():
        if wait_s < _LEAST_WAIT_S and any(f"spindle.{key}" in text for text in used):
            text = f"spindle.{key} = {wait_s:g} s: the program does not wait for the spindle"
            remedy = f"give the measured time in spindle.{key}" + (
                ", or spindle.at_speed_input" if key == "start_s" else ""
            )
            yield Issue("warning", "spindle-wait", 0, text, remedy)


def _geometry_keys(toolpath: Toolpath, cell: Cell) -> Iterator[tuple[str, str]]:
    """Yield (key, reason) of the geometry: without these keys nothing can be planned."""
    if not cell.robot.geometry.known:
        yield "robot.model", "which arm moves is not known"
    if cell.frames.base is None:
        yield "frames.base", "where $BASE stands is not known"
    if cell.home.q_deg is None:
        yield "home.q_deg", "where the program starts and ends is not known"
    used = [number for number in used_tools(toolpath) if number in cell.tool]
    if not cell.tool:
        numbers = [number for number in used_tools(toolpath) if number > 0]
        yield f"tool.{numbers[0] if numbers else 1}", "the cell has no tool"
    for number in used or sorted(cell.tool)[:1]:
        for key in cell.missing_of_tool(number):
            yield key, f"the tip of T{number} is not known"


def _other_keys(toolpath: Toolpath, cell: Cell) -> Iterator[tuple[str, str]]:
    """Yield (key, reason) of the other keys that the text of the program needs."""
    tools = [number for number in used_tools(toolpath) if number in cell.tool]
    if any(cell.tool[n].tool_data is None and cell.load_of(n).mass_kg is None for n in tools):
        yield "load.mass_kg", "$LOAD is written with $TOOL"
    if any(event.kind == "spindle" for event in toolpath.events) and cell.spindle.max_rpm is None:
        yield "spindle.max_rpm", "whether the spindle can turn at S is not known"
    from gcode2krl.cell import templates as cell_templates
    from gcode2krl.cell.switching import SAMPLE

    view = {"cell": plain_view(cell), "spindle": cell.spindle.model_dump()}
    templates = cell.templates()
    for key in _used_templates(toolpath, templates):
        try:
            cell_templates.render(templates[key], {**SAMPLE, **view})
        except cell_templates.MissingValueError as error:
            if "." in error.key:
                yield error.key.removeprefix("cell."), f"{key} switches it"
        except cell_templates.TemplateError:
            continue  # reported where it is rendered with its own values


def _unread_pairs(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield the pairs that the program uses whose switching off calls a subprogram."""
    from gcode2krl.cell import switching

    templates = cell.templates()
    view = {"cell": plain_view(cell), "spindle": cell.spindle.model_dump()}
    used = _used_templates(toolpath, templates)
    for issue in switching.pair_issues(templates, view):
        if issue.message.split()[0] in used:
            yield issue


def _used_templates(toolpath: Toolpath, templates: dict[str, str]) -> list[str]:
    used = {_template_of(event) for event in toolpath.events} | {"program.prologue", "program.epilogue"}
    return [key for key in templates if key in used]


def _template_of(event: Event) -> str:
    return "tool_change" if event.kind == "tool" else f"m_code.M{event.values['m']}"


def used_tools(toolpath: Toolpath) -> list[int]:
    """Return the numbers of the tools that move to a programmed position, in order; found once."""
    if toolpath not in _USED:
        moves = toolpath.is_position() & ~toolpath.machine
        _USED[toolpath] = distinct(toolpath.tool[moves]).tolist()
    return _USED[toolpath]
