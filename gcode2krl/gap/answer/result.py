"""What a diagnosis says: types, the JSON object (docs/diagnose.md) made of their fields, and a cell file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcode2krl.cell import library, resolve_cell
from gcode2krl.effects import Applied
from gcode2krl.errors import Issue, input_error
from gcode2krl.exchange.findings import Findings
from gcode2krl.exchange.views import view
from gcode2krl.files import write_together
from gcode2krl.gap.answer.evidence import Evidence
from gcode2krl.gap.posterior.cause_tests import Constancy, Interval
from gcode2krl.gap.posterior.judgement import NAMED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "gcode2krl/gap/1"
_NAMES = {"source": "from", "answer": "if", "shows": "then"}
"""Names of the contract that Python keeps for itself."""
_LEFT_OUT_WHERE_NONE = frozenset({"offset_deg", "words", "rivals", "behind_nats", "moment", "together"})
"""Keys that only some links and causes have; others are null where nothing is known."""


_ORDER = (
    *("verdict", "gap", "at_part", "links", "where", "events", "causes", "unexplained", "not_examined"),
    *("observable", "next_run", "runs", "notes", "issues"),
)
"""Keys of the JSON object, behind that of its schema."""
_OF_ISSUES = ("severity", "code", "line", "message", "remedy")


def plain(value: Any) -> Any:
    """Return a result without dataclasses and numpy types: dicts, lists, numbers, texts, None."""
    if isinstance(value, Interval):
        value = value._asdict()
    if is_dataclass(value):
        items = ((entry.name, getattr(value, entry.name)) for entry in fields(value))
        value = {
            _NAMES.get(name, name): item
            for name, item in items
            if item is not None or name not in _LEFT_OUT_WHERE_NONE
        }
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


@dataclass(frozen=True, kw_only=True)
class RunSize:
    """The gap of one run, in the unit of what it is part of."""

    run: str
    rms_before: float
    rms_after: float | None
    """With the named causes as the runs that explain say they are; None where that is not known."""
    held_out: bool
    """The run only tests: nothing was chosen or fitted with it."""


@dataclass(frozen=True, kw_only=True)
class GapSize:
    """The signal with the largest gap over its noise, in its unit; None where nothing was compared.

    ``rms_before``, ``rms_after``, the largest values and ``shrink`` are of held-out data where there are any.
    """

    signal: str
    unit: str
    rms_before: float | None = None
    rms_after: float | None = None
    noise_floor: float | None = None
    """Noise, and the normal mismatch of machine and tool."""
    max_before: float | None = None
    max_after: float | None = None
    shrink: float | None = None
    """Share of the explainable gap that is gone on held-out data."""
    held_out: bool = False
    per_run: tuple[RunSize, ...] = ()
    """Of every run, those that explain and those that are held out."""


@dataclass(frozen=True, kw_only=True)
class AtPart:
    """The gap as it is met at the part, whatever signal shows it best."""

    what: str
    """tip or part, in mm; time, in s, where clocks or the time law alone are off; force, in N, and joints,
    in deg, where nothing else is known."""
    unit: str
    rms_before: float
    """Over all runs."""
    rms_after: float | None
    """With the named causes in the model, on held-out data; None where that is not known."""
    noise: float | None
    """In the same unit; None where the size was converted, which takes the noise out of it."""
    link: str
    """The link that shows it."""
    held_out_before: float | None = None
    """On the data that ``rms_after`` is of; None where that is not known."""
    per_run: tuple[RunSize, ...] = ()
    """Of every run; empty where a run has no size of its own, as for clocks, scans and slips."""


OF_POSES = "what no effect explains"
"""Where the noise of poses is from that are not visited again."""


@dataclass(frozen=True, kw_only=True)
class NoiseResult:
    """The noise of a link's instrument: rms over its components of their standard deviations."""

    stated: float | None
    """As run.toml states it."""
    learnt: float
    """What noise was taken to be, with what it forgets within seconds."""
    short: float
    """What of it is forgotten within milliseconds: the other reading, where nothing else is known."""
    source: str
    """In the JSON object ``from``: repeats, each run by itself, or (of poses) what no effect explains."""

    @property
    def is_a_guess(self) -> bool:
        """Tell whether the noise of poses is only what no effect explains: nothing else tells it."""
        return self.stated is None and self.source == OF_POSES


