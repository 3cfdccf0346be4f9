"""What the data lists of a controller say of its cell: robot, limits, frames, loads, HOME, mounting.

Lengths and speeds come from ``$machine.dat`` as the planner there uses them; both were compared with the
library's KR 210 R2700-2, whose values were read elsewhere: the lengths are equal, the speeds to 0.1 deg/s.
"""

import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Union

from gcode2krl.cell import library
from gcode2krl.cell.sections import Robot
from gcode2krl.cell.setup.urdf import ENDINGS, read_arm
from gcode2krl.errors import Gcode2KrlError, input_error

# The data lists in an archive of a controller: a folder, or the zip that *File > Archive* writes.
#
# An archive is foreign: nothing of it is unpacked to disk, and sizes and counts are bounded.

WANTED = ("$config.dat", "$machine.dat")
"""TOOL_DATA, BASE_DATA, LOAD_DATA and XHOME; the robot's name, limits, lengths and mounting."""
VERSION = "am.ini"
"""Of the archive itself, at its top: which KSS wrote it."""
MOST_FILES = 50_000
"""An archive of everything has some thousand files."""
MOST_ARCHIVE_BYTES = 2_000_000_000
MOST_DIRECTORY_BYTES = 16_000_000
"""Of the list of files in a zip; `zipfile` holds all of it in memory."""
MOST_BYTES = 4_000_000
"""Of a data list; the largest have 0.1 MB."""
_END, _END_64 = b"PK\x05\x06", b"PK\x06\x07"
_END_BYTES, _LOCATOR_BYTES, _MOST_COMMENT = 22, 20, 65_535
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, OSError, ValueError)
"""What `zipfile` raises on damaged, encrypted and unknown members."""


@dataclass(frozen=True)
class DataList:
    """A data list: its path in the archive, and its text."""

    path: str
    text: str


def read_archive(path: Path) -> dict[str, DataList]:
    """Return name → data list of those in `WANTED` that a folder or zip has, and its `VERSION` beside them.

    Raises `NotUnderstoodError` where there is none, where those of several robots differ, and where the
    archive is damaged or too large.
    """
    try:
        entries = _of_folder(path) if path.is_dir() else _of_zip(path)
    except OSError as error:
        raise _refused(path, f"cannot read: {error.strerror or error}", "name a folder or a zip") from None
    data_lists = {name: _only_one(name, entries, path) for name in WANTED}
    lists = {name: one for name, one in data_lists.items() if one is not None}
    if not lists:
        sentence = f"no {' and no '.join(WANTED)} in it"
        raise _refused(path, sentence, "archive with File > Archive > USB (KUKA) > All, and name that zip")
    versions = [one for one in entries if PurePosixPath(one.path).name.lower() == VERSION]
    top = min(versions, key=lambda one: one.path.count("/"), default=None)
    return lists if top is None else {**lists, VERSION: top}


def _only_one(name: str, entries: Iterable[DataList], path: Path) -> DataList | None:
    """Return the data list of that name, of the robot rather than of the controller's own ``STEU``."""
    alike = [one for one in entries if PurePosixPath(one.path).name.lower() == name]
    of_robot = [one for one in alike if "r1" in one.path.lower().split("/")] or alike
    if len({one.text for one in of_robot}) > 1:
        places = ", ".join(sorted(one.path for one in of_robot)[:4])
        raise _refused(path, f"several {name} that differ: {places}", "name the folder of one of them")
    return of_robot[0] if of_robot else None


