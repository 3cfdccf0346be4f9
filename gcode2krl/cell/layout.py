"""Where things of a cell stand, against each other: plane, stock, table, clamps, tools, load, arm.

Only sizes that the cell itself states are compared; the way of a program is judged elsewhere.
"""

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.sections import Frame, Load, Obstacle
from gcode2krl.errors import Issue, Severity

Box = tuple[Floats, Floats]
"""Low and high corner (3,) in mm."""

_MM = 1.0
"""What stands on something may be this much inside it: boxes of a cell are measured by hand."""
_METRES = 10.0
"""Frames whose numbers are all smaller were typed in metres: no $BASE lies within 10 mm of the robot root."""
_INSIDE_FLANGE_MM = 30.0
"""No end effector is shorter: the flange of the smallest arm (KR 3) has a radius of 20 mm."""
_NEAR_LOAD_MM, _HEAVY_KG = 10.0, 5.0
_BEHIND_MM = 30.0
_AROUND_LOAD_MM = 200.0
_LARGEST_GYRATION_MM, _LEAST_GYRATION_MM = 1000.0, 3.0
"""Of what hangs on a flange: end effectors of milling cells are below 1.5 m (`ranges.toml`)."""
_TRIANGLE = 1.02
"""Data sheets round inertias to two digits."""
_BEYOND_REACH_MM = 500.0
"""$BASE may lie beside the work: that far outside of all reach it does not."""
_LEAST_STOCK_MM, _LEAST_GAP_MM = 2.0, 1.0
_AXIS_TURNED = 0.9
_FAR_BODY_MM = 400.0
_SAME_MM = 1e-6


def layout_issues(cell: Cell) -> Iterator[Issue]:
    """Yield what cannot stand where the cell says, or hardly does."""
    yield from _frames(cell)
    yield from _stock(cell)
    yield from _plane(cell)
    yield from _obstacles(cell)
    yield from _tools(cell)
    yield from _same_tools(cell)
    yield from _loads(cell)
    yield from _home(cell)


def stock_box(cell: Cell) -> Box | None:
    """Return the corners of the stated stock in ``$BASE``; None without one, or for a mesh."""
    box = cell.stock.box_mm if cell.stock is not None else None
    return None if box is None else (np.array(box[0]), np.array(box[1]))


def obstacle_box(cell: Cell, obstacle: Obstacle) -> Box | None:
    """Return the box around an obstacle in ``$BASE``; None for meshes, planes and unknown frames."""
    if obstacle.box_mm is None:
        return None
    corners = np.array(list(product(*zip(*obstacle.box_mm, strict=True))))
    if obstacle.frame != "base":
        if cell.frames.base is None:
            return None
        base = cell.base_matrix() if obstacle.frame == "robroot" else cell.base_in_world()
        corners = (corners - base[:3, 3]) @ base[:3, :3]
    return corners.min(axis=0), corners.max(axis=0)


def reach_mm(cell: Cell) -> float | None:
    """Return how far the wrist's centre gets from the axis A2, None without the arm's geometry."""
    geometry = cell.robot.geometry
    if not geometry.known:
        return None
    _, a2, _, c2, c3, _ = geometry.array()
    return float(c2 + np.hypot(c3, a2))


def _beyond_reach_mm(cell: Cell, points_base_mm: Floats, tip_mm: float) -> Floats | None:
    """Return by how much points (n, 3) in ``$BASE`` are out of reach; None where that is not known."""
    wrist_mm = reach_mm(cell)
    if wrist_mm is None or cell.frames.base is None or cell.external:
        return None
    base = cell.base_matrix()
    points = points_base_mm @ base[:3, :3].T + base[:3, 3]
    a1, _, c1, *_ = cell.robot.geometry.array()
    away = np.hypot(np.maximum(np.hypot(points[:, 0], points[:, 1]) - a1, 0.0), points[:, 2] - c1)
    return np.asarray(away - wrist_mm - tip_mm)