@dataclass(frozen=True, kw_only=True)
class EventResult:
    """What was rough or far off for a moment."""

    link: str
    run: str
    t_s: float
    line: int
    """Of the G-code; 0 where the robot is on none."""
    what: str
    """impulse, slip, or burst: the instrument's, left out."""
    size: float
    """The largest deviation from the level around it, of a slip the change that stays."""
    unit: str
    lasts_s: float


@dataclass(frozen=True, kw_only=True)
class LinkResult:
    """One examined link."""

    link: str
    rms_before: float
    rms_after: float
    floor: float | None
    """Length of noise and normal mismatch together."""
    unit: str
    verdict: str
    """no_gap, explained, partly_explained or unexplained."""
    noise: NoiseResult | None = None
    """None where nothing measures it, or nothing was learnt."""
    offset_deg: Mapping[str, float] | None = None
    """Joint -> zero between its two encoders, where the link has two."""


@dataclass(frozen=True, kw_only=True)
class SignalResult:
    """The size of a signal's gap beside its noise."""

    signal: str
    rms: float
    noise: float
    significant: bool


@dataclass(frozen=True, kw_only=True)
class IntervalResult:
    """A stretch of time in which the gap exceeds the noise."""

    run: str
    signal: str
    t_start_s: float
    t_end_s: float
    lines: tuple[int, ...]
    """First and last G-code line; none where no move of the program is in it."""
    rms: float
    what: str
    """What goes on there: a phase, or the reversal of a joint."""
    share: float | None = None
    """Of the gap's power over all runs."""


@dataclass(frozen=True, kw_only=True)
class PhaseResult:
    """The gap in a phase of the work, and its share of the gap's power."""

    phase: str
    rms: float
    share: float


@dataclass(frozen=True, kw_only=True)
class JointResult:
    """The share of a joint in the gap's power."""

    joint: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Where:
    """The place of a gap: in which signals and, of the largest, when, along what and at which joints."""

    signals: tuple[SignalResult, ...] = ()
    intervals: tuple[IntervalResult, ...] = ()
    """All times at which the gap exceeds the noise; the stretch with the largest share first."""
    direction_base: tuple[float, ...] | None = None
    """Unit vector in ``$BASE``, where the signal is one."""
    phases: tuple[PhaseResult, ...] = ()
    joints: tuple[JointResult, ...] = ()
    frequency_hz: tuple[float, ...] | None = None
    """The band that holds the power between its 10 % and 90 % points."""


@dataclass(frozen=True)
class EffectAt:
    """An effect and where it is."""

    effect: str
    target: str | None
    behind_nats: float | None = None
    """By how much it is worse than the cause that it stands beside; None where that was not compared."""
    together: bool | None = None
    """It does so with the others of which this is true; None where it does so alone."""


@dataclass(frozen=True)
class RivalResult:
    """An effect in place of a cause, and its probability."""

    effect: str
    target: str | None
    probability: float
    behind_nats: float | None = None
    """By how much it is worse than the cause."""


@dataclass(frozen=True)
class UnknownAt:
    """Something that the library lacks, by its place and the input that it depends on."""

    kind: str = field(default="unknown", init=False)
    at: str
    on: str


@dataclass(frozen=True, kw_only=True)
class Course:
    """How a deviation goes over an input: a few points, each the mean of a stretch of the input."""

    over: str
    """The input, ``torque of A2``."""
    over_unit: str
    unit: str
    """Of the deviation, along ``direction`` where there is one."""
    points: tuple[tuple[float, float], ...]
    """(input, deviation), by rising input."""
    run: str | None = None
    """Where each run has a course of its own, that which this one is of: the run that deviates most."""


