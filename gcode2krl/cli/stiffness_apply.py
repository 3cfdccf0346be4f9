"""Writing identified stiffness into a cell file, with its source and reliability."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.cli.identified import section_in, write_section
from gcode2krl.identify.stiffness import KEYS, JointFit, StiffnessIdentification

_OF_END_EFFECTOR = ("sensor", "spindle")
_OTHERS = "; others: "


def apply(result: StiffnessIdentification, file: Path, cell: Cell) -> Path:
    """Write the virtual joints into a cell file.

    A stiffness stated as known is written with the one split from it: only their sum was measured.
    """
    section = section_in(file, "compliance", "virtual_joints")
    joints = {**section.get("virtual_joints", {}), **dict(_values(result))}
    section = {**section, "virtual_joints": joints, **_robot(result, section, cell)}
    return write_section(file, "compliance", {**section, **_end_effector(result, section, cell)})


def _values(result: StiffnessIdentification) -> Iterator[tuple[str, dict[str, float]]]:
    for name, (value, origin) in result.known.items():
        if origin == "stated":
            yield name, {key: getattr(value, key) for key in KEYS}
    for fit in result.joints:
        values = zip(KEYS, fit.k_Nmm_rad, strict=True)
        yield fit.joint, {key: float(f"{k.value:.4g}") for key, k in values if k is not None}


def _robot(result: StiffnessIdentification, section: dict[str, Any], cell: Cell) -> dict[str, str]:
    """Return source and sure of the robot's joints, where one of them was identified."""
    names = [name for name in VIRTUAL_JOINTS if name not in _OF_END_EFFECTOR]
    before = section.get("robot_source", cell.compliance.robot_source)
    text, complete = _source(result, names, str(before))
    sure = section.get("robot_sure", cell.compliance.robot_sure)
    return {"robot_source": text, "robot_sure": "checked" if complete else str(sure)} if text else {}


def _end_effector(result: StiffnessIdentification, section: dict[str, Any], cell: Cell) -> dict[str, str]:
    """Return source and sure of sensor and spindle, where one of them was identified or stated."""
    text, complete = _source(result, _OF_END_EFFECTOR, str(section.get("source", cell.compliance.source)))
    sure = section.get("sure", cell.compliance.sure)
    return {"source": text, "sure": "checked" if complete else str(sure)} if text else {}


def _source(
    result: StiffnessIdentification, names: list[str] | tuple[str, ...], before: str
) -> tuple[str, bool]:
    """Return the source of a group's joints, empty if none is new, and whether all were identified."""
    fits = [fit for fit in result.joints if fit.joint in names]
    stated = [name for name, (_, origin) in result.known.items() if origin == "stated" and name in names]
    file = Path(result.source).name
    words = []
    if fits:
        names_fitted = ", ".join(fit.joint for fit in fits)
        words.append(
            f"{names_fitted} identified from {file}, {result.level:.0%} intervals within {_widest(fits):.0%}"
        )
    split = [f"{fit.joint} split from {', '.join(fit.known)}" for fit in fits if fit.known]
    words += split
    if stated:
        words.append(f"{', '.join(stated)} as stated in the head of {file}")
    others = len(fits) + len(stated) < len(names)
    if words and others and before:
        words.append(_OTHERS.removeprefix("; ") + before.rpartition(_OTHERS)[2])
    return "; ".join(words), len(fits) == len(names)


def _widest(fits: list[JointFit]) -> float:
    """Return the half-width of the widest interval relative to its value."""
    estimates = [k for fit in fits for k in fit.k_Nmm_rad if k is not None]
    return max(max(k.high - k.value, k.value - k.low) / k.value for k in estimates)
