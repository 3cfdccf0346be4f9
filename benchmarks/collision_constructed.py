"""Constructed collisions and clean cells, judged by python-fcl.

Each case is a small part with something in its way: a box, a mesh, a fence or the table on the cut, a box on
the PTP from and to HOME, a HOME from which the arm hits itself, a wall of stock beside the holder, one beside
the spindle. What is hit, where and by what is found by python-fcl on dense rows of joints, with forward
kinematics written here. A case counts as right where the first line that is refused, with link and obstacle,
is one that the library sees touched, and where nothing that it sees at its own first line is missing there. A
clean cell has the same things where nothing comes nearer than 2 mm.

    python benchmarks/collision_constructed.py               200 collisions, 200 clean cells
    python benchmarks/collision_constructed.py --share 0.1   a tenth of them
"""

import argparse
import itertools
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import fcl
import numpy as np

from gcode2krl import plan_motion, predict, read_gcode, solve_joints
from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.chain import prepare
from gcode2krl.errors import Issue, NotUnderstoodError

KINDS = {
    "box": 40,
    "mesh": 20,
    "fence": 15,
    "table": 15,
    "ptp": 30,
    "itself": 20,
    "holder": 30,
    "spindle": 30,
}
"""How many of each; ``holder`` and ``spindle`` are walls of stock."""
CERTAIN_MM = -0.5
"""An overlap that has to be found. What is found may be up to half of `NEAR_MM` apart here: the rows are some
mm apart on a PTP, and holder and cutter are held by shapes that are up to 8 % wider."""
CLEAN_MM, NEAR_MM = 2.0, 10.0
PTP_ROWS, POINTS = 400, 9
LINKS = ("foot", "A1", "A2", "A3", "A4", "A5", "A6")
ITSELF = " of the arm itself"
MAY_HIT = {"A4": LINKS[:2], "A5": LINKS[:3], "A6": LINKS[:3]}
"""Of the arm itself, by `docs/collision.md`; spindle, holder and cutter may hit A3 too."""
SPINDLE = [
    {"from_mm": [0.0, 0.0, 40.0], "to_mm": [50.0, 0.0, 250.0], "radius_mm": 70.0},
    {"from_mm": [75.0, 0.0, 250.0], "to_mm": [-150.0, 0.0, 250.0], "radius_mm": 75.0},
]
STICK_OUT_MM, HOLDER_MM, LENGTH_MM, CUTTER_MM = 45.0, 50.0, 100.0, 16.0


class Body(NamedTuple):
    """A capsule or a cylinder in the frame of a link."""

    name: str
    link: int
    ends_mm: np.ndarray
    radius_mm: float
    is_flat: bool


class Track(NamedTuple):
    """Rows of joints (n, 6) that belong to a line of the G-code."""

    line: int
    q_rad: np.ndarray


class Hit(NamedTuple):
    """Who hits what in which line."""

    line: int
    who: str
    what: str


# the arm ----------------------------------------------------------------------------------------------------


def frames(q_rad: np.ndarray, geometry: np.ndarray) -> np.ndarray:
    """Return the frames (n, 7, 4, 4) of foot, A1 to A5 and flange in the robot root."""
    a1, a2, c1, c2, c3, c4 = geometry
    count, steps = len(q_rad), []
    for angle, axis, sign, shift in (
        (q_rad[:, 0], 2, -1, (0.0, 0.0, 0.0)),
        (q_rad[:, 1], 1, 1, (a1, 0.0, c1)),
        (q_rad[:, 2], 1, 1, (c2, 0.0, 0.0)),
        (q_rad[:, 3], 0, -1, (c3, 0.0, -a2)),
        (q_rad[:, 4], 1, 1, (0.0, 0.0, 0.0)),
        (q_rad[:, 5], 0, -1, (0.0, 0.0, 0.0)),
    ):
        steps.append(turned(sign * angle, axis, shift))
    last = turned(np.full(count, np.pi / 2), 1, (c4, 0.0, 0.0))
    found = [np.broadcast_to(np.eye(4), (count, 4, 4))]
    for step in steps[:5]:
        found.append(found[-1] @ step)
    return np.stack([*found, found[-1] @ steps[5] @ last], axis=1)


def turned(angle: np.ndarray, axis: int, shift: tuple[float, float, float]) -> np.ndarray:
    """Return translations followed by turns about an axis (n, 4, 4)."""
    made = np.tile(np.eye(4), (len(angle), 1, 1))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    made[:, i, i] = made[:, j, j] = np.cos(angle)
    made[:, j, i], made[:, i, j] = np.sin(angle), -np.sin(angle)
    made[:, :3, 3] = shift
    return made


