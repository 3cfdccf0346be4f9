"""The diagnosis: runs beside their predictions, link by link, to one answer."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.effects import Applied, Effect, inputs_of, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue, input_error
from gcode2krl.gap.beside.clocks import coarse_offset, fitted_offset
from gcode2krl.gap.beside.fine_prediction import refined_prediction
from gcode2krl.gap.beside.links import EXAMINED, MODEL_RAD, traces_of
from gcode2krl.gap.beside.log_alone import log_pairs
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.planning import remembered_plan
from gcode2krl.gap.beside.retiming import refined, retimed
from gcode2krl.gap.beside.scan import examine_scans
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.fitted_joints import with_fitted
from gcode2krl.gap.choose.judgement import Judgement, judge
from gcode2krl.gap.choose.selection import Question
from gcode2krl.gap.fit.signatures import HZ, Block, blocks_at, blocks_of, strongest_hz
from gcode2krl.gap.slips.set_up import Slip, clock_slips, slips_of
from gcode2krl.gap.slips.stops import unplanned_stops
from gcode2krl.gap.tell.assembly import answer
from gcode2krl.gap.tell.result import Gap
from gcode2krl.gap.tell.scan_answer import with_scan
from gcode2krl.prediction import Prediction
from gcode2krl.runs import Run, check_program

_S_PER_H = 3600.0
_SET = 0.1
"""The controller's clock is set before the path is examined: a tenth of its mismatch remains."""
_PEAKS = 4
_LOST, _CLOCKS_LOST = ("unexplained", "partly_explained"), 4
"""Where the run's own timing replaced the plan's, an instrument's clock is known so many times worse."""
_CLOCKS_OF_TWO = 2
"""Two clocks are the same where they differ by no more than normal mismatch of both."""


def diagnose(
    prediction: Prediction,
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    *,
    effects: Sequence[str | Path | Effect] = (),
    exclude: Sequence[str] = (),
    mismatch: Mismatch | None = None,
    seed: int = 0,
) -> Gap:
    """Return where runs differ from their prediction, why, and how much is gone with the causes in the model.

    Parameters
    ----------
    runs : measured runs that explain; one whose ``run.toml`` names a prediction is compared with that one.
    holdout : runs that only test; without any, whole runs by turns, of a single run stretches of the path.
    effects : effects besides the library's, or folders of them.
    exclude : names of effects that are no candidates; as normal mismatch they still count.
    mismatch : what is no gap; by default the bounds of `Mismatch`.

    Raises
    ------
    NotUnderstoodError
        No run, a run of another program than its prediction's, or a prediction without motion.
    """
    if not runs:
        raise input_error("no-runs", "there is no run to diagnose", "name at least one run folder")
    everything = [*runs, *holdout]
    pairs = list(_pairs(prediction, everything))
    known = known_effects(effects)
    return _diagnosed(pairs, len(runs), known, mismatch or Mismatch(), seed, exclude=frozenset(exclude))


def diagnose_log(
    runs: Sequence[Run],
    cell: Cell | None = None,
    holdout: Sequence[Run] = (),
    *,
    effects: Sequence[str | Path | Effect] = (),
    mismatch: Mismatch | None = None,
    seed: int = 0,
) -> Gap:
    """Return what logs alone tell, without a prediction: servo, gear and, with a known robot, mechanics.

    ``cell`` is the robot's; without one only joint signals are compared. Other parameters and errors as for
    `diagnose`.
    """
    if not runs:
        raise input_error("no-runs", "there is no run to diagnose", "name at least one run folder")
    pairs = log_pairs([*runs, *holdout], cell)
    return _diagnosed(
        pairs, len(runs), known_effects(effects), mismatch or Mismatch(), seed, cell is not None
    )


def known_effects(extra: Sequence[str | Path | Effect]) -> dict[str, Effect]:
    """Return the library with effects of one's own."""
    known = library([each for each in extra if not isinstance(each, Effect)])
    return known | {each.name: each for each in extra if isinstance(each, Effect)}


@dataclass
class _State:
    """What is known while the links are gone through."""

    pairs: list[Pair]
    explaining: int
    known: Mapping[str, Effect]
    mismatch: Mismatch
    seed: int
    kinematics: bool = True
    exclude: frozenset[str] = frozenset()
    examined: frozenset[str] = frozenset()
    found: list[Applied] = field(default_factory=list)
    """Causes that belong to the model of later links."""
    slips: list[Applied] = field(default_factory=list)
    judgements: list[Judgement] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    clocks_set: bool = False
    stopped: bool = False
    """Stops that nobody planned are in the plan."""


