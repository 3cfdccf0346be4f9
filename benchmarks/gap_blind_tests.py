"""Which test stopped each wrong name and lost each right one, and what a check without it would have named.

Read from the answers alone. Where a cause has ``tests`` (name -> passed, or an object with ``passed``), those
count; else the contract's figures are compared with the limits here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gap_blind_names import NAMED, Truth, declares, is_among

FORM_FITS = 0.9
"""A form that takes less than this of what its family takes is another form."""
CONSTANT_P = 0.01
REST_SHARE = 0.05
"""Share of the gap from which on what is left depends on something."""
UNLISTED, NO_GAP, UNDECIDED = "not listed", "no gap found", "probability alone"


@dataclass(frozen=True)
class Tested:
    """The fate of one candidate: whether it was right, whether it was named, and which tests it failed."""

    is_right: bool
    is_named: bool
    failed: frozenset[str]


def tested_of(result: dict[str, Any], truths: Sequence[Truth]) -> tuple[Tested, ...]:
    """Return the fate of each named cause, of the first if none is named, and of each truth in any case."""
    causes = result["causes"]
    chosen = [cause for cause in causes if cause["probability"] >= NAMED] or causes[:1]
    absent = 0
    for truth in truths:
        right = [cause for cause in causes if declares(cause, truth)]
        absent += not right
        if right and not any(cause is each for cause in right for each in chosen):
            chosen = [*chosen, right[0]]
    reason = NO_GAP if result["verdict"] == "no_gap" else UNLISTED
    return (
        *(
            Tested(is_among(cause, truths), cause["probability"] >= NAMED, failed_tests(cause, result))
            for cause in chosen
        ),
        *[Tested(True, False, frozenset({reason}))] * absent,
    )


def failed_tests(cause: dict[str, Any], result: dict[str, Any]) -> frozenset[str]:
    """Return the names of the tests that a cause failed; of one that was not named always at least one."""
    stated = cause.get("tests")
    failed = _stated(stated) if _says_passed(stated) else _read(cause, result)
    if not failed and cause["probability"] < NAMED:
        failed = {UNDECIDED}
    return frozenset(failed)


def _says_passed(tests: Any) -> bool:
    """Tell whether tests say what was passed; plain numbers are what a probability is made of."""
    return bool(tests) and not (isinstance(tests, dict) and any(_is_number(each) for each in tests.values()))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _stated(tests: Any) -> set[str]:
    if isinstance(tests, dict):
        items = list(tests.items())
    else:
        items = [(test.get("test") or test.get("name"), test) for test in tests]
    return {name for name, test in items if not (test["passed"] if isinstance(test, dict) else test)}


def _read(cause: dict[str, Any], result: dict[str, Any]) -> set[str]:
    failed = set()
    if cause.get("form_fits") is not None and cause["form_fits"] < FORM_FITS:
        failed.add("form")
    if cause.get("constant") and cause["constant"]["p"] < CONSTANT_P:
        failed.add("constancy")
    rest = [
        each
        for each in result["unexplained"].get("depends_on") or ()
        if each["link"] == cause.get("link") and (each["share"] or 0.0) >= REST_SHARE
    ]
    if rest and cause.get("family") and f"{rest[0]['at']}, {rest[0]['on']}" != cause["family"]:
        failed.add("family")
    elif rest:
        failed.add("rest")
    return failed


@dataclass(frozen=True)
class Ablation:
    """What one test did: names it stopped and lost, and how many of them no other test would have."""

    test: str
    wrong_stopped: int
    wrong_alone: int
    right_lost: int
    right_alone: int


def ablation(tested: Sequence[Tested]) -> list[Ablation]:
    """Return a line for each test that failed anywhere; the one that stopped most first."""
    stopped = [each for each in tested if not each.is_named]
    rows = [
        _ablated(test, [each for each in stopped if test in each.failed])
        for test in sorted({name for each in stopped for name in each.failed})
    ]
    return sorted(rows, key=lambda row: -row.wrong_stopped)


def _ablated(test: str, stopped: Sequence[Tested]) -> Ablation:
    wrong = [each for each in stopped if not each.is_right]
    right = [each for each in stopped if each.is_right]
    alone = [sum(len(each.failed) == 1 for each in group) for group in (wrong, right)]
    return Ablation(test, len(wrong), alone[0], len(right), alone[1])
