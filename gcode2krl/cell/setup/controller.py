"""What the data lists of a controller say of its cell: robot, limits, frames, loads, HOME, mounting.

Lengths and speeds come from ``$machine.dat`` as the planner there uses them; both were compared with the
library's KR 210 R2700-2, whose values were read elsewhere: the lengths are equal, the speeds to 0.1 deg/s.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from gcode2krl.cell import library
from gcode2krl.cell.sections import Robot
from gcode2krl.cell.setup.archive import VERSION, read_archive
from gcode2krl.cell.setup.krl_data import Value, krl_values
from gcode2krl.cell.setup.urdf import ENDINGS, read_arm

Numbers = tuple[float, ...]
FRAME_KEYS = ("X", "Y", "Z", "A", "B", "C")
_AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
_LENGTH_KEYS = ("a1_mm", "a2_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm")
_MOST_NUMBER = 32
"""Largest number of TOOL_DATA and BASE_DATA that a cell may name."""
_SAME_MM = 0.5
"""Two arms whose lengths differ by no more are the same model."""
_DEG_S_PER_RPM = 6.0
_KSS = re.compile(r"^\[Version\]\s*^Version=V(8\.[3567])\b", re.MULTILINE)
_LINEAR = 1
"""``$AXIS_TYPE`` of a linear axis; 3 to 5 turn."""


@dataclass(frozen=True)
class NamedFrame:
    """An entry of ``TOOL_DATA`` or ``BASE_DATA``."""

    number: int
    name: str
    frame: Numbers
    """X, Y, Z in mm, A, B, C in degrees."""

    def text(self) -> str:
        """Return number, name and position, as a list of them shows it."""
        x_mm, y_mm, z_mm = self.frame[:3]
        return f"{self.number}  {self.name or 'without a name'}  (X {x_mm:g}, Y {y_mm:g}, Z {z_mm:g})"


@dataclass(frozen=True)
class Payload:
    """An entry of ``LOAD_DATA``: mass, centre of gravity in the flange, inertia about its axes."""

    mass_kg: float
    centre_mm: Numbers
    inertia_kgm2: Numbers | None
    """None where its axes are turned against the flange, which a cell file cannot state."""


@dataclass(frozen=True)
class ExternalData:
    """What the data lists state of an external axis; not how it stands in the room, nor what it carries."""

    number: int
    is_linear: bool | None
    limits: tuple[float, float] | None
    """In mm or degrees."""
    speed_deg_s: float | None
    """None of a linear axis, whose ratio is not one of turns."""
    home: float | None


@dataclass(frozen=True)
class Controller:
    """What an archive states; None or empty where it does not."""

    source: str
    trafo_name: str = ""
    model: str = ""
    """Robot of the library, where its name and its lengths agree."""
    lengths_mm: Numbers | None = None
    """a1, a2, c1, c2, c3, c4 of the arm."""
    limits_deg: tuple[tuple[float, float], ...] | None = None
    speeds_deg_s: Numbers | None = None
    robroot: Numbers | None = None
    home_deg: Numbers | None = None
    tools: tuple[NamedFrame, ...] = ()
    bases: tuple[NamedFrame, ...] = ()
    loads: Mapping[int, Payload] | None = None
    externals: tuple[ExternalData, ...] = ()
    kss: str = ""
    """``8.3``, as the archive's own ``am.ini`` has it (``Version=V8.3.29``)."""
    is_description: bool = False
    """Read from a URDF: lengths, limits and speeds of the arm, nothing of a controller."""


def read_controller(path: Path) -> Controller:
    """Read the archive of a controller, a folder or a zip, or the URDF of an arm.

    Raises `NotUnderstoodError` where it cannot.
    """
    if path.suffix.lower() in ENDINGS:
        arm = read_arm(path)
        return Controller(
            source=path.name,
            lengths_mm=arm.lengths_mm,
            limits_deg=arm.limits_deg,
            speeds_deg_s=arm.speeds_deg_s,
            is_description=True,
        )
    lists = read_archive(path)
    version = lists.pop(VERSION, None)
    values: dict[str, Value] = {}
    for one in lists.values():
        values |= krl_values(one.text)
    stated = _KSS.search(version.text) if version is not None else None
    return replace(controller_of(values, path.name or str(path)), kss=stated[1] if stated else "")