def _diagnosed(
    pairs: list[Pair], explaining: int, known: Mapping[str, Effect], mismatch: Mismatch, seed: int,
    kinematics: bool = True, exclude: frozenset[str] = frozenset(),
) -> Gap:  # fmt: skip
    offered = {name: effect for name, effect in known.items() if name not in exclude}
    # stops first: what a run falls behind at them looks like a wrong clock
    slips, stopped = unplanned_stops(pairs, offered)
    issues: list[Issue] = []
    if slips:
        state = _State(stopped, explaining, known, mismatch, seed, kinematics, exclude, stopped=True)
    else:
        pairs = [_with_coarse_clocks(pair) for pair in pairs]
        slips, issues = slips_of(pairs, offered)
        slips += clock_slips(pairs, offered)
        state = _State(pairs, explaining, known, mismatch, seed, kinematics, exclude)
    if any(slip.final for slip in slips):
        return answer(state.pairs, [], slips, issues, state.examined, state.notes)
    if not state.stopped:
        _apply_slips(state, slips)
    _set_controller_clocks(state)
    state.examined = frozenset(_examined(state))
    for link in EXAMINED:
        traces = _traces(state, link)
        if traces:
            held = [trace for trace in traces if trace.run_number >= explaining]
            mine = [trace for trace in traces if trace.run_number < explaining]
            judgement = judge(link, mine or held, held if mine else [], _question(state, link, traces))
            state.judgements.append(judgement)
            _learn(state, judgement)
    gap = answer(state.pairs, state.judgements, slips, issues, state.examined, state.notes)
    if not state.kinematics or any(pair.from_log for pair in state.pairs):
        return gap
    return with_scan(gap, examine_scans(state.pairs, state.found, offered, mismatch))


def _pairs(prediction: Prediction, runs: Sequence[Run]) -> Iterator[Pair]:
    started = [run.head.started for run in runs if run.head.started is not None]
    first = min(started) if started else None
    inputs = {}
    for number, run in enumerate(runs):
        own = run.path("prediction")
        mine = Prediction.load(own) if own is not None and own.exists() else prediction
        sha = mine.inputs.get("program_sha256")
        wrong = check_program(run, sha) if isinstance(sha, str) else []
        if wrong:
            raise input_error(wrong[0].code, wrong[0].message, wrong[0].remedy, source=str(run.folder))
        key = str(own) if mine is not prediction else ""
        if key not in inputs:
            fine = refined_prediction(mine)
            inputs[key] = inputs_of(fine, plan=remembered_plan(fine))
        hours = 0.0
        if first is not None and run.head.started is not None:
            hours = (run.head.started - first).total_seconds() / _S_PER_H
        yield Pair(run=run, number=number, inputs=replace(inputs[key], hours=hours))


def _with_coarse_clocks(pair: Pair) -> Pair:
    tables = [table for table in (pair.run.controller, pair.run.tracker) if table is not None]
    if pair.from_log:
        return pair
    offsets = {type(table).__name__.lower(): coarse_offset(pair, table) for table in tables}
    return replace(pair, clock_s={name: offset for name, offset in offsets.items() if offset != 0.0})


def _apply_slips(state: _State, slips: Sequence[Slip]) -> None:
    """Let later links start from what a slip did to the motion."""
    for slip in slips:
        if slip.applied.effect.is_clock:
            continue  # it was taken off the stamps
        planned = _planned_once(state, slip.applied)
        if not slip.applied.effect.plans_anew:  # else all that it does is in the plan
            state.found.append(planned)
            state.slips.append(planned)


def _planned_once(state: _State, applied: Applied) -> Applied:
    """Take what a cause does to the commanded joints into the inputs; return the rest of what it does."""
    state.pairs = [replace(pair, inputs=applied.effect.replan(pair.inputs, applied)) for pair in state.pairs]
    return replace(applied, planned=True)


def _examined(state: _State) -> Iterator[str]:
    for link in EXAMINED:
        if _traces(state, link):
            yield link
            if link == "path":
                yield "timing"


def _traces(state: _State, link: str) -> list[Trace]:
    if link == "mechanics" and not state.kinematics:
        return []
    base = state.found if link == "mechanics" else state.slips
    return traces_of(link, state.pairs, base)


def _question(state: _State, link: str, traces: Sequence[Trace]) -> Question:
    cell = traces[0].inputs.cell
    upstream = frozenset(each for each in EXAMINED if each not in state.examined)
    blocks: list[Block] = []
    for effect in state.known.values():
        if effect.kind == "slip" and state.slips:
            continue
        if effect.name in state.exclude or (state.stopped and effect.plans_anew):
            continue
        for target in effect.targets(cell):
            if effect.searched(link, target, state.examined):
                if HZ in effect.names:
                    p = effect.parameter(HZ)
                    peaks = strongest_hz(
                        [trace.residual for trace in traces], _step(traces), p.low, p.high, _PEAKS
                    )
                    blocks += blocks_at(effect, target, peaks)
                else:
                    blocks += blocks_of(effect, target)
    clocks = 2 if link == "mechanics" and "path" not in state.examined and "servo" in state.examined else 1
    if link != "path":
        path = next((each.verdict for each in state.judgements if each.link == "path"), "no_gap")
        clocks = _CLOCKS_LOST if path in _LOST else max(clocks, 1 if path == "no_gap" else 2)
    share = _SET if link == "path" and state.clocks_set else 1.0
    return Question(state.known, blocks, state.mismatch, upstream, clocks, share, state.seed)


