"""What a person must confirm of a cell, where its values come from, and what it does not state."""

from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from gcode2krl.cell import Cell, plain_view, switching
from gcode2krl.cell.confirmation import confirmation_issues, future_confirmation
from gcode2krl.cell.contradictions import contradictory
from gcode2krl.cell.ranges import range_issues
from gcode2krl.cell.sections import Frame, Obstacle, Robot
from gcode2krl.errors import Issue

MISSING = "MISSING"
Row = tuple[str, str, str]


def to_confirm(cell: Cell) -> Iterator[Row]:
    """Yield (what, value, how sure) of everything a person must confirm."""
    robot = cell.robot
    yield "robot", robot.model or ("geometry given" if robot.geometry.known else MISSING), robot.geometry.sure
    yield "$TRAFONAME[] begins with", _robot_name(robot), robot.trafo_sure
    yield "joint limits", _pairs(robot.limits.q_deg), robot.limits.sure
    yield "joint speeds", _list(robot.speeds.qd_deg_s, "deg/s", "unknown"), robot.speeds.sure
    if cell.frames.robroot is not None:
        yield "$ROBROOT", _frame(cell.frames.robroot), cell.frames.sure
    yield "$BASE", _frame(cell.frames.base) + _number("BASE_DATA", cell.frames.base_data), cell.frames.sure
    length_mm = cell.frames.tool_length_mm
    length = f"length {length_mm:g} mm" if length_mm is not None else f"length {MISSING}"
    if cell.frames.tool is not None or not cell.tool or any(one.frame is None for one in cell.tool.values()):
        yield "$TOOL (reference tool)", f"{_frame(cell.frames.tool)}, {length}", cell.frames.sure
    yield from _tools(cell)
    yield from _loads(cell)
    yield "HOME", _list(cell.home.q_deg, "deg", MISSING), "assumption"
    plane = cell.clearance.z_mm
    place = MISSING if plane is None else f"Z {plane} mm in $BASE, free of obstacles all the way"
    yield "clearance plane", place, "assumption"
    yield from _obstacles(cell)
    yield from _signals(cell)
    for item in cell.guard_inputs:
        yield f"$IN[{item.number}]", f"{item.meaning} = {item.value}", "assumption"
    link = cell.online.link
    yield (
        "RSI",
        f"$OUT[{link.t1_output}] on in T1, $OUT[{link.ready_output}] free, PC {link.address}:{link.port}",
        "memory",
    )


def _robot_name(robot: Robot) -> str:
    """Return what the guard compares, and what to do where nobody has read it at a controller."""
    if not robot.trafo_name:
        return "not compared: state [robot] trafo_name"
    is_read = robot.trafo_sure in ("verified", "checked")
    return robot.trafo_name + (
        "" if is_read else ": if the controller shows another name, state [robot] trafo_name"
    )


def _loads(cell: Cell) -> Iterator[Row]:
    """Yield ``$LOAD``, and that of each tool that has its own."""
    loads = {
        f"$LOAD with T{number}": tool.load for number, tool in cell.tool.items() if tool.load is not None
    }
    every = {"$LOAD": cell.load} if len(loads) < len(cell.tool) or not cell.tool else {}
    for name, load in {**every, **loads}.items():
        centre = f"at X {load.x_mm:g} Y {load.y_mm:g} Z {load.z_mm:g}"
        inertia = f"J {load.jx_kgm2:g} {load.jy_kgm2:g} {load.jz_kgm2:g} kgm2"
        weight = f"{load.mass_kg:g} kg {centre}, {inertia}" if load.mass_kg is not None else MISSING
        yield name, weight, load.sure


def missing_keys(cell: Cell) -> list[str]:
    """Return the keys that any program needs and the cell does not state."""
    stated = {
        "robot.model": cell.robot.geometry.known or None,
        "robot.limits.q_deg": cell.robot.limits.q_deg,
        "frames.base": cell.frames.base,
        "home.q_deg": cell.home.q_deg,
        "clearance.z_mm": cell.clearance_z_mm,
        "tool": cell.tool or None,
    }
    keys = [key for key, value in stated.items() if value is None]
    for number in sorted(cell.tool):
        keys += cell.missing_of_tool(number)
    if any(tool.tool_data is None and cell.load_of(n).mass_kg is None for n, tool in cell.tool.items()):
        keys.append("load.mass_kg")
    if cell.spindle.max_rpm is None:
        keys.append("spindle.max_rpm")
    keys += [f"m_code.{code}" for code in ("M3", "M5") if code not in cell.m_code]
    return list(dict.fromkeys(keys))


