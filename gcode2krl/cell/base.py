"""A cell file laid over the cell that it is ``based_on``: plain tables in, plain tables out.

Nothing is taken over that the file does not ask for by name, and each value taken over is recorded.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcode2krl.cell import library
from gcode2krl.errors import NotUnderstoodError, input_error

DEMONSTRATION = "kr300_demonstration"
_OF_THE_FILE_ALONE = ("model", "name", "based_on", "verified")
"""Keys that describe one file; they are never taken over."""
_NO_VALUES = frozenset(["source", "sure", "note", "robot_source", "robot_sure", "trafo_source", "trafo_sure"])
_CUTTER_KEYS = frozenset(["model", "kind", "diameter_mm", "teeth"])
"""A tool that states one of these keys is another tool: nothing of the base's tool is kept."""
_FORCE_LAW_KEYS = frozenset(["model", "linear_edge", "kienzle"])
_SHAPE_KEYS = frozenset(["box_mm", "mesh"])
_JOINTS_OF_END_EFFECTOR = ("sensor", "spindle")
_FILES = (
    ("robot", "model"),
    ("controller", "model"),
    ("material", "model"),
    ("stock", "mesh"),
    ("online", "calibration"),
)
_NUMBER_OF_FRAME = re.compile(r"frames\.base_data|tool\.\d+\.tool_data")
"""Numbers of the controller's table; the frame beside each is compared with the controller's own."""
Table = dict[str, Any]


@dataclass(frozen=True)
class Taken:
    """A value taken over: dotted key, value as text, its cell, whether that cell is verified."""

    key: str
    value: str
    source: str
    verified: bool


@dataclass(frozen=True)
class StatedCell:
    """What a cell file states together with its base, as plain tables."""

    data: Table
    taken: tuple[Taken, ...]


def lay_over_base(
    data: Table,
    folder: Path | None,
    source: str,
    is_confirmed: Callable[[StatedCell], bool],
    seen: tuple[Path, ...] = (),
) -> StatedCell:
    """Return ``data`` over the cell it is ``based_on``; without ``based_on`` it stands alone.

    ``is_confirmed`` tells whether a base is as a person confirmed it, ``seen`` holds the files that led here.
    Raises `NotUnderstoodError` where the base is not found, is not a cell file or is based on itself.
    """
    table = _with_whole_paths(data, folder)
    name = table.get("based_on", "")
    if not isinstance(name, str) or not name:
        return StatedCell(table, ())
    base, whose = _base(name, folder, source, is_confirmed, seen), name
    verified = isinstance(base.data.get("verified"), dict) and is_confirmed(base)
    below = {key: value for key, value in base.data.items() if key not in _OF_THE_FILE_ALONE}
    merged = _merge(_without_replaced(below, table), table, ())
    from_further = {taken.key: taken for taken in base.taken}
    stated = dict(_leaves(table))
    taken = tuple(
        from_further.get(key, Taken(key, _shown(key, value), whose, verified))
        for key, value in _leaves(merged)
        if key not in stated and key.rpartition(".")[2] not in _NO_VALUES
    )
    return StatedCell(merged, taken)


def split_pairs(stated: StatedCell) -> Iterator[tuple[str, str]]:
    """Yield (number, frame), dotted keys of a pair whose halves come from different files.

    A number of ``BASE_DATA`` or ``TOOL_DATA`` and a frame from another file may be two different places.
    """
    whose = {taken.key: taken.source for taken in stated.taken}
    known = stated_keys(stated.data)
    for number in sorted(filter(_NUMBER_OF_FRAME.fullmatch, known)):
        frame = "frames.base" if number == "frames.base_data" else number.removesuffix("tool_data") + "frame"
        if frame in known and whose.get(number) != whose.get(frame):
            yield number, frame


def is_demonstration(name: str) -> bool:
    """Tell whether ``based_on`` names the demonstration cell of the library."""
    return name in ("demonstration", DEMONSTRATION)


def _base(
    name: str,
    folder: Path | None,
    source: str,
    is_confirmed: Callable[[StatedCell], bool],
    seen: tuple[Path, ...],
) -> StatedCell:
    if is_demonstration(name):
        return StatedCell(library.read_model("cells", DEMONSTRATION), ())
    if not name.endswith(".toml"):
        raise input_error(
            "cell-base",
            f"based_on: found {name[:60]!r}, allowed: demonstration, or another cell file",
            'write based_on = "demonstration" or based_on = "other.toml"',
            source=source,
        )
    file = ((folder or Path()) / name).resolve()
    if file in seen or len(seen) > 8:
        raise input_error(
            "cell-base", f"based_on: {name[:60]!r} is based on itself", "name another cell", source=source
        )
    try:
        data = library.read_toml(file)
    except NotUnderstoodError as error:
        reason = error.issues[0].message
        raise input_error(
            "cell-base", f"based_on: {name[:60]!r}: {reason}", "correct the path", source=source
        ) from None
    return lay_over_base(data, file.parent, str(file), is_confirmed, (*seen, file))