def controller_of(values: Mapping[str, Value], source: str) -> Controller:
    """Return what the values of the data lists mean."""
    trafo_name = str(values.get("$TRAFONAME[]", "")).removeprefix("#").strip()
    lengths = _lengths(values)
    return Controller(
        source=source,
        trafo_name=trafo_name,
        model=_model(_machine_name(values), trafo_name, lengths),
        lengths_mm=lengths,
        limits_deg=_limits(values),
        speeds_deg_s=_speeds(values),
        robroot=_members(values.get("$ROBROOT"), FRAME_KEYS),
        home_deg=_members(values.get("XHOME"), _AXES) or _members(values.get("$H_POS"), _AXES),
        tools=_named(values, "TOOL"),
        bases=_named(values, "BASE"),
        loads=_loads(values),
        externals=tuple(_externals(values)),
    )


def _named(values: Mapping[str, Value], kind: str) -> tuple[NamedFrame, ...]:
    """Return the entries that were measured: those with a frame other than zero.

    Left out are tools that stand in the room (``#TCP``) and bases on an external kinematic system.
    """
    entries = []
    for number in range(1, _MOST_NUMBER + 1):
        frame = _members(values.get(f"{kind}_DATA[{number}]"), FRAME_KEYS)
        of_room = values.get(f"{kind}_TYPE[{number}]") == "#TCP"
        parent = values.get(f"MACHINE_FRAME_DAT[{number}]")
        moves = kind == "BASE" and isinstance(parent, Mapping) and parent.get("PARENT") not in ("WORLD", "")
        if frame is not None and any(frame) and not of_room and not moves:
            name = str(values.get(f"{kind}_NAME[{number},]", "")).strip()
            entries.append(NamedFrame(number, name, frame))
    return tuple(entries)


def _loads(values: Mapping[str, Value]) -> dict[int, Payload]:
    """Return the loads that were stated; a mass of -1 says that none was."""
    loads = {}
    for number in range(1, _MOST_NUMBER + 1):
        entry = values.get(f"LOAD_DATA[{number}]")
        if not isinstance(entry, Mapping):
            continue
        mass_kg = _number(entry.get("M"))
        centre = _members(entry.get("CM"), FRAME_KEYS)
        inertia = _members(entry.get("J"), ("X", "Y", "Z"))
        if mass_kg is not None and mass_kg > 0.0 and centre is not None and inertia is not None:
            is_turned = any(centre[3:]) and len(set(inertia)) > 1
            loads[number] = Payload(mass_kg, centre[:3], None if is_turned else inertia)
    return loads


def _limits(values: Mapping[str, Value]) -> tuple[tuple[float, float], ...] | None:
    pairs = [_limits_of(values, axis) for axis in range(1, 7)]
    known = [pair for pair in pairs if pair is not None]
    return tuple(known) if len(known) == len(pairs) else None


def _limits_of(values: Mapping[str, Value], axis: int) -> tuple[float, float] | None:
    low = _number(values.get(f"$SOFTN_END[{axis}]"))
    high = _number(values.get(f"$SOFTP_END[{axis}]"))
    return None if low is None or high is None or low >= high else (low, high)


def _speeds(values: Mapping[str, Value]) -> Numbers | None:
    speeds = [_speed_of(values, axis) for axis in range(1, 7)]
    known = [speed for speed in speeds if speed is not None]
    return tuple(known) if len(known) == len(speeds) else None


def _speed_of(values: Mapping[str, Value], axis: int) -> float | None:
    """Return the largest speed of a joint in deg/s: that of its motor in rpm over the ratio of its gear."""
    motor_rpm = _number(values.get(f"$VEL_AXIS_MA[{axis}]"))
    ratio = _members(values.get(f"$RAT_MOT_AX[{axis}]"), ("N", "D"))
    if not motor_rpm or ratio is None or not all(ratio):
        return None
    return round(abs(motor_rpm * ratio[1] / ratio[0]) * _DEG_S_PER_RPM, 1)