def findings(cell: Cell) -> list[Issue]:
    """Return what is doubtful in the cell, and what is not allowed in its templates."""
    templates = cell.templates()
    wrong = switching.template_issues(templates, _template_values(cell), cell.program.externals)
    pairs = switching.pair_issues(templates, _template_values(cell))
    unconfirmed = [issue for issue in confirmation_issues(cell) if issue.severity == "warning"]
    judged = (*range_issues(cell), *contradictory(cell))
    return [*wrong, *pairs, *judged, *unconfirmed, *future_confirmation(cell)]


def origin_of(cell: Cell, key: str, lines: Mapping[str, int]) -> str:
    """Return where the value of a dotted key comes from; ``lines`` are those of the values of its file."""
    steps = key.split(".")
    places = {".".join(steps[:count]) for count in range(1, len(steps) + 1)}  # a frame is stated whole
    for taken in cell.taken_over:
        if taken.key in places:
            return f"taken over from {taken.source}"
    for place in places & lines.keys():
        return f"line {lines[place]}"
    return "default" if places & set(cell.defaults) else "library or default"


def switched(cell: Cell) -> dict[str, str]:
    """Return key → what its template switches or says, as far as it can be rendered."""
    return {
        name if name in cell.templates() else f"m_code.{name}": value for name, value, _ in _signals(cell)
    }


def _tools(cell: Cell) -> Iterator[Row]:
    for number, tool in sorted(cell.tool.items()):
        length = f"{tool.length_mm:g} mm" if tool.length_mm is not None else "no length"
        whose = " (library)" if f"tool.{number}.length_mm" in cell.defaults else ""
        data = _number("TOOL_DATA", tool.tool_data)
        frame = f", $TOOL {_frame(tool.frame)}, {tool.axis or '+z'} to the holder" if tool.frame else ""
        shape = f"{tool.model or tool.kind} D{tool.diameter_mm:g} z{tool.teeth}"
        yield f"tool T{number}", f"{shape} {length}{whose}{data}{frame}", tool.sure


def _obstacles(cell: Cell) -> Iterator[Row]:
    """Yield the shapes that collisions are checked with."""
    for obstacle in cell.obstacle:
        yield f"obstacle {obstacle.name}", _shape(obstacle), "assumption"
    body, arm = cell.spindle.body, cell.robot.body
    if body is not None:
        yield "spindle body", f"{len(body.capsules)} capsules in the flange frame", body.sure
    if (cell.obstacle or body is not None) and arm.capsules:
        yield "arm", f"{len(arm.capsules)} capsules", arm.sure


def _shape(obstacle: Obstacle) -> str:
    where = "$BASE" if obstacle.frame == "base" else "the robot root"
    if obstacle.box_mm is not None:
        low, high = (" ".join(f"{x:g}" for x in corner) for corner in obstacle.box_mm)
        return f"box {low} to {high} mm in {where}"
    if obstacle.plane is not None:
        point, normal = (
            " ".join(f"{x:g}" for x in v) for v in (obstacle.plane.point_mm, obstacle.plane.normal)
        )
        return f"solid behind the plane through {point} mm, free towards {normal}, in {where}"
    return f"mesh {PurePath(str(obstacle.mesh)).name} in {where}"


def _signals(cell: Cell) -> Iterator[Row]:
    """Yield what each M-code really switches, read back from its rendered template."""
    spindle = cell.spindle
    most = f"{spindle.max_rpm:g} rpm at most" if spindle.max_rpm is not None else MISSING
    yield "spindle", most, spindle.sure
    texts = switching.rendered(cell.templates(), _template_values(cell))
    for key, template in cell.templates().items():
        name = key.removeprefix("m_code.")
        if key not in texts:
            yield name, f"cannot be rendered: {' '.join(template.split())[:60]}", "assumption"
            continue
        switched = switching.signals_text(texts, key)
        statements = "; ".join(line.strip() for line in texts[key].split("\n") if line.strip())
        yield name, f"switches {switched}" if switched else statements[:100], "assumption"


def _template_values(cell: Cell) -> dict[str, Any]:
    return {"cell": plain_view(cell), "spindle": cell.spindle.model_dump()}


def _frame(frame: Frame | None) -> str:
    if frame is None:
        return MISSING
    place = f"X {frame.x_mm:g} Y {frame.y_mm:g} Z {frame.z_mm:g}"
    return f"{place} A {frame.a_deg:g} B {frame.b_deg:g} C {frame.c_deg:g}"


def _number(name: str, number: int | None) -> str:
    return f" = {name}[{number}]" if number is not None else ""


def _pairs(pairs: tuple[tuple[float, float], ...] | None) -> str:
    if pairs is None:
        return "unknown: translation refuses"
    return ", ".join(f"{low:g}..{high:g}" for low, high in pairs) + " deg"


def _list(values: tuple[float, ...] | None, unit: str, unknown: str) -> str:
    return unknown if values is None else f"{', '.join(f'{v:g}' for v in values)} {unit}"
