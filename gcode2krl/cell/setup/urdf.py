"""Lengths, limits, speeds and masses of an arm from its URDF or xacro file, whatever pose its zeros describe.

Six turning axes as lines in the room say everything: how far axis 2 is from axis 1, axis 3 from axis 2,
where axes 4 to 6 meet, and where the flange is. KUKA's angles at the file's zeros follow from the directions
of link arm and forearm; those of A4 and A6 do not show and count as zero.
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import NotUnderstoodError, input_error

ENDINGS = (".urdf", ".xacro")
_LARGEST_BYTES = 4_000_000
_SLACK_MM, _SLACK = 0.3, 1e-3
"""Lengths and directions that differ by less are the same: files round."""
_TURNING = ("revolute", "continuous")
_OPERATORS: Mapping[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_IN_BRACES = re.compile(r"\$\{([^}]*)\}")


@dataclass(frozen=True)
class DescribedArm:
    """An ortho-parallel arm with spherical wrist."""

    name: str
    lengths_mm: tuple[float, ...]
    """a1, a2, c1, c2, c3, c4."""
    limits_deg: tuple[tuple[float, float], ...] | None
    """In KUKA's angles."""
    speeds_deg_s: tuple[float, ...] | None
    link_mass_kg: tuple[float, ...] | None = None
    """Of the links that A1 to A6 move; None where they are missing, or placeholders: all alike."""


@dataclass(frozen=True)
class _Joint:
    name: str
    turns: bool
    parent: str
    child: str
    pose: Floats
    """(4, 4) of its frame in the parent's, m."""
    axis: Floats
    limits: tuple[float, float] | None
    speed: float | None


def read_arm(file: Path) -> DescribedArm:
    """Return the arm of a file; raises `NotUnderstoodError` where it is none of six axes as KUKA's are."""
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise _refused(file, f"larger than {_LARGEST_BYTES / 1e6:.0f} MB")
        text = file.read_bytes()
        if b"<!DOCTYPE" in text:
            raise _refused(file, "it declares a document type")
        root = ElementTree.fromstring(text)
        values = _properties(root)
        joints, mass_kg = list(_joints(root, values)), _masses(root, values)
    except OSError as error:
        raise _refused(file, f"cannot read: {error.strerror}") from None
    except (
        ElementTree.ParseError,
        ValueError,
        KeyError,
        SyntaxError,
        ZeroDivisionError,
        RecursionError,
    ) as error:
        raise _refused(file, f"not a URDF that can be read: {error}"[:160]) from None
    chain = _chain(joints, file)
    lengths, offsets, signs = _geometry(chain, file)
    turning = [joint for joint, _ in chain if joint.turns]
    limits = [joint.limits for joint in turning]
    speeds = [joint.speed for joint in turning]
    limits_deg = None
    if all(limit is not None for limit in limits):
        degrees = [
            sorted(sign * math.degrees(end) + offset for end in limit or ())
            for limit, sign, offset in zip(limits, signs, offsets, strict=True)
        ]
        limits_deg = tuple((round(low, 3) + 0.0, round(high, 3) + 0.0) for low, high in degrees)
    known = [round(math.degrees(speed), 3) for speed in speeds if speed]
    masses = [mass_kg.get(joint.child, 0.0) for joint in turning]
    return DescribedArm(
        root.get("name") or file.stem,
        lengths,
        limits_deg,
        tuple(known) if len(known) == 6 else None,
        tuple(masses) if len(set(masses)) > 1 and min(masses[:4]) > 0.0 else None,
    )


def _refused(file: Path, why: str) -> NotUnderstoodError:
    return input_error("urdf", why, "name the URDF or the macro file of one six-axis arm", source=str(file))


def _properties(root: ElementTree.Element) -> dict[str, float]:
    values = {"pi": math.pi}
    for element in root.iter():
        if element.tag.endswith("}property") and "value" in element.attrib:
            try:
                values[element.attrib["name"]] = _number(element.attrib["value"], values)
            except (ValueError, KeyError, SyntaxError):
                continue  # no number: a name or a block
    return values


