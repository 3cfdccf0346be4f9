"""All families of a link beside several views of it, and the null of the largest."""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.families.columns import Columns
from gcode2krl.gap.families.directions import along_one
from gcode2krl.gap.families.evidence import Evidence, evidence_of, moved_evidence
from gcode2krl.gap.families.grid import Grid, Place
from gcode2krl.gap.families.nested import simplest_first
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.families.steps import Steps, step_evidence
from gcode2krl.gap.families.tone_search import angle_tones, tones
from gcode2krl.gap.families.view import View
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.families
_COMMANDED = (
    Dependence.OWN_ANGLE,
    Dependence.MOTOR_ANGLE,
    Dependence.REVERSALS,
    Dependence.OWN_TORQUE,
    Dependence.PLACE,
    Dependence.VELOCITY,
    Dependence.ACCELERATION,
    Dependence.JERK,
    Dependence.FORCE,
    Dependence.FORCE_BY_PLACE,
)
"""Where the robot is and what it does; what grows with time a drift of the instrument imitates."""


@dataclass(frozen=True, eq=False)
class Study:
    """What every family says of one view, the most probable first."""

    chi2: float
    """Of the view, with nothing explained."""
    evidences: tuple[Evidence, ...]
    p: float
    """Of an evidence as large as the largest, if nothing admissible explains what is left."""
    tail_p: float = 1.0
    """The same by the distribution of the largest (Gumbel 1935) that has the mean and deviation of the flips.

    That goes on where so many flips end.
    """

    moved: Callable[[], Floats] = field(default=lambda: np.zeros(0), repr=False)
    """(moves,) the largest evidence of what the command gives, where each run's rest is moved in time."""

    @cached_property
    def command_p(self) -> float:
        """Return p of the largest evidence of what the command gives, where runs are moved in time.

        Few strong stretches have few signs to flip, yet do not stand where the robot turns back by chance.
        Of its root, which is as an amplitude: the evidence itself has a longer tail than Gumbel's.
        """
        nats = max((each.unbounded for each in self.evidences if each.on in _COMMANDED), default=0.0)
        # of less a sound robot may have as much where its force is
        moved = self.moved() if nats >= _LIMITS.certain_evidence else np.zeros(0)
        return _tail_p(np.sqrt(np.maximum(moved, 0.0)), nats**0.5) if len(moved) else 1.0

    def p_of(self, evidence: Evidence) -> float:
        """Return the same of one of its evidences."""
        return _p(self.evidences, evidence.unbounded)


def studies(rows: Rows, views: Sequence[View], grid: Grid, seed: int = 0) -> list[Study]:
    """Return what every family says of some views of the same rows."""
    found: list[list[Evidence]] = [[] for _ in views]
    signs = [_signs(view, seed) for view in views]
    for family in grid.families():
        place = family.place
        columns = Columns(rows.of(family.columns, place.component))
        for view, own, sign in zip(views, found, signs, strict=True):
            at = view.at(place.component)
            every = evidence_of(at, place, family.on, family.columns, columns, family.roots, sign)
            _add(own, [every, along_one(at, every, family, columns, sign)])
    for place in grid.places:
        for own, evidences in zip(found, _searched(rows, views, place, signs), strict=True):
            _add(own, evidences)
    return [
        _study(view, own, functools.partial(_moved, rows, view, grid))
        for view, own in zip(views, found, strict=True)
    ]


def _searched(
    rows: Rows, views: Sequence[View], place: Place, signs: Sequence[Floats]
) -> Iterator[list[Evidence | None]]:
    """Yield for each view the families at a place whose moment or frequency the data must find."""
    steps = Steps(rows, place)
    for view, sign in zip(views, signs, strict=True):
        at = view.at(place.component)
        yield [
            step_evidence(at, steps, sign),
            *tones(rows, at, place, sign),
            *angle_tones(rows, at, place, sign),
        ]


def _add(found: list[Evidence], evidences: Sequence[Evidence | None]) -> None:
    found += [each for each in evidences if each is not None]


def _signs(view: View, seed: int) -> Floats:
    """Return random signs (flips, g) of the stretches of time."""
    generator = np.random.default_rng(seed)
    shape = (_LIMITS.flips, view.members.shape[0])
    signs: Floats = np.where(generator.random(shape) < 0.5, -1.0, 1.0)
    return signs


def _study(view: View, found: Sequence[Evidence], moved: Callable[[], Floats]) -> Study:
    """Return the study: one evidence for each place and input, and p of the largest."""
    best: dict[object, Evidence] = {}
    for each in sorted(found, key=lambda evidence: -evidence.nats):
        best.setdefault(each.key, each)
    if not found:
        return Study(view.chi2, (), 1.0)
    nats = max(each.unbounded for each in found)
    return Study(
        view.chi2,
        simplest_first(best.values()),
        _p(found, nats),
        _tail_p(_largest(found), nats),
        moved,
    )


def _largest(found: Sequence[Evidence]) -> Floats:
    """Return the largest evidence (flips,) over all families for random signs of stretches."""
    largest: Floats = np.max(np.stack([each.flipped for each in found]), axis=0)
    return largest


def _p(found: Sequence[Evidence], nats: float) -> float:
    """Return p of an evidence, from the largest over all families for random signs of stretches."""
    random = _largest(found)
    return (1.0 + float(np.sum(random >= nats))) / (1.0 + len(random))


def _moved(rows: Rows, view: View, grid: Grid) -> Floats:
    """Return the largest evidence (moves,) of what the command gives, where runs are moved in time.

    None of joints beside a plan, whose corners are off by more than noise.
    """
    if rows.traces[0].link.of_joints and not rows.traces[0].of_six_encoders:
        return np.zeros(0)
    largest = np.full(_LIMITS.moves, -np.inf)
    for family in grid.families():
        if family.on in _COMMANDED:
            columns = Columns(rows.of(family.columns, family.place.component))
            at = view.at(family.place.component)
            largest = np.maximum(largest, moved_evidence(at, columns, family.roots))
    return largest


def _tail_p(random: Floats, nats: float) -> float:
    """Return the probability of at least so much of a Gumbel distribution with the moments of values (n,)."""
    scale = float(np.std(random)) * np.sqrt(6.0) / np.pi
    middle = float(np.mean(random)) - np.euler_gamma * scale
    return float(-np.expm1(-np.exp(-(nats - middle) / max(scale, 1e-12))))
