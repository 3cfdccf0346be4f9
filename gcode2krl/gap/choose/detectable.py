"""What a link's data could have shown: the smallest size of each effect, and what of it mismatch hides."""

from typing import Any

import numpy as np

from gcode2krl.gap.choose.scoring import LEAST_RATIO
from gcode2krl.gap.choose.selection import Examination

SEEN = 0.02
"""A block of whose power less than this is left beside the nuisance is not observable (design/gap.md)."""


def observable(found: Examination) -> list[dict[str, Any]]:
    """Return for each effect with one size the smallest that would have been a finding in this link.

    From the first order of its signature; nothing of a path that is sound. ``seen`` is false where mismatch
    could do nearly all that it does.
    """
    best: dict[tuple[str, str | None], dict[str, Any]] = {}
    for column, (share, power) in zip(found.columns, found.seen, strict=False):
        block = found.blocks[column.block]
        sizes = [p for p in block.effect.parameters if not p.is_shape]
        if column.width != 1 or len(sizes) != 1 or power <= 0.0:
            continue
        inputs, name = found.traces[0].inputs, sizes[0].name
        start, nominal = (f(inputs, block.target)[name] for f in (block.effect.start, block.effect.nominal))
        needed = max(2.0 * found.first_level, LEAST_RATIO**2 * found.times)
        smallest = abs(start - nominal) * float(np.sqrt(needed / power))
        entry = {
            "link": found.link.name, "effect": block.effect.name, "target": block.target, "parameter": name,
            "smallest": smallest, "seen": share >= SEEN,
        }  # fmt: skip
        if block.key not in best or smallest < best[block.key]["smallest"]:
            best[block.key] = entry
    return list(best.values())
