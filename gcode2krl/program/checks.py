"""Checks that refuse a program from the G-code and the cell alone (no robot, no material)."""

from collections.abc import Iterator, Sequence
from weakref import WeakKeyDictionary

import numpy as np

from gcode2krl.arrays import Bools
from gcode2krl.cell import Cell, plain_view, ranges
from gcode2krl.cell.sections import missing_key
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import MOST_PLACES, Issue, RefusedError
from gcode2krl.tables import Event, Toolpath
from gcode2krl.units import MM_PER_M, S_PER_MIN

# Keys that a program needs and its cell does not state, and doubtful values that it states.

_USED: WeakKeyDictionary[Toolpath, list[int]] = WeakKeyDictionary()
_LEAST_WAIT_S = 0.5
"""Assumed: motor spindles start and stop in 1 to 15 s, the smallest in half a second."""
_LEAST_HELIX_DEG = 5.0
"""Catalogues: straight edges, or 10 to 60 degrees; 0.17 to 1.05 are those in radians."""


def lacks_geometry(toolpath: Toolpath, cell: Cell) -> bool:
    """Tell whether the cell lacks the geometry of arm, work or a tool, so that nothing can be planned."""
    return any(_geometry_keys(toolpath, cell))


def missing_issues(toolpath: Toolpath, cell: Cell, but: Sequence[int] = ()) -> list[Issue]:
    """Return an error for each key that the program needs and the cell does not state.

    ``but``: tools whose missing length is told otherwise.
    """
    keys = dict([*_geometry_keys(toolpath, cell), *_other_keys(toolpath, cell)])
    for number in but:
        keys.pop(f"tool.{number}.length_mm", None)
    return [missing_key(key, reason) for key, reason in keys.items()]


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


_SLOWEST_MM_S = 0.001
_TOUCHED_OFF = (
    '; if lengths are set by touching off: [program] tool_length = "from_table" in the cell, '
    "or --allow g43-missing"
)


def check_toolpath(toolpath: Toolpath, cell: Cell) -> tuple[Issue, ...]:
    """Return the findings on a Toolpath that would make its program unsafe, with their lines."""
    feed = ~toolpath.rapid & ~toolpath.machine & ~_stands(toolpath)
    feed[:1] = False
    findings: list[Issue] = []
    for check in (_undefined_positions, _machine_moves, _spindle, _speeds, _length_offsets, _clearance):
        findings += list(check(toolpath, cell, feed))
    findings += list(_tools(toolpath, cell, feed))
    findings += missing_issues(toolpath, cell, but=_without_length(toolpath, cell))
    findings += doubtful_issues(toolpath, cell)
    findings += list(_events(toolpath, cell))
    findings += list(_silent_changes(toolpath, cell))
    findings += list(_outputs_of_words(toolpath, cell))
    return tuple(findings)


def _stands(toolpath: Toolpath) -> Bools:
    """Tell which rows move nothing and state no position: ``G1 F100`` alone, as posts write it at the top."""
    stands = np.zeros(len(toolpath), dtype=np.bool_)
    for column in (toolpath.position_mm, toolpath.axis, toolpath.known):
        stands[1:] |= (column[1:] != column[:-1]).any(axis=1)
    return ~stands


def require_geometry(toolpath: Toolpath, cell: Cell) -> None:
    """Raise `RefusedError` with all findings where the cell lacks the geometry of arm, work or tool."""
    if lacks_geometry(toolpath, cell):
        raise RefusedError((*toolpath.issues, *check_toolpath(toolpath, cell)), toolpath.source)


def _stretches(wrong: Bools) -> list[int]:
    """Return the first row of each run of wrong rows."""
    if not wrong.any():
        return []
    starts = np.flatnonzero(wrong & ~np.concatenate([[False], wrong[:-1]]))
    return [int(row) for row in starts[:MOST_PLACES]]