def _longest_tip_mm(cell: Cell) -> float:
    """Return how far the tip of the longest tool is from the wrist's centre; 1000 where it is not known."""
    c4_mm = cell.robot.geometry.c4_mm or 0.0
    tips = [cell.tool_matrix(n)[:3, 3] for n in cell.tool if not cell.missing_of_tool(n)]
    return max((float(np.linalg.norm(tip + np.array([0.0, 0.0, c4_mm]))) for tip in tips), default=1000.0)


def _frames(cell: Cell) -> Iterator[Issue]:
    base, robroot, tool = cell.frames.base, cell.frames.robroot, cell.frames.tool
    for key, frame in (("frames.base", base), ("frames.robroot", robroot)):
        place = _place(frame)
        if place is not None and 0.0 < np.abs(place).max() < _METRES:
            turned = (
                key == "frames.base"
                or abs(frame.b_deg if frame else 0) + abs(frame.c_deg if frame else 0) > 90
            )
            yield _wrong(
                "error" if turned else "warning",
                key,
                f"X {place[0]:g} Y {place[1]:g} Z {place[2]:g} mm is within the foot of the robot: metres?",
            )
    named = {"frames.base": base, "frames.robroot": robroot, "frames.tool": tool}
    named |= {f"work_offsets.{name}": frame for name, frame in cell.work_offsets.items()}
    for (key, frame), (other_key, other) in combinations(named.items(), 2):
        if frame is not None and frame == other and not key.startswith("work") and _is_some(frame):
            yield _wrong("error", other_key, f"is {key} again, number by number: one was copied")
    if base is None:
        return
    if cell.base_in_world()[2, 2] < -0.5:
        text = "stands upside down: its Z points to the floor, and so does the clearance plane"
        yield _wrong("warning", "frames.base", text)
    zeros = np.array([[0.0, 0.0, 0.0], *(_place(frame) for frame in cell.work_offsets.values())])
    if (box := stock_box(cell)) is not None:
        zeros = np.vstack([zeros, *box])
    beyond = _beyond_reach_mm(cell, zeros, _longest_tip_mm(cell))
    if beyond is not None and beyond.min() > _BEYOND_REACH_MM:
        yield _wrong("warning", "frames.base", f"is {beyond.min():.0f} mm beyond the reach of the arm")


def _stock(cell: Cell) -> Iterator[Issue]:
    stock, box = cell.stock, stock_box(cell)
    if stock is None or box is None:
        return
    low, high = box
    if (high - low).max() < _LEAST_STOCK_MM:
        yield _wrong("error", "stock.box_mm", f"is {_sizes(high - low)} mm large: metres?")
        return
    if cell.table is not None:
        under_mm = cell.table.z_mm - low[2]
        if under_mm > _MM:
            yield _wrong("error", "table.z_mm", f"is {under_mm:g} mm above the underside of the stock")
        elif 0.0 < -under_mm < stock.through_mm - _MM:
            text = f"goes {stock.through_mm + under_mm:g} mm into the table at Z {cell.table.z_mm:g}"
            yield _wrong("error", "stock.through_mm", text)
        elif abs(under_mm) <= _MM and stock.through_mm > _MM:
            yield _wrong("warning", "stock.through_mm", "goes into the table on which the stock lies")
    nearest = np.clip(_shoulder(cell), low, high) if cell.frames.base is not None else None
    beyond = None if nearest is None else _beyond_reach_mm(cell, nearest[None], _longest_tip_mm(cell))
    if beyond is not None and beyond[0] > 0.0:
        yield _wrong("error", "stock.box_mm", f"is {beyond[0]:.0f} mm out of the robot's reach as a whole")
    smallest = min((tool.diameter_mm for tool in cell.tool.values()), default=np.inf)
    if stock.resolution_mm is not None and stock.resolution_mm > min(smallest, (high - low).min()):
        text = f"= {stock.resolution_mm:g} is more than the smallest cutter or the stock is thick"
        yield _wrong("warning", "stock.resolution_mm", text)


