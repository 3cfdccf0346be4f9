"""What is known while the links are judged one after the other."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Context:
    """Pairs as far as they are understood, and the judgements so far; each step returns a new one."""

    pairs: tuple[Pair, ...]
    explaining: int
    """So many of the pairs explain; the others are held out."""
    known: Mapping[str, Effect]
    """The library with the user's effects; those that are excluded still count as normal mismatch."""
    mismatch: Mismatch
    exclude: frozenset[str] = frozenset()
    """Names of effects that are no candidates."""
    seed: int = 0
    examined: frozenset[str] = frozenset()
    """Names of the links that have data."""
    joints: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Link of joints -> those that it has data of."""
    slips: tuple[Applied, ...] = ()
    """Set-up slips that every link's model has."""
    learned: tuple[Applied, ...] = ()
    """Causes that bend the arm, so that the mechanics' model has them."""
    judgements: tuple[Verdict, ...] = ()
    clocks_set: bool = False
    """The controllers' clocks were set by the commanded joints."""
    stopped: bool = False
    """Stops that nobody planned are in the plan."""

    @property
    def timing(self) -> Verdict | None:
        """Return the judgement of the link that tells when the robot is where."""
        return next((each for each in self.judgements if each.link.tells_time), None)

    @property
    def offered(self) -> Mapping[str, Effect]:
        """Return the effects that are candidates."""
        return {name: effect for name, effect in self.known.items() if name not in self.exclude}

    def has_data(self, link: str) -> bool:
        """Tell whether a link can be judged."""
        return link in self.examined

    def examined_at(self, effect: Effect, target: str | None) -> frozenset[str]:
        """Return the links with data of what an effect moves: load encoders may be on some joints only."""
        return self.examined - unmeasured_at(effect, target, self.joints)

    def candidates(self) -> "list[Effect]":
        """Return the effects that links try: no slip beside one that was found, nor a second kind of stop."""
        return [
            effect
            for effect in self.offered.values()
            if not (effect.kind == "slip" and self.slips) and not (effect.plans_anew and self.stopped)
        ]

    def with_pairs(self, pairs: Iterable[Pair]) -> "Context":
        """Return the context with other pairs."""
        return replace(self, pairs=tuple(pairs))

    def replanned(self, applied: Applied) -> "Context":
        """Return the context whose pairs have an effect in their plan."""
        return self.with_pairs(
            replace(pair, inputs=applied.effect.replan(pair.inputs, applied)) for pair in self.pairs
        )

    def with_slip(self, applied: Applied) -> "Context":
        """Return the context with a set-up slip in the plan, and the rest of what it does in every model."""
        context = self.replanned(applied)
        if applied.effect.plans_anew:  # all that it does is in the plan
            return context
        return replace(context, slips=(*self.slips, replace(applied, planned=True)))

    def with_learned(self, learned: Iterable[Applied]) -> "Context":
        """Return the context with more causes that bend the arm."""
        return replace(self, learned=(*self.learned, *learned))

    def with_judgement(self, judged: Verdict) -> "Context":
        """Return the context with one more judgement."""
        return replace(self, judgements=(*self.judgements, judged))

    def without_cause(self, judged: Verdict, applied: Applied) -> "Context":
        """Return the context whose judgement of a link lacks a cause."""
        judgements = tuple(each.without(applied) if each is judged else each for each in self.judgements)
        return replace(self, judgements=judgements)


def unmeasured_at(effect: Effect, target: str | None, joints: Mapping[str, frozenset[str]]) -> frozenset[str]:
    """Return the links of joints, among those with data, that lack a joint which an effect moves."""
    moved = effect.joints_at(target)
    return frozenset(link for link, measured in joints.items() if not moved <= measured)