@dataclass(frozen=True, kw_only=True)
class DependsOnResult:
    """On what a gap without a name depends: where, on which input, in which form."""

    link: str
    at: str
    """``tip``, a joint ``A1`` … ``A6``, or an axis of the force ``fx`` ``fy`` ``fz``."""
    on: str
    """An input: the value of an `effects.dependence.Dependence`, "time in the run" for a step too."""
    form: str
    """impulse, step, drift, periodic, loop or smooth."""
    probability: float
    share: float
    """Of the gap's power beyond noise that it takes."""
    at_time_s: float | None = None
    """Of a step or an impulse its moment in `run`, of what is one of moments its largest; in the JSON object
    ``t_s`` too."""
    run: str | None = None
    in_later_runs: bool | None = None
    """Of a step, whether it stays: between runs somebody may have mended it."""
    line: int | None = None
    """Of the G-code, at that moment."""
    size: float | None = None
    """Of a step its height, else the largest deviation, in ``unit``."""
    unit: str | None = None
    direction: tuple[float, ...] | None = None
    """Unit vector in ``$BASE`` of what moves the tip or is a force."""
    frequency_hz: float | None = None
    """Of a tone."""
    course: Course | None = None
    """Of a drift or a smooth function, how it goes over its input."""
    tests: Mapping[str, float | None] | None = None
    """Name -> number: what its probability is made of (`posterior.calibrated.FamilyFeatures`)."""
    place_probability: float | None = None
    """That its place, or one of its set's, is right, whatever the gap depends on there."""
    indistinguishable_from: tuple[UnknownAt, ...] = ()
    """Places and inputs that these data cannot tell from it."""
    set_probability: float | None = None
    """That it or one of these is right; None of an impulse, and of all but the first of a signal."""


@dataclass(frozen=True, kw_only=True)
class Separates:
    """Two answers that the data leave open, and the odds expected between them after a run."""

    first: str
    second: str
    odds: float


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """What a run will show if an answer is right."""

    answer: str
    shows: str


@dataclass(frozen=True, kw_only=True)
class NextRun:
    """The canned program that parts best what the data leave open."""

    program: str
    """A name that ``gcode2krl make-test`` takes."""
    minutes: float
    separates: tuple[Separates, ...]
    expect: tuple[Expectation, ...]


@dataclass(frozen=True, kw_only=True)
class MomentResult:
    """A moment of a run."""

    run: str
    t_s: float
    line: int
    """Of the G-code."""


@dataclass(frozen=True, kw_only=True)
class CauseResult:
    """One effect at one target, a set-up slip included."""

    effect: str
    target: str | None
    link: str
    probability: float
    parameters: Mapping[str, Interval]
    """Name -> value and 90 % interval."""
    shrink: float | None
    """Share of the explainable gap that it takes on held-out data, on top of the causes above it."""
    rms_after: float | None
    words: str | None = None
    """Of a set-up slip, what shows it; None for other causes."""
    indistinguishable_from: tuple[EffectAt | UnknownAt, ...] = ()
    """Others that these data cannot tell from it: they share the probability. The last one may be something
    of its place and input that the library lacks."""
    rivals: tuple[RivalResult, ...] | None = None
    """None where no other effect was compared with it."""
    family: str | None = None
    """Where and on what it depends, ``A2, reversals``."""
    family_probability: float | None = None
    """That place and family are right; at least that of the name."""
    form_fits: float | None = None
    """The gain of its form over that of the best function of what it depends on."""
    constant: Constancy | None = None
    tests: Mapping[str, float | None] | None = None
    """Name -> number: what its probability is made of (`calibrated.Features`); None where not tested."""
    moment: MomentResult | None = None
    """Of what begins at a moment, where that is in its run; of what acts for moments, its largest."""

    @property
    def is_named(self) -> bool:
        """Tell whether its probability is at least 0.5."""
        return self.probability >= NAMED


@dataclass(frozen=True, kw_only=True)
class Unexplained:
    """What is left of the gap with the causes in the model."""

    rms: float | None
    significant: bool
    structure: str
    """structured, white or unknown."""
    depends_on: tuple[DependsOnResult, ...] = ()
    """The most probable first; empty where nothing significant is left."""
    probability: float | None = None
    """That the library lacks what is at work in the largest gap; None without a gap."""


@dataclass(frozen=True, kw_only=True)
class NotExamined:
    """A link without data, and what a run must hold for it."""

    link: str
    needs: str