def _masses(root: ElementTree.Element, values: Mapping[str, float]) -> dict[str, float]:
    """Return the masses that the links' inertials state, in kg."""
    masses = {_plain(link.get("name", "")): link.find("inertial/mass") for link in root.iter("link")}
    return {
        name: round(_number(mass.get("value", ""), values), 3)
        for name, mass in masses.items()
        if mass is not None
    }


def _joints(root: ElementTree.Element, values: Mapping[str, float]) -> Iterator[_Joint]:
    """Yield the joints of a URDF, those in macros too, with the numbers that expressions stand for."""
    for element in root.iter("joint"):
        if element.find("parent") is None or element.find("child") is None:
            continue  # of a controller's description
        origin, axis, limit = (element.find(tag) for tag in ("origin", "axis", "limit"))
        pose = np.eye(4)
        if origin is not None:
            pose[:3, :3] = _turned(_numbers(origin.get("rpy", "0 0 0"), values))
            pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"), values)
        turns = element.get("type") in _TURNING
        direction = np.array(
            _numbers(axis.get("xyz", "1 0 0") if axis is not None and turns else "1 0 0", values)
        )
        given = limit.attrib if limit is not None else {}
        ends = [_number(given[end], values) for end in ("lower", "upper") if end in given]
        yield _Joint(
            _plain(element.get("name", "")),
            turns,
            _plain(element.find("parent").get("link", "")),  # type: ignore[union-attr]  # asked above
            _plain(element.find("child").get("link", "")),  # type: ignore[union-attr]
            pose,
            direction / np.linalg.norm(direction),
            (ends[0], ends[1]) if len(ends) == 2 else None,
            _number(given["velocity"], values) if "velocity" in given else None,
        )


def _plain(name: str) -> str:
    return _IN_BRACES.sub("", name)


def _numbers(text: str, values: Mapping[str, float]) -> list[float]:
    words = re.findall(r"(?:\$\{[^}]*\}|[^\s$])+", text)
    if len(words) != 3:
        raise ValueError(f"{text!r} is no three numbers")
    return [_number(word, values) for word in words]


def _number(text: str, values: Mapping[str, float]) -> float:
    """Return the number of a text, in which ``${...}`` is an expression of properties, pi and radians()."""
    return float(
        _IN_BRACES.sub(
            lambda found: repr(_value(ast.parse(found[1].strip(), mode="eval").body, values)), text
        )
    )


def _value(node: ast.expr, values: Mapping[str, float]) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return values[name]
        case ast.Attribute(value=ast.Name(id="math"), attr="pi"):
            return math.pi
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return float(_OPERATORS[type(op)](_value(left, values), _value(right, values)))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return float(_OPERATORS[type(op)](_value(operand, values)))
        case ast.Call(func=ast.Name(id="radians"), args=[argument]):
            return math.radians(_value(argument, values))
    raise ValueError("an expression other than + - * / and radians()")