def bodies_of(cell: Cell, tool: int) -> list[Body]:
    """Return what the cell states of arm, spindle, holder and cutter."""
    bodies = [
        Body(c.link, LINKS.index(c.link), np.array([c.from_mm, c.to_mm]), c.radius_mm, False)
        for c in cell.robot.body.capsules
    ]
    for c in cell.spindle.body.capsules if cell.spindle.body is not None else ():
        bodies.append(Body("spindle", 6, np.array([c.from_mm, c.to_mm]), c.radius_mm, False))
    own, frame = cell.tool[tool], cell.tool_matrix(tool)

    def cylinder(name: str, low_mm: float, high_mm: float, radius_mm: float) -> Body:
        ends = np.array([[0.0, 0.0, low_mm], [0.0, 0.0, high_mm]]) @ frame[:3, :3].T + frame[:3, 3]
        return Body(name, 6, ends, radius_mm, True)

    bodies.append(cylinder(f"the cutter of T{tool}", 0.0, STICK_OUT_MM, own.diameter_mm / 2))
    if own.holder_diameter_mm is not None:
        bodies.append(cylinder(f"the holder of T{tool}", STICK_OUT_MM, LENGTH_MM, own.holder_diameter_mm / 2))
    return bodies


# the library ------------------------------------------------------------------------------------------------


def placed(body: Body, frame: np.ndarray) -> fcl.CollisionObject:
    """Return a body as the library has it."""
    ends = body.ends_mm @ frame[:3, :3].T + frame[:3, 3]
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    kind = fcl.Cylinder if body.is_flat else fcl.Capsule
    return fcl.CollisionObject(
        kind(body.radius_mm, length), fcl.Transform(along(way / max(length, 1e-12)), ends.mean(axis=0))
    )