def _undefined_positions(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    known = toolpath.is_position()
    from_known = np.concatenate([[False], known[:-1]])
    for row in _stretches(feed & ~(known & from_known)):
        both = toolpath.known[row - 1] & toolpath.known[row]
        missing = [axis for axis in range(3) if not both[axis]]
        yield Issue(
            "error",
            "undefined-position",
            int(toolpath.source_line[row]),
            f"feed move from a position whose {_named(missing)} has not been programmed: "
            + "; ".join(_why_unknown(toolpath, row, axis) for axis in missing),
            "program X, Y and Z with G0 first (after G28, G53 and a change of G43 too), or state in the cell "
            "where the tip stands at the start: [program.start] position_mm",
        )


def _named(axes: list[int]) -> str:
    return ", ".join("XYZ"[axis] for axis in axes)


def _why_unknown(toolpath: Toolpath, row: int, axis: int) -> str:
    """Return what made an axis unknown, or how long the program has gone without it."""
    name = "XYZ"[axis]
    known = np.flatnonzero(toolpath.known[:, axis])
    before = known[known < row]
    if not len(known):
        return f"no {name} in {int(toolpath.source_line[-1]):,} lines"
    if not len(before):
        return f"no {name} before line {int(toolpath.source_line[known[0]]):,}"
    lost = int(before[-1]) + 1
    line = int(toolpath.source_line[lost])
    if toolpath.machine[lost]:
        return f"{name} is unknown since the machine move (G28, G30, G53) in line {line}"
    if name == "Z":
        return f"{name} is unknown since the tool length changed before line {line}"
    return f"{name} is unknown since the zero was turned, or the tool's length tilted, before line {line}"


def axes_nowhere(toolpath: Toolpath) -> str:
    """Return a text on axes that no line gives a position, empty if all have one or nothing moves."""
    known: Bools = np.any(toolpath.known, axis=0)
    lines = int(toolpath.source_line.max(initial=0))
    return (
        "" if known.all() or lines == 0 else f"{_axes(~known)} given no absolute position in {lines:,} lines"
    )


def _axes(chosen: Bools) -> str:
    """Return ``Z is`` or ``X, Y and Z are``."""
    *others, last = (name for name, is_chosen in zip("XYZ", chosen, strict=True) if is_chosen)
    return f"{', '.join(others)} and {last} are" if others else f"{last} is"


def _machine_moves(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    for row in _stretches(toolpath.machine & ~toolpath.rapid):
        yield Issue(
            "error",
            "machine-feed",
            int(toolpath.source_line[row]),
            "a feed move in machine coordinates (G53 G1) has no meaning on a robot",
            "use G53 G0, which becomes a retract",
        )
    if cell.clearance_z_mm is None:
        for row in _stretches(toolpath.machine):
            yield Issue(
                "error",
                "no-clearance",
                int(toolpath.source_line[row]),
                "G28, G30 and G53 become a retract, and the cell has no clearance plane",
                "give [clearance] z_mm in the cell",
            )


def _spindle(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    speed = toolpath.spindle_rad_s
    for row in _stretches(feed & (speed == 0)):
        stopped = any(event.kind in ("spindle", "tool") for event in toolpath.events if event.row < row)
        by_hand = "" if stopped else "; switched by hand: [program.start] spindle_rpm in the cell"
        yield Issue(
            "error",
            "spindle-off",
            int(toolpath.source_line[row]),
            f"feed move with the spindle off{_why_off(toolpath, row)}",
            f"program S and M3 before it{by_hand}",
        )
    tapping = {int(event.values["line"]): event.values["cycle"] for event in toolpath.events if _taps(event)}
    yield from _tapping(tapping)
    for row in _stretches(feed & (speed < 0) & ~np.isin(toolpath.source_line, list(tapping))):
        yield Issue(
            "error",
            "spindle-direction",
            int(toolpath.source_line[row]),
            "feed move with the spindle turning left (M4)",
            "the tools of the cell cut with M3",
        )
    by_hand_rpm = cell.program.start.spindle_rpm
    if by_hand_rpm is not None:
        yield from _spindle_speed(by_hand_rpm, 0, 0, toolpath, cell)
    for event in toolpath.events:
        if event.kind == "spindle":
            rpm, line = abs(event.values["rpm"]), int(event.values["line"])
            yield from _spindle_speed(rpm, event.row, line, toolpath, cell)


def _taps(event: Event) -> bool:
    return event.kind == "spindle" and event.values.get("cycle") in ("G74", "G84", "CYCLE84")


def _tapping(cycles: dict[int, str]) -> Iterator[Issue]:
    """Yield a finding on each tapping cycle, given by line: the spindle is not coupled to the robot."""
    for line, code in cycles.items():
        yield Issue(
            "error",
            "tapping-cycle",
            line,
            f"{code} taps a thread: the robot cannot couple its feed to the turning of the spindle",
            "mill the thread (G2 or G3 helix); for a head that compensates length: --allow tapping-cycle",
        )


def _why_off(toolpath: Toolpath, row: int) -> str:
    """Return what left the spindle off before a row."""
    before = [event for event in toolpath.events if event.kind == "spindle" and event.row < row]
    if not before:
        return ": no M3 comes before it"
    values = before[-1].values
    if values["m"] != 5:
        return f": M{values['m']} without S in line {values['line']}"
    return f": it was stopped by {'M6' if values.get('implied') else 'M5'} in line {values['line']}"


def _spindle_speed(rpm: float, row: int, line: int, toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    tool = cell.tool.get(int(toolpath.tool[min(row + 1, len(toolpath) - 1)]))
    stated = (cell.spindle.max_rpm, tool.max_rpm if tool is not None else None)
    most = min((rpm for rpm in stated if rpm is not None), default=np.inf)
    if rpm > most * (1 + 1e-9):
        sentence = f"S{rpm:.0f} is above the {most:.0f} rpm that spindle and tool allow"
        yield Issue("error", "spindle-speed", line, sentence, "lower S, or correct max_rpm in the cell")


def _speeds(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    most_mm_s = cell.controller.vel_cp_m_s * MM_PER_M
    for row in _stretches(feed & (toolpath.feed_mm_s > most_mm_s * (1 + 1e-9))):
        yield Issue(
            "error",
            "feed-too-high",
            int(toolpath.source_line[row]),
            f"feed {toolpath.feed_mm_s[row] * S_PER_MIN:.0f} mm/min is above the largest path speed, "
            f"{most_mm_s * S_PER_MIN:.0f} mm/min",
            "check F and the unit (G20/G21); where F asks for all that the machine can, write at most that",
        )
    for row in _stretches(feed & (toolpath.feed_mm_s > 0) & (toolpath.feed_mm_s < _SLOWEST_MM_S)):
        yield Issue(
            "error",
            "feed-too-low",
            int(toolpath.source_line[row]),
            f"feed {toolpath.feed_mm_s[row] * S_PER_MIN:g} mm/min is too small for $VEL.CP",
            "check F and the feed mode (G93, G94, G95)",
        )
    for row in _stretches(feed & ~(toolpath.feed_mm_s > 0)):
        if not np.array_equal(toolpath.position_mm[row], toolpath.position_mm[row - 1]):
            yield Issue(
                "error", "no-feed", int(toolpath.source_line[row]), "feed move at speed zero", "check F"
            )


def _length_offsets(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    selected = toolpath.length_offset_tool
    touched_off = np.arange(len(toolpath)) <= _first_change(toolpath)  # with the mounted tool
    other = feed & (toolpath.tool > 0) & (selected != toolpath.tool) & ~(touched_off & (selected < 0))
    for row in _stretches(other):
        number, offset = int(toolpath.tool[row]), int(selected[row])
        tool = cell.tool.get(number)
        if tool is None or (offset < 0 and not tool.length_mm):
            continue
        having = "without G43" if offset < 0 else f"with the length of tool {offset} (G43 H{offset})"
        yield Issue(
            "error",
            "g43-missing",
            int(toolpath.source_line[row]),
            f"tool {number} cuts {having}: Z would be that of another tool or of the spindle nose",
            f"add G43 H{number} after the tool change" + (_TOUCHED_OFF if offset < 0 else ""),
        )


def _clearance(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    clearance = cell.clearance_z_mm
    if clearance is None:
        yield Issue(
            "error",
            "no-clearance",
            0,
            "the cell has no clearance plane to approach and leave on",
            "give [clearance] z_mm in the cell",
        )
        return
    above = feed & (toolpath.position_mm[:, 2] > clearance)
    highest = toolpath.position_mm[above, 2].max(initial=clearance)
    for row in _stretches(above):
        yield Issue(
            "error",
            "above-clearance",
            int(toolpath.source_line[row]),
            f"feed at Z {toolpath.position_mm[row, 2]:.3f}, above the clearance plane at {clearance:.3f}",
            f"raise [clearance] z_mm to {highest:.3f} or more, or check the zero point and the unit",
        )


def _tools(toolpath: Toolpath, cell: Cell, feed: Bools) -> Iterator[Issue]:
    moves = toolpath.is_position() & ~toolpath.machine
    first = int(np.argmax(moves))
    if moves[first] and toolpath.tool[first] > 0 and first <= _first_change(toolpath):
        yield Issue(
            "warning",
            "tool-assumed",
            int(toolpath.source_line[first]),
            f"no tool has been named (T… M6); tool {toolpath.tool[first]} is taken as mounted",
            "program T and M6",
        )
    for number in used_tools(toolpath):
        row = int(np.argmax(moves & (toolpath.tool == number)))
        line = int(toolpath.source_line[row])
        for event in toolpath.events:
            if event.kind == "tool" and event.values["tool"] == number:
                line = int(event.values["line"])
                break
        if number == 0:
            emptied = any(event.kind == "tool" and event.values["tool"] == 0 for event in toolpath.events)
            yield from _no_tool(line, emptied)
        elif number not in cell.tool:
            yield Issue(
                "error",
                "tool-unknown",
                line,
                f"T{number} is not in the cell",
                f"`gcode2krl tools import LIBRARY --cell CELL.toml --only {number}` adds it: from the CAM's "
                "library, or from this program's comments where they name them (--tools LIBRARY: one call); "
                f"or write [tool.{number}] with diameter_mm, teeth and length_mm, or tool_data",
            )
        elif number in _without_length(toolpath, cell):
            yield Issue(
                "error",
                "tool-unknown",
                line,
                f"T{number} has no length and no frame in the cell",
                f"give tool.{number}.length_mm",
            )


def _without_length(toolpath: Toolpath, cell: Cell) -> list[int]:
    """Return the tools of the cell that move and have neither a length nor a frame."""
    tools = [(number, cell.tool[number]) for number in used_tools(toolpath) if number in cell.tool]
    return [number for number, tool in tools if tool.length_mm is None and tool.frame is None]


def _first_change(toolpath: Toolpath) -> int:
    """Return the row of the first tool change; the cell's mounted tool is in the spindle up to it."""
    return min((event.row for event in toolpath.events if event.kind == "tool"), default=len(toolpath))


def _no_tool(line: int, emptied: bool) -> Iterator[Issue]:
    if emptied:
        yield Issue(
            "error", "tool-missing", line, "moves with an empty spindle (T0 M6)", "change to a tool first"
        )
    else:
        yield Issue(
            "error",
            "tool-missing",
            line,
            "no tool has been named (T… M6), and the cell does not say which is mounted",
            "program T and M6, or give mounted_tool in the cell",
        )


def _events(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    for event in toolpath.events:
        code = m_code(event)
        if code and not has_krl(code, cell):
            yield Issue(
                "error",
                "m-code-unmapped",
                int(event.values["line"]),
                f"{code} has no KRL in the cell",
                "give tool_change in the cell"
                if code == "M6"
                else f'add {code} = "…" to [m_code] of the cell',
            )


def _silent_changes(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield the changes to another tool at which nobody changes it: the tip is taken for that of the new."""
    changes = [event for event in toolpath.events if event.kind == "tool"]
    if not changes or not cell.tool_change.strip():
        return
    from gcode2krl.cell.m_codes import silent_changes

    silent = set(silent_changes(cell, sorted({event.values["tool"] for event in changes})))
    in_spindle = int(toolpath.tool[0]) or None
    for event in changes:
        number = event.values["tool"]
        if number not in silent:
            in_spindle = number or None
            continue
        if number and in_spindle and number != in_spindle:
            yield Issue(
                "error",
                "tool-change-silent",
                int(event.values["line"]),
                f"T{number} is called with T{in_spindle} in the spindle, and tool_change of the cell neither "
                "stops, waits nor calls anything",
                "let tool_change stop or call the magazine, or use one tool in a program",
                key="tool_change",
            )
        in_spindle = in_spindle or number or None


def _outputs_of_words(toolpath: Toolpath, cell: Cell) -> Iterator[Issue]:
    """Yield the M-codes whose words name an output of the spindle, the coolant or the online side."""
    with_words = [event for event in toolpath.events if {"p", "q", "e"} & event.values.keys()]
    if not with_words:
        return
    from gcode2krl.cell.output_words import reserved_outputs, switched_by_words

    reserved, seen = reserved_outputs(cell), set()
    for event in with_words:
        for signal in sorted(switched_by_words(event, cell) & reserved.keys()):
            if (event.values["m"], signal) in seen:
                continue
            seen.add((event.values["m"], signal))
            yield Issue(
                "error",
                "signal-twice",
                int(event.values["line"]),
                f"M{event.values['m']} switches {signal} here, which belongs to {reserved[signal]}",
                "name another output",
            )


def m_code(event: Event) -> str:
    """Return the M-code an event stands for (``M3``), empty for a plain message."""
    if event.kind == "tool":
        return "M6"
    return f"M{event.values['m']}" if event.values["m"] >= 0 else ""


def has_krl(code: str, cell: Cell) -> bool:
    """Tell whether the cell has KRL for an M-code."""
    return bool(cell.tool_change.strip()) if code == "M6" else code in cell.m_code
