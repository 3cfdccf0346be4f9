"""Whether an answer says where a gap sits and on what it depends, as the label has it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from gap_blind_names import named_of

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
}
"""Input in the words of a label -> ``on``; the others differ by their spaces alone."""


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

    A named cause states its own family; a dependence of the rest counts where nothing is named. None where
    the label knows none.
    """
    allowed = allowed_by(entry)
    if allowed is None:
        return None
    stated = [*_of_causes(named_of(result))] or [*_of_rest(result)]
    stated = [each for each in stated if each.probability >= STATED]
    return _compared(max(stated, key=lambda each: each.probability), allowed) if stated else NOTHING


def located(entries: Sequence[dict[str, Any]], result: dict[str, Any]) -> bool:
    """Tell whether each true effect has a statement of its own, of a cause or of the rest, with its place."""
    stated = [*_of_causes(named_of(result)), *_of_rest(result)]
    places = [each.at for each in stated if each.probability >= STATED]
    allowed = [allowed_by(entry) for entry in entries]
    return bool(allowed) and all(allowed) and _each_has_its_own([a.at for a in allowed if a], places)


def _each_has_its_own(allowed: Sequence[frozenset[str]], places: Sequence[str]) -> bool:
    if not allowed:
        return True
    return any(
        place in allowed[0] and _each_has_its_own(allowed[1:], [*places[:i], *places[i + 1 :]])
        for i, place in enumerate(places)
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
        yield Said(each["at"], each["on"], each["form"], each["probability"])


def _of_causes(causes: Iterable[dict[str, Any]]) -> Iterable[Said]:
    for cause in causes:
        if cause.get("family"):
            at, _, on = cause["family"].partition(", ")
            yield Said(at, TIME if on == STEP else on, None, cause["probability"])


def _compared(said: Said, allowed: Allowed) -> Told:
    place = said.at in allowed.at
    family = place and said.on in allowed.on
    return Told(place, family, family and said.form in (None, allowed.form))