def _shoulder(cell: Cell) -> Floats:
    """Return the middle of axis A2 (3,) in ``$BASE``, from where everything is reached."""
    base, c1_mm = cell.base_matrix(), cell.robot.geometry.c1_mm or 0.0
    return np.asarray((np.array([0.0, 0.0, c1_mm]) - base[:3, 3]) @ base[:3, :3])


def _plane(cell: Cell) -> Iterator[Issue]:
    z_mm, box = cell.clearance_z_mm, stock_box(cell)
    if z_mm is None:
        return
    key = "clearance.z_mm"
    if box is not None and z_mm <= box[1][2]:
        # no error: a program beside a high raw part may be sound, and its ways are held against the stock
        yield _wrong("warning", key, f"= {z_mm:g} is not above the stock, whose top is at {box[1][2]:g}")
    elif box is not None and z_mm < box[1][2] + _LEAST_GAP_MM:
        yield _wrong("warning", key, f"= {z_mm:g} is {z_mm - box[1][2]:g} mm above the top of the stock")
    elif box is not None and cell.collision.clearance_mm >= z_mm - box[1][2]:
        text = f"= {cell.collision.clearance_mm:g} is more than from the clearance plane to the stock"
        yield _wrong("warning", "collision.clearance_mm", text)
    if cell.table is not None and z_mm <= cell.table.z_mm:
        yield _wrong("error", key, f"= {z_mm:g} is not above the table at {cell.table.z_mm:g}")
    if box is None:
        return
    around_mm = max((tool.diameter_mm for tool in cell.tool.values()), default=0.0)
    for obstacle in cell.obstacle:
        clamp = obstacle_box(cell, obstacle)
        if clamp is None or not clamp[0][2] < z_mm < clamp[1][2]:
            continue
        if _overlap(clamp, (box[0] - around_mm, box[1] + around_mm), 2):
            text = f"= {z_mm:g} is below the top of obstacle {obstacle.name}, {clamp[1][2]:g}, at the stock"
            yield _wrong("warning", key, text)


def _obstacles(cell: Cell) -> Iterator[Issue]:
    stock = stock_box(cell)
    boxes: list[tuple[Obstacle, Box]] = []
    for number, obstacle in enumerate(cell.obstacle):
        key = f"obstacle.{number}"
        if obstacle.plane is not None:
            yield from _behind_plane(cell, obstacle, key, stock)
        box = obstacle_box(cell, obstacle)
        if box is None:
            continue
        low, high = box
        for other, other_box in boxes:
            if np.allclose(box, other_box, atol=_SAME_MM):
                yield _wrong("warning", key, f"{obstacle.name} stands where {other.name} stands")
        boxes.append((obstacle, box))
        if (high - low).max() < _METRES:
            text = f"{obstacle.name} is {_sizes(high - low)} mm large: metres?"
            yield _wrong("warning", f"{key}.box_mm", text)
        if stock is not None:
            yield from _in_stock(obstacle, key, box, stock)
        if cell.table is not None and obstacle.frame == "base" and high[2] < cell.table.z_mm - _MM:
            text = f"{obstacle.name} ends {cell.table.z_mm - high[2]:g} mm below the table"
            yield _wrong("warning", f"{key}.box_mm", text)
        if cell.frames.base is not None and cell.robot.geometry.known and not cell.external:
            shoulder = _shoulder(cell)
            if (low < shoulder).all() and (shoulder < high).all():
                yield _wrong("error", f"{key}.box_mm", f"{obstacle.name} has the robot in it: another frame?")