def _of_folder(folder: Path) -> list[DataList]:
    lists = []
    for count, file in enumerate(_files(folder)):
        if count >= MOST_FILES:
            raise _refused(folder, f"more than {MOST_FILES:,} files", "name the folder of the archive alone")
        if file.name.lower() in (*WANTED, VERSION):
            with file.open("rb") as stream:
                lists.append(
                    _data_list(file.relative_to(folder).as_posix(), stream.read(MOST_BYTES + 1), folder)
                )
    return lists


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder; links to folders are not followed."""
    for place, _, names in os.walk(folder, followlinks=False):
        yield from (Path(place) / name for name in names)


def _of_zip(path: Path) -> list[DataList]:
    _refuse_large_zip(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if len(members) > MOST_FILES:
                raise _refused(path, f"more than {MOST_FILES:,} files", "archive the controller anew")
            wanted = [one for one in members if _name_in_zip(one).lower() in (*WANTED, VERSION)]
            lists = []
            for member in wanted[: 3 * MOST_LISTS]:
                with archive.open(member) as stream:
                    lists.append(_data_list(_path_in_zip(member), stream.read(MOST_BYTES + 1), path))
            return lists
    except Gcode2KrlError:
        raise
    except _BROKEN as error:
        raise _refused(path, f"not a zip that can be read: {error}"[:200], "archive anew") from None


MOST_LISTS = 16
"""Most data lists of a name; a controller has two."""


def _path_in_zip(member: zipfile.ZipInfo) -> str:
    return member.filename.replace("\\", "/")


def _name_in_zip(member: zipfile.ZipInfo) -> str:
    return PurePosixPath(_path_in_zip(member)).name


def _refuse_large_zip(path: Path) -> None:
    """Raise if the zip, or the list of its files, is larger than any archive: before `zipfile` reads it."""
    size = path.stat().st_size
    if size > MOST_ARCHIVE_BYTES:
        raise _refused(
            path, f"more than {MOST_ARCHIVE_BYTES // 10**9} GB", "name the archive of one controller"
        )
    with path.open("rb") as stream:
        stream.seek(max(0, size - _END_BYTES - _MOST_COMMENT - _LOCATOR_BYTES))
        tail = stream.read()
    end = tail.rfind(_END)
    if end < 0 or end + _END_BYTES > len(tail):
        raise _refused(path, "neither a folder nor a zip", "name a folder or a zip")
    (directory_bytes,) = struct.unpack_from("<L", tail, end + 12)
    if _END_64 in tail[:end] or directory_bytes > MOST_DIRECTORY_BYTES:
        raise _refused(path, f"more than {MOST_FILES:,} files", "name the archive of one controller")


def _data_list(path: str, content: bytes, archive: Path) -> DataList:
    if len(content) > MOST_BYTES:
        sentence = f"{path[:100]}: more than {MOST_BYTES // 10**6} MB: not a data list"
        raise _refused(archive, sentence, "archive anew")
    return DataList(path, content.decode("latin-1"))


def _refused(path: Path, sentence: str, remedy: str) -> Gcode2KrlError:
    return input_error("archive", sentence, remedy, source=str(path))


# Values of a KRL data list (``$config.dat``, ``$machine.dat``): assignments, read line by line.
#
# ``TOOL_DATA[1]={X 0.0,Y 0.0,…} ; comment`` becomes ``{"TOOL_DATA[1]": {"X": 0.0, "Y": 0.0, …}}``. Names
# are in capitals, as KRL does not tell them apart. What is not such an assignment is passed over.

Value = Union[float, bool, str, "Mapping[str, Value]"]

_MOST_LEVELS = 8
"""The deepest structure of a controller's data has 3."""
_ASSIGNMENT = re.compile(
    r"[ \t]*(?:[A-Za-z]\w{0,39}[ \t]+){0,4}(\$?[A-Za-z_]\w{0,39})[ \t]*(\[[\d, \t]{0,16}\])?[ \t]*=[ \t]*"
)
_NAME = re.compile(r"[ \t]*([A-Za-z_]\w{0,39})(?:\[[\d, ]{0,8}\])?[ \t]+")
_TYPE = re.compile(r"[ \t]*\w{1,40}[ \t]*:")
_TEXT = re.compile(r'"([^"]*)"')
_PLAIN = re.compile(r"[^,}; \t\r\n]+")


def krl_values(text: str) -> dict[str, Value]:
    """Return name → value of the assignments in a data list; of a name that is set twice the last counts."""
    values: dict[str, Value] = {}
    for line in text.splitlines():
        match = _ASSIGNMENT.match(line)
        if match is None:
            continue
        value, _ = _value(line, match.end(), 0)
        if value is not None:
            values[f"{match[1]}{(match[2] or '').replace(' ', '')}".upper()] = value
    return values


def _value(line: str, at: int, level: int) -> tuple[Value | None, int]:
    """Return the value that begins at a place, and where it ends; None where there is none."""
    if line.startswith("{", at) and level < _MOST_LEVELS:
        return _structure(line, at + 1, level)
    text = _TEXT.match(line, at)
    if text is not None:
        return text[1].strip(), text.end()
    plain = _PLAIN.match(line, at)
    return (_plain(plain[0]), plain.end()) if plain is not None else (None, at)


