"""The tables of the check."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from gap_blind_score import (
    HALF,
    TOLERANCE,
    UNKNOWN,
    Judged,
    Rate,
    by_effect,
    calibration_error,
    rate,
    smallest_seen,
)


def metrics(cases: Sequence[Judged]) -> list[tuple[str, str, str, str]]:
    """Return a row for each metric: name, same form, other form, aim."""
    null = [each for each in cases if each.kind == "null"]
    alarms = rate(bool(each.named) or each.verdict != "no_gap" for each in null)
    rows = [("false alarms on effect-free runs", _at_most(alarms), "", "<= 1 % of 300")]
    causes = rate(bool(each.named) for each in null)
    rows.append(("  of them with a named cause", _at_most(causes), "", ""))
    forms = [
        [each for each in cases if each.kind == "single" and each.form == form] for form in ("same", "other")
    ]

    def both(name: str, aim: str, figure) -> None:
        rows.append((name, *(figure(form) for form in forms), aim))

    def seen(form: Iterable[Judged]) -> list[Judged]:
        return [each for each in form if each.observable]

    both(
        "right: effect and target, effect >= noise",
        ">= .98",
        lambda f: _at_least(rate(e.exact for e in seen(f))),
    )
    both("  within the declared set", "", lambda f: _at_least(rate(e.declared for e in seen(f))))
    both("  truth among the named", "", lambda f: _at_least(rate(e.hit for e in seen(f))))
    both(
        "  something else named",
        "",
        lambda f: _at_most(rate(bool(e.named) and not e.declared for e in seen(f))),
    )
    both(
        "right at half the noise, declared set",
        ">= .99",
        lambda f: _at_least(rate(e.declared for e in _half(f))),
    )
    both("  said no gap there", "", lambda f: _at_most(rate(e.verdict == "no_gap" for e in _half(f))))
    both(
        "shrink on held-out runs / oracle (median)",
        ">= .95",
        lambda f: _middle(e.relative_shrink for e in seen(f)),
    )
    both("parameter error (median)", "5 %", lambda f: _middle(x for e in seen(f) for x in e.errors))
    both("  within 5 %", "", lambda f: _at_least(rate(x <= TOLERANCE for e in seen(f) for x in e.errors)))
    both("coverage of the 90 % interval", ".88-.92", lambda f: _plain(rate(x for e in f for x in e.covered)))
    both("place: overlap (median)", ">= .85", lambda f: _middle(e.overlap for e in seen(f)))
    both(
        "calibration error",
        "<= .03",
        lambda f: f"{calibration_error([p for e in f for p in e.probabilities]):.3f}",
    )
    rows.append(("  null and open set included", f"{_calibration(cases):.3f}", "", "<= .03"))
    rows += _others(cases)
    return rows


def _others(cases: Sequence[Judged]) -> list[tuple[str, str, str, str]]:
    rows = []
    for kind, name in (("slip", "set-up slips: right"), ("pair", "two effects: both exactly right")):
        mine = [each for each in cases if each.kind == kind and each.observable]
        rows.append(
            (name, _at_least(rate(each.exact for each in mine)), "", ">= .90" if kind == "pair" else "")
        )
        rows.append(("  within the declared sets", _at_least(rate(each.declared for each in mine)), "", ""))
    for kind, name in (("open", "of no library"), ("deleted", "taken out of the library")):
        mine = [each for each in cases if each.kind == kind and each.observable]
        flagged = rate(each.verdict in UNKNOWN for each in mine)
        rows.append((f"{name}: flagged unknown", _at_least(flagged), "", ">= .97"))
        wrong = rate(each.verdict == "explained" and bool(each.named) for each in mine)
        rows.append(("  wrongly named with confidence", _at_most(wrong), "", "<= 1 %"))
        rows.append(("  with any wrong name", _at_most(rate(bool(each.named) for each in mine)), "", ""))
        rows.append(("  place: overlap (median)", _middle(each.overlap for each in mine), "", ""))
    return rows


def _calibration(cases: Iterable[Judged]) -> float:
    return calibration_error([pair for each in cases for pair in each.probabilities])


def _half(cases: Iterable[Judged]) -> list[Judged]:
    return [each for each in cases if HALF[0] <= each.ratio <= HALF[1]]


def _at_least(one: Rate) -> str:
    return f"{one.value:.3f} (>= {one.lower:.3f}, n {one.of})" if one.of else "-"


def _at_most(one: Rate) -> str:
    return f"{one.value:.3f} (<= {one.upper:.3f}, n {one.of})" if one.of else "-"


def _plain(one: Rate) -> str:
    return f"{one.value:.3f} (n {one.of})" if one.of else "-"


def _middle(values: Iterable[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.3f} (n {len(known)})" if known else "-"


def report(cases: Sequence[Judged], title: str) -> str:
    """Return all tables as text."""
    parts = [title, _table(("metric", "same form (95 % bound)", "other form", "aim"), metrics(cases))]
    single = [each for each in cases if each.kind in ("single", "slip")]
    if single:
        parts += [
            "By effect, the worst first (single effects and slips):",
            _table(_EFFECT_HEAD, _effects(single)),
        ]
        parts += ["Wrong answers, effects >= noise:", _wrong(single)]
    parts += [
        "Simple methods on the same cases, exactly right:",
        _table(("method", "effect >= noise", "no effect"), _methods(cases)),
    ]
    parts.append(_time(cases))
    return "\n\n".join(part for part in parts if part) + "\n"


_EFFECT_HEAD = (
    "effect",
    "n",
    "n>=noise",
    "exact",
    "declared",
    "error",
    "shrink/oracle",
    "IoU",
    "smallest seen",
)


def _effects(cases: Sequence[Judged]) -> list[tuple[str, ...]]:
    rows = []
    for name, mine in by_effect(cases).items():
        seen = [each for each in mine if each.observable]
        least = smallest_seen(mine)
        exact, declared = rate(e.exact for e in seen), rate(e.declared for e in seen)
        row = (
            name,
            str(len(mine)),
            str(len(seen)),
            f"{exact.count}/{exact.of}",
            f"{declared.count}/{declared.of}",
            _short(x for e in seen for x in e.errors),
            _short(e.relative_shrink for e in seen),
            _short(e.overlap for e in seen),
            "-" if least is None else f"{least:.2f} x noise",
        )
        rows.append((declared.value if seen else 2.0, row))
    return [row for _, row in sorted(rows, key=lambda each: each[0])]


def _short(values: Iterable[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.2f}" if known else "-"


def _wrong(cases: Iterable[Judged]) -> str:
    """Return the confusions: truth and answer, with how often."""
    found = Counter((each.name, each.answer) for each in cases if each.observable and not each.exact)
    rows = [(truth, answer, str(count)) for (truth, answer), count in sorted(found.items())]
    return _table(("truth", "answer", "times"), rows) if rows else "none"


def _methods(cases: Sequence[Judged]) -> list[tuple[str, str, str]]:
    single = [each for each in cases if each.kind == "single" and each.observable]
    null = [each for each in cases if each.kind == "null"]
    rows = [("diagnose", _plain(rate(e.exact for e in single)), _plain(rate(not e.named for e in null)))]
    methods = dict.fromkeys(method for each in cases for method in each.baselines)
    for method in methods:
        columns = (
            _plain(rate(each.baselines[method] for each in group if method in each.baselines))
            for group in (single, null)
        )
        rows.append((method, *columns))
    return rows


def _time(cases: Sequence[Judged]) -> str:
    seconds = np.array([each.seconds for each in cases if each.seconds > 0.0] or [0.0])
    plant = np.array([each.plant_s for each in cases if each.plant_s > 0.0] or [0.0])
    own = np.array([each.cpu_s for each in cases if each.cpu_s > 0.0] or [0.0])
    failed = [f"{each.kind}-{each.seed:05d}" for each in cases if each.failed]
    text = (
        f"Seconds a case: diagnosis median {np.median(seconds):.2f}, worst {seconds.max():.2f} "
        f"(processor {np.median(own):.2f}, {own.max():.2f}); plant median {np.median(plant):.2f}, "
        f"worst {plant.max():.2f}."
    )
    return text + (f"\nNo result, an exception: {', '.join(failed)}" if failed else "")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["-" * len(name) for name in head], *rows]
    width = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, width, strict=True)) + " |" for line in lines
    )
