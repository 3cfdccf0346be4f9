"""Force, deflection and time with interval and source, and the key of the cell that decides the interval."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from gcode2krl import krc4
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS
from gcode2krl.compliance import joint_shares
from gcode2krl.prediction.forecast import LoadFigures
from gcode2krl.tables import Targets

MOST_TARGETS = 50_000
"""Of a program with more, which no controller holds as a whole, the range of the time is not planned."""


class Quantity(NamedTuple):
    """A predicted figure with its 90 % interval."""

    value: float
    low: float | None
    high: float | None
    """None where nothing is known of the interval."""
    source: str
    key: str
    """Of the cell: what the interval hangs on most."""
    share: float
    """Of the variance of the interval that this key brings; 1 where it is all that is varied."""


def quantities(loads: LoadFigures | None, time_s: float, targets: Targets, cell: Cell) -> dict[str, Any]:
    """Return ``time_s``, ``max_force_N`` and ``max_deflection_mm`` as plain values; unknown ones are None."""
    figures: dict[str, Quantity | None] = {"time_s": _time(time_s, targets, cell)}
    figures |= {"max_force_N": None, "max_deflection_mm": None}
    if loads is not None and cell.material is not None:
        figures["max_force_N"] = _force(loads, cell)
        if loads.deflection_mm is not None:
            figures["max_deflection_mm"] = _deflection(loads, loads.deflection_mm, cell)
    return {name: each._asdict() if each is not None else None for name, each in figures.items()}


def band_words(figures: dict[str, Any]) -> Iterator[str]:
    """Yield what the intervals hang on, a quantity each."""
    force, bent, time = figures["max_force_N"], figures["max_deflection_mm"], figures["time_s"]
    for name, quantity in (("force", force), ("deflection", bent)):
        if quantity is not None:
            yield f"{quantity['share']:.0%} of the band of the {name} is {quantity['key']}"
    if time is not None and time["low"] is not None and time["high"] > time["low"]:
        yield f"time {time['low']:.1f}..{time['high']:.1f} s by {time['key']}, unverified"


def _force(loads: LoadFigures, cell: Cell) -> Quantity:
    material = cell.material
    if material is None:
        raise ValueError("forces without a material")
    source = material.source or material.model or "not stated"
    if cell.stock is None:
        source += "; the stock is guessed, which the interval does not contain"
    return _around(loads.force_N, loads.force_band, source, _law(cell), 1.0)


def _deflection(loads: LoadFigures, value_mm: float, cell: Cell) -> Quantity:
    """Trace the band to the coefficients, or to the joint that moves the tip most where it bends most."""
    of_force, of_stiffness = loads.force_band**2, cell.compliance.relative_band**2
    share = of_force / max(of_force + of_stiffness, 1e-12)
    key, most = _law(cell), share
    if loads.worst is not None and not cell.external:
        joint, part = _softest(loads, cell)
        if (1.0 - share) * part > most:
            key, most = f"compliance.virtual_joints.{joint}", (1.0 - share) * part
    source = cell.compliance.robot_source or cell.compliance.source or "not stated"
    return _around(value_mm, loads.deflection_band, source, key, most)


def _softest(loads: LoadFigures, cell: Cell) -> tuple[str, float]:
    """Return the virtual joint that moves the tip most at the largest deflection, and its part of it."""
    worst = loads.worst
    if worst is None:
        raise ValueError("no largest deflection")
    turn = cell.base_matrix()[:3, :3]
    load = worst.q_rad[None], (turn @ worst.force_base_N)[None], (turn @ worst.moment_base_Nmm)[None]
    alone = joint_shares(*load, cell, np.array([worst.tool]))[0]
    whole = alone.sum(axis=0)
    part = alone @ whole / max(float(whole @ whole), 1e-12)
    return VIRTUAL_JOINTS[int(np.argmax(part))], float(part.max())


def _time(time_s: float, targets: Targets, cell: Cell) -> Quantity | None:
    """Return the time with and without the model of the look-ahead, by both laws."""
    if math.isnan(time_s):
        return None
    controller = cell.controller
    source = f"law {controller.law}, k_s = {controller.k_s:g} s, advance = {controller.advance}: unverified"
    if len(targets) > MOST_TARGETS:
        return Quantity(time_s, None, None, source, "controller.advance", 1.0)
    chain = krc4.build_chain(targets, cell)
    planned_s = krc4.plan(chain, cell).total_s
    apart_s = {"controller.advance": krc4.plan(chain, cell, look_ahead=False).total_s - planned_s}
    other = controller.model_copy(update={"law": "trapezoid" if controller.law == "averages" else "averages"})
    by_law = cell.model_copy(update={"controller": other})
    apart_s["controller.law"] = krc4.plan(chain, by_law).total_s - planned_s
    key = max(apart_s, key=lambda name: abs(apart_s[name]))
    variance = sum(each**2 for each in apart_s.values())
    share = apart_s[key] ** 2 / variance if variance else 1.0
    low, high = min(0.0, *apart_s.values()), max(0.0, *apart_s.values())
    return Quantity(time_s, time_s + low, time_s + high, source, key, share)


def _around(value: float, band: float, source: str, key: str, share: float) -> Quantity:
    return Quantity(value, max(0.0, value * (1.0 - band)), value * (1.0 + band), source, key, share)


def _law(cell: Cell) -> str:
    kienzle = cell.material is not None and cell.material.kienzle is not None
    return f"material.{'kienzle' if kienzle else 'linear_edge'}"
