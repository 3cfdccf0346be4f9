"""How far apart the true cause of a case is from everything else that could explain its data, in nats.

D is half the least chi² of the true change (signals with the effect less signals without, all measured links
of all runs jointly, whitened by the case's noise) beside

* `mismatch`: normal mismatch within its bounds alone: whether a gap is there at all;
* `one`, `two`: mismatch and any one or two effects of the library other than the truth, their parameters free
  within their ranges.

An observer who knows every effect of the library and the course of the noise tells the truth from its best
imitator at odds of exp(D) to one. Assumptions, each of which makes D a little too large or too small:

* Truth and imitators act on the nominal robot; mismatch enters to first order, in a box of its bounds. The
  zero between two encoders of a joint is free.
* The noise of a column is of first order with the case's memory; the last digit's share is added to its
  power. Foreign noise and drop-outs are not counted. The commanded log is met by the prediction to 0.01 mm.
* Effects enter by their signatures at a grid of starts (`signatures.py`); of two, the second extends one of
  the `BEAM` best singles. Of the best few the effect itself is run and, where it is not linear, refitted.
* The truth's own model errs by a share of its change (`MODEL_ERROR`): the distance is reduced by so much.
* A scan of the part is no link here: where it was made D is too small, of what shows in it alone not known.
"""

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tests.plant import kinds
from tests.plant.distance import Block, Fit, Products
from tests.plant.effects import LIBRARY, SLIPS
from tests.plant.faults import Fault
from tests.plant.plans import Plan
from tests.plant.refit import Guess
from tests.plant.signatures import Library, Start
from tests.plant.whitened import Case, starts_found

DECIDABLE, OPEN, FAR = 10.0, 3.0, 100.0
"""Nats of the classes, and from which on a first refit is not gone on with."""
CHECKED = 3
"""So many of the best candidates are run and, where they are not linear, refitted."""
CURVED = 0.05
"""Share of its change from which on an effect that differs from its signatures is refitted."""
MODEL_ERROR = {"plan": 0.10, "force": 0.03}
"""Share of a true effect's change that its model does not get right: of one that plans the motion anew, and
of one of the cut's forces, whose edges are met to so much. Of frames and joints nothing."""
PLANS = ("velocity_rule", "corner", "advance_stop")


@dataclass(frozen=True)
class Decidability:
    """D in nats beside mismatch, one effect and two, and who imitates best."""

    mismatch: float
    one: float
    two: float
    best_one: str
    best_two: tuple[str, str]

    @property
    def name(self) -> str:
        """Class by the best imitators: decidable, open or undecidable."""
        return class_of(self.two)

    def as_dict(self) -> dict:
        """Plain numbers and names."""
        return {**asdict(self), "best_two": list(self.best_two), "class": self.name}


def class_of(nats: float) -> str:
    """Class of a distance."""
    return "decidable" if nats >= DECIDABLE else "open" if nats >= OPEN else "undecidable"


def distance_nats(chi2: float, change2: float, error: float) -> float:
    """D of a least chi², with a model error as a share of the whole change's distance taken off."""
    return 0.5 * max(np.sqrt(chi2) - error * np.sqrt(change2), 0.0) ** 2