@dataclass(frozen=True, kw_only=True)
class Detectable:
    """The smallest size of an effect that would have been a finding in a link."""

    link: str
    effect: str
    target: str | None
    parameter: str
    smallest: float
    seen: bool
    """False where normal mismatch could do nearly all that the effect does."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Gap:
    """Where reality differs from the prediction, why, and how much is gone with the causes in the model."""

    verdict: str
    """no_gap, explained, partly_explained or unexplained."""
    gap: GapSize
    links: tuple[LinkResult, ...]
    where: Where
    causes: tuple[CauseResult, ...]
    """The most probable first."""
    unexplained: Unexplained
    not_examined: tuple[NotExamined, ...]
    observable: tuple[Detectable, ...] = ()
    next_run: NextRun | None = None
    """None only where nothing is left to part."""
    named: tuple[Applied, ...] = ()
    """The causes with a probability of at least 0.5, as effects that `predict` takes."""
    issues: tuple[Issue, ...] = ()
    runs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    at_part: AtPart | None = None
    """None where there is no gap, or nothing to compare."""
    events: tuple[EventResult, ...] = ()
    """What happened in a moment of one run, in the order of links and runs."""
    evidence: Evidence | None = field(default=None, repr=False, compare=False)
    """What the pictures are drawn from; not in the JSON object."""

    @property
    def named_causes(self) -> tuple[CauseResult, ...]:
        """Return the causes with a probability of at least 0.5."""
        return tuple(cause for cause in self.causes if cause.is_named)

    def as_dict(self) -> dict[str, Any]:
        """Return the object of the JSON contract, plain numbers only; what is not finite is None."""
        made: dict[str, Any] = {"schema": SCHEMA} | {name: plain(getattr(self, name)) for name in _ORDER}
        for dependence in made["unexplained"]["depends_on"]:
            # a moment is t_s as in events, and at_time_s as it was first called
            dependence["t_s"] = dependence["at_time_s"]
        made["issues"] = [{name: getattr(issue, name) for name in _OF_ISSUES} for issue in self.issues]
        if self.next_run is not None:
            pairs = made["next_run"]["separates"]
            made["next_run"]["separates"] = [[each["first"], each["second"], each["odds"]] for each in pairs]
        return made

    @property
    def findings(self) -> Findings:
        """The ``issues`` as a table: severity, code, line, message, remedy."""
        return Findings(self.issues)

    def plot(self, run: str | None = None) -> "Figure":
        """Return the figure of a run, the first by default: over time, on the path, by what it depends on.

        Raises `NotUnderstoodError` where nothing was compared, or there is no such run.
        """
        figure: Figure = view("gap figure")(self, run)
        return figure

    def __repr__(self) -> str:
        return f"Gap({view('gap words')(self)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        page: str = view("gap page")(self)
        return page


def apply_to_cell(gap: Gap, file: Path, base: Path | None, sources: Sequence[str]) -> int:
    """Write the named causes into a cell file as ``[[effects]]`` and return how many there are.

    Parameters
    ----------
    file : the cell file that is written; if it exists, its other keys are kept and its comments are lost.
    base : the cell file to begin from where ``file`` does not exist.
    sources : names of the runs that the causes come from.

    Raises
    ------
    NotUnderstoodError
        A file is no cell file, or cannot be written.
    """
    import tomli_w

    begin = file if file.exists() else base
    data: dict[str, Any] = library.read_toml(begin) if begin is not None else {}
    before = data.get("effects", [])
    if not isinstance(before, list):
        raise input_error("cell-key", "effects: found no list", "write [[effects]]", source=str(file))
    causes = [applied for applied in gap.named if applied.effect.kind == "cause"]
    entries = [
        {
            "name": cause.effect.name,
            **({"target": cause.target} if cause.target is not None else {}),
            "parameters": {name: float(f"{value:.6g}") for name, value in cause.values.items()},
            "source": f"diagnosed from {', '.join(sources)}",
        }
        for cause in causes
    ]
    replaced = {(entry["name"], entry.get("target")) for entry in entries}
    kept = [entry for entry in before if (entry.get("name"), entry.get("target")) not in replaced]
    data["effects"] = [*kept, *entries]
    resolve_cell(data, folder=file.parent, source=str(file))
    write_together({file: tomli_w.dumps(data).encode("utf-8")})
    return len(entries)
