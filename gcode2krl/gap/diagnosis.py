"""The diagnosis: runs beside their predictions, link by link, to one answer.

**What bends the arm where the model of the force fails.** A force that is there bends it; an error of its
sensor does not. With X what the measured force less the predicted one would do to the tip, and r what the tip
does beside its prediction, both less normal mismatch, r = g·X + noise: g is near 1 where the force is there,
and near 0 where it is the sensor's. What is noise of the sensor in X makes g smaller (errors in variables,
Fuller 1987).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gcode2krl.cell import Cell
from gcode2krl.effects import Effect, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue, RefusedError, input_error
from gcode2krl.gap.answer.assembly import answer
from gcode2krl.gap.answer.causes import late_by, with_geometry, with_lateness
from gcode2krl.gap.answer.result import Gap
from gcode2krl.gap.compare.clocks import on_own_timing, with_controller_clocks
from gcode2krl.gap.compare.events import rough_spans, sorted_out, without_hum
from gcode2krl.gap.compare.links import FORCE, MECHANICS, PART, PATH, SERVO, SIGNALS, TIMING
from gcode2krl.gap.compare.pair import Pair, log_pairs, pairs_of
from gcode2krl.gap.compare.trace import Context, Link, Span, Trace, evenly_spread, is_lost, split
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import Nuisance, nuisance_for
from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import question_of, unexplained_by_mismatch
from gcode2krl.gap.posterior.geometry import geometry_of_arm, judge_surface
from gcode2krl.gap.posterior.judgement import Judgement, judge
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.posterior.set_up import examine_set_up
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.prediction import Prediction
from gcode2krl.progress import Begin, unseen
from gcode2krl.runs import Run


def diagnose(
    prediction: Prediction,
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    *,
    effects: Sequence[str | Path | Effect] = (),
    exclude: Sequence[str] = (),
    mismatch: Mismatch | None = None,
    seed: int = 0,
    begin: Begin = unseen,
) -> Gap:
    """Return where runs differ from their prediction, why, and how much is gone with the causes in the model.

    Parameters
    ----------
    runs : measured runs that explain; one whose ``run.toml`` names a prediction is compared with that one.
    holdout : runs that only test; without any, whole runs by turns, of a single run stretches of the path.
    effects : effects besides the library's, or folders of them.
    exclude : names of effects that are no candidates; as normal mismatch they still count.
    mismatch : what is no gap; by default the bounds of `Mismatch`.
    begin : told the name of each stage as it begins.

    Raises
    ------
    NotUnderstoodError
        No run, a run of another program than its prediction's, or a prediction without motion.
    RefusedError
        Nothing can be compared (``nothing-compared``), or positions are in a frame that no slip explains.

    Examples
    --------
    >>> from gcode2krl import Prediction, diagnose, load_run
    >>> gap = diagnose(Prediction.load("prediction"), [load_run("run-1"), load_run("run-2")])
    >>> [(cause.effect, cause.target) for cause in gap.named_causes]
    [('backlash', 'A2')]
    >>> gap.plot("run-1").savefig("gap.png")
    """
    if not runs:
        raise input_error("no-runs", "there is no run to diagnose", "name at least one run folder")
    pairs = tuple(pairs_of(prediction, [*runs, *holdout]))
    known = known_effects(effects)
    return _diagnosed(
        Context(pairs, len(runs), known, mismatch or Mismatch(), frozenset(exclude), seed), begin
    )


def diagnose_log(
    runs: Sequence[Run],
    cell: Cell | None = None,
    holdout: Sequence[Run] = (),
    *,
    effects: Sequence[str | Path | Effect] = (),
    mismatch: Mismatch | None = None,
    seed: int = 0,
    begin: Begin = unseen,
) -> Gap:
    """Return what logs alone tell, without a prediction: servo, gear and, with a known robot, mechanics.

    ``cell`` is the robot's; without one only joint signals are compared. Other parameters and errors as for
    `diagnose`.
    """
    if not runs:
        raise input_error("no-runs", "there is no run to diagnose", "name at least one run folder")
    pairs = tuple(log_pairs([*runs, *holdout], cell))
    without = [run.name for run in (*runs, *holdout) if run.name not in {pair.name for pair in pairs}]
    if without:
        words = f"{', '.join(without)}: no joint angles, so nothing can be compared"
        remedy = "record q1_cmd_deg … and q1_act_deg …, or name the prediction of the program that ran"
        raise RefusedError(Issue("error", "nothing-compared", 0, words, remedy))
    known = known_effects(effects)
    return _diagnosed(Context(pairs, len(runs), known, mismatch or Mismatch(), seed=seed), begin)


def known_effects(extra: Sequence[str | Path | Effect]) -> dict[str, Effect]:
    """Return the library with effects of one's own."""
    known = library([each for each in extra if not isinstance(each, Effect)])
    return known | {each.name: each for each in extra if isinstance(each, Effect)}


