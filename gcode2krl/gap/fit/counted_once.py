"""Mismatch is counted once: nuisance of the form of an effect gives way while the effect is in the model.

Two columns of one form share a deviation in any way: a clock that is 3.07 ms late was fitted as 0.90 ms of
the effect and 2.17 ms of nuisance, each of which looks usual. Of nuisance that all runs share the column
goes. Of nuisance that each run has for itself what is common to all runs goes, their mean; how the runs
differ from it stays. So the effect's number is the whole deviation.

Several shared columns may have the form only together: the lag of one servo is no clock, the same lag of all
six is one. With N the shared columns and P the projection onto the span of the effect's signature, the
directions b that imitate it are eigenvectors of Nᵀ·P·N·b = λ·(NᵀN + I)·b with λ near 1; these go, and all
that is orthogonal to them stays. What they may add is allowed on top of the effect's own bound.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied
from gcode2krl.effects.parameter import Role
from gcode2krl.gap.fit.box import MOST
from gcode2krl.gap.fit.gram import solve
from gcode2krl.gap.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from gcode2krl.gap.fit.design import Candidates, NuisanceDesign
    from gcode2krl.gap.fit.gram import SignatureGram
    from gcode2krl.gap.fit.nuisance import Nuisance

Key = tuple[str, str | None]
"""Name and target of an effect."""

NO_COUNTS: Mapping[str, float] = MappingProxyType({})
_LEFT = 1e-6
"""A direction of which a projection leaves less is gone already."""


@dataclass(frozen=True, eq=False)
class CountedOnce:
    """Which nuisance of a design gives way to which effects."""

    design: "NuisanceDesign"
    alike: Mapping[Key, Bools] = field(default_factory=dict)
    """Effect -> which coefficients (m,) are of the form of its signature."""
    together: Mapping[Key, Floats] = field(default_factory=dict)
    """Effect -> orthonormal directions (m, d) of shared coefficients that together have its form."""
    allowed: Mapping[Key, float] = field(default_factory=dict)
    """Effect -> its size, in typical ones, that these directions may make within their bounds."""

    @cached_property
    def _possible(self) -> bool:
        """Tell whether any nuisance is of the form of an effect."""
        of_effects = (each.block for items in self.design.nuisance for each in items)
        return bool(self.alike or self.together) or any(block is not None for block in of_effects)

    def gone(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are of the form of an effect."""
        none = np.zeros(self.design.width, dtype=np.bool_)
        found: Bools = self._own(applied) | self.alike.get(_key(applied), none)
        return found

    def kept(self, applied: Iterable[Applied], clocks: bool = False) -> Floats | None:
        """Return the projection (m, m) of b onto what is left of it beside effects; None where all is.

        ``clocks``: beside those of them that are clocks.
        """
        gone = np.zeros(self.design.width, dtype=np.bool_)
        together: list[Floats] = []
        for each in applied if self._possible else ():
            if each.effect.is_clock or not clocks:
                gone |= self.gone(each)
            if not clocks and _key(each) in self.together:
                together.append(self.together[_key(each)])
        if not gone.any() and not together:
            return None
        return _beside(self._projection(gone), together)

    def allowed_sizes(self, applied: Applied) -> float:
        """Return the size of an effect, in typical ones, that usual sizes of others together may make."""
        return self.allowed.get(_key(applied), 0.0)

    def _own(self, applied: Applied) -> Bools:
        """Return which coefficients (m,) are the usual size of an effect at its own target and counts."""
        names = {p.name for p in applied.effect.parameters if p.role is Role.COUNT}
        return self.own_of(_key(applied), {name: applied[name] for name in names})

    def own_of(self, key: Key, counts: Mapping[str, float] = NO_COUNTS) -> Bools:
        """Return which coefficients (m,) are the usual size of an effect at its target, of some counts."""

        def is_own(item: "Nuisance") -> bool:
            block = item.block
            return (
                block is not None
                and block.key == key
                and all(block.shape.get(name, value) == value for name, value in counts.items())
            )

        return self._where(is_own)

    @property
    def straight(self) -> Bools:
        """(m,) all but what an effect does beyond the first order of its size."""
        return ~self._where(lambda item: item.bent)

    def _where(self, asked: "Callable[[Nuisance], bool]") -> Bools:
        """Return which coefficients (m,) are of nuisance of which something is true."""
        found = np.zeros(self.design.width, dtype=np.bool_)
        for items, places in zip(self.design.nuisance, self.design.places, strict=True):
            widths = [each.columns.shape[2] for each in items]
            found[places] |= np.repeat([asked(each) for each in items], widths).astype(np.bool_)
        return found

    def _projection(self, gone: Bools) -> Floats:
        """Return the projection (m, m): shared coefficients away, others less their mean over the runs."""
        projection = np.diag(1.0 - gone)
        for places in self.design.of_runs:
            if gone[places].any():
                projection[np.ix_(places, places)] = np.eye(len(places)) - 1.0 / len(places)
        return projection


