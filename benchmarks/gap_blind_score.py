"""Scores of records: one judgement for each case, then the figures of the whole check.

A cause counts as named from probability 0.5. *Exact*: the named causes are the truth, no more and no less.
*Declared*: each named cause or one that it declares indistinguishable is a truth, and every truth is covered.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gap_blind_oracle import flat

NAMED = 0.5
TOLERANCE = 0.05
UNKNOWN = ("unexplained", "partly_explained")
VERDICTS = {"null": ("no_gap",), "open": UNKNOWN, "deleted": UNKNOWN}
"""The right verdicts where no cause is right."""
LEAST_REMOVED = 0.1
"""An oracle that removes less of the power than this gives no figure for shrink."""
HALF = (0.35, 0.71)
"""Ratios that count as half the noise."""
ANY_TARGET = frozenset({"tool_number", "swapped_tool"})
"""The plant's target is a way of being wrong, not one of the library's targets."""
EVERYWHERE = frozenset(
    {
        "mastering",
        "link_length",
        "base_frame",
        "tool_frame",
        "thermal",
        "gravity",
        "load",
        "wrist_coupling",
        "force_offset",
        "force_drift",
        "tool_weight",
        "hose_pack",
        "tool_number",
        "base_number",
        "absolute_accuracy",
        "unit",
        "swapped_tool",
        "other_program",
    }
)
"""Effects that act all the time: their place in time is not scored."""
NOMINAL = {"scale": 1.0, "factor": 1.0}
OWN_SIZE = frozenset({"k_s", "acc_cp_m_s2", "cdis_mm", "percent"})
"""Parameters whose error is relative to the value itself, not of its deviation from nominal."""
SHAPES = frozenset(
    {
        "decay_s",
        "harmonic",
        "phase",
        "time_constant_h",
        "hz",
        "damping",
        "torque_Nm",
        "skew",
        "count",
        "cx_mm",
        "cy_mm",
        "cz_mm",
        "direction_x",
        "direction_y",
        "direction_z",
    }
)
VECTORS = (("x_mm", "y_mm", "z_mm"), ("fx_N", "fy_N", "fz_N"), ("h0_x_N", "h0_y_N", "h0_z_N"))
TURNS = ("a_deg", "b_deg", "c_deg")


@dataclass
class Judged:
    """One case, judged."""

    seed: int
    kind: str
    truths: tuple[tuple[str, str | None], ...]
    family: str
    form: str
    ratio: float
    verdict: str
    named: tuple[tuple[str, str | None], ...]
    exact: bool
    declared: bool
    hit: bool
    """Every truth is among the named ones, whatever else is."""
    set_size: float
    probabilities: list[tuple[float, bool]]
    shrink: float | None = None
    relative_shrink: float | None = None
    errors: list[float] = field(default_factory=list)
    covered: list[bool] = field(default_factory=list)
    overlap: float | None = None
    seconds: float = 0.0
    cpu_s: float = 0.0
    plant_s: float = 0.0
    failed: bool = False
    baselines: dict[str, bool] = field(default_factory=dict)

    @property
    def observable(self) -> bool:
        """Tell whether the effect is as large as the noise."""
        return self.ratio >= 1.0

    @property
    def name(self) -> str:
        """Return the true causes."""
        return " + ".join(_text(one) for one in self.truths) or "none"

    @property
    def answer(self) -> str:
        """Return the named causes."""
        return " + ".join(_text(one) for one in self.named) or self.verdict


def judge(record: dict[str, Any]) -> Judged:
    """Return the judgement of a record; one without a result counts as wrong."""
    label, result, case = record["label"], record.get("result"), record["case"]
    entries = label["effects"]
    truths = tuple((entry["effect"], entry["target"]) for entry in entries)
    one = entries[0] if len(entries) == 1 else None
    judged = Judged(
        seed=case["seed"],
        kind=case["kind"],
        truths=truths,
        family=one["family"] if one else "",
        form="other" if any(entry["form"] == "other" for entry in entries) else "same",
        ratio=min((entry["ratio"] for entry in entries), default=0.0),
        verdict="failed" if result is None else result["verdict"],
        named=(),
        exact=False,
        declared=False,
        hit=False,
        set_size=0.0,
        probabilities=[],
        seconds=record.get("diagnosis_s", 0.0),
        cpu_s=record.get("diagnosis_cpu_s", 0.0),
        plant_s=record.get("plant_s", 0.0),
        failed=record.get("error") is not None,
        baselines=_baselines(record, truths),
    )
    if result is not None:
        _judge_causes(judged, result)
        if one is not None:
            _judge_one(judged, one, record, result)
    return judged


def _judge_causes(judged: Judged, result: dict[str, Any]) -> None:
    causes = result["causes"]
    named = [cause for cause in causes if cause["probability"] >= NAMED]
    judged.named = tuple((cause["effect"], cause["target"]) for cause in named)
    allowed = VERDICTS.get(judged.kind)
    truths = judged.truths if allowed is None else ()
    possible = len(named) == len(truths) and (allowed is None or judged.verdict in allowed)
    judged.exact = possible and _covered(truths, named, _is)
    judged.declared = possible and _covered(truths, named, _among)
    judged.hit = _covered(truths, named, _is)
    judged.set_size = (
        float(np.mean([1 + len(c.get("indistinguishable_from") or ()) for c in named])) if named else 0.0
    )
    judged.probabilities = [(c["probability"], any(_among(c, truth) for truth in truths)) for c in causes]


def _covered(truths: Sequence[tuple], named: Sequence[dict], says: Callable[[dict, tuple], bool]) -> bool:
    """Tell whether each truth can be matched with a different cause that names it."""
    if not truths:
        return True
    return any(
        says(cause, truths[0]) and _covered(truths[1:], [*named[:i], *named[i + 1 :]], says)
        for i, cause in enumerate(named)
    )


def _is(cause: dict[str, Any], truth: tuple[str, str | None]) -> bool:
    return cause["effect"] == truth[0] and (cause["target"] == truth[1] or truth[0] in ANY_TARGET)


def _among(cause: dict[str, Any], truth: tuple[str, str | None]) -> bool:
    return any(_is(each, truth) for each in (cause, *(cause.get("indistinguishable_from") or ())))


def _judge_one(judged: Judged, entry: dict, record: dict, result: dict[str, Any]) -> None:
    """Judge place, size and shrink where one effect is at work."""
    if entry["effect"] not in EVERYWHERE and entry["where"] and judged.verdict != "no_gap":
        judged.overlap = overlap(entry, result["where"].get("intervals") or [])
    judged.shrink = result["gap"].get("shrink") if result["gap"].get("held_out") else None
    known = record.get("oracle")
    if judged.shrink is not None and known is not None and known["removed"] > LEAST_REMOVED * known["before"]:
        gone = result["gap"]["rms_before"] ** 2 - result["gap"]["rms_after"] ** 2
        judged.relative_shrink = float(np.clip(gone / known["removed"], 0.0, 1.0))
    right = [
        _one_way(cause, entry)
        for cause in result["causes"]
        if _is(cause, judged.truths[0]) and cause["probability"] >= NAMED
    ]
    if right and judged.form == "same" and judged.kind == "single":
        judged.errors, judged.covered = _numbers(flat(entry["parameters"]), right[0]["parameters"])


def _one_way(cause: dict[str, Any], entry: dict[str, Any]) -> dict[str, Any]:
    """Return a cause with its direction the truth's way round where the effect has a line, not an arrow."""
    names = ("direction_x", "direction_y", "direction_z")
    said, true = cause["parameters"], flat(entry["parameters"])
    if entry["effect"] != "vibration" or not set(names) <= set(said) & set(true):
        return cause
    if sum(said[name]["value"] * true[name] for name in names) >= 0.0:
        return cause
    turned = {
        name: {"value": -said[name]["value"], "low": -said[name]["high"], "high": -said[name]["low"]}
        for name in names
    }
    return {**cause, "parameters": {**said, **turned}}


