"""What a link's data could have shown: the smallest size of each effect, and what of it mismatch hides."""

from typing import Any

import numpy as np

from gcode2krl.gap.choose.examination import Examination, Key
from gcode2krl.gap.fit.signatures import Block
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose


def observable(found: Examination) -> list[dict[str, Any]]:
    """Return for each effect with one size the smallest that would have been reported in this link.

    From the first order of its signature; nothing of a path that is sound. ``seen`` is false where mismatch
    could do nearly all that it does.
    """
    smallest: dict[Key, dict[str, Any]] = {}
    needed = max(2.0 * found.first_level, _LIMITS.least_ratio**2 * found.data.times)
    candidates = found.data.candidates
    for column, (share, power) in zip(candidates.columns, found.observable, strict=False):
        block = candidates.block(column)
        name = _only_size(block)
        if column.width != 1 or name is None or power <= 0.0:
            continue
        entry = {
            "link": found.link.name,
            "effect": block.effect.name,
            "target": block.target,
            "parameter": name,
            "smallest": _typical(found, block, name) * float(np.sqrt(needed / power)),
            "seen": share >= _LIMITS.observable_share,
        }
        if block.key not in smallest or entry["smallest"] < smallest[block.key]["smallest"]:
            smallest[block.key] = entry
    return list(smallest.values())


def _only_size(block: Block) -> str | None:
    """Return the name of an effect's size, where it has one."""
    sizes = [p.name for p in block.effect.parameters if not p.is_shape]
    return sizes[0] if len(sizes) == 1 else None


def _typical(found: Examination, block: Block, name: str) -> float:
    """Return by how much a typical effect is away from nominal."""
    inputs = found.traces[0].inputs
    start, nominal = (f(inputs, block.target)[name] for f in (block.effect.start, block.effect.nominal))
    return abs(start - nominal)