def _in_stock(obstacle: Obstacle, key: str, box: Box, stock: Box) -> Iterator[Issue]:
    (low, high), (stock_low, stock_high) = box, stock
    if (low < stock_low - _MM).all() and (high > stock_high + _MM).all():
        yield _wrong("error", f"{key}.box_mm", f"{obstacle.name} has the whole stock in it")
        return
    inside = np.prod(np.maximum(np.minimum(high, stock_high) - np.maximum(low, stock_low), 0.0))
    share = inside / np.prod(high - low)
    if share > 0.999:
        yield _wrong("error", f"{key}.box_mm", f"{obstacle.name} is inside the stock")
    elif share > 0.5:
        yield _wrong("warning", f"{key}.box_mm", f"{share:.0%} of {obstacle.name} is inside the stock")


def _behind_plane(cell: Cell, obstacle: Obstacle, key: str, stock: Box | None) -> Iterator[Issue]:
    """Yield a plane whose solid side has the robot or the stock: its normal points the wrong way."""
    if obstacle.plane is None or cell.frames.base is None:
        return
    frame = np.eye(4)
    if obstacle.frame == "robroot":
        frame = cell.base_matrix()
    elif obstacle.frame == "world":
        frame = cell.base_in_world()
    points = [] if stock is None else [("the stock", (stock[0] + stock[1]) / 2.0)]
    if cell.robot.geometry.known and not cell.external:
        points.append(("the robot", _shoulder(cell)))
    for what, point in points:
        there = frame[:3, :3] @ point + frame[:3, 3]
        if (there - obstacle.plane.point_mm) @ np.array(obstacle.plane.normal) < 0.0:
            text = f"{obstacle.name}: {what} stands on its solid side; the normal points to the free side"
            # A fence ends somewhere; the plane that stands for it does not: a doubt, no error.
            severity: Severity = "warning" if what == "the robot" else "error"
            yield _wrong(severity, f"{key}.plane", text)
            return


def _tools(cell: Cell) -> Iterator[Issue]:
    length_mm, wrist_mm = cell.frames.tool_length_mm, reach_mm(cell)
    lengths = [tool.length_mm for tool in cell.tool.values() if tool.length_mm and tool.frame is None]
    if length_mm is not None and 0.0 < length_mm < 1.0:
        yield _wrong("error", "frames.tool_length_mm", f"= {length_mm:g} is no length of a tool: metres?")
    elif length_mm and lengths and not min(lengths) / 5.0 < length_mm < max(lengths) * 5.0:
        text = f"= {length_mm:g}, and the tools are {min(lengths):g} to {max(lengths):g} mm long"
        yield _wrong("warning", "frames.tool_length_mm", text)
    seen: set[str] = set()
    for number, tool in cell.tool.items():
        if cell.missing_of_tool(number):
            continue
        key = f"tool.{number}.frame" if tool.frame is not None else "frames.tool"
        tip = cell.tool_matrix(number)
        for issue in _tip(cell, key, number, tip, wrist_mm):
            if issue.key not in seen:
                seen.add(issue.key)
                yield issue
    sensor_mm = cell.compliance.sensor_height_mm
    if sensor_mm and cell.tool and sensor_mm > _longest_tip_mm(cell):
        text = f"= {sensor_mm:g}: the sensor reaches beyond the tip of the longest tool"
        yield _wrong("error", "compliance.sensor_height_mm", text)