def _diagnosed(context: Context, begin: Begin) -> Gap:
    """Return the answer; of poses that many errors of the arm explain, also what is beside these."""
    gap = _answered(context, begin)
    if not gap.links and not gap.causes:
        raise RefusedError(_nothing_compared(gap, context))
    if any(cause.words is not None for cause in gap.named_causes):
        return gap
    tip = next((link for link in gap.links if link.link == MECHANICS.name), None)
    if tip is not None and tip.verdict == "explained":  # one error alone keeps its own name
        return gap
    share_left = tip.rms_after / tip.rms_before if tip is not None and tip.rms_before > 0.0 else 1.0
    arm = geometry_of_arm(context.pairs, context.explaining, share_left)
    if arm is None:
        return gap
    return with_geometry(gap, _answered(context.with_pairs(arm.pairs), begin), arm)


def _answered(context: Context, begin: Begin) -> Gap:
    """Return the answer: slips first, then each link on what earlier ones have shown, then the verdict."""
    begin("slips of the set-up")
    set_up = examine_set_up(context)
    context, slips, issues = set_up.context, set_up.slips, set_up.issues
    if set_up.is_final:
        return answer(context, slips, issues)
    in_no_frame = [issue for issue in issues if issue.code == "run-frame" and issue.severity == "error"]
    if in_no_frame and not slips:
        raise RefusedError(in_no_frame)
    context = with_controller_clocks(context, PATH)
    on_time = context.with_pairs(on_own_timing(pair, SERVO) for pair in context.pairs)
    issues = [*issues, *_of_actual_joints(context, on_time)]
    late = [
        late_by(planned, timed)
        for planned, timed in zip(context.pairs, on_time.pairs, strict=True)
        if planned.has_actual_joints_alone
    ]
    context = _with_data(on_time)
    rough = {link: rough_spans(link.traces(context.pairs, link.base(context))) for link in SIGNALS}
    shares: dict[str, float] = {}
    links = begin("links")
    for count, link in enumerate(SIGNALS):
        links(count, len(SIGNALS))
        traces = link.traces(context.pairs, link.base(context))
        if traces:
            calm = without_hum(sorted_out(traces, _elsewhere(rough, link)))
            judged = evenly_spread(calm)
            shares[link.name] = _rows(judged) / max(1, _rows(calm))
            explain, held = split(judged, context.explaining)
            question = question_of(link, traces, context)
            judgement = judge(link, explain, held, question)
            bends = bends_of(judgement, context)
            shown = shown_at_tip(judged, judgement, bends)
            if shown is not None:
                judgement = judge(link, *split(shown, context.explaining), question)
            context = link.learn(context.with_judgement(judgement), judgement)
            if is_lost(judgement):  # what bends the arm beside the named causes
                context = bent_by(bends_of(judgement, context) if judgement.applied else bends, context)
    begin("part and answer")
    surface = judge_surface(PART, context)
    if surface is not None:
        context = context.with_judgement(surface)
    return with_lateness(answer(context, slips, [*issues, *_of_long_runs(shares)]), late)


def _rows(traces: Sequence[Trace]) -> int:
    return sum(len(trace.time_s) for trace in traces)