def _step(traces: Sequence[Trace]) -> float:
    return float(np.median(np.diff(traces[0].time_s)))


def _learn(state: _State, judgement: Judgement) -> None:
    """Take what a link says into the model of the later ones."""
    named = list(judgement.applied)
    if judgement.link == "force":
        learned = [one.effect.learned(one, judgement.link) for one in named]
        state.found += [one for one in learned if one is not None]
        if judgement.verdict in _LOST:
            state.pairs = [pair.with_measured_load() for pair in state.pairs]
    if judgement.link == "servo":
        _free_controller(state, judgement)
    if judgement.link in ("servo", "gear") and judgement.verdict in ("no_gap", "explained"):
        state.pairs = with_fitted(state.pairs, judgement, _question_of(judgement))
    if judgement.link != "path":
        return
    planned = [one for one in named if one.effect.plans_anew]
    for one in planned:
        state.pairs = [replace(pair, inputs=one.effect.replan(pair.inputs, one)) for pair in state.pairs]
    if any(one.effect.own_model for one in named):
        state.pairs = [_without_own_model(pair) for pair in state.pairs]
        return
    if judgement.verdict in _LOST:
        state.pairs = [retimed(pair) for pair in state.pairs]
    state.pairs = [refined(_with_controller_clock(pair)) for pair in state.pairs]


def _without_own_model(pair: Pair) -> Pair:
    """Return the pair on the run's own time, the controller's joints less what its own model adds."""
    on_time = refined(pair.with_own_model())
    inputs = replace(on_time.inputs, q_cmd_rad=pair.inputs.q_cmd_rad)
    return replace(on_time, inputs=inputs).with_nominal_joints()


def _free_controller(state: _State, servo: Judgement) -> None:
    """Take the clock off the controller's table where its commanded columns alone are off.

    They then differ by the same time from the plan and from the drives.
    """
    path = next((each for each in state.judgements if each.link == "path"), None)
    mine, own = _clock(path, "controller"), _clock(servo, "q_cmd")
    if path is None or mine is None or own is None:
        return
    if abs(mine["offset_s"] - own["offset_s"]) > _CLOCKS_OF_TWO * state.mismatch.clock_s:
        return
    kept = tuple(cause for cause in path.causes if cause.applied.target != "controller")
    state.judgements[state.judgements.index(path)] = replace(path, causes=kept)
    state.pairs = [replace(pair, clock_s=_later(pair, -mine["offset_s"])) for pair in state.pairs]


def _clock(judgement: Judgement | None, target: str) -> Applied | None:
    """Return the named clock of a table or of columns."""
    named = judgement.applied if judgement is not None else ()
    return next((one for one in named if one.effect.is_clock and one.target == target), None)


def _question_of(judgement: Judgement) -> Question:
    return judgement.examination.question


def _set_controller_clocks(state: _State) -> None:
    """Set the controllers' clocks run by run where the runs then keep to the plan's times.

    What all of them are off by stays, where it is a finding. Where they do not keep to the plan, their clocks
    are fitted along with what the law of time is.
    """
    offsets = []
    for pair in state.pairs:
        traces = traces_of("path", [pair])
        offset, deviation = fitted_offset(traces[0]) if traces else (0.0, np.inf)
        offsets.append(offset if np.isfinite(deviation) else 0.0)
    common = float(np.median(offsets)) if offsets else 0.0
    kept = common if abs(common) > state.mismatch.clock_s else 0.0

    def later(by: float) -> list[Pair]:
        return [
            replace(pair, clock_s=_later(pair, offset - by))
            for pair, offset in zip(state.pairs, offsets, strict=True)
        ]

    left = [trace.residual for pair in later(0.0) for trace in traces_of("path", [pair])]
    if left and float(np.sqrt(np.mean(np.concatenate(left) ** 2))) < MODEL_RAD:
        state.pairs, state.clocks_set = later(kept), True


def _later(pair: Pair, offset_s: float) -> dict[str, float]:
    return {**pair.clock_s, "controller": pair.clock_s.get("controller", 0.0) + offset_s}


def _with_controller_clock(pair: Pair) -> Pair:
    """Return the pair with the controller's clock set by its commanded joints, run by run."""
    traces = traces_of("path", [pair])
    if not traces:
        return pair
    offset, deviation = fitted_offset(traces[0])
    if not np.isfinite(deviation):
        return pair
    return replace(pair, clock_s=_later(pair, offset))