def _tip(cell: Cell, key: str, number: int, frame: Floats, wrist_mm: float | None) -> Iterator[Issue]:
    tip, away_mm = frame[:3, 3], float(np.linalg.norm(frame[:3, 3]))
    shown = f"the tip of T{number} at X {tip[0]:.4g} Y {tip[1]:.4g} Z {tip[2]:.4g}"
    if away_mm < _INSIDE_FLANGE_MM:
        yield _wrong("error", key, f"{shown} is within the flange")
        return
    if tip[2] < -50.0 and np.hypot(tip[0], tip[1]) < 60.0:
        yield _wrong("error", key, f"{shown} is within the wrist: Z of the flange points away from the arm")
        return
    if wrist_mm is not None and away_mm > wrist_mm:
        yield _wrong(
            "error", key, f"{shown} is farther from the flange than the arm reaches, {wrist_mm:.0f} mm"
        )
        return
    tool = cell.tool[number]
    length_mm = tool.length_mm or 0.0
    gauge = tip + length_mm * frame[:3, 2]
    if length_mm and np.linalg.norm(gauge) > away_mm + _AXIS_TURNED * length_mm:
        yield _wrong("warning", key, f"{shown} points to the flange: z leads from the tip to the holder")
    body = cell.spindle.body
    if body is None:
        return
    near = min(_distance_mm(tip, np.array(c.from_mm), np.array(c.to_mm)) - c.radius_mm for c in body.capsules)
    if near < 0.0:
        yield _wrong("error", "spindle.body", f"{shown} is inside the body of the spindle")
    nose = min(
        _distance_mm(gauge, np.array(c.from_mm), np.array(c.to_mm)) - c.radius_mm for c in body.capsules
    )
    if length_mm and nose > _FAR_BODY_MM:
        text = f"ends {nose:.0f} mm from where the holder of T{number} begins"
        yield _wrong("warning", "spindle.body", text)


def _same_tools(cell: Cell) -> Iterator[Issue]:
    for (first, a), (second, b) in combinations(cell.tool.items(), 2):
        lengths = (
            a.length_mm is not None and b.length_mm is not None and abs(a.length_mm - b.length_mm) > 0.01
        )
        if a.tool_data is not None and a.tool_data == b.tool_data:
            yield _wrong(
                "error" if lengths or a.frame != b.frame else "warning",
                f"tool.{second}.tool_data",
                f"is TOOL_DATA[{a.tool_data}], and so is tool.{first}.tool_data",
            )
        elif a.frame is not None and a.frame == b.frame and lengths:
            text = f"is that of T{first}, and the tools are {a.length_mm:g} and {b.length_mm:g} mm long"
            yield _wrong("error", f"tool.{second}.frame", text)


def _loads(cell: Cell) -> Iterator[Issue]:
    loads = {"load": (cell.load, next(iter(cell.tool), None))}
    loads |= {f"tool.{n}.load": (tool.load, n) for n, tool in cell.tool.items() if tool.load is not None}
    rated_kg = cell.robot.payload.mass_kg
    for key, (load, number) in loads.items():
        if load is None or load.mass_kg is None:
            continue
        if rated_kg is not None and load.mass_kg > rated_kg * 1.0001:
            severity: Severity = "error" if load.mass_kg > 1.5 * rated_kg else "warning"
            text = f"= {load.mass_kg:g}, and the robot carries {rated_kg:g} kg"
            yield _wrong(severity, f"{key}.mass_kg", text)
        elif rated_kg == load.mass_kg:
            yield _wrong("warning", f"{key}.mass_kg", f"= {load.mass_kg:g} is the rated payload: weighed?")
        if key != "load" and cell.load.mass_kg and load.mass_kg < 0.2 * cell.load.mass_kg:
            text = f"= {load.mass_kg:g} is the tool alone: everything on the flange is meant"
            yield _wrong("warning", f"{key}.mass_kg", text)
        tip = None
        if number is not None and not cell.missing_of_tool(number):
            tip = cell.tool_matrix(number)[:3, 3]
        yield from _centre(load, key, tip)
        yield from _inertia(load, key)