class Truth:
    """One true effect of a case, and its distances."""

    def __init__(self, case: Case, fault: Fault, size: float, without: Sequence[str] = ()):
        self.case, self.error = case, error_of(fault)
        self.change = case.white(case.changes(fault.hooks(size)))
        own = fault.kind.name if fault.target is None else f"{fault.kind.name}@{fault.target}"
        is_named = LIBRARY.get(fault.kind.name) is fault.kind
        self.left_out = {own} if is_named else set()
        self.without = set(without)
        self.candidates = [b for b in case.blocks if self._allowed(b)]
        self.size2 = sum(float(v @ v) for v in self.change.values())

    def _allowed(self, block: Block) -> bool:
        return block.label not in self.left_out and block.start.name not in self.without

    def nats(self, chi2: float) -> float:
        """D of a least chi²."""
        return distance_nats(chi2, self.size2, self.error)

    def decided(self) -> Decidability:
        """All three distances."""
        alone = self.case.against(self.change, ())
        gap = alone.least().chi2
        if self.nats(gap) < OPEN:  # mismatch alone imitates it
            d = self.nats(gap)
            return Decidability(d, d, d, "mismatch", ("mismatch", "mismatch"))
        products = self._with_events(alone)
        singles = products.singles()
        one, name = self._best(singles, gap)
        pairs = products.pairs(singles)
        two, names = self._best(pairs, one)
        if two >= one:
            names = (*name, "mismatch")[:2]
        return Decidability(
            self.nats(gap), self.nats(one), self.nats(min(one, two)), " + ".join(name), tuple(names)
        )

    def _with_events(self, alone: Products) -> Products:
        """Products with all candidates, those that begin where this change does included."""
        rest = self._beside_mismatch(alone)
        more: list[tuple[Start, list[dict]]] = []
        for name in self.case.library.by_case:
            for start in starts_found(name, rest, self.case.channels):
                label = Block(start.label, np.zeros(0), np.zeros(0), np.zeros(0), start)
                if self._allowed(label):
                    more.append((start, self.case.columns_of(start)))
        if not more:
            return self.case.against(self.change, self.candidates)
        self.case = self.case.and_also(more)
        return self.case.against(self.change, [b for b in self.case.blocks if self._allowed(b)])

    def _beside_mismatch(self, alone: Products) -> dict[tuple, np.ndarray]:
        m = alone.mismatch.at
        inner = alone.products[np.ix_(m, m)] + np.eye(len(m))
        return self.case.less(self.change, m, np.linalg.solve(inner, alone.products[m, 0]))

    def _best(self, fits: Sequence[Fit], most: float) -> tuple[float, tuple[str, ...]]:
        """Least chi² of the best candidates when the effects themselves are run, and their names."""
        best, names = most, ("mismatch",)
        for fit in fits[:CHECKED]:
            if fit.chi2 >= best:
                break
            chi2 = self._run(fit)
            if chi2 < best:
                best, names = chi2, tuple(b.label for b in fit.blocks)
        return best, names

    def _run(self, fit: Fit) -> float:
        """Least chi² when the effects of a fit are run; refitted where they are not linear."""
        guess = Guess(self.case, self.change, fit)
        acted = guess.white(guess.start)
        straight = self.case.line(fit)
        off = sum(float((acted[k] - straight.get(k, 0.0)) @ (acted[k] - straight.get(k, 0.0))) for k in acted)
        size2 = sum(float(v @ v) for v in acted.values())
        if off <= CURVED**2 * size2:
            return fit.chi2
        chi2 = guess.chi2(acted)
        if self.nats(chi2) < OPEN:
            return chi2
        return min(chi2, guess.refitted(lambda chi2: OPEN < self.nats(chi2) < FAR))


def error_of(fault: Fault) -> float:
    """Share of its change that the truth's own model does not get right."""
    if fault.kind.name in PLANS:
        return MODEL_ERROR["plan"]
    return MODEL_ERROR["force"] if fault.kind.family == "force" else 0.0


def of_plan(
    plan: Plan, sizes: Sequence[float], library: Library, without: Sequence[str] = ()
) -> list[Decidability | None]:
    """D of each fault of a plan at its size; None of a slip, and of what no link shows but the part alone.

    `without`: effects that are taken out of the library.
    """
    is_slip = [fault.kind in SLIPS.values() for fault in plan.faults]
    if all(is_slip):
        return [None] * len(is_slip)
    case = Case(library, plan.how, plan.days)
    out: list[Decidability | None] = []
    for fault, size, slips in zip(plan.faults, sizes, is_slip, strict=True):
        truth = None if slips else Truth(case, fault, size, without)
        out.append(None if truth is None or truth.size2 == 0.0 else truth.decided())
    return out


MIX = ("single", "open", "double", "single", "deleted", "open", "single", "story")


def main(arguments: list[str] | None = None) -> int:
    """Print the distances of drawn cases, and how many of each kind are in which class."""
    parser = argparse.ArgumentParser(prog="python -m tests.plant.decidability", description=main.__doc__)
    parser.add_argument("--cases", type=int, default=8, help="of the kinds in turn")
    parser.add_argument("--seed", type=int, default=1, help="of the first; the next has one more")
    parser.add_argument("--kinds", default=",".join(MIX), help="in turn")
    parser.add_argument("--signatures", type=Path, help="folder that keeps them between calls")
    options = parser.parse_args(arguments)
    library, of_kind, took_s = Library(options.signatures), {}, []
    names = options.kinds.split(",")
    for i in range(options.cases):
        kind, seed = names[i % len(names)], options.seed + i
        plan, more = kinds.plan_of(kind, seed)
        sizes = plan.sizes([plan.drive(day, []) for day in plan.days])
        library.ready(plan.days)
        begin = time.process_time()
        without = [more["delete"]] if "delete" in more else []
        found = of_plan(plan, sizes, library, without)
        took_s.append(time.process_time() - begin)
        for fault, d in zip(plan.faults, found, strict=True):
            text = "not known" if d is None else _line(d)
            form = "same" if fault.same else "other"
            print(f"{kind} {seed} {fault.kind.name} {fault.target or ''} ({form}): {text}", flush=True)
            of_kind.setdefault(kind, Counter())[d.name if d else "not known"] += 1
    for kind, counts in of_kind.items():
        print(f"{kind}: " + ", ".join(f"{name} {n}" for name, n in counts.most_common()))
    print(f"processor seconds a case: median {np.median(took_s):.1f}, worst {max(took_s):.1f}")
    return 0


def _line(d: Decidability) -> str:
    both = " and ".join(d.best_two)
    return f"{d.name}; beside mismatch {d.mismatch:.4g}, {d.best_one} {d.one:.4g}, {both} {d.two:.4g} nats"


if __name__ == "__main__":
    raise SystemExit(main())
