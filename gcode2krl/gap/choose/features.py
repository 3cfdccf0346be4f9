"""The results of all tests of a cause, gathered: what its probability is made of, and what the JSON shows."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from gcode2krl.effects import Role
from gcode2krl.gap.choose.constancy import Constancy
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.family_tests import FamilyTests, Rest
from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.choose.rivals import Rival
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.choose
MOST_NATS = 1000.0
"""Evidence beyond it says no more; also where there is nothing to compare with."""
_DIGITS = 4


@dataclass(frozen=True, kw_only=True)
class Features:
    """What the tests say of a cause, numbers only; None where a test could not be made."""

    surprise: float
    """-log of the probability of its gain without it, beyond what the search finds by chance, in nats."""
    size_over_noise: float
    """RMS of what it takes of the whitened data."""
    margin: float
    """Evidence of its family over that of the best other one, in nats (`FamilyTests`)."""
    form_ratio: float
    """Of what its family takes, the share that its form takes."""
    other_share: float
    """Of the gap's power, what the best other family takes beside it."""
    other_power: float
    """That family's share of the power of both in the signal."""
    other_p: float
    """Of an evidence as large as that by chance."""
    inconstancy: float | None
    """Spread of its size over parts of the data beyond noise, over the size."""
    constant_p: float | None
    """Of at least that spread where the size is one number."""
    shape_interval: float
    """Widest 90 % interval of its shapes over their ranges; 1 where one was not found, 0 without shapes."""
    fold_agreement: float | None
    """Share of the splits in which the other data alone choose the same effect at the same target."""
    shrink_of_rest: float | None
    """Of what the causes above it leave on held-out data, the share that it takes."""
    shrink_where_others: float | None
    """Of the gap on held-out data, the share that it takes where causes above it act too; 1 if none does."""
    shrink_together: float | None
    """Of the gap on held-out data, the share that all causes of the link take."""
    share_left: float
    """Of the gap, what all causes leave on held-out data and on those that explain; 0 if insignificant."""
    rest_share: float
    """Of the gap, what the best family there takes beside all causes; 0 if insignificant."""
    rival_nats: float
    """By how much the best effect that the data can tell from it is worse."""
    alike: int
    """Number of effects that the data cannot tell from it."""
    causes: int
    """Number of causes that were accepted in the link."""
    links_missing: int
    """Number of links without data."""
    gap_p: float
    """Of the best family's evidence by chance, the cause taken out."""
    conditions_failed: int
    """How many of the conditions of a name fail: family best, form fits, no other beside it, one size."""

    def as_dict(self) -> dict[str, float | None]:
        """Return name -> number, rounded."""
        return {entry.name: _rounded(getattr(self, entry.name)) for entry in fields(self)}


NAMES = tuple(entry.name for entry in fields(Features))


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{_DIGITS}g}")


@dataclass(frozen=True, kw_only=True)
class FamilyFeatures:
    """What is known of a family that the rest of a gap depends on."""

    lead_nats: float
    """Its evidence over that of the best other family of its signal or of none, over the inflation."""
    share: float
    """Of the gap's power, what it takes."""
    p: float
    """Of its evidence by chance."""
    of_largest: float
    """Its evidence over that of the best family of all signals of its link."""
    larger_links: int
    """Links with a larger gap that has no name, or not all of one: what they leave may show here too."""

    def as_dict(self) -> dict[str, float | None]:
        """Return name -> number, rounded."""
        return {entry.name: _rounded(getattr(self, entry.name)) for entry in fields(self)}


FAMILY_NAMES = tuple(entry.name for entry in fields(FamilyFeatures))


def family_features(rest: Rest, evidence: Evidence, larger_links: int = 0) -> FamilyFeatures:
    """Return the features of a family of a rest; those of other signals, of another joint, are no rivals."""
    rivals = [each for each in rest.study.evidences if each.place.component == evidence.place.component]
    other = max((each.nats for each in rivals if each is not evidence), default=0.0)
    return FamilyFeatures(
        lead_nats=_within((evidence.nats - max(other, 0.0)) / rivals[0].inflation),
        share=rest.share(evidence),
        p=rest.study.p_of(evidence),
        of_largest=min(max(evidence.nats, 0.0) / max(rest.study.evidences[0].nats, 1.0), 1.0),
        larger_links=larger_links,
    )


@dataclass(frozen=True)
class HeldOut:
    """What held-out data say of a cause; None where there are none, or where they were not left out of it."""

    agreement: float | None
    shrink_of_rest: float | None
    shrink_where_others: float | None
    shrink_together: float | None
    share_left: float


def features_of(
    found: Examination,
    number: int,
    *,
    tests: FamilyTests,
    rest: Rest,
    gap_p: float,
    constant: Constancy | None,
    parameters: dict[str, Interval],
    rivals: Sequence[Rival],
    held_out: HeldOut,
) -> Features:
    """Return the features of an accepted effect."""
    chi2 = found.likelihood.chi2(found.without(number))
    # by convention, not by the table, which is made from these numbers
    told = [rival for rival in rivals if rival.behind_nats >= _LIMITS.alike_chi2 / 2.0]
    near = [each for each in rest.worth_naming if tests.is_near(each)]
    return Features(
        surprise=_within(found.surprises[number] - found.level),
        size_over_noise=(max(chi2 - found.fitted.chi2, 0.0) / found.data.values) ** 0.5,
        margin=_within(tests.margin),
        form_ratio=tests.form_ratio,
        other_share=tests.other_share,
        other_power=tests.other_power,
        other_p=tests.other_p,
        inconstancy=None if constant is None else constant.inconstancy,
        constant_p=None if constant is None else constant.p,
        shape_interval=_shape_interval(found, number, parameters),
        fold_agreement=held_out.agreement,
        shrink_of_rest=held_out.shrink_of_rest,
        shrink_where_others=held_out.shrink_where_others,
        shrink_together=held_out.shrink_together,
        share_left=held_out.share_left,
        rest_share=max((rest.share(each) for each in near), default=0.0),
        rival_nats=_within(min((each.behind_nats for each in told), default=MOST_NATS)),
        alike=len(rivals) - len(told),
        causes=len(found.causes),
        links_missing=len(found.question.upstream),
        gap_p=gap_p,
        conditions_failed=[
            tests.is_best,
            tests.form_fits,
            tests.is_alone,
            constant is None or constant.is_one_number,
        ].count(False),
    )


def _within(nats: float) -> float:
    return min(max(nats, -MOST_NATS), MOST_NATS)


def _shape_interval(found: Examination, number: int, parameters: dict[str, Interval]) -> float:
    """Return the widest interval of an effect's shapes over their ranges."""
    free, applied = found.fitted.numbers.free[number], found.applied[number]
    at_end = free.shapes_at_end(found.fitted.x[found.fitted.numbers.slices[number]])
    widths = [0.0]
    for p in applied.effect.parameters:
        if p.role not in (Role.SHAPE, Role.FREQUENCY) or not p.high > p.low:
            continue
        interval = parameters.get(p.name)
        if interval is None or p.name in applied.held or p.name in at_end:
            return 1.0
        widths.append((interval.high - interval.low) / (p.high - p.low))
    return min(max(widths), 1.0)