def _turned(rpy: Sequence[float]) -> Floats:
    """Return Rz(yaw) Ry(pitch) Rx(roll), as a URDF counts."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _chain(joints: Sequence[_Joint], file: Path) -> list[tuple[_Joint, Floats]]:
    """Return the joints from the base to the flange, each with its pose (4, 4) in the base, m."""
    turning = [joint for joint in joints if joint.turns]
    if len(turning) != 6:
        raise _refused(file, f"{len(turning)} turning joints, six are needed")
    of_child = {joint.child: joint for joint in joints}
    last = turning[-1]
    ends = [joint for joint in joints if not joint.turns and joint.parent == last.child]
    end = next((joint for name in ("flange", "tool0") for joint in ends if joint.child == name), None)
    chain: list[_Joint] = []
    at = end or last
    while True:
        chain.insert(0, at)
        if at.parent not in of_child:
            break
        at = of_child[at.parent]
        if at in chain:
            raise _refused(file, "its joints form a circle")
    if [joint for joint in chain if joint.turns] != turning:
        raise _refused(file, "its six joints are no chain")
    pose, placed = np.eye(4), []
    for joint in chain:
        pose = pose @ joint.pose
        placed.append((joint, pose))
    return placed


def _geometry(
    chain: Sequence[tuple[_Joint, Floats]], file: Path
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Return lengths in mm, KUKA's angles in degrees where the file's are zero, and the signs of both."""
    turning = [(joint, pose) for joint, pose in chain if joint.turns]
    axes = [pose[:3, :3] @ joint.axis for joint, pose in turning]
    points = [1000.0 * pose[:3, 3] for _, pose in turning]
    flange = 1000.0 * chain[-1][1][:3, 3]
    up = np.array([0.0, 0.0, 1.0])
    if abs(abs(axes[0] @ up) - 1.0) > _SLACK or any(abs(axis @ up) > _SLACK for axis in axes[1:3]):
        raise _refused(file, "A1 must turn about the vertical, A2 and A3 about a horizontal axis")
    if abs(abs(axes[1] @ axes[2]) - 1.0) > _SLACK:
        raise _refused(file, "A2 and A3 are not parallel")
    if abs(axes[3] @ axes[4]) > 1.0 - _SLACK:
        raise _refused(file, "A4 and A5 are parallel: no spherical wrist")
    wrist = _meeting(points[3], axes[3], points[4], axes[4])
    if _distance(wrist, points[5], axes[5]) > _SLACK_MM or _distance(wrist, points[3], axes[3]) > _SLACK_MM:
        raise _refused(file, "A4, A5 and A6 do not meet in one point: no spherical wrist")
    if abs(abs(axes[3] @ axes[5]) - 1.0) > _SLACK:
        raise _refused(file, "A5 is not stretched at the file's zeros")
    aside = axes[1] if (wrist - points[0]) @ np.cross(axes[1], up) > 0.0 else -axes[1]
    ahead = np.cross(aside, up)
    if abs((wrist - points[0]) @ aside) > _SLACK_MM:
        raise _refused(file, f"the wrist is {abs((wrist - points[0]) @ aside):.1f} mm beside the plane of A1")

    def in_plane(vector: Floats) -> Floats:
        return np.array([vector @ ahead, vector @ up])

    link, forearm = in_plane(points[2] - points[1]), in_plane(wrist - points[2])
    along = in_plane(axes[3])
    along = along if along @ forearm > 0.0 else -along
    outward = axes[5] if (flange - wrist) @ axes[5] > 0.0 else -axes[5]
    lengths = (
        float(in_plane(points[1] - points[0])[0]),
        float(forearm @ np.array([along[1], -along[0]])),
        float(in_plane(points[1])[1]),
        float(np.linalg.norm(link)),
        float(forearm @ along),
        float((flange - wrist) @ outward),
    )
    if min(lengths[3:]) <= 0.0:
        raise _refused(file, "link arm, forearm and flange must have a length")
    a2_deg = -math.degrees(math.atan2(link[1], link[0]))
    pitch_deg = -math.degrees(math.atan2(along[1], along[0]))
    offsets = (0.0, a2_deg, (pitch_deg - a2_deg + 180.0) % 360.0 - 180.0, 0.0, 0.0, 0.0)
    arm = along[0] * ahead + along[1] * up
    positive = (-up, aside, aside, -arm, aside, -arm)
    signs = tuple(1.0 if axis @ kuka > 0.0 else -1.0 for axis, kuka in zip(axes, positive, strict=True))
    return tuple(round(length, 3) + 0.0 for length in lengths), offsets, signs


def _meeting(p: Floats, u: Floats, q: Floats, v: Floats) -> Floats:
    """Return the point of the second line, q + t·v, that is nearest to the first, p + s·u."""
    across = np.cross(v, u)  # the shortest way between both lies along it
    return q + v * float(np.cross(p - q, u) @ across) / float(across @ across)


def _distance(point: Floats, on_line: Floats, direction: Floats) -> float:
    return float(np.linalg.norm(np.cross(point - on_line, direction)))
