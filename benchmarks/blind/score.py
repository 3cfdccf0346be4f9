"""One judgement for each record: is the answer right, and how right are its parts.

A cause counts as named from probability 0.5. *Exact*: the named causes are the truth, no more and no less.
*Declared*: each named cause or one that it declares indistinguishable is a truth, and every truth is covered.

The label is first put into the words of the library, targets, and names and units of parameters: the plant
and the library are written apart and count some things otherwise. Judged beside the names are where a gap
sits and on what it depends; the moment of an event, to 20 ms; the stretches of time; and the parameters of a
right cause.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.plant.decidability import DECIDABLE, class_of

Truth = tuple[str, str | None]
"""Effect and target."""
NAMED = 0.5
ANY_TARGET = frozenset({"tool_number", "swapped_tool"})
"""The plant's target is a way of being wrong, not one of the library's targets."""


def named_of(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the causes of an answer that count as named."""
    return [cause for cause in result["causes"] if cause["probability"] >= NAMED]


def names(cause: dict[str, Any], truth: Truth) -> bool:
    """Tell whether a cause, or one of the members of a group, is this effect at this target."""
    if any(names(member, truth) for member in cause.get("members") or ()):
        return True
    if cause.get("effect") != truth[0]:  # an unknown in a set has none
        return False
    return cause.get("target") == truth[1] or truth[0] in ANY_TARGET


