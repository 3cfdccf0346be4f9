"""The tables of the check as text: each figure with its bound, the worst effect of the row, and the aim."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from blind.cases import full_counts, not_simulated
from blind.figures import (
    CLASSES,
    Pairs,
    Rate,
    brier,
    calibration_error,
    class_rows,
    grouped,
    log_score,
    rate,
    smallest_seen,
    worst,
)
from blind.next_run import cost as next_cost
from blind.next_run import rows as next_rows
from blind.score import NULLS, Judged

HALF = (0.35, 0.71)
"""Ratios that count as half the noise."""
TOLERANCE = 0.05
CONFIDENT = 0.9
MOST_REST = 1.2
"""Largest rest over that of the truth that counts as all of it being in the model."""
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
    many = [each for each in _of(cases, "many") if each.observable]
    yield _median(
        "three to six at once: rest over the truth's (median)", many, lambda e: [e.rest], "<= 1.2", high=False
    )
    left = [each for each in many if each.rest is not None]
    yield _high("  of them at most 1.2", left, lambda e: e.rest is not None and e.rest <= MOST_REST)
    yield _median("  share of them named or in a set (median)", many, lambda e: [e.named_share])
    yield _low("  something else named", many, lambda e: e.is_wrongly_named)
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


SLOWEST = 6
MOST_LINES = 60
"""Lines of the longest tables."""


def report(cases: Sequence[Judged], driven: Sequence[dict], title: str) -> str:
    """Return all tables as text; ``driven``: the records of the next runs."""
    rows = [(row.metric, row.figure, row.worst, row.aim) for row in metrics(cases)]
    parts = [title, table(("metric", "figure (95 % bound)", "worst", "aim"), rows)]
    if any(each.nats is not None for each in cases):
        parts += [
            "By class of decidability (two effects of the library as imitators; docs/diagnose_check.md):"
        ]
        parts += [table(("metric", *CLASSES), class_rows(cases))]
    if foreign := [each for each in cases if not each.truths and each.foreign]:
        parts += ["False alarms by what is foreign (a case counts for each noise that it has):"]
        parts += [_by_foreign(foreign)]
    single = [each for each in cases if each.kind in ("single", "slip")]
    if single:
        parts += ["By effect, the worst first (single effects and slips):", _by_effect(single)]
    unknown = [each for each in cases if each.kind in ("open", "deleted") and each.observable]
    if unknown:
        parts += ["Outside the library and taken out of it, effect >= noise, the worst first:"]
        parts += [_by_unknown(unknown)]
    parts += ["Wrong answers, effects >= noise:", _wrong(cases)]
    if driven:
        parts += [f"Ambiguity gone after one more run, {len(driven)} cases that were left open:"]
        parts += [table(("one more run", "settled (95 % bound)", "skipped", "aim"), next_rows(driven))]
        parts += [next_cost(driven)]
    parts.append(_time(cases))
    return "\n\n".join(part for part in parts if part) + "\n"


def _by_foreign(cases: Sequence[Judged]) -> str:
    """Return the false alarms of each kind of noise, of each channel, and of each law of mismatch."""
    every = [(name, each) for each in cases for name in each.foreign]
    rows = []
    for name, mine in grouped(every, lambda pair: pair[0]).items():
        found = rate(each.alarms for _, each in mine)
        answers = Counter(each.answer for _, each in mine if each.alarms)
        told = ", ".join(f"{answer} {times}" for answer, times in answers.most_common(3))
        rows.append((-found.value, (str(name), f"{_count(found)} (<= {found.upper:.3f})", told)))
    return table(("what", "alarms", "answers"), [row for _, row in sorted(rows, key=lambda each: each[0])])


def _by_effect(cases: Sequence[Judged]) -> str:
    head = ("effect", "n", "n>=noise", "exact", "declared", "error", "shrink/oracle", "IoU", "smallest seen")
    rows = []
    for name, mine in grouped(cases, lambda e: e.subject).items():
        seen = [each for each in mine if each.observable]
        least = smallest_seen([(each.ratio, each.declared) for each in mine])
        declared = rate(each.declared for each in seen)
        row = (
            str(name),
            str(len(mine)),
            str(len(seen)),
            _count(rate(each.exact for each in seen)),
            _count(declared),
            _short(error for each in seen for error in each.errors),
            _short(each.shrink for each in seen),
            _short(each.place.noise for each in seen),
            "-" if least is None else f"{least:.2f} x noise",
        )
        rows.append((declared.value if seen else 2.0, row))
    return table(head, [row for _, row in sorted(rows, key=lambda each: each[0])])


def _by_unknown(cases: Sequence[Judged]) -> str:
    rows = []
    for (kind, name), mine in grouped(cases, lambda e: (e.kind, e.subject)).items():
        wrong, told = rate(bool(each.named) for each in mine), [e.told for e in mine if e.told is not None]
        flagged = rate(each.flagged for each in mine)
        answers = Counter(each.answer for each in mine if each.named)
        row = (
            str(name) + (" (taken out)" if kind == "deleted" else ""),
            str(len(mine)),
            _count(wrong),
            _count(flagged),
            _count(rate(each.place for each in told)),
            _count(rate(each.family for each in told)),
            ", ".join(f"{answer} {times}" for answer, times in answers.most_common(3)),
        )
        rows.append((-wrong.value, flagged.value, row))
    head = ("effect", "n", "named", "flagged", "place", "family", "named as")
    return table(head, [row for *_, row in sorted(rows, key=lambda each: each[:2])])


def _wrong(cases: Iterable[Judged]) -> str:
    """Return the confusions: kind, truth and answer, with how often."""
    wrong = [each for each in cases if not each.exact and (each.observable or not each.truths)]
    found = Counter((each.kind, each.name, each.answer) for each in wrong).most_common()
    rows = [(*key, str(times)) for key, times in found[:MOST_LINES]]
    text = table(("kind", "truth", "answer", "times"), rows) if rows else "none"
    left = len(found) - MOST_LINES
    return text + (f"\n{left} more, each less often than these" if left > 0 else "")


def _time(cases: Sequence[Judged]) -> str:
    """Return how long the cases took, and what the whole check takes at that rate."""
    wall, own, plant = (
        np.array([value for each in cases if (value := getattr(each, name)) > 0.0] or [0.0])
        for name in ("seconds", "cpu_s", "plant_s")
    )
    parts = [_mean(getattr(each, name) for each in cases) for name in ("plant_cpu_s", "beside_cpu_s")]
    whole_h = sum(full_counts().values()) * (own.mean() + sum(parts)) / 2.0 / 3600.0
    costs = {
        name: np.mean([e.cpu_s for e in mine]) for name, mine in grouped(cases, lambda e: e.subject).items()
    }
    slow = sorted(costs, key=lambda name: -costs[name])[:SLOWEST]
    failed = [f"{each.kind}-{each.seed:05d}" for each in cases if each.failed]
    lines = [
        f"Seconds a case: diagnosis median {np.median(wall):.2f}, worst {wall.max():.2f} (processor "
        f"{np.median(own):.2f}, mean {own.mean():.2f}, worst {own.max():.2f}); plant median "
        f"{np.median(plant):.2f}, worst {plant.max():.2f}.",
        f"Processor seconds of a case, mean: plant {parts[0]:.2f}, diagnosis {own.mean():.2f}, oracle "
        f"{parts[1]:.2f}: {_share(sum(parts), own.mean())} of a case is not the diagnosis.",
        f"At this rate the full check of {sum(full_counts().values())} cases takes {whole_h:.1f} h on two "
        "cores, without the next runs.",
        f"The slowest, processor seconds a case: {', '.join(f'{name} {costs[name]:.0f}' for name in slow)}.",
    ]
    if failed:
        lines.append(f"No result, an exception: {', '.join(failed)}")
    if untried := not_simulated():
        lines.append(f"Effects of the library that the plant cannot do: {', '.join(untried)}")
    return "\n".join(lines)


def failures(records: Iterable[dict], folder: Path) -> None:
    """Write the exceptions of a check to a file beside its records."""
    text = "\n".join(
        f"{record['case']['kind']}-{record['case']['seed']:05d}\n{record['error']}"
        for record in records
        if record["error"]
    )
    (folder / "failures.txt").write_text(text, encoding="utf-8")


def _mean(values: Iterable[float]) -> float:
    known = list(values)
    return sum(known) / len(known) if known else 0.0


def _share(beside_s: float, own_s: float) -> str:
    return f"{100.0 * beside_s / max(beside_s + own_s, 1e-9):.0f} %"


def _count(one: Rate) -> str:
    return f"{one.count}/{one.of}"


def _short(values: Iterable[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.2f}" if known else "-"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown with columns of equal width."""
    lines = [head, ["-" * len(name) for name in head], *rows]
    width = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, width, strict=True)) + " |" for line in lines
    )