def _of_long_runs(shares: Mapping[str, float]) -> list[Issue]:
    """Return a note on the links of which a share of the rows alone was judged."""
    shortened = [f"{link} {share:.0%}" for link, share in shares.items() if share < 1.0]
    words = (
        f"the runs are long: judged are evenly spread windows of {THRESHOLDS.compare.judged_window_s:g} s, "
        f"of the rows of {', '.join(shortened)}; events are sought in all of them"
    )
    return [Issue("note", "run-long", 0, words)] if shortened else []


def _nothing_compared(gap: Gap, context: Context) -> Issue:
    """Return why no link has data: the tables are of other times, or hold nothing that can be compared."""
    for pair in context.pairs:
        run, planned_s = pair.run, pair.inputs.time_s
        for name, table in (("controller", run.controller), ("tracker", run.tracker), ("force", run.force)):
            if table is None or pair.from_log:
                continue
            first, last = float(table.time_s[0]), float(table.time_s[-1])
            if last < planned_s[0] or first > planned_s[-1]:
                words = (
                    f"{pair.name}: {name}: t_s is from {first:.6g} to {last:.6g} s, the prediction from "
                    f"{planned_s[0]:.4g} to {planned_s[-1]:.4g} s: nothing can be compared"
                )
                remedy = f"[clocks] {name}_s in run.toml: what t_s reads where the prediction starts"
                return Issue("error", "nothing-compared", 0, words, remedy)
    needs = "; ".join(f"{each.link}: {each.needs}" for each in gap.not_examined)
    return Issue(
        "error", "nothing-compared", 0, "the runs hold nothing that can be compared", f"record {needs}"
    )


def _of_actual_joints(planned: Context, on_time: Context) -> list[Issue]:
    """Return what logs without commanded joints cost, and which of them leave the planned times."""
    pairs = [(a, b) for a, b in zip(planned.pairs, on_time.pairs, strict=True) if a.has_actual_joints_alone]
    alone = [pair.name for pair, _ in pairs]
    if not alone:
        return []
    late = []
    for pair, timed in pairs:
        largest_s = late_by(pair, timed).largest_s
        if largest_s > 0.0:
            words = (
                f"{pair.name}: by up to {largest_s:.3g} s off the planned times, and compared place by place"
            )
            late.append(
                Issue("warning", "joints-actual-alone", 0, words, "record the commanded joints for a cause")
            )
    words = (
        f"{', '.join(alone)}: no commanded joints: the actual ones are compared with the prediction's, path "
        "and drives as one link (servo); a lag that all axes share is taken for the clock"
    )
    return [Issue("note", "joints-actual-alone", 0, words), *late]


def _elsewhere(rough: Mapping[Link, Mapping[str, Sequence[Span]]], link: Link) -> dict[str, list[Span]]:
    """Return of each run the times at which tables other than a link's own are rough."""
    spans: dict[str, list[Span]] = {}
    for other in (each for each in rough if each.table != link.table):
        for run in rough[other]:
            spans.setdefault(run, []).extend(rough[other][run])
    return spans


def _with_data(context: Context) -> Context:
    """Return the context with the names of the links that have data."""
    traces = {link: link.traces(context.pairs, link.base(context)) for link in SIGNALS}
    links = [link for link in SIGNALS if traces[link]]
    joints = {
        link.name: frozenset.intersection(*(frozenset(trace.components) for trace in traces[link]))
        for link in links
        if link.of_joints
    }
    if any(link.tells_time for link in links):
        links.append(TIMING)
    return replace(context, examined=frozenset(link.name for link in links), joints=joints)


# What bends the arm where the model of the force fails

_SURE = 3.0
"""Standard deviations."""


@dataclass(frozen=True)
class Bend:
    """Runs whose arm the measured force bends, and what the tip says to it."""

    pairs: tuple[Pair, ...]
    gain: float
    """How much of what that would do the tip does."""
    nats: float
    """The evidence of it."""
    sigma: float
    """Of the gain."""

    @property
    def is_seen(self) -> bool:
        """Tell whether the tip does what the force says, and not by chance."""
        return (
            self.nats >= THRESHOLDS.posterior.bend_nats
            and abs(self.gain - 1.0) <= THRESHOLDS.posterior.bend_off
        )

    @property
    def is_denied(self) -> bool:
        """Tell whether the tip surely does not do what the force says: that is the sensor's."""
        return self.gain + _SURE * self.sigma < 1.0 - THRESHOLDS.posterior.bend_off


