"""The chain of one cell: frames, softness of the virtual joints, tool tips.

Frames and their order are those of Haehn & Weigold 2020, fig. 1 and table 1, for any arm with an
ortho-parallel base and a spherical wrist; docs/compliance.md has the reason for each place and axis.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compiled.inputs import distinct
from gcode2krl.compliance.estimate import ARM, Estimate, estimated
from gcode2krl.errors import Issue, NotUnderstoodError, Severity, input_error


class Tips(NamedTuple):
    """Tool tips in frame 10: ``position_mm`` (k, 3), and which of them each row has, ``tool`` (n,)."""

    position_mm: Floats
    tool: Ints32


def frames(cell: Cell) -> Floats:
    """Return cos alpha, sin alpha, a and d (10, 4) of eq. 1 for frames 1 to 10, in mm."""
    a1_mm, a2_mm, c1_mm, c2_mm, c3_mm, c4_mm = cell.robot.geometry.array()
    half_mm = _height_mm(cell) / 2
    quarter_turns_a_d = np.array(
        [
            (0, 0.0, c1_mm),  # A1: foot of axis 1, lifted to axis 2
            (-1, a1_mm, 0.0),  # A2: axis 2
            (0, c2_mm / 2, 0.0),  # linked arm: its middle
            (0, c2_mm / 2, 0.0),  # A3: axis 3
            (-1, -a2_mm, c3_mm / 2),  # arm: on axis 4, half-way to the wrist
            (0, 0.0, c3_mm / 2),  # A4: wrist centre
            (1, 0.0, 0.0),  # A5: wrist centre
            (-1, 0.0, c4_mm),  # A6: flange
            (0, 0.0, half_mm),  # sensor: half its height
            (0, 0.0, half_mm),  # spindle and holder: mounting face on the sensor
        ]
    )
    cos_alpha = np.where(quarter_turns_a_d[:, 0] == 0, 1.0, 0.0)
    return np.column_stack([cos_alpha, quarter_turns_a_d])


class Stiffness(NamedTuple):
    """The virtual joints of a cell, stated or estimated."""

    softness: Floats
    """(10, 3) 1/k_C, 1/k_B, 1/k_A in rad/(N·mm)."""
    relative_band: float
    """Half-width of the 90 % band, relative."""
    assumed: str
    """What nobody stated, in words; empty where all is stated."""


def missing_stiffness(cell: Cell) -> Issue | None:
    """Return the finding that the arm's stiffness is neither stated nor can be estimated; None otherwise."""
    missing = [name for name in ARM if name not in cell.compliance.virtual_joints]
    if not missing or _estimate(cell) is not None:
        return None
    return Issue(
        "error",
        "stiffness-unknown",
        0,
        f"no deflection: the stiffness of {', '.join(missing)} of {cell.robot.title} is not known",
        "state mass_kg and reach_mm of [robot.payload], from which it is estimated, or measure it: "
        "`gcode2krl identify stiffness --pulls form.csv`",
    )


def assumed_stiffness(cell: Cell, severity: Severity = "error") -> Issue | None:
    """Return the finding that names what of the stiffness nobody stated; None where all is stated.

    A robot is not moved by such a stiffness, and a prediction from it says so.
    """
    missing = missing_stiffness(cell)
    if missing is not None:
        return missing
    known = stiffness(cell)
    if not known.assumed:
        return None
    sentence = f"deflection known to +- {known.relative_band:.0%} at best (90 %): {known.assumed}"
    return Issue(
        severity,
        "stiffness-estimated",
        0,
        sentence,
        "measure the arm: `gcode2krl identify stiffness --pulls form.csv`; state sensor and spindle in "
        "[compliance.virtual_joints] of the cell (9.9e99 = rigid)",
    )


def stiffness(cell: Cell) -> Stiffness:
    """Return the stiffness of every virtual joint; raises what `missing_stiffness` finds.

    Joints of the arm that the cell does not state are estimated; sensor and spindle are taken as rigid.
    """
    issue = missing_stiffness(cell)
    if issue is not None:
        raise NotUnderstoodError(issue)
    stated = {str(name): (k.k_c, k.k_b, k.k_a) for name, k in cell.compliance.virtual_joints.items()}
    soft = np.zeros((len(VIRTUAL_JOINTS), 3))
    for row, name in enumerate(VIRTUAL_JOINTS):
        if name in stated:
            soft[row] = 1.0 / np.array(stated[name])
    band, words = cell.compliance.relative_band, []
    estimable = [name for name in ARM if name not in stated]
    estimate = _estimate(cell) if estimable else None
    if estimate is not None:
        rows = [ARM.index(name) for name in estimable]
        soft[rows] = estimate.softness[rows]
        band = max(band, estimate.relative_band)
        whole = "the arm" if len(estimable) == len(ARM) else ", ".join(estimable)
        words.append(f"{whole} estimated from payload and reach, +- {estimate.relative_band:.0%}")
    rigid = [name for name in VIRTUAL_JOINTS if name not in stated and name not in ARM]
    if rigid:
        words.append(f"{' and '.join(rigid)} taken as rigid")
    elif cell.compliance.sensor_height_mm is None:
        words.append("sensor_height_mm taken as 0")
    return Stiffness(soft, band, "; ".join(words))


def softness(cell: Cell) -> Floats:
    """Return 1/k_C, 1/k_B, 1/k_A (10, 3) in rad/(N·mm); raises what `missing_stiffness` finds."""
    return stiffness(cell).softness


def tips(cell: Cell, tool: npt.ArrayLike | None, count: int) -> Tips:
    """Return the tips of ``count`` rows: one tool number for all, one a row (n,), or None = the mounted one.

    Raises
    ------
    NotUnderstoodError
        If the cell does not have the tool.
    ValueError
        If there is not one number for all or one a row.
    """
    if tool is None:
        tool = cell.usual_tool or 0
    if np.ndim(tool) == 0:  # a cycle of the online side has no time to sort
        numbers, index = np.array([tool]), np.array(0)
    else:
        numbers = distinct(np.ravel(tool))
        index = np.searchsorted(numbers, tool) if len(numbers) > 1 else np.array(0)
    for number in numbers:
        if int(number) not in cell.tool:
            known = ", ".join(str(name) for name in sorted(cell.tool)) or "none"
            raise input_error(
                "tool-unknown", f"tool {number} is not in the cell, which has {known}", f"add [tool.{number}]"
            )
    if np.shape(tool) not in ((), (count,)):
        raise ValueError(f"tool has shape {np.shape(tool)}, not () or ({count},)")
    holder_mm = np.array([0.0, 0.0, _height_mm(cell)])
    position = np.array([cell.tool_matrix(int(number))[:3, 3] - holder_mm for number in numbers])
    rows = np.broadcast_to(index, count)
    return Tips(position.reshape(-1, 3), np.ascontiguousarray(rows, dtype=np.int32))


def _estimate(cell: Cell) -> Estimate | None:
    """Return what is estimated of the arm; None where its rated payload or reach is not stated."""
    mass_kg, reach_mm = cell.robot.payload.mass_kg, cell.robot.payload.reach_mm
    return None if mass_kg is None or reach_mm is None else estimated(mass_kg, reach_mm)


def _height_mm(cell: Cell) -> float:
    """Return how far the face of spindle and holder is from the flange; 0 where there is no sensor."""
    return cell.compliance.sensor_height_mm or 0.0
