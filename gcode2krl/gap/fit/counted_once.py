"""Mismatch is counted once: nuisance of the form of an effect gives way while the effect is in the model.

Two columns of one form share a deviation in any way: a clock that is 3.07 ms late was fitted as 0.90 ms of
the effect and 2.17 ms of nuisance, each of which looks usual. Of nuisance that all runs share the column
goes. Of nuisance that each run has for itself what is common to all runs goes, their mean; how the runs
differ from it stays. So the effect's number is the whole deviation.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied
from gcode2krl.effects.parameter import Role
from gcode2krl.gap.fit.gram import solve
from gcode2krl.gap.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from gcode2krl.gap.fit.design import Candidates, NuisanceDesign
    from gcode2krl.gap.fit.gram import SignatureGram

Key = tuple[str, str | None]
"""Name and target of an effect."""


@dataclass(frozen=True, eq=False)
class CountedOnce:
    """Which nuisance of a design gives way to which effects."""

    design: "NuisanceDesign"
    alike: Mapping[Key, Bools] = field(default_factory=dict)
    """Effect -> which coefficients (m,) are of the form of its signature."""

    @cached_property
    def _possible(self) -> bool:
        """Tell whether any nuisance is of the form of an effect."""
        of_effects = (each.block for items in self.design.nuisance for each in items)
        return bool(self.alike) or any(block is not None for block in of_effects)

    def gone(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are of the form of an effect."""
        none = np.zeros(self.design.width, dtype=np.bool_)
        found: Bools = self._own(applied) | self.alike.get((applied.effect.name, applied.target), none)
        return found

    def kept(self, applied: Iterable[Applied], clocks: bool = False) -> Floats | None:
        """Return the projection (m, m) of b onto what is left of it beside effects; None where all is.

        ``clocks``: beside those of them that are clocks.
        """
        gone = np.zeros(self.design.width, dtype=np.bool_)
        for each in applied if self._possible else ():
            if each.effect.is_clock or not clocks:
                gone |= self.gone(each)
        return self._projection(gone) if gone.any() else None

    def _own(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are the usual size of an effect at its own target and counts."""
        counts = {p.name for p in applied.effect.parameters if p.role is Role.COUNT}
        own = np.zeros(self.design.width, dtype=np.bool_)
        for items, places in zip(self.design.nuisance, self.design.places, strict=True):
            first = 0
            for each in items:
                at = places[first : first + each.columns.shape[2]]
                first += each.columns.shape[2]
                block = each.block
                if block is None or block.key != (applied.effect.name, applied.target):
                    continue
                own[at] |= all(block.shape.get(name) == applied[name] for name in counts & set(block.shape))
        return own

    def _projection(self, gone: Bools) -> Floats:
        """Return the projection (m, m): shared coefficients away, others less their mean over the runs."""
        projection = np.diag(1.0 - gone)
        for places in self.design.of_runs:
            if gone[places].any():
                projection[np.ix_(places, places)] = np.eye(len(places)) - 1.0 / len(places)
        return projection


def once_among(
    design: "NuisanceDesign", candidates: "Candidates", signatures: "SignatureGram"
) -> CountedOnce:
    """Return which nuisance of the runs' own has the form of which candidates: what these span of it."""
    alike: dict[Key, Bools] = {}
    for column in candidates.columns:
        spanned = _spanned(column.index, signatures, design)
        key = candidates.block(column).key
        alike[key] = alike.get(key, False) | spanned
    return CountedOnce(design, {key: mask for key, mask in alike.items() if mask.any()})


def _spanned(index: np.ndarray, signatures: "SignatureGram", design: "NuisanceDesign") -> Bools:
    """Return which coefficients (m,) of the runs' own nuisance some signatures span in every run."""
    share = np.zeros(design.width)
    for total, places in zip(signatures.totals, signatures.places, strict=True):
        inner, cross = total[np.ix_(index, index)], total[index][:, signatures.signatures :]
        whole = np.diag(total)[signatures.signatures :]
        explained = np.sum(cross * solve(inner, cross), axis=0)
        share[places] = explained / np.maximum(whole, 1e-300)
    spanned = np.zeros(design.width, dtype=np.bool_)
    for places in design.of_runs:
        spanned[places] = bool(np.all(share[places] >= THRESHOLDS.fit.same_form))
    return spanned