def effects_alike(cause: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the effects of the library that a cause declares indistinguishable from it."""
    return [each for each in cause.get("indistinguishable_from") or () if each.get("kind") != "unknown"]


def declares(cause: dict[str, Any], truth: Truth) -> bool:
    """Tell whether a cause, or one that it declares indistinguishable, is the truth."""
    return any(names(each, truth) for each in (cause, *(cause.get("indistinguishable_from") or ())))


def is_among(cause: dict[str, Any], truths: Iterable[Truth]) -> bool:
    """Tell whether a cause or its declared set holds one of the truths."""
    return any(declares(cause, truth) for truth in truths)


def covers(
    causes: Sequence[dict[str, Any]],
    truths: Sequence[Truth],
    says: Callable[[dict[str, Any], Truth], bool] = names,
) -> bool:
    """Tell whether each truth can be matched with a different cause that says it."""
    if not truths:
        return True
    return any(
        says(cause, truths[0]) and covers([*causes[:i], *causes[i + 1 :]], truths[1:], says)
        for i, cause in enumerate(causes)
    )


def text(name: Truth) -> str:
    """Return effect and target as words."""
    return name[0] if name[1] is None else f"{name[0]} {name[1]}"


PLANT_RPM = 13_000.0
"""Spindle speed of the plant's programs."""
BENT_mm_m_K = 0.93e-6 * 2.0**2 / 2.0 * 1000.0
"""Sag of a beam of 2 m for 1 K/m: dn/dT of air times the length squared over two."""
SPELT_OUT = {
    "frame_off_mm": ("x_mm", "y_mm", "z_mm"),
    "h0_N": ("h0_x_N", "h0_y_N", "h0_z_N"),
    "direction": ("direction_x", "direction_y", "direction_z"),
    "H_N_rad": tuple(f"H_{row}{column}_N_rad" for row in "xyz" for column in "xyz"),
}
"""Vector of a label -> its elements in the library."""
RENAMED = {"kg": "mass_kg"}
CONVERTED: dict[str, dict[str, tuple[tuple[str, ...], float]]] = {
    "bolt_ratchet": {"mm": (("step_mm",), 1.0), "hold_N": (("threshold_N",), 1.0)},
    "cutter_bending": {"mm_per_kN": (("um_per_N",), 1.0)},
    "dead_time": {"dead_time_s": (("delay_s",), 1.0)},
    "encoder_interpolation": {"lines": (("periods",), 1.0)},
    "fixture_compliance": {"mm_per_kN": (("x_um_per_N", "y_um_per_N", "z_um_per_N"), 1.0)},
    "floor_vibration": {"mm": (("amplitude_mm",), 1.0)},
    "jerk_feed_forward": {"s3": (("per_jerk_s3",), -1.0)},
    "spindle_growth": {"mm": (("um_per_krpm",), 1000.0 / (PLANT_RPM / 1000.0))},
    "tracker_refraction": {
        "mm_at_2m": (("K_per_m",), 1.0 / BENT_mm_m_K),
        "stand_mm": (("tracker_x_m", "tracker_y_m"), 1e-3),
    },
}
"""Effect -> parameter of its label -> names in the library, and the factor to its unit."""


def truth_of(entry: dict[str, Any]) -> Truth:
    """Return effect and target of an entry of a label."""
    return entry["effect"], entry["target"]


def flat(entry: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of an entry of a label under the library's names; words are left out."""
    converted = CONVERTED.get(entry["effect"], {})
    found: dict[str, float] = {}
    for key, value in entry["parameters"].items():
        if isinstance(value, str | bool) or value is None:
            continue
        values = [float(each) for each in np.ravel(value)]
        if key in converted:
            names, factor = converted[key]
            found |= {name: factor * each for name, each in zip(names, values, strict=False)}
        elif key in SPELT_OUT and isinstance(value, list):
            found |= dict(zip(SPELT_OUT[key], values, strict=True))
        elif not isinstance(value, list):
            found[RENAMED.get(key, key)] = values[0]
    return _stepped(found, entry["parameters"].get("unit")) if entry["effect"] == "step" else found


def _stepped(found: dict[str, float], unit: str | None) -> dict[str, float]:
    """Return the numbers of a step: of a joint its way round is the sign of its size."""
    size = found.pop("direction", 1.0) * found.pop("size")
    return {**found, f"size_{unit}": size}


STATED = 0.5
"""Probability from which on a dependence counts as stated."""
AXES = frozenset({"fx", "fy", "fz", "force"})
JOINTS = frozenset({"A1", "A2", "A3", "A4", "A5", "A6"})
ALL = "all"
"""``target`` of a label, and ``at`` of an answer, of what errs alike in all joints."""
TIMING = "timing"
"""``at`` of what moves all joints along the path, and of the links that see it."""
PLACES = {"tip": {"tip"}, "force": AXES, "part": {"tip", "part"}, "clock": {"tip", TIMING} | AXES | JOINTS}
"""Where, in the words of a label -> ``at``, in those of an answer. A joint is the label's own."""
TIME, STEP = "time in the run", "step in time"
"""One input: a step is a form of it."""
INPUTS = {
    "time_smooth": {TIME},
    "time_step": {TIME},
    "time_since_start": {"time since the run's start"},
    "own_torque_memory": {"own torque"},
    "force_memory": {"force"},
    "jerk": {"jerk", "acceleration"},
    "noise": {TIME},
}
"""Input in the words of a label -> ``on``; the others differ by their spaces alone. What is random has a
course of its own in each run: that is time in the run."""
MOST_OF = 0.5
"""Of a link's gap: on what less of it depends is an aside, however sure, and not what the gap depends on."""


@dataclass(frozen=True)
class Allowed:
    """What a label allows: places, inputs and the form."""

    at: frozenset[str]
    on: frozenset[str]
    form: str


@dataclass(frozen=True)
class Said:
    """A dependence that an answer states; a named cause states no form."""

    at: str
    on: str
    form: str | None
    probability: float
    """Of it, or of the set that is declared with it."""
    place_probability: float
    share: float = 1.0
    """Of the gap of its link."""
    alike: tuple[tuple[str, str], ...] = ()
    """Place and input of what it declares indistinguishable from it."""


@dataclass(frozen=True)
class Told:
    """What an answer tells right about the place and the family of a gap."""

    place: bool
    family: bool
    """Place and input."""
    form: bool
    """Place, input and form."""


NOTHING = Told(False, False, False)


def told(entry: dict[str, Any], result: dict[str, Any]) -> Told | None:
    """Compare the most probable dependence that an answer states with those that the label allows.

    One of its declared set counts as right; what takes little of its link's gap counts only where nothing
    else is stated. A named cause states its own family; a dependence of the rest counts where nothing is
    named. Its place has a probability of its own, and may be stated where the input is not. None where the
    label knows none.
    """
    allowed = allowed_by(entry)
    if allowed is None:
        return None
    stated = [*_of_causes(named_of(result))] or [*_of_rest(result)]
    if not stated:
        return NOTHING
    sure = [each for each in stated if each.probability >= STATED]
    if sure:
        most = [each for each in sure if each.share >= MOST_OF]
        return _compared(max(most or sure, key=lambda each: each.probability), allowed)
    best = max(stated, key=lambda each: each.place_probability)
    return Told(best.place_probability >= STATED and _compared(best, allowed).place, False, False)


def located(entries: Sequence[dict[str, Any]], result: dict[str, Any]) -> bool:
    """Tell whether each true effect has a statement of its own, of a cause or of the rest, with its place.

    A right name says the place, whatever family its numbers fit best.
    """
    stated = [(cause, {each.at for each in _of_causes([cause])}) for cause in named_of(result)]
    stated += [({}, {each.at}) for each in _of_rest(result) if each.place_probability >= STATED]
    return bool(entries) and _each_has_its_own(entries, stated)


def _each_has_its_own(
    entries: Sequence[dict[str, Any]], stated: Sequence[tuple[dict[str, Any], set[str]]]
) -> bool:
    if not entries:
        return True
    allowed = allowed_by(entries[0])
    return any(
        (names(cause, truth_of(entries[0])) or (allowed is not None and places & allowed.at))
        and _each_has_its_own(entries[1:], [*stated[:i], *stated[i + 1 :]])
        for i, (cause, places) in enumerate(stated)
    )


def probabilities(entry: dict[str, Any], result: dict[str, Any]) -> list[tuple[float, bool]]:
    """Return the probability of each dependence of the rest, and whether place and input are right."""
    allowed = allowed_by(entry)
    if allowed is None:
        return []
    return [(each.probability, _compared(each, allowed).family) for each in _of_rest(result)]


def says_family(cause: dict[str, Any], allowed: Allowed) -> bool:
    """Tell whether a cause's own family is the right one at the right place."""
    return any(_compared(each, allowed).family for each in _of_causes([cause]))


def allowed_by(entry: dict[str, Any]) -> Allowed | None:
    """Return what the label of an effect allows, in the words of an answer."""
    depends = entry.get("depends")
    if not depends:
        return None
    places = set(depends["joints"]) if depends["where"] == "joint" else PLACES[depends["where"]]
    if depends.get("target") == ALL:
        places = {ALL, TIMING}
    if TIMING in depends.get("links", ()):
        places = places | {TIMING}
    inputs = {word for on in depends["on"] for word in INPUTS.get(on, {on.replace("_", " ")})}
    return Allowed(frozenset(places), frozenset(inputs), depends["form"])


def _of_rest(result: dict[str, Any]) -> Iterable[Said]:
    for each in result["unexplained"].get("depends_on") or ():
        place = each.get("place_probability") or each["probability"]  # an impulse has one for both
        of_set = each.get("set_probability") or each["probability"]
        alike = tuple((other["at"], other["on"]) for other in each.get("indistinguishable_from") or ())
        yield Said(each["at"], each["on"], each["form"], of_set, place, each["share"] or 0.0, alike)


def _of_causes(causes: Iterable[dict[str, Any]]) -> Iterable[Said]:
    for cause in causes:
        if cause.get("family"):
            at, _, on = cause["family"].partition(", ")
            yield Said(at, TIME if on == STEP else on, None, cause["probability"], cause["probability"])


def _compared(said: Said, allowed: Allowed) -> Told:
    there = [(at, on) for at, on in ((said.at, said.on), *said.alike) if at in allowed.at]
    family = any(on in allowed.on for _, on in there)
    is_first = said.at in allowed.at and said.on in allowed.on
    return Told(bool(there), family, is_first and said.form in (None, allowed.form))


CLOSE_s = 0.02
TIMES = ("t_s", "at_s", "at_time_s")
"""Names of a moment in an answer, in a cause, its parameters or a dependence."""

Moment = tuple[str | None, float]
"""Run, None where the answer states none, and its time."""


def moment_hit(entries: Iterable[dict[str, Any]], result: dict[str, Any]) -> bool | None:
    """Tell whether a moment that the answer tells is a true one; None where the label has none.

    A moment within the event counts: from its begin to its end where it lasts.
    """
    true = [each for entry in entries for each in entry.get("moments") or ()]
    if not true:
        return None
    return any(_is_at(run, t_s, each) for run, t_s in told_moments(result) for each in true)


def _is_at(run: str | None, t_s: float, true: dict[str, Any]) -> bool:
    return run in (None, true["run"]) and abs(t_s - true["t_s"]) <= CLOSE_s + 0.5 * true.get("lasts_s", 0.0)


def told_moments(result: dict[str, Any]) -> Iterator[Moment]:
    """Yield the moments that an answer tells."""
    for cause in result["causes"]:
        moment = cause.get("moment")
        if moment:  # parameters count from the start of the earliest run
            yield from _moments(moment, moment["run"])
        else:
            yield from _moments(cause.get("parameters") or {}, cause.get("run"))
    for each in result["unexplained"].get("depends_on") or ():
        yield from _moments(each, each.get("run"))


def _moments(holder: dict[str, Any], run: str | None) -> Iterator[Moment]:
    for name in TIMES:
        value = holder.get(name)
        if isinstance(value, dict):
            value = value.get("value")
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield run, float(value)


NOMINAL = {"scale": 1.0, "factor": 1.0}
OWN_SIZE = frozenset({"k_s", "acc_cp_m_s2", "cdis_mm", "percent"})
"""Parameters whose error is relative to the value itself, not to its deviation from nominal."""
VECTORS = (("x_mm", "y_mm", "z_mm"), ("fx_N", "fy_N", "fz_N"), ("h0_x_N", "h0_y_N", "h0_z_N"))
TURNS = frozenset({"a_deg", "b_deg", "c_deg"})
DIRECTION = ("direction_x", "direction_y", "direction_z")
SHAPES = TURNS | frozenset(DIRECTION)
SHAPES |= {"decay_s", "harmonic", "phase", "time_constant_h", "hz", "damping", "torque_Nm", "skew", "count"}
SHAPES |= {"cx_mm", "cy_mm", "cz_mm", "time_constant_s", "at_s", "lines", "stand_mm", "length_mm"}
"""Parameters that say how an effect looks, not how large it is: their interval is scored, not their error."""
LINES = frozenset({"vibration"})
"""Effects along a line, whose direction may be told either way round."""
LEAST_SIZE = 1e-12

Numbers = dict[str, dict[str, float]]
"""Parameter -> value and the ends of its interval."""


def numbers(entry: dict[str, Any], cause: dict[str, Any]) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    """Return relative errors of the sizes, vectors as one, and whether each interval holds the true value."""
    true, said = flat(entry), cause["parameters"]
    if entry["effect"] in LINES:
        said = _same_way_round(true, said)
    covered = tuple(_holds(name, true[name], said[name]) for name in said if name in true)
    return tuple(_errors(true, said)), covered


def _errors(true: dict[str, float], said: Numbers) -> list[float]:
    single = [name for name in said if name in true and name not in SHAPES]
    errors = []
    for vector in VECTORS:
        if set(vector) <= set(single):
            apart = np.array([said[name]["value"] - true[name] for name in vector])
            length = float(np.linalg.norm([true[name] for name in vector]))
            errors.append(float(np.linalg.norm(apart)) / max(length, LEAST_SIZE))
            single = [name for name in single if name not in vector]
    for name in single:
        size = abs(true[name] - (0.0 if name in OWN_SIZE else NOMINAL.get(name, 0.0)))
        if size > LEAST_SIZE:
            errors.append(abs(said[name]["value"] - true[name]) / size)
    return errors


def _same_way_round(true: dict[str, float], said: Numbers) -> Numbers:
    """Return the parameters with their direction the truth's way round."""
    if not set(DIRECTION) <= set(said) & set(true):
        return said
    if sum(said[name]["value"] * true[name] for name in DIRECTION) >= 0.0:
        return said
    turned = {
        name: {"value": -said[name]["value"], "low": -said[name]["high"], "high": -said[name]["low"]}
        for name in DIRECTION
    }
    return {**said, **turned}


def _holds(name: str, true: float, said: dict[str, float]) -> bool:
    low, high = said.get("low"), said.get("high")
    if low is None or high is None:
        return False
    turns = (-2.0 * np.pi, 0.0, 2.0 * np.pi) if name == "phase" else (0.0,)
    return any(low <= true + turn <= high for turn in turns)


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
OWN, NOISE = "where", "above_noise"
"""Label: where the effect, smoothed, exceeds its own RMS; and where it exceeds the noise."""
ALMOST = 0.99
"""Intervals that are all alike are all the worst."""

Span = dict[str, Any]
"""``run``, ``t_start_s``, ``t_end_s``; of an answer also ``signal``."""


def overlap(entry: dict[str, Any], intervals: Sequence[Span], definition: str = OWN) -> float | None:
    """Return intersection over union on the time axis, all runs together; None where the label has no place.

    Where the answer gives intervals of the signal that the label is judged in, those alone count.
    """
    true = entry.get(definition) or ()
    if entry["effect"] in EVERYWHERE or not true:
        return None
    said = [each for each in intervals if each["signal"] == entry["main_signal"]] or list(intervals)
    both = either = 0.0
    for run in {each["run"] for each in [*true, *said]}:
        one, two = _spans(true, run), _spans(said, run)
        edges = np.unique([time for span in (*one, *two) for time in span])
        middle, width = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges)
        a, b = _inside(middle, one), _inside(middle, two)
        both, either = both + float(width[a & b].sum()), either + float(width[a | b].sum())
    return both / either if either > 0.0 else 0.0


def worst_of(intervals: Sequence[Span]) -> list[Span]:
    """Return the intervals whose RMS is at least that of all of them together; all where none states one."""
    if not all("rms" in each for each in intervals) or not intervals:
        return list(intervals)
    rms = np.array([each["rms"] for each in intervals])
    length = np.array([each["t_end_s"] - each["t_start_s"] for each in intervals])
    together = np.sqrt(np.sum(rms**2 * length) / max(float(length.sum()), 1e-9))
    return [each for each, own in zip(intervals, rms, strict=True) if own >= ALMOST * together]


def _spans(intervals: Iterable[Span], run: str) -> list[tuple[float, float]]:
    return [(each["t_start_s"], each["t_end_s"]) for each in intervals if each["run"] == run]


def _inside(times: np.ndarray, spans: Iterable[tuple[float, float]]) -> np.ndarray:
    found = np.zeros(len(times), dtype=bool)
    for start, end in spans:
        found |= (times >= start) & (times <= end)
    return found


UNKNOWN = ("unexplained", "partly_explained")
NULLS = ("null", "null_foreign_noise", "null_foreign_mismatch")
VERDICTS = dict.fromkeys(NULLS, ("no_gap",)) | {"open": UNKNOWN, "deleted": UNKNOWN}
"""The right verdicts where no cause is right."""
LEAST_REMOVED = 0.1
"""An oracle that removes less of the power than this gives no figure for shrink."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """Overlap with the label's place, by its two definitions."""

    own: float | None = None
    noise: float | None = None


@dataclass(frozen=True, kw_only=True)
class Judged:
    """One case, judged."""

    seed: int
    kind: str
    truths: tuple[Truth, ...]
    subject: str
    """What the worst of a row is looked for among: the true effects, or what is foreign."""
    form: str
    ratio: float
    """RMS of the smallest true effect over the noise."""
    beyond: float = 0.0
    """The same of what normal mismatch could not do of it; the ratio itself where that is not known."""
    is_imitated: bool = False
    """A simple effect of the library fits the change to within the noise."""
    is_undecided: bool = False
    """What is left of the data cannot say which effect it is."""
    plant_s: float = 0.0
    seconds: float = 0.0
    cpu_s: float = 0.0
    plant_cpu_s: float = 0.0
    beside_cpu_s: float = 0.0
    """Of the oracle."""
    foreign: tuple[str, ...] = ()
    """Each kind of noise, or the law of the mismatch, that the usual cases do not have."""
    failed: bool = True
    """An exception instead of an answer."""
    verdict: str = "failed"
    named: tuple[Truth, ...] = ()
    exact: bool = False
    declared: bool = False
    hit: bool = False
    """Every truth is among the named ones, whatever else is."""
    in_a_set: bool = False
    """Every truth is among the causes listed or their sets, however probable."""
    is_wrongly_named: bool = False
    """A named cause whose declared set holds no truth."""
    probabilities: tuple[tuple[float, bool], ...] = ()
    """Of each cause, and whether it or its set is a truth."""
    depends: tuple[tuple[float, bool], ...] = ()
    """Of each stated dependence, and whether it is right."""
    has_rest: bool = False
    """What is left is significant."""
    told: Told | None = None
    named_share: float = 0.0
    """Share of the truths that are among the named causes or their sets."""
    rest: float | None = None
    """What named causes leave over what the truth leaves, of the worst link; None where it takes nothing."""
    located: bool = False
    """Each truth has a statement of its own with its place."""
    moment: bool | None = None
    """A moment that is told is one of the truth's, to 20 ms; None where the truth has none."""
    nats: float | None = None
    """Distance of the least decidable effect from its best imitators; None where it is not known."""
    gap_nats: float | None = None
    """The same beside mismatch alone."""
    next_program: str | None = None
    shrink: float | None = None
    errors: tuple[float, ...] = ()
    covered: tuple[bool, ...] = ()
    place: Place = Place()

    @property
    def observable(self) -> bool:
        """Tell whether the effect is as large as the noise."""
        return self.ratio >= 1.0

    @property
    def decidable(self) -> bool:
        """Tell whether mismatch leaves as much as the noise of it, and no simple effect fits it."""
        return self.beyond >= 1.0 and not self.is_imitated

    @property
    def decidability(self) -> str:
        """Return the class of the case; empty without an effect."""
        if not self.truths:
            return ""
        return "not known" if self.nats is None else class_of(self.nats)

    @property
    def is_plain(self) -> bool:
        """Tell whether mismatch is too far from the truth to explain it away."""
        return self.gap_nats is not None and self.gap_nats >= DECIDABLE

    @property
    def flagged(self) -> bool:
        """Tell whether the answer says that something is unknown."""
        return self.verdict in UNKNOWN

    @property
    def alarms(self) -> bool:
        """Tell whether the answer says that something is wrong at all."""
        return bool(self.named) or self.verdict != "no_gap"

    @property
    def family_or_name(self) -> bool:
        """Tell whether place and family are right; a right name says both."""
        return self.declared or (self.told is not None and self.told.family)

    @property
    def name(self) -> str:
        """Return the true causes."""
        return " + ".join(text(one) for one in self.truths) or "none"

    @property
    def answer(self) -> str:
        """Return the named causes."""
        return " + ".join(text(one) for one in self.named) or self.verdict


def _beyond(entry: dict[str, Any]) -> float:
    left = entry.get("left_by_mismatch")
    return float(entry["ratio"] if left is None else left)


def _known(entries: list[dict[str, Any]], which: str) -> list[float] | None:
    found = [(entry.get("nats") or {}).get(which) for entry in entries]
    return None if not found or any(each is None for each in found) else [float(each) for each in found]


def _least(entries: list[dict[str, Any]], which: str) -> float | None:
    known = _known(entries, which)
    return None if known is None else min(known)


def _most(entries: list[dict[str, Any]], which: str) -> float | None:
    known = _known(entries, which)
    return None if known is None else max(known)


def judge(record: dict[str, Any]) -> Judged:
    """Return the judgement of a record; one without a result counts as wrong."""
    label, case, result = record["label"], record["case"], record.get("result")
    entries = label["effects"]
    truths = tuple(truth_of(entry) for entry in entries)
    known = {} if result is None else _answered(case["kind"], entries, truths, record)
    return Judged(
        seed=case["seed"],
        kind=case["kind"],
        truths=truths,
        subject=" + ".join(sorted(effect for effect, _ in truths)) or " + ".join(_foreign(label)) or "usual",
        form="other" if any(entry["form"] == "other" for entry in entries) else "same",
        ratio=min((entry["ratio"] for entry in entries), default=0.0),
        beyond=min((_beyond(entry) for entry in entries), default=0.0),
        is_imitated=any(entry.get("stand_ins") for entry in entries),
        is_undecided=bool(label.get("undecided")),
        plant_s=record.get("plant_s", 0.0),
        seconds=record.get("diagnosis_s", 0.0),
        cpu_s=record.get("diagnosis_cpu_s", 0.0),
        plant_cpu_s=record.get("plant_cpu_s", 0.0),
        beside_cpu_s=record.get("beside_cpu_s", 0.0),
        foreign=_foreign(label),
        nats=_least(entries, "two"),
        gap_nats=_most(entries, "mismatch"),
        failed=record.get("error") is not None,
        **known,
    )


def _foreign(label: dict[str, Any]) -> tuple[str, ...]:
    """Return what is foreign about a case: channel and kind of each noise, or the law of its mismatch."""
    noise = sorted({f"{each['channel']} {each['kind']}" for each in label.get("foreign_noise") or ()})
    law = label.get("mismatch_law") or {"shape": "uniform"}
    wide = [] if law["shape"] == "uniform" else [f"{law['scale']:g} x {law['shape']}"]
    return (*noise, *wide)


def _answered(
    kind: str, entries: list[dict[str, Any]], truths: tuple[Truth, ...], record: dict[str, Any]
) -> dict[str, Any]:
    result = record["result"]
    allowed = VERDICTS.get(kind)
    right = truths if allowed is None else ()
    causes, named = result["causes"], named_of(result)
    possible = len(named) == len(right) and (allowed is None or result["verdict"] in allowed)
    found = {
        "verdict": result["verdict"],
        "named": tuple((cause["effect"], cause["target"]) for cause in named),
        "exact": possible and covers(named, right),
        "declared": possible and covers(named, right, declares),
        "hit": bool(right) and covers(named, right),
        "in_a_set": bool(right) and covers(causes, right, declares),
        "is_wrongly_named": not all(is_among(cause, right) for cause in named),
        "probabilities": tuple((cause["probability"], is_among(cause, right)) for cause in causes),
        "has_rest": bool(result["unexplained"].get("significant")),
        "next_program": (result.get("next_run") or {}).get("program"),
        "named_share": sum(any(declares(each, one) for each in named) for one in right) / max(len(right), 1),
        "rest": _worst_rest(record.get("rests") or {}),
        "located": located(entries, result),
        "moment": moment_hit(entries, result),
    }
    return found | (_one_effect(kind, entries[0], record) if len(entries) == 1 else {})


def _worst_rest(rests: dict[str, list[float]]) -> float | None:
    """Return the largest rest over the truth's, of the links where the truth removes power that counts."""
    ratios = [
        named / true
        for before, named, true in rests.values()
        if true > 0.0 and before**2 - true**2 > LEAST_REMOVED * before**2
    ]
    return max(ratios, default=None)


def _one_effect(kind: str, entry: dict[str, Any], record: dict[str, Any]) -> dict[str, Any]:
    """Return place, family, size and shrink where one effect is at work."""
    result = record["result"]
    found: dict[str, Any] = {
        "told": told(entry, result),
        "depends": tuple(probabilities(entry, result)),
        "shrink": _relative_shrink(record),
    }
    if result["verdict"] != "no_gap":
        said = result["where"].get("intervals") or []
        found["place"] = Place(own=overlap(entry, worst_of(said), OWN), noise=overlap(entry, said, NOISE))
    truth = truth_of(entry)
    right = [cause for cause in named_of(result) if names(cause, truth)]
    if right and kind == "single" and entry["form"] == "same":
        found["errors"], found["covered"] = numbers(entry, right[0])
    return found


def _relative_shrink(record: dict[str, Any]) -> float | None:
    """Return the power that the named causes remove over what the truth removes, on held-out data."""
    gap, known = record["result"]["gap"], record.get("oracle")
    if not gap.get("held_out") or gap.get("shrink") is None or known is None:
        return None
    if known["removed"] <= LEAST_REMOVED * known["before"]:
        return None
    gone = gap["rms_before"] ** 2 - gap["rms_after"] ** 2
    return float(np.clip(gone / known["removed"], 0.0, 1.0))