def bends_of(judged: Judgement, context: Context) -> list[Bend]:
    """Return the arm bent by the measured force, in the cut alone and in air too, where its model may fail.

    Of the force link alone, where it is lost, or what may be noise of its sensor is slow or loud; else none.
    """
    if judged.link is not FORCE or not (is_lost(judged) or _is_doubtful(judged)):
        return []
    base = FORCE.base(context)
    seen, bending = (*base, *judged.applied), (*base, *context.learned)
    bent = [
        tuple(pair.with_measured_load(seen, bending, in_air=in_air) for pair in context.pairs)
        for in_air in (False, True)
    ]
    of_tip = MECHANICS.base(context)
    traces = evenly_spread(MECHANICS.traces(context.pairs, of_tip))
    if not traces or traces[0].still:
        return [Bend(each, 0.0, 0.0, np.inf) for each in bent]
    question = replace(question_of(MECHANICS, traces, context), blocks=())
    nuisance = nuisance_for(traces, question, Signatures())
    bends = []
    for pairs in bent:
        models = {trace.run_number: trace.inputs for trace in MECHANICS.traces(pairs)}
        at_same_rows = [replace(trace, inputs=models[trace.run_number]) for trace in traces]
        bends.append(Bend(pairs, *_followed(traces, at_same_rows, nuisance)))
    return bends


def shown_at_tip(traces: Sequence[Trace], judged: Judgement, bends: Sequence[Bend]) -> list[Trace] | None:
    """Return the traces of a force whose slow or loud noise bends the arm, and so is no noise; else None."""
    if not (bends and _is_doubtful(judged) and any(bend.is_seen for bend in bends)):
        return None
    return [replace(trace, is_shown_at_tip=True) for trace in traces]


def bent_by(bends: Sequence[Bend], context: Context) -> Context:
    """Return the context whose arm the measured force bends, in air too where the tip shows that better.

    Where the tip does not tell, in the cut alone; where it denies the force, the predicted one goes on.
    """
    seen = [bend for bend in bends if bend.is_seen]
    if not seen and (not bends or bends[0].is_denied):
        return context
    return context.with_pairs(max(seen or bends[:1], key=lambda bend: bend.nats).pairs)


def _is_doubtful(judged: Judgement) -> bool:
    """Tell whether the noise has a slow part, or loud rows that its sensor may have had."""
    return judged.size.is_loud or any(noise.slow for noise in judged.examination.noise)


def _followed(
    traces: Sequence[Trace], bent: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]]
) -> tuple[float, float, float]:
    """Return the gain g of r = g·X + noise, its evidence in nats, and its standard deviation.

    ``traces`` are tips beside the predicted load, ``bent`` the same beside the measured one. g by least
    squares, the evidence ½·(|r|² - |r - g·X|²), both over how much more than noise is left.
    """
    ways = [there.nominal - trace.nominal for trace, there in zip(traces, bent, strict=True)]
    if not any(way.any() for way in ways):
        return 0.0, 0.0, np.inf
    columns = [np.ascontiguousarray(way.T)[:, :, None] for way in ways]
    likelihood = Likelihood(traces, nuisance, noise_of(traces, columns, nuisance))
    residuals = [trace.residual for trace in traces]
    r, x = (likelihood.whiten(unexplained_by_mismatch(likelihood, each)) for each in (residuals, ways))
    power = max(float(x @ x), 1e-30)
    gain = float(r @ x) / power
    unexplained = float(np.sum((r - gain * x) ** 2))
    inflation = max(1.0, unexplained / len(r))
    return gain, 0.5 * (float(r @ r) - unexplained) / inflation, float(np.sqrt(inflation / power))