def _centre(load: Load, key: str, tip: Floats | None) -> Iterator[Issue]:
    centre = np.array([load.x_mm, load.y_mm, load.z_mm])
    away_mm = float(np.linalg.norm(centre))
    axis = "xyz"[int(np.abs(centre).argmax())]
    stated = {"x_mm", "y_mm", "z_mm"} & load.model_fields_set
    mass_kg = load.mass_kg or 0.0
    if stated and 0.0 < away_mm < 1.0:
        text = f"= {centre.max():g}: the centre of {mass_kg:g} kg is on the face of the flange: metres?"
        yield _wrong("error", f"{key}.{axis}_mm", text)
    elif stated and away_mm < _NEAR_LOAD_MM and mass_kg >= _HEAVY_KG:
        text = f": the centre of {mass_kg:g} kg is {away_mm:g} mm from the middle of the flange's face"
        yield _wrong("warning", f"{key}.{axis}_mm", text)
    elif tip is not None and away_mm > 0.0:
        if centre[2] < -_BEHIND_MM and tip[2] > 0.0:
            text = f"= {centre[2]:g} is behind the flange, and the tip is in front of it, at {tip[2]:.4g}"
            yield _wrong("warning", f"{key}.z_mm", text)
        elif centre @ tip < 0.0:
            side = "xyz"[int((centre * tip).argmin())]
            text = ": the centre of gravity and the tip are on different sides of the flange"
            yield _wrong("warning", f"{key}.{side}_mm", text)
        elif np.linalg.norm(centre - tip) < 1.0:
            yield _wrong(
                "warning", f"{key}.{axis}_mm", ": the centre of gravity is the tip of the tool: copied?"
            )
        elif away_mm > np.linalg.norm(tip) + _AROUND_LOAD_MM:
            text = f"= {centre[int(np.abs(centre).argmax())]:g}: the centre of gravity is far beyond the tip"
            yield _wrong("warning", f"{key}.{axis}_mm", text)


def _inertia(load: Load, key: str) -> Iterator[Issue]:
    inertia = {"jx": load.jx_kgm2, "jy": load.jy_kgm2, "jz": load.jz_kgm2}
    name = max(inertia, key=lambda axis: inertia[axis])
    largest, total = inertia[name], sum(inertia.values())
    if largest > _TRIANGLE * (total - largest) and largest > 0.0:
        text = f"= {largest:g} is more than the other two together: no body has that"
        yield _wrong("error", f"{key}.{name}_kgm2", text)
    elif largest > 0.0 and load.mass_kg:
        radius_mm = 1000.0 * float(np.sqrt(largest / load.mass_kg))
        if not _LEAST_GYRATION_MM < radius_mm < _LARGEST_GYRATION_MM:
            text = f"= {largest:g} with {load.mass_kg:g} kg is a radius of gyration of {radius_mm:.3g} mm"
            yield _wrong("warning", f"{key}.{name}_kgm2", text)


def _home(cell: Cell) -> Iterator[Issue]:
    if cell.home.q_deg is None or cell.robot.limits.q_deg is None:
        return
    for number, (angle, (low, high)) in enumerate(
        zip(cell.home.q_deg, cell.robot.limits.q_deg, strict=True), start=1
    ):
        if not low <= angle <= high:
            text = f": HOME has A{number} at {angle:g}, beyond its limits, {low:g} to {high:g}"
            yield _wrong("warning", "home.q_deg", text)


def _distance_mm(point: Floats, start: Floats, end: Floats) -> float:
    along = end - start
    share = np.clip((point - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * along))


def _overlap(a: Box, b: Box, axes: int) -> bool:
    return bool((a[0][:axes] < b[1][:axes]).all() and (b[0][:axes] < a[1][:axes]).all())


def _place(frame: Frame | None) -> Floats | None:
    return None if frame is None else np.array([frame.x_mm, frame.y_mm, frame.z_mm])


def _is_some(frame: Frame) -> bool:
    return bool(np.abs(_place(frame)).max() > 0.0)  # type: ignore[arg-type]  # it is a frame


def _sizes(size: Floats) -> str:
    return " x ".join(f"{length:g}" for length in size)


def _wrong(severity: Severity, key: str, text: str) -> Issue:
    remedy = f"measure it, and correct {key} or what it contradicts"
    return Issue(severity, "cell-contradiction", 0, f"{key} {text}".replace(" :", ":"), remedy, key=key)
