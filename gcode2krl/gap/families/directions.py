"""One free direction: functions of an input that all move the tip, or the force, along one line."""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.families.columns import Columns
from gcode2krl.gap.families.evidence import Evidence, evidence_of
from gcode2krl.gap.families.grid import Family
from gcode2krl.gap.families.view import View


def along_one(
    view: View, every: Evidence | None, family: Family, columns: Columns, signs: Floats
) -> Evidence | None:
    """Return the evidence of a family along the one direction in which it says most; None where it has one.

    ``every``: what the family says along all of its axes. The direction is one that the data must find:
    of the mean over all of them (Laplace), the share of the hemisphere that is near the best one is
    1/gain. By chance it says no more than the family along all axes, whose null it has.
    """
    d = family.directions
    if every is None or d == 1 or len(columns) <= d:
        return None
    along = _main_axis(every, family)
    found = evidence_of(
        view,
        family.place,
        family.on,
        [_turned(each, along) for each in family.columns],
        Columns(_turned(columns.values, along)),
        [root[::d, ::d] for root in family.roots],  # the same for each axis: a Kronecker product
        signs,
        cost=float(np.log(max(every.gain, 1.0))),
    )
    return None if found is None else replace(found, flipped=every.flipped, unbounded=every.unbounded)


def _main_axis(every: Evidence, family: Family) -> Floats:
    """Return the direction (d,), in units of the place, along which a family has most of its signal."""
    units = [unit[:, 0] for unit in family.place.units]
    rows = np.concatenate([np.linalg.solve(u, own.T).T for u, own in zip(units, every.signal, strict=True)])
    axis: Floats = np.linalg.eigh(rows.T @ rows)[1][:, -1]
    return axis


def _turned(columns: Floats, along: Floats) -> Floats:
    """Return columns (…, f·d) along a direction (d,), (…, f)."""
    turned: Floats = columns.reshape(*columns.shape[:-1], -1, len(along)) @ along
    return turned