def overlap(entry: dict[str, Any], intervals: Sequence[dict[str, Any]]) -> float:
    """Return intersection over union on the time axis, all runs together.

    Where the diagnosis gives intervals of the signal that the label is judged in, those alone count.
    """
    same = [each for each in intervals if each["signal"] == entry["main_signal"]]
    said = same or list(intervals)
    both = either = 0.0
    for run in {each["run"] for each in [*entry["where"], *said]}:
        one = [(w["t_start_s"], w["t_end_s"]) for w in entry["where"] if w["run"] == run]
        two = [(w["t_start_s"], w["t_end_s"]) for w in said if w["run"] == run]
        edges = np.unique([t for span in (*one, *two) for t in span])
        middle, width = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges)
        a, b = _inside(middle, one), _inside(middle, two)
        both, either = both + float(width[a & b].sum()), either + float(width[a | b].sum())
    return both / either if either > 0.0 else 0.0


def _inside(times: np.ndarray, spans: Iterable[tuple[float, float]]) -> np.ndarray:
    found = np.zeros(len(times), dtype=bool)
    for start, end in spans:
        found |= (times >= start) & (times <= end)
    return found


def _numbers(true: dict[str, float], said: dict[str, dict[str, float]]) -> tuple[list[float], list[bool]]:
    """Return relative errors of the sizes, vectors as one, and whether each interval holds the true value."""
    errors = []
    single = [name for name in said if name in true and name not in SHAPES | set(TURNS)]
    for names in VECTORS:
        if set(names) <= set(single):
            t, s = (
                np.array([values[n] if values is true else values[n]["value"] for n in names])
                for values in (true, said)
            )
            errors.append(float(np.linalg.norm(s - t) / max(np.linalg.norm(t), 1e-12)))
            single = [name for name in single if name not in names]
    for name in single:
        size = abs(true[name]) if name in OWN_SIZE else abs(true[name] - NOMINAL.get(name, 0.0))
        if size > 1e-12:
            errors.append(abs(said[name]["value"] - true[name]) / size)
    return errors, [_holds(name, true[name], said[name]) for name in said if name in true]


