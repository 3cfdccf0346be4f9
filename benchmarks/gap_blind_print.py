"""The tables of the check as text."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from gap_blind_cases import full_counts, not_simulated
from gap_blind_classes import CLASSES, class_rows
from gap_blind_figures import Rate, grouped, rate, smallest_seen
from gap_blind_next import cost as next_cost
from gap_blind_next import rows as next_rows
from gap_blind_rows import metrics
from gap_blind_score import Judged
from gap_blind_tests import Ablation, ablation

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
    parts += ["What the tests did to candidates that were not named (wrong ones stopped, right ones lost;"]
    parts[-1] += " alone: no other test failed, so that without it they would be named):"
    parts += [
        _tests(cases),
        "Right names lost, effects >= noise, and the tests that they failed:",
        _lost(cases),
    ]
    parts += ["Wrong answers, effects >= noise:", _wrong(cases)]
    if any(each.baselines for each in cases):
        parts += ["Simple methods on the same cases, exactly right:", _methods(cases)]
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


def _tests(cases: Sequence[Judged]) -> str:
    tested = [each for case in cases if case.observable or not case.truths for each in case.tested]
    rows = [_ablated(each) for each in ablation(tested)]
    named = [each for each in tested if each.is_named]
    right = sum(each.is_right for each in named)
    rows.append(("(named with all tests)", str(len(named) - right), "", str(right), ""))
    return table(("test", "wrong stopped", "alone", "right lost", "alone"), rows)


def _ablated(row: Ablation) -> tuple[str, ...]:
    numbers = (row.wrong_stopped, row.wrong_alone, row.right_lost, row.right_alone)
    return (row.test, *map(str, numbers))


def _lost(cases: Sequence[Judged]) -> str:
    """Return each case whose true cause was not named, and which tests it failed."""
    rows = [
        (f"{case.kind}-{case.seed:05d}", case.name, case.answer, ", ".join(sorted(each.failed)))
        for case in cases
        if case.observable
        for each in case.tested
        if each.is_right and not each.is_named
    ]
    left = len(rows) - MOST_LINES
    text = table(("case", "truth", "answer", "failed"), rows[:MOST_LINES]) if rows else "none"
    return text + (f"\n{left} more" if left > 0 else "")


def _wrong(cases: Iterable[Judged]) -> str:
    """Return the confusions: kind, truth and answer, with how often."""
    wrong = [each for each in cases if not each.exact and (each.observable or not each.truths)]
    found = Counter((each.kind, each.name, each.answer) for each in wrong).most_common()
    rows = [(*key, str(times)) for key, times in found[:MOST_LINES]]
    text = table(("kind", "truth", "answer", "times"), rows) if rows else "none"
    left = len(found) - MOST_LINES
    return text + (f"\n{left} more, each less often than these" if left > 0 else "")


def _methods(cases: Sequence[Judged]) -> str:
    beside = [each for each in cases if each.baselines]
    single = [each for each in beside if each.kind == "single" and each.observable]
    null = [each for each in beside if not each.truths]
    rows = [("diagnose", _plain(rate(e.exact for e in single)), _plain(rate(not e.named for e in null)))]
    for method in dict.fromkeys(name for each in beside for name, _ in each.baselines):
        columns = (_plain(rate(dict(e.baselines)[method] for e in group)) for group in (single, null))
        rows.append((method, *columns))
    return table(("method", "effect >= noise", "no effect"), rows)


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
        f"Processor seconds of a case, mean: plant {parts[0]:.2f}, diagnosis {own.mean():.2f}, oracle and "
        f"simple methods {parts[1]:.2f}: {_share(sum(parts), own.mean())} of a case is not the diagnosis.",
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


def _plain(one: Rate) -> str:
    return f"{one.value:.3f} (n {one.of})" if one.of else "-"


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
