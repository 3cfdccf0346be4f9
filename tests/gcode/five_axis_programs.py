"""Sound five-axis programs for any declared machine: tips and tool axes of a part, posted by matrices.

The post shares nothing with the reader: angles are found by the directions of two axes, positions by solving
homogeneous matrices (scipy). ``SOUND`` names the programs, `posted` writes one for a machine.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Vector = NDArray[np.float64]
TOOL_MM = 100.0
"""Length of tool 1 of the demonstration cell."""
STOCK = "[stock]\nbox_mm = [[-60.0, -60.0, -50.0], [60.0, 60.0, 0.0]]\n"


class Step(NamedTuple):
    """A move: rapid or feed, to a tip with a tool axis."""

    rapid: bool
    tip: tuple[float, float, float]
    axis: tuple[float, float, float]


def _unit(x: float, y: float, z: float) -> Vector:
    vector = np.array([x, y, z])
    return np.asarray(vector / np.linalg.norm(vector))


def _step(rapid: bool, tip: Vector, axis: Vector) -> Step:
    return Step(rapid, tuple(map(float, tip)), tuple(map(float, axis)))  # type: ignore[arg-type]


def _cut(points: list[tuple[Vector, Vector]], out_mm: float = 30.0) -> Iterator[Step]:
    """Yield the approach along the axis, the feed moves, and the retract along the axis."""
    (first, axis), (last, end_axis) = points[0], points[-1]
    yield _step(True, first + out_mm * axis, axis)
    yield _step(False, first, axis)
    for tip, direction in points[1:]:
        yield _step(False, tip, direction)
    yield _step(True, last + out_mm * end_axis, end_axis)


def _plane(centre: Vector, normal: Vector, size_mm: float, lines: int) -> list[tuple[Vector, Vector]]:
    """Return a zigzag in a plane, turned within it."""
    across = _unit(*np.cross(normal, [0.3, 1.0, 0.2]))
    along = np.cross(normal, across)
    points = []
    for k in range(lines):
        v = size_mm * (k / (lines - 1) - 0.5)
        for u in (-0.5, 0.5) if k % 2 == 0 else (0.5, -0.5):
            points.append((centre + u * size_mm * across + v * along, normal))
    return points


def tilted_planes() -> Iterator[Step]:
    """Yield 3+2: the top, and four planes around it, each at its own depth."""
    yield from _cut(_plane(np.array([0.0, 0.0, -2.0]), _unit(0, 0, 1), 80.0, 5))
    for k, depth_mm in enumerate((6.0, 9.0, 12.0, 8.0)):
        angle = math.radians(20.0 + 80.0 * k)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        normal = _unit(*(math.sin(math.radians(30.0)) * out + [0.0, 0.0, math.cos(math.radians(30.0))]))
        yield from _cut(_plane(48.0 * out + [0.0, 0.0, -depth_mm], normal, 24.0, 4))


def tilted_holes() -> Iterator[Step]:
    """Yield holes drilled at five angles, each down and up along its axis."""
    for k in range(5):
        angle = math.radians(15.0 + 65.0 * k)
        axis = _unit(0.5 * math.cos(angle), 0.5 * math.sin(angle), 1.0)
        mouth = np.array([35.0 * math.cos(angle), 35.0 * math.sin(angle), -1.0])
        yield _step(True, mouth + 40.0 * axis, axis)
        yield _step(True, mouth + 3.0 * axis, axis)
        yield _step(False, mouth - 15.0 * axis, axis)
        yield _step(True, mouth + 40.0 * axis, axis)


def sphere(lead_deg: float = 0.0) -> Iterator[Step]:
    """Yield a spherical dome, finished in rings, the tool along the normal or leaning towards its feed."""
    points = []
    for ring in range(1, 6):
        polar = math.radians(9.0 * ring)
        for k in range(37):
            angle = 2.0 * math.pi * k / 36.0 + 0.3
            normal = np.array(
                [math.sin(polar) * math.cos(angle), math.sin(polar) * math.sin(angle), math.cos(polar)]
            )
            along = np.array([-math.sin(angle), math.cos(angle), 0.0])
            lead = math.radians(lead_deg)
            tip = np.array([8.0, -5.0, -45.0]) + 44.0 * normal
            points.append((tip, math.cos(lead) * normal + math.sin(lead) * along))
    yield from _cut(points)


def dome_raster() -> Iterator[Step]:
    """Yield an ellipsoid in parallel passes to and fro, the tool along its normal."""
    points = []
    for k in range(13):
        y = -36.0 + 6.0 * k
        for j in range(25):
            x = (-36.0 + 3.0 * j) * (1 if k % 2 == 0 else -1)
            z = -4.0 - x * x / 140.0 - (y - 6.0) ** 2 / 110.0
            points.append((np.array([x, y, z]), _unit(x / 70.0, (y - 6.0) / 55.0, 1.0)))
    yield from _cut(points)


def cone_swarf() -> Iterator[Step]:
    """Yield the flank of an oblique cone: the tool lies along its rulings."""
    points = []
    for k in range(61):
        angle = 2.0 * math.pi * k / 60.0 - 1.0
        foot = np.array([38.0 * math.cos(angle), 34.0 * math.sin(angle) + 4.0, -18.0])
        head = np.array([26.0 * math.cos(angle) + 5.0, 25.0 * math.sin(angle), 4.0])
        points.append((foot, _unit(*(head - foot))))
    yield from _cut(points)


def impeller() -> Iterator[Step]:
    """Yield twisted blades: ruled flanks from hub to shroud, in and out."""
    for blade in range(4):
        points = []
        for k in range(25):
            share = k / 24.0
            angle = math.radians(90.0 * blade + 70.0 * share + 10.0)
            radius = 14.0 + 34.0 * share
            foot = np.array([radius * math.cos(angle), radius * math.sin(angle), -30.0 + 12.0 * (1 - share)])
            lean = math.radians(10.0 + 22.0 * share)
            side = np.array([-math.sin(angle + 0.4), math.cos(angle + 0.4), 0.0])
            points.append((foot, _unit(*(math.sin(lean) * side + [0.0, 0.0, math.cos(lean)]))))
        yield from _cut(points, 60.0)


def undercut() -> Iterator[Step]:
    """Yield a dovetail around a boss that is no circle: the tool leans outwards below its edge."""
    points = []
    for k in range(73):
        angle = 2.0 * math.pi * k / 72.0 + 0.2
        radius = 34.0 + 6.0 * math.cos(2.0 * angle)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        points.append((radius * out + [0.0, 0.0, -14.0], _unit(*(-0.45 * out + [0.0, 0.0, 1.0]))))
    (first, axis), outwards = points[0], np.array([math.cos(0.2), math.sin(0.2), 0.0])
    yield _step(True, first + 30.0 * outwards + 30.0 * axis, axis)
    yield _step(True, first + 30.0 * outwards, axis)
    for tip, direction in points:
        yield _step(False, tip, direction)
    yield _step(False, first + 30.0 * outwards, axis)
    yield _step(True, first + 30.0 * outwards + 30.0 * axis, axis)


def tilted_pockets() -> Iterator[Step]:
    """Yield roughing in layers of two pockets in sloping faces, each in its tilted plane."""
    for out, slope in ((_unit(1.0, 0.35, 0.0), 25.0), (_unit(-0.4, 1.0, 0.0), 40.0)):
        tilt = math.radians(slope)
        normal = _unit(*(math.sin(tilt) * out + [0.0, 0.0, math.cos(tilt)]))
        for layer in range(3):
            centre = 30.0 * out + np.array([0.0, 0.0, -4.0]) - 3.0 * layer * normal
            yield from _cut(_plane(centre, normal, 20.0, 5))


def wavy_fixed() -> Iterator[Step]:
    """Yield a wavy surface finished under one fixed tilt, to which its slopes have no relation."""
    axis = _unit(0.2, -0.3, 1.0)
    points = []
    for k in range(11):
        y = -30.0 + 6.0 * k
        for j in range(31):
            x = (-36.0 + 2.4 * j) * (1 if k % 2 == 0 else -1)
            points.append((np.array([x, y, -8.0 + 4.0 * math.sin(x / 9.0) + 3.0 * math.cos(y / 7.0)]), axis))
    yield from _cut(points)


def blade_spiral() -> Iterator[Step]:
    """Yield a spiral down an elliptic blade, the tool at 70 degrees from the outward normal, with a lead."""
    points = []
    for k in range(181):
        angle, z = 2.0 * math.pi * k / 36.0, -2.0 - 0.12 * k
        tip = np.array([30.0 * math.cos(angle), 12.0 * math.sin(angle), z])
        normal = _unit(12.0 * math.cos(angle), 30.0 * math.sin(angle), 0.0)
        along = _unit(-30.0 * math.sin(angle), 12.0 * math.cos(angle), 0.0)
        lean = math.radians(20.0)
        axis = math.sin(lean) * normal + math.cos(lean) * np.array([0.0, 0.0, 1.0]) + 0.1 * along
        points.append((tip, _unit(*axis)))
    yield from _cut(points)


def leaning_ring() -> Iterator[Step]:
    """Yield a ring whose tool leans inwards evenly: nothing of it says which sign an axis has."""
    points = []
    for k in range(49):
        angle = 2.0 * math.pi * k / 48.0
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        points.append((32.0 * out + [0.0, 0.0, -8.0], _unit(*(-0.3 * out + [0.0, 0.0, 1.0]))))
    yield from _cut(points)


SOUND: dict[str, Callable[[], Iterator[Step]]] = {
    "tilted planes": tilted_planes,
    "tilted holes": tilted_holes,
    "tilted pockets": tilted_pockets,
    "sphere along the normal": sphere,
    "sphere with lead": lambda: sphere(12.0),
    "dome raster": dome_raster,
    "cone swarf": cone_swarf,
    "impeller": impeller,
    "undercut": undercut,
    "wavy surface, fixed tilt": wavy_fixed,
    "blade spiral": blade_spiral,
    "leaning ring": leaning_ring,
}
MACHINES: dict[str, dict[str, Any]] = {
    "table-table AC": {"kind": "table-table", "axes": ["A", "C"], "signs": [-1, -1]},
    "table-table BC": {"kind": "table-table", "axes": ["B", "C"], "signs": [-1, -1]},
    "table-table AC, other signs": {"kind": "table-table", "axes": ["A", "C"], "signs": [1, -1]},
    "table-head CB": {"kind": "table-head", "axes": ["C", "B"], "signs": [-1, 1]},
    "table-head AB": {"kind": "table-head", "axes": ["A", "B"], "signs": [-1, 1]},
    "head-head CA": {"kind": "head-head", "axes": ["C", "A"], "signs": [1, 1]},
    "head-head AB": {"kind": "head-head", "axes": ["A", "B"], "signs": [1, 1]},
}
LENGTHS: dict[str, Any] = {"pivot_mm": 180.0, "centre_mm": [10.0, -15.0, -140.0]}


def _chain(machine: dict[str, Any]) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
    """Return letters and signs of the table's axes and of the head's."""
    pairs = list(zip(machine["axes"], machine["signs"], strict=True))
    tables = {"table": 1, "table-table": 2, "table-head": 1}.get(machine["kind"], 0)
    return pairs[:tables], pairs[tables:]


def _angles(machine: dict[str, Any], axis: Vector) -> dict[str, float]:
    """Return the angles in degrees that lay the tool along an axis; the outer one is not unwrapped."""
    tables, heads = _chain(machine)
    turns = [(letter, -sign) for letter, sign in reversed(tables)] + heads
    (outer, s_outer), (inner, s_inner) = turns
    x, y, z = axis
    level = math.hypot(x, y)
    found = {
        "CA": lambda: (math.atan2(x, -y) if level > 1e-12 else 0.0, math.acos(min(z, 1.0))),
        "CB": lambda: (math.atan2(y, x) if level > 1e-12 else 0.0, math.acos(min(z, 1.0))),
        "AB": lambda: (math.atan2(-y, z), math.asin(x)),
        "BA": lambda: (math.atan2(x, z), -math.asin(y)),
    }[outer + inner]()
    return {outer: s_outer * math.degrees(found[0]), inner: s_inner * math.degrees(found[1])}


def _turned(pairs: list[tuple[str, int]], deg: dict[str, float]) -> Rotation:
    made = Rotation.identity()
    for letter, sign in pairs:
        made = made * Rotation.from_euler(
            letter.lower().translate(str.maketrans("abc", "xyz")), sign * deg[letter], degrees=True
        )
    return made


def _position(machine: dict[str, Any], tip: Vector, deg: dict[str, float]) -> Vector:
    """Return the machine's X, Y, Z (tool length in force) with which its tip stands there."""
    tables, heads = _chain(machine)
    reach = machine.get("pivot_mm", 0.0) + TOOL_MM if heads else 0.0
    centre = np.array(machine.get("centre_mm", [0.0, 0.0, 0.0]) if tables else [0.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, reach])
    on_table = _turned(tables, deg).apply(tip - centre) + centre
    return np.asarray(on_table + _turned(heads, deg).apply(up) - up)