def _externals(values: Mapping[str, Value]) -> Iterator[ExternalData]:
    """Yield E1 to E6 as far as there are any; they are axes 7 to 12 of the machine data."""
    home = values.get("XHOME")
    for number in range(1, min(int(_number(values.get("$EX_AX_NUM")) or 0), 6) + 1):
        axis = number + 6
        kind = _number(values.get(f"$AXIS_TYPE[{axis}]"))
        is_linear = None if kind is None else kind == _LINEAR
        yield ExternalData(
            number=number,
            is_linear=is_linear,
            limits=_limits_of(values, axis),
            speed_deg_s=None if is_linear is not False else _speed_of(values, axis),
            home=_number(home.get(f"E{number}")) if isinstance(home, Mapping) else None,
        )


def _lengths(values: Mapping[str, Value]) -> Numbers | None:
    """Return a1 … c4 of an arm with spherical wrist; None of any other kinematics."""
    a1, c2 = (_number(values.get(name)) for name in ("$LENGTH_A", "$LENGTH_B"))
    foot, wrist, flange = (_members(values.get(name), FRAME_KEYS) for name in ("$TIRORO", "$TX3P3", "$TFLWP"))
    if a1 is None or c2 is None or foot is None or wrist is None or flange is None:
        return None
    others = (*foot[:2], *foot[3:], wrist[1], wrist[3], wrist[4] - 90.0, wrist[5], *flange[:2], *flange[3:])
    wrists = [_members(values.get(name), ("DHART_A", "DHART_D")) for name in ("$DH_4", "$DH_5")]
    twisted = any(wrist not in (None, (0.0, 0.0)) for wrist in wrists)
    if any(abs(other) > 1e-3 for other in others) or twisted or min(c2, wrist[0], flange[2]) <= 0.0:
        return None
    return a1, -wrist[2] + 0.0, foot[2], c2, wrist[0], flange[2]


def robots_of_lengths(lengths_mm: Numbers | None) -> list[str]:
    """Return the robots of the library whose lengths agree with those of an arm, all where none is known."""
    names = library.names("robots")
    return [name for name in names if _has_lengths(library.read_model("robots", name), lengths_mm)]


def _machine_name(values: Mapping[str, Value]) -> str:
    machine = values.get("MACHINE_DEF[1]")
    return str(machine.get("NAME", "")) if isinstance(machine, Mapping) else ""


def _model(machine_name: str, trafo_name: str, lengths_mm: Numbers | None) -> str:
    """Return the robot of the library that the archive means; empty where none or several could be it."""
    fits = robots_of_lengths(lengths_mm)
    robots = {name: library.read_model("robots", name) for name in fits}
    by_name = [name for name in fits if _fold(name) == _fold(machine_name)]
    by_trafo = [
        name
        for name in fits
        if Robot(trafo_name=str(robots[name].get("trafo_name", ""))).is_named(trafo_name)
    ]
    named = by_name or by_trafo
    return named[0] if len(named) == 1 else ""


def _has_lengths(robot: Mapping[str, object], lengths_mm: Numbers | None) -> bool:
    geometry = robot.get("geometry")
    if lengths_mm is None or not isinstance(geometry, dict) or "a1_mm" not in geometry:
        return True
    stated = (float(geometry[key]) for key in _LENGTH_KEYS)
    return all(abs(a - b) <= _SAME_MM for a, b in zip(stated, lengths_mm, strict=True))


def _members(value: Value | None, keys: tuple[str, ...]) -> Numbers | None:
    if not isinstance(value, Mapping):
        return None
    numbers = [_number(value.get(key)) for key in keys]
    known = [number for number in numbers if number is not None]
    return tuple(known) if len(known) == len(keys) else None


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, float) and abs(value) < 1e9 else None


def _fold(name: str) -> str:
    return "".join(name.split()).casefold()
