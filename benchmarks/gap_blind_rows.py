"""The rows of the table of metrics: each figure with its bound, the worst effect of the row, and the aim."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from gap_blind_figures import Pairs, brier, calibration_error, log_score, rate, worst
from gap_blind_score import NULLS, Judged

HALF = (0.35, 0.71)
"""Ratios that count as half the noise."""
TOLERANCE = 0.05
CONFIDENT = 0.9
UNKNOWN_KINDS = ("open", "deleted")


@dataclass(frozen=True)
class Row:
    """One figure of the table."""

    metric: str
    figure: str
    worst: str = ""
    aim: str = ""


def metrics(cases: Sequence[Judged]) -> list[Row]:
    """Return all rows of the table for these cases."""
    return [*_nothing(cases), *_one_effect(cases), *_unknowns(cases), *_others(cases), *_sureness(cases)]


def _nothing(cases: Sequence[Judged]) -> Iterator[Row]:
    yield _low("false alarms, usual noise", _of(cases, "null"), _alarms, "<= 1 %")
    yield _low("false alarms, foreign noise", _of(cases, "null_foreign_noise"), _alarms, "<= 3 %")
    yield _low("false alarms, foreign mismatch", _of(cases, "null_foreign_mismatch"), _alarms)
    yield _low("  all effect-free cases", _of(cases, *NULLS), _alarms)
    yield _low("  any of them with a named cause", _of(cases, *NULLS), lambda e: bool(e.named))


def _alarms(each: Judged) -> bool:
    return each.alarms


def _one_effect(cases: Sequence[Judged]) -> Iterator[Row]:
    single = _of(cases, "single")
    for form, aims in (("same", (">= .97", ">= .92", "")), ("other", (">= .85", "", ">= .95"))):
        mine = [each for each in single if each.form == form]
        seen = [each for each in mine if each.observable]
        half = [each for each in mine if HALF[0] <= each.ratio <= HALF[1]]
        yield _high(f"{form} form, >= noise: declared set", seen, lambda e: e.declared, aims[0])
        yield _high("  exact", seen, lambda e: e.exact, aims[1])
        yield _high("  family and place, or declared", seen, lambda e: e.family_or_name, aims[2])
        told_apart = [each for each in mine if each.decidable]
        yield _high("  beyond mismatch, not imitated: declared set", told_apart, lambda e: e.declared)
        yield _high("  beyond mismatch, not imitated: exact", told_apart, lambda e: e.exact)
        yield _high("  truth among the named", seen, lambda e: e.hit)
        yield _low("  something else named", seen, lambda e: e.is_wrongly_named)
        yield _low("  said no gap", seen, lambda e: e.verdict == "no_gap")
        yield _high("  half the noise: declared set", half, lambda e: e.declared)
        yield _low("  half the noise: something else named", half, lambda e: e.is_wrongly_named)
        yield from _numbers(seen, ">= .97" if form == "same" else ">= .95")


def _numbers(cases: Sequence[Judged], shrink_aim: str) -> Iterator[Row]:
    yield _median("  shrink over that of an oracle (median)", cases, lambda e: [e.shrink], shrink_aim)
    yield _median("  place: IoU of the worst stretches (median)", cases, lambda e: [e.place.own], ">= .85")
    yield _median("  place: IoU of all stretches (median)", cases, lambda e: [e.place.noise], ">= .85")
    if errors := [error for each in cases for error in each.errors]:
        yield _median("  parameter error (median)", cases, lambda e: e.errors, "5 %", high=False)
        within = rate(error <= TOLERANCE for error in errors)
        yield Row(
            "  parameter error within 5 %", f"{within.value:.3f} (>= {within.lower:.3f}, n {within.of})"
        )
    if covered := [flag for each in cases for flag in each.covered]:
        found = rate(covered)
        yield Row("  coverage of the 90 % interval", f"{found.value:.3f} (n {found.of})", "", ".88-.92")


def _unknowns(cases: Sequence[Judged]) -> Iterator[Row]:
    words = {"open": ("outside the library", "<= 2 %"), "deleted": ("taken out of the library", "<= 3 %")}
    for kind, (name, most) in words.items():
        mine = [each for each in _of(cases, kind) if each.observable]
        yield _low(f"{name}: wrongly named", mine, lambda e: bool(e.named), most)
        yield _low(
            "  of them with the verdict explained", mine, lambda e: bool(e.named) and e.verdict == "explained"
        )
        apart = [each for each in mine if not each.is_imitated]
        yield _low("  wrongly named, no simple effect fits as well", apart, lambda e: bool(e.named))
        yield _high("  flagged unknown", mine, lambda e: e.flagged, ">= .95")
        yield from _told(mine)
        yield _median("  place: IoU of all stretches (median)", mine, lambda e: [e.place.noise])
    every = [each for each in _of(cases, *UNKNOWN_KINDS) if each.observable]
    yield from _told(every, "family and place of an unknown right", ">= .80")


def _told(cases: Sequence[Judged], name: str = "  family and place", aim: str = "") -> Iterator[Row]:
    known = [each for each in cases if each.told is not None]
    yield _high(name, known, lambda e: e.told is not None and e.told.family, aim)
    yield _high("  place alone", known, lambda e: e.told is not None and e.told.place)
    yield _high("  family, place and form", known, lambda e: e.told is not None and e.told.form)


def _others(cases: Sequence[Judged]) -> Iterator[Row]:
    pairs = [each for each in _of(cases, "pair") if each.observable]
    yield _high("two effects: both exactly right", pairs, lambda e: e.exact, ">= .90")
    yield _high("  within the declared sets", pairs, lambda e: e.declared)
    told_apart = [each for each in pairs if each.decidable]
    yield _high("  beyond mismatch, not imitated: both exactly right", told_apart, lambda e: e.exact)
    slips = _of(cases, "slip")
    yield _high("set-up slips: right", slips, lambda e: e.exact)
    yield _high("  within the declared sets", slips, lambda e: e.declared)
    alike = [each for each in _of(cases, "confounded") if each.observable]
    yield _high("confounded: the truth in the set", alike, lambda e: e.in_a_set)
    yield _low("  something else named", alike, lambda e: e.is_wrongly_named)
    yield _high("  a next run is given", alike, lambda e: e.next_program is not None)
    missing = [each for each in _of(cases, "missing") if each.observable]
    decided = [each for each in missing if not each.is_undecided]
    yield _high("channels missing, effect still shows: declared set", decided, lambda e: e.declared)
    yield _low("  all of them: something else named", missing, lambda e: e.is_wrongly_named)


def _sureness(cases: Sequence[Judged]) -> Iterator[Row]:
    said = [each for each in cases if each.verdict == "explained"]
    yield _low("explained, beside a significant rest", said, lambda e: e.has_rest, "0")
    sure = [(each, right) for each in cases for p, right in each.probabilities if p >= CONFIDENT]
    found = rate(right for _, right in sure)
    yield Row(
        "precision of names with p >= .9, all kinds",
        f"{found.value:.3f} (>= {found.lower:.3f}, n {found.of})" if sure else "-",
        _worst(sure, lambda pair: pair[0].subject, lambda pair: pair[1], True),
        ">= .97",
    )
    same = [each for each in cases if each.kind == "single" and each.form == "same"]
    other = [each for each in cases if each.kind == "single" and each.form == "other"]
    foreign = [each for each in cases if each.kind in (*NULLS, "single", *UNKNOWN_KINDS)]
    for name, mine, aim in (
        ("ECE; Brier; log score: same form", same, ""),
        ("  null, open and taken out included", [e for e in foreign if e not in other], "ECE <= .03"),
        ("  other forms", other, "ECE <= .05"),
        ("  all kinds", list(cases), ""),
    ):
        yield Row(name, _scores([pair for each in mine for pair in each.probabilities]), "", aim)
    yield Row("  dependences that are stated", _scores([pair for each in cases for pair in each.depends]))


def _scores(pairs: Pairs) -> str:
    if not pairs:
        return "-"
    return (
        f"{calibration_error(pairs):.3f}; {brier(pairs):.3f}; {log_score(pairs):.3f} "
        f"(n {len(pairs)}, right {np.mean([right for _, right in pairs]):.2f})"
    )


# rows of one figure -----------------------------------------------------------------------------------------


def _of(cases: Iterable[Judged], *kinds: str) -> list[Judged]:
    return [each for each in cases if each.kind in kinds]


def _high(metric: str, cases: Sequence[Judged], flag: Callable[[Judged], bool], aim: str = "") -> Row:
    found = rate(flag(each) for each in cases)
    figure = f"{found.value:.3f} (>= {found.lower:.3f}, n {found.of})" if cases else "-"
    return Row(metric, figure, _worst(cases, lambda e: e.subject, flag, True), aim)


def _low(metric: str, cases: Sequence[Judged], flag: Callable[[Judged], bool], aim: str = "") -> Row:
    found = rate(flag(each) for each in cases)
    figure = f"{found.value:.3f} (<= {found.upper:.3f}, n {found.of})" if cases else "-"
    return Row(metric, figure, _worst(cases, lambda e: e.subject, flag, False), aim)


def _worst(cases: Sequence, key: Callable, flag: Callable, high: bool) -> str:
    found = worst(cases, key, flag, high)
    return "" if found is None else f"{found[0]} {found[1].count}/{found[1].of}"


def _median(
    metric: str,
    cases: Sequence[Judged],
    values: Callable[[Judged], Iterable[float | None]],
    aim: str = "",
    high: bool = True,
) -> Row:
    """Return the median of all values, and the effect whose own median is furthest from the aim."""
    known = {each: [value for value in values(each) if value is not None] for each in cases}
    every = [value for each in known.values() for value in each]
    if not every:
        return Row(metric, "-", "", aim)
    subjects = {each.subject for each, mine in known.items() if mine}
    medians = {
        subject: float(np.median([v for each in cases if each.subject == subject for v in known[each]]))
        for subject in subjects
    }
    name = (min if high else max)(sorted(medians), key=lambda subject: medians[subject])
    return Row(metric, f"{np.median(every):.3f} (n {len(every)})", f"{name} {medians[name]:.2f}", aim)