def posted(
    name: str,
    machine: dict[str, Any],
    *,
    tip: str = "G43.4 H1",
    per_block_time: bool = False,
    radians: bool = False,
) -> str:
    """Return the program of `SOUND` for a machine; ``tip`` is ``G43 H1`` for the machine's own axes."""
    lines = ["%", f"({name.upper()})", "G21 G90 G94 G17", "T1 M6", "S8000 M3", tip]
    by_tip = tip != "G43 H1"
    before: dict[str, float] = {}
    standing: Vector | None = None
    if per_block_time:
        lines.append("G93")
    for step in SOUND[name]():
        deg = _angles(machine, np.array(step.axis))
        for letter, value in deg.items():  # onwards from the last angle, past 360
            if letter in before:
                deg[letter] = value + 360.0 * round((before[letter] - value) / 360.0)
        before = deg
        at = np.array(step.tip)
        place = at if by_tip else _position(machine, at, deg)
        factor = math.pi / 180.0 if radians else 1.0
        turn = " ".join(f"{letter}{factor * value:.4f}" for letter, value in sorted(deg.items()))
        words = f"X{place[0]:.4f} Y{place[1]:.4f} Z{place[2]:.4f} {turn}"
        feed = "F1200"
        if per_block_time and standing is not None:
            feed = f"F{1200.0 / max(float(np.linalg.norm(at - standing)), 1e-3):.3f}"
        lines.append(f"G0 {words}" if step.rapid else f"G1 {words} {feed}")
        standing = at
    return "\n".join(
        [
            *lines,
            "G49",
            "G94",
            "G91 G28 Z0",
            "G90 G28 A0 B0 C0".replace(
                next(x for x in ("A0 ", "B0 ", "C0") if x[0] not in machine["axes"]), ""
            ).rstrip(),
            "M5",
            "M30",
            "%",
            "",
        ]
    )


def cell_text(machine: dict[str, Any], *, tcpm: bool = False, stock: str = STOCK) -> str:
    """Return the sections of a cell file that declare a machine and the stock."""
    lines = ["[machine]"]
    for key, value in {**machine, "tcpm": tcpm}.items():
        if isinstance(value, str):
            lines.append(f'{key} = "{value}"')
        elif key == "axes":
            lines.append(f"axes = [{', '.join(f'{letter!r}' for letter in value)}]")
        else:
            lines.append(f"{key} = {str(value).lower()}")
    return "\n".join(lines) + "\n" + stock