def along(z: np.ndarray) -> np.ndarray:
    """Return a rotation whose z is a unit vector."""
    if not np.any(z):
        return np.eye(3)
    x = np.cross(z, [1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


class Shape(NamedTuple):
    """A box along the axes of ``$BASE``."""

    low_mm: np.ndarray
    high_mm: np.ndarray


def obstacle_shapes(cell: Cell) -> dict[str, Shape]:
    """Return table, obstacles and the uncut stock, all of them boxes here."""
    shapes, far = {}, 5e3
    if cell.table is not None:
        shapes["the table"] = Shape(np.array([-far, -far, -far]), np.array([far, far, cell.table.z_mm]))
    for each in cell.obstacle:
        if each.box_mm is not None:
            shapes[each.name] = Shape(*map(np.array, each.box_mm))
        elif each.plane is not None:  # the fences here stand across y
            y = each.plane.point_mm[1]
            shapes[each.name] = Shape(np.array([-far, y, -far]), np.array([far, y + far, far]))
        else:
            shapes[each.name] = Shape(*mesh_corners(Path(str(each.mesh))))
    if cell.stock is not None and cell.stock.box_mm is not None:
        shapes["the stock"] = Shape(*map(np.array, cell.stock.box_mm))
    return shapes


def in_library(shape: Shape, base: np.ndarray) -> fcl.CollisionObject:
    """Return a box in the robot root."""
    middle = base[:3, :3] @ (shape.low_mm + shape.high_mm) / 2 + base[:3, 3]
    return fcl.CollisionObject(fcl.Box(*(shape.high_mm - shape.low_mm)), fcl.Transform(base[:3, :3], middle))


def mesh_corners(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of a mesh, which is a box here."""
    words = [line.split() for line in file.read_text(encoding="ascii").splitlines()]
    points = np.array([[float(x) for x in line[1:]] for line in words if line[:1] == ["vertex"]])
    return points.min(axis=0), points.max(axis=0)


def gap_mm(one: fcl.CollisionObject, other: fcl.CollisionObject) -> float:
    """Return a distance, or minus the depth of an overlap."""
    request, result = fcl.CollisionRequest(num_max_contacts=10, enable_contact=True), fcl.CollisionResult()
    if fcl.collide(one, other, request, result):
        return -max(contact.penetration_depth for contact in result.contacts)
    return float(fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()))


def points_of(bodies: list[Body], poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points along the axes of bodies (n, b, 9, 3), and how far a body reaches from them (b,)."""
    share = np.linspace(0.0, 1.0, POINTS)[:, None]
    points, reach = [], []
    for body in bodies:
        own = body.ends_mm[0] + share * (body.ends_mm[1] - body.ends_mm[0])
        pose = poses[:, body.link]
        points.append(np.einsum("nij,pj->npi", pose[:, :3, :3], own) + pose[:, None, :3, 3])
        apart = np.linalg.norm(body.ends_mm[1] - body.ends_mm[0]) / (POINTS - 1)
        reach.append(np.hypot(apart / 2, body.radius_mm) if body.is_flat else apart / 2 + body.radius_mm)
    return np.stack(points, axis=1), np.array(reach)


def seen(cell: Cell, tracks: list[Track], kind: str) -> dict[Hit, float]:
    """Return the least gap of each pair in each line, as far as it is below `NEAR_MM`.

    The library is asked where points along the axes of the bodies are near enough.
    """
    bodies, shapes = bodies_of(cell, 1), obstacle_shapes(cell)
    geometry, base = cell.robot.geometry.array(), cell.base_matrix()
    gaps: dict[Hit, float] = {}
    for track in tracks:
        poses = frames(track.q_rad, geometry)
        points, reach = points_of(bodies, poses)
        in_base = (points - base[:3, 3]) @ base[:3, :3]
        for what, shape in shapes.items():
            other = in_library(shape, base)
            beyond = np.maximum(0.0, np.maximum(shape.low_mm - in_base, in_base - shape.high_mm))
            near = np.linalg.norm(beyond, axis=3).min(axis=2) < reach + NEAR_MM
            for k, body in enumerate(bodies):
                if _counts(body, what, kind):
                    for row in np.flatnonzero(near[:, k]):
                        note(
                            gaps, Hit(track.line, body.name, what), placed(body, poses[row, body.link]), other
                        )
        for k, j in itertools.permutations(range(len(bodies)), 2):
            body, limb = bodies[k], bodies[j]
            if limb.name not in MAY_HIT.get(body.name, LINKS[:4] if body.name not in LINKS else ()):
                continue
            apart = np.linalg.norm(points[:, k, :, None] - points[:, j, None], axis=3).min(axis=(1, 2))
            hit = Hit(track.line, body.name, limb.name + ITSELF)
            for row in np.flatnonzero(apart < reach[k] + reach[j] + NEAR_MM):
                pose = poses[row]
                note(gaps, hit, placed(body, pose[body.link]), placed(limb, pose[limb.link]))
    return gaps


def _counts(body: Body, what: str, kind: str) -> bool:
    """Tell whether a pair is looked at, by `docs/collision.md`; of a wall of stock who it is made for."""
    if body.name == "foot":
        return False
    if what == "the table":
        return body.link >= 5 and "cutter" not in body.name
    if what == "the stock":
        return "holder" in body.name if kind == "holder" else body.name in (*LINKS, "spindle")
    return True


def note(gaps: dict[Hit, float], hit: Hit, one: fcl.CollisionObject, other: fcl.CollisionObject) -> None:
    """Keep the least gap of a pair, where it is small."""
    gap = gap_mm(one, other)
    if gap < NEAR_MM:
        gaps[hit] = min(gap, gaps.get(hit, np.inf))


# cases ------------------------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A part and a cell."""

    kind: str
    part: Path
    cell: Cell


def program(rng: np.random.Generator, top_mm: float) -> str:
    """Return a part of lines across the table, some of them with a step down."""
    lines = ["G21 G90 G94 G17", "T1 M6", "S10000 M3", f"G0 G43 H1 X0 Y0 Z{top_mm:.1f}", "G0 Z5"]
    x, y, z = 0.0, 0.0, -1.0
    lines.append(f"G1 Z{z:.1f} F6000")
    for number in range(int(rng.integers(4, 9))):
        x, y = (float(rng.uniform(-20, 160)), y) if number % 2 == 0 else (x, float(rng.uniform(-60, 120)))
        z = max(-8.0, z - float(rng.uniform(0, 2))) if rng.random() < 0.3 else z
        lines.append(f"G1 X{x:.2f} Y{y:.2f} Z{z:.2f}")
    return "\n".join([*lines, f"G0 Z{top_mm:.1f}", "M5", "M30", ""])


def cell_of(**more: object) -> Cell:
    """Return the demonstration with a spindle, a holder, and what a case adds."""
    tool = {
        **{"kind": "flat", "diameter_mm": CUTTER_MM, "teeth": 3, "flute_length_mm": 30.0},
        **{"stick_out_mm": STICK_OUT_MM, "holder_diameter_mm": HOLDER_MM, "length_mm": LENGTH_MM},
    }
    spindle = {"body": {"capsules": SPINDLE}}
    return resolve_cell({"based_on": "demonstration", "tool": {"1": tool}, "spindle": spindle, **more})


def tracks_of(part: Path, cell: Cell) -> list[Track]:
    """Return the rows of joints along all ways of a program, by line."""
    toolpath = read_gcode(part, cell)
    plan = prepare(toolpath, cell)
    targets, joints = plan.targets, plan.joints
    motion = plan_motion(targets, cell, 0.008, watches=False)
    q_rad = solve_joints(motion, cell).q_rad
    line = toolpath.source_line[motion.move]
    tracks = [Track(int(number), q_rad[line == number]) for number in np.unique(line)]
    first, last = int(line[0]), int(line[-1])
    q = joints.q_rad
    ways = [(first, q[0], q[1]), (last, q[-2], q[-1])]
    tracks += [Track(number, np.linspace(a, b, PTP_ROWS)) for number, a, b in ways]
    lines = [(first, q[1], q_rad[0]), (last, q_rad[-1], q[-2])]
    return [*tracks, *(Track(number, np.linspace(a, b, 40)) for number, a, b in lines)]


def place_on(
    rng: np.random.Generator, cell: Cell, tracks: list[Track], who: Sequence[str], share: float
) -> np.ndarray:
    """Return a point (3,) in ``$BASE`` a share of its radius off the axis of a body somewhere on its way."""
    track = tracks[int(rng.integers(len(tracks)))]
    bodies = [body for body in bodies_of(cell, 1) if body.name in who or (not who and body.name != "foot")]
    body = bodies[int(rng.integers(len(bodies)))]
    pose = frames(track.q_rad[rng.integers(len(track.q_rad)), None], cell.robot.geometry.array())[
        0, body.link
    ]
    ends = body.ends_mm @ pose[:3, :3].T + pose[:3, 3]
    out = rng.normal(size=3)
    point = ends[0] + rng.uniform() * (ends[1] - ends[0]) + share * body.radius_mm * out / np.linalg.norm(out)
    return (np.linalg.inv(cell.base_matrix()) @ [*point, 1.0])[:3]


def write_box(file: Path, low: np.ndarray, high: np.ndarray) -> str:
    """Write a box as an STL file."""
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    text = ["solid box"]
    for face in faces:
        text += ["facet normal 0 0 0", "outer loop"]
        text += ["vertex " + " ".join(f"{x:.6f}" for x in corners[k]) for k in face]
        text += ["endloop", "endfacet"]
    file.write_text("\n".join([*text, "endsolid box", ""]), encoding="ascii")
    return str(file)


def drawn(kind: str, rng: np.random.Generator, folder: Path, is_clean: bool) -> Case:
    """Return a case that may or may not be what is wanted."""
    part = folder / "part.nc"
    part.write_text(program(rng, float(rng.uniform(60, 140))), encoding="ascii")
    cell = cell_of()
    if kind == "itself":
        low, high = np.array([(-90, -130, 40, -170, -115, -170), (90, -30, 160, 170, 115, 170)], dtype=float)
        return Case(kind, part, cell_of(home={"q_deg": rng.uniform(low, high).round(1).tolist()}))
    if kind in ("holder", "spindle"):
        return Case(kind, part, cell_of(stock={"box_mm": _wall(kind, rng), "resolution_mm": 0.5}))
    tracks = tracks_of(part, cell)
    chosen = tracks[-4:-2] if kind == "ptp" else tracks
    who = ("A5", "A6", "spindle", "the holder of T1") if kind == "table" else ()
    if is_clean and kind in ("table", "fence"):
        far = rng.uniform(10.0, 400.0)
        at = np.array([0.0, 300.0 + far, -8.0 - far])
    else:
        at = place_on(rng, cell, chosen, who, rng.uniform(1.2, 3.0) if is_clean else 0.7)
    if kind == "table":
        return Case(kind, part, cell_of(table={"z_mm": float(at[2])}))
    if kind == "fence":
        plane = {"point_mm": [0.0, float(at[1]), 0.0], "normal": [0.0, -1.0, 0.0]}
        return Case(kind, part, cell_of(obstacle=[{"name": "fence", "plane": plane}]))
    half = rng.uniform(5, 40, 3)
    low, high = at - half, at + half
    if kind == "mesh":
        mesh = write_box(folder / "fixture.stl", low, high)
        return Case(kind, part, cell_of(obstacle=[{"name": "fixture", "mesh": mesh}]))
    return Case(kind, part, cell_of(obstacle=[{"name": "clamp", "box_mm": [low.tolist(), high.tolist()]}]))


def _wall(kind: str, rng: np.random.Generator) -> list[list[float]]:
    """Return a wall of stock that the cutter passes by, or cuts into, while something above it does not."""
    x, y = rng.uniform(-20, 160), rng.uniform(-60, 120)
    top = rng.uniform(46, 80) if kind == "holder" else rng.uniform(102, 160)
    long_mm, wide_mm = rng.uniform(5, 60, 2)
    return [[x, y, -20.0], [x + long_mm, y + wide_mm, float(top)]]


def cut_into(case: Case, tracks: list[Track]) -> bool:
    """Tell whether the cutter comes into the wall: then it does not stand any more as it is drawn."""
    if case.kind not in ("holder", "spindle"):
        return False
    shape, base = obstacle_shapes(case.cell)["the stock"], case.cell.base_matrix()
    wide = CUTTER_MM / 2 + 1.0
    margin = np.array([wide, wide, 0.0])
    low, high = shape.low_mm - margin - [0.0, 0.0, STICK_OUT_MM], shape.high_mm + margin
    for track in tracks:
        flange = frames(track.q_rad, case.cell.robot.geometry.array())[:, 6]
        tip = flange @ np.append(case.cell.tool_matrix(1)[:3, 3], 1.0)
        at = (tip[:, :3] - base[:3, 3]) @ base[:3, :3]
        if ((at > low) & (at < high)).all(axis=1).any():
            return True
    return False


# figures ----------------------------------------------------------------------------------------------------


def told(issues: Sequence[Issue], kind: str) -> set[Hit]:
    """Return who hits what in which line, by the program's own words."""
    hits = set()
    for issue in issues:
        if issue.code == "collision" and issue.severity == "error":
            who, _, rest = issue.message.partition(" hits ")
            what = rest.split(" on the ")[0].split(" on a ")[0].split(", ")[0]
            hits.add(Hit(issue.line, who, what))
        elif issue.code == "holder-in-stock" and kind == "holder":
            hits.add(Hit(issue.line, "the holder of T1", "the stock"))
    return hits


def judged(found: set[Hit], gaps: dict[Hit, float]) -> str:
    """Return what is wrong with what was found, nothing where it is right."""
    certain = {hit for hit, gap in gaps.items() if gap < CERTAIN_MM}
    first = min(hit.line for hit in certain)
    missing = {hit for hit in certain if hit.line == first} - found
    begins = min((hit.line for hit in found), default=0)
    beyond = {hit for hit in found if hit.line == begins and gaps.get(hit, np.inf) > NEAR_MM / 2}
    if not found:
        return "not refused"
    if missing:
        return f"line {first}: {missing} not told"
    return f"line {begins}: {beyond} not seen by the library" if beyond else ""


def cases(kind: str, count: int, is_clean: bool) -> Iterator[tuple[str, str]]:
    """Yield for each case its kind and what is wrong with the answer."""
    seed = itertools.count(1000 * list(KINDS).index(kind) + (500_000 if is_clean else 0))
    done = 0
    while done < count:
        rng = np.random.default_rng(next(seed))
        with tempfile.TemporaryDirectory() as folder:
            try:
                case = drawn(kind, rng, Path(folder), is_clean)
                tracks = tracks_of(case.part, case.cell)
            except (ValueError, NotUnderstoodError):  # out of reach, or a cell that contradicts itself
                continue
            if any(np.isnan(track.q_rad).any() for track in tracks) or cut_into(case, tracks):
                continue
            gaps = seen(case.cell, tracks, kind)
            least = min(gaps.values(), default=np.inf)
            if least < CLEAN_MM if is_clean else least > CERTAIN_MM:
                continue
            found = told(predict(case.part, case.cell, forces=kind in ("holder", "spindle")).issues, kind)
        done += 1
        if is_clean:
            yield kind, f"{sorted(found)[0]}" if found else ""
        else:
            yield kind, judged(found, gaps)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="constructed collisions against python-fcl")
    parser.add_argument("--share", type=float, default=1.0, help="of the cases of each kind")
    parser.add_argument("--only", choices=KINDS)
    options = parser.parse_args(arguments)
    for is_clean in (False, True):
        right = total = 0
        for kind, whole in KINDS.items():
            if options.only not in (None, kind):
                continue
            count = max(1, round(options.share * whole))
            wrong = [words for _, words in cases(kind, count, is_clean) if words]
            right, total = right + count - len(wrong), total + count
            name = f"{'clean' if is_clean else 'hit'}, {kind}"
            print(f"{name:16} {count - len(wrong)} of {count} {'; '.join(wrong[:3])}", flush=True)
        words = "cells without a collision" if is_clean else "collisions at the right line, link and obstacle"
        print(f"{words}: {right} of {total}\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