def _with_whole_paths(data: Table, folder: Path | None) -> Table:
    """Return the file with its relative paths joined to its folder, so that they hold from anywhere."""
    table = dict(data)
    if folder is None:
        return table
    for section, key in _FILES:
        if isinstance(table.get(section), dict):
            table[section] = _whole_path(table[section], key, folder)
    if isinstance(table.get("obstacle"), list):
        table["obstacle"] = [
            _whole_path(obstacle, "mesh", folder) if isinstance(obstacle, dict) else obstacle
            for obstacle in table["obstacle"]
        ]
    tools = table.get("tool")
    if isinstance(tools, dict):
        table["tool"] = {
            number: _whole_path(tool, "model", folder) if isinstance(tool, dict) else tool
            for number, tool in tools.items()
        }
    return table


def _whole_path(section: Table, key: str, folder: Path) -> Table:
    value = section.get(key)
    is_name = key == "model" and not str(value).endswith(".toml")
    if not isinstance(value, str) or is_name or "\0" in value:
        return section
    return {**section, key: str((folder / value).resolve())}


def _without_replaced(base: Table, stated: Table) -> Table:
    """Return the base without the values that a value of the file itself makes meaningless."""
    kept = dict(base)
    if _states(stated, "robot", {"model", "geometry"}):  # another arm: nothing of the base's is true of it
        kept.pop("robot", None)
        kept["compliance"] = _end_effector_only(kept.get("compliance"))
    if _states(stated, "controller", {"model"}):
        kept.pop("controller", None)
    if _states(stated, "material", _FORCE_LAW_KEYS):
        kept.pop("material", None)
    if _states(stated, "stock", _SHAPE_KEYS) and isinstance(kept.get("stock"), dict):
        kept["stock"] = {key: value for key, value in kept["stock"].items() if key not in _SHAPE_KEYS}
    tools, own_tools = kept.get("tool"), stated.get("tool")
    if isinstance(tools, dict) and isinstance(own_tools, dict):
        kept["tool"] = {
            number: tool for number, tool in tools.items() if not _states(own_tools, number, _CUTTER_KEYS)
        }
    return kept


def _states(table: Table, section: str, keys: frozenset[str] | set[str]) -> bool:
    value = table.get(section)
    return isinstance(value, dict) and bool(value.keys() & keys)


def _end_effector_only(compliance: Any) -> Any:
    if not isinstance(compliance, dict) or not isinstance(compliance.get("virtual_joints"), dict):
        return compliance if compliance is not None else {}
    joints = compliance["virtual_joints"]
    kept = {name: value for name, value in joints.items() if name in _JOINTS_OF_END_EFFECTOR}
    return {**compliance, "virtual_joints": kept}


def _merge(base: Table, over: Table, path: tuple[str, ...]) -> Table:
    """Return ``base`` with ``over`` on top, table by table; a frame is taken whole."""
    merged = dict(base)
    for key, value in over.items():
        below, here = merged.get(key), (*path, key)
        both = isinstance(below, dict) and isinstance(value, dict) and not _is_frame(here)
        merged[key] = _merge(below, value, here) if both and isinstance(below, dict) else value
    return merged


def _is_frame(path: tuple[str, ...]) -> bool:
    return (
        path in (("frames", "base"), ("frames", "tool"), ("frames", "robroot"))
        or (len(path) == 3 and path[0] == "tool" and path[2] == "frame")
        or (len(path) == 2 and path[0] == "work_offsets")
        or (len(path) == 3 and path[0] == "external" and path[2] == "origin")
    )


def _leaves(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, value) of each value; a frame is one value."""
    for key, value in table.items():
        here = (*path, str(key))
        if isinstance(value, dict) and not _is_frame(here):
            yield from _leaves(value, here)
        else:
            yield ".".join(here), value


def stated_keys(data: Table) -> frozenset[str]:
    """Return the dotted keys of all values of a cell file."""
    return frozenset(key for key, _ in _leaves(data))


def _shown(key: str, value: Any) -> str:
    """Return a value as text; of a file its name, as a program must not depend on where a folder lies."""
    section, _, last = key.partition(".")
    names_file = (section, last) in _FILES or (section == "tool" and last.endswith(".model"))
    if names_file and isinstance(value, str) and Path(value).is_absolute():
        return _text(Path(value).name)
    return _text(value)


def _text(value: Any) -> str:
    """Return a value as a person writes it, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} {_text(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else " ".join(str(value).split())