def _structure(line: str, at: int, level: int) -> tuple[Value | None, int]:
    """Read ``X 1.0,CM {…}}`` behind the opening brace; ``{E6AXIS: A1 …}`` may name its type first."""
    members: dict[str, Value] = {}
    kind = _TYPE.match(line, at)
    at = kind.end() if kind is not None else at
    while True:
        name = _NAME.match(line, at)
        if name is None:
            return None, at
        value, at = _value(line, name.end(), level + 1)
        if value is None:
            return None, at
        members[name[1].upper()] = value
        while line.startswith((" ", "\t"), at):
            at += 1
        if line.startswith("}", at):
            return members, at + 1
        if not line.startswith(",", at):
            return None, at
        at += 1


def _plain(word: str) -> Value:
    if word.upper() in ("TRUE", "FALSE"):
        return word.upper() == "TRUE"
    try:
        return float(word)
    except ValueError:
        return word


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
class ArchivedController:
    """What an archive states; None or empty where it does not."""

    source: str
    name: str = ""
    """What the robot is called there."""
    trafo_name: str = ""
    model: str = ""
    """Robot of the library, where its name and its lengths agree."""
    lengths_mm: Numbers | None = None
    """a1, a2, c1, c2, c3, c4 of the arm."""
    limits_deg: tuple[tuple[float, float], ...] | None = None
    speeds_deg_s: Numbers | None = None
    gear_ratio: Numbers | None = None
    link_mass_kg: Numbers | None = None
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


def read_controller(path: Path) -> ArchivedController:
    """Read the archive of a controller, a folder or a zip, or the URDF of an arm.

    Raises `NotUnderstoodError` where it cannot.
    """
    if path.suffix.lower() in ENDINGS:
        arm = read_arm(path)
        return ArchivedController(
            source=path.name,
            name=arm.name,
            lengths_mm=arm.lengths_mm,
            limits_deg=arm.limits_deg,
            speeds_deg_s=arm.speeds_deg_s,
            link_mass_kg=arm.link_mass_kg,
            is_description=True,
        )
    lists = read_archive(path)
    version = lists.pop(VERSION, None)
    values: dict[str, Value] = {}
    for data_list in lists.values():
        values |= krl_values(data_list.text)
    stated = _KSS.search(version.text) if version is not None else None
    return replace(controller_of(values, path.name or str(path)), kss=stated[1] if stated else "")


def controller_of(values: Mapping[str, Value], source: str) -> ArchivedController:
    """Return what the values of the data lists mean."""
    trafo_name = str(values.get("$TRAFONAME[]", "")).removeprefix("#").strip()
    lengths = _lengths(values)
    return ArchivedController(
        source=source,
        name=trafo_name,
        trafo_name=trafo_name,
        model=_model(_machine_name(values), trafo_name, lengths),
        lengths_mm=lengths,
        limits_deg=_limits(values),
        speeds_deg_s=_six(_speed_of(values, axis) for axis in range(1, 7)),
        gear_ratio=_six(_ratio_of(values, axis) for axis in range(1, 7)),
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


def _six(stated: Iterable[float | None]) -> Numbers | None:
    known = [number for number in stated if number is not None]
    return tuple(known) if len(known) == len(_AXES) else None


def _ratio_of(values: Mapping[str, Value], axis: int) -> float | None:
    """Return the turns of a motor for one of its joint; their sign says only how the motor is mounted."""
    ratio = _members(values.get(f"$RAT_MOT_AX[{axis}]"), ("N", "D"))
    return abs(ratio[0] / ratio[1]) if ratio is not None and all(ratio) else None


def _speed_of(values: Mapping[str, Value], axis: int) -> float | None:
    """Return the largest speed of a joint in deg/s: that of its motor in rpm over the ratio of its gear."""
    motor_rpm = _number(values.get(f"$VEL_AXIS_MA[{axis}]"))
    ratio = _ratio_of(values, axis)
    return round(abs(motor_rpm) / ratio * _DEG_S_PER_RPM, 1) if motor_rpm and ratio else None


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