def _key(applied: Applied) -> Key:
    return applied.effect.name, applied.target


def _beside(projection: Floats, together: list[Floats]) -> Floats:
    """Return a projection (m, m) less what it leaves of some directions (m, d)."""
    left = [projection @ directions for directions in together]
    if not left:
        return projection
    basis, sizes, _ = np.linalg.svd(np.concatenate(left, axis=1), full_matrices=False)
    basis = basis[:, sizes > _LEFT]
    less: Floats = projection - basis @ basis.T
    return less


def once_among(
    design: "NuisanceDesign",
    candidates: "Candidates",
    signatures: "SignatureGram",
    bounded: Collection[Key] = (),
) -> CountedOnce:
    """Return which nuisance has the form of which candidates: what these span of it.

    Each run's own column by column; what is shared also together, for the effects with a bound, as only these
    are compared with one.
    """
    once = CountedOnce(design)
    alike: dict[Key, Bools] = {}
    together: dict[Key, Floats] = {}
    allowed: dict[Key, float] = {}
    for column in candidates.columns:
        block = candidates.block(column)
        alike[block.key] = alike.get(block.key, False) | _spanned(column.index, signatures, design)
        if column.width and block.key in bounded and block.key not in together:
            others = once.straight & ~once.own_of(block.key)
            directions, sizes = _imitating(column.index, signatures, design, others)
            if directions.shape[1]:
                together[block.key], allowed[block.key] = directions, sizes
    return CountedOnce(design, {key: mask for key, mask in alike.items() if mask.any()}, together, allowed)


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


def _imitating(
    index: np.ndarray, signatures: "SignatureGram", design: "NuisanceDesign", others: Bools
) -> tuple[Floats, float]:
    """Return directions (m, d) of shared nuisance that some signatures span, and the size they may make."""
    at = np.flatnonzero(others[: design.shared])
    inner = np.zeros((len(index), len(index)))
    cross, gram = np.zeros((len(index), design.width)), np.zeros((design.width, design.width))
    for total, places in zip(signatures.totals, signatures.places, strict=True):
        inner += total[np.ix_(index, index)]
        cross[:, places] += total[index][:, signatures.signatures :]
        gram[np.ix_(places, places)] += total[signatures.signatures :, signatures.signatures :]
    if not len(at):
        return np.zeros((design.width, 0)), 0.0
    made = solve(inner, cross[:, at])
    shares, vectors = linalg.eigh(cross[:, at].T @ made, gram[np.ix_(at, at)] + np.eye(len(at)))
    found = vectors[:, shares >= THRESHOLDS.fit.same_form]
    directions = np.zeros((design.width, found.shape[1]))
    directions[at] = np.linalg.qr(found)[0]
    within = MOST / np.maximum(np.abs(found).max(axis=0, initial=0.0), 1e-300)
    return directions, float(np.abs(made[0] @ found * within).sum())