def _holds(name: str, true: float, said: dict[str, float]) -> bool:
    if said.get("low") is None or said.get("high") is None:
        return False
    turn = 2.0 * np.pi if name == "phase" else 0.0
    return any(said["low"] <= true + k * turn <= said["high"] for k in ((-1, 0, 1) if turn else (0,)))


def _baselines(record: dict[str, Any], truths: Sequence[tuple]) -> dict[str, bool]:
    found = {}
    for method, named in (record.get("baselines") or {}).items():
        found[method] = sorted(map(tuple, named), key=str) == sorted(truths, key=str)
    return found


def _text(one: tuple[str, str | None]) -> str:
    return one[0] if one[1] is None else f"{one[0]} {one[1]}"


# figures ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rate:
    """A fraction of cases, with its one-sided 95 % bounds (Clopper and Pearson 1934)."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """Return the fraction, NaN without cases."""
        return self.count / self.of if self.of else float("nan")

    @property
    def lower(self) -> float:
        """Return the lower bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.05, self.count, self.of - self.count + 1)) if self.count else 0.0

    @property
    def upper(self) -> float:
        """Return the upper bound of the true rate."""
        from scipy.stats import beta

        return float(beta.ppf(0.95, self.count + 1, self.of - self.count)) if self.count < self.of else 1.0


def rate(flags: Iterable[bool]) -> Rate:
    """Return the fraction of true flags."""
    flags = list(flags)
    return Rate(sum(flags), len(flags))


def calibration_error(pairs: Sequence[tuple[float, bool]], bins: int = 10) -> float:
    """Return the expected calibration error (Naeini et al. 2015), bins of equal width; NaN without pairs."""
    if not pairs:
        return float("nan")
    p, right = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs], float)
    place = np.minimum((p * bins).astype(int), bins - 1)
    return float(
        sum(
            abs(p[place == b].mean() - right[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )


def smallest_seen(cases: Sequence[Judged], share: float = 0.9) -> float | None:
    """Return the smallest ratio from which on this share of the larger ones is right; None without."""
    ordered = sorted(cases, key=lambda each: -each.ratio)
    found = None
    for count in range(1, len(ordered) + 1):
        top = ordered[:count]
        if top[-1].declared and sum(each.declared for each in top) >= share * count:
            found = top[-1].ratio
    return found


def by_effect(cases: Iterable[Judged]) -> dict[str, list[Judged]]:
    """Return the cases of each effect, by name."""
    found: dict[str, list[Judged]] = defaultdict(list)
    for each in cases:
        found[each.truths[0][0] if each.truths else "none"].append(each)
    return dict(sorted(found.items()))
