"""The thresholds of the diagnosis: one frozen table by rooms, each with its reason; in docs/thresholds.md.

A room's thresholds are a frozen dataclass whose fields are made by `physics`, `calibrated` and `convention`:
a value, the reason for it, and what kind of number it is. The weights of probabilities stand in
`probabilities.json`.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from gcode2krl.units import RAD_PER_DEG

_Value = TypeVar("_Value")


class Kind(Enum):
    """Where a threshold comes from."""

    PHYSICS = "physics"
    """A law, an instrument, a standard, or the measured accuracy of a model."""
    CALIBRATED = "calibrated"
    """Chosen by what it does on cases of the independent plant."""
    CONVENTION = "convention"
    """An agreed limit or a setting of the computation: another of its order would serve as well."""


DEVELOPMENT = range(10_000)
"""Seeds of the cases that the diagnosis is developed on (docs/diagnose_check.md)."""
WITH_ONCE_SCORED = range(16_000)
"""Those and 10000-15999, which are calibration cases since their errors were looked at."""

ONCE_SCORED = range(290_000, 554_000)
"""Cases that were scored, told with their figures, and looked at since: none is scored again."""


@dataclass(frozen=True)
class Threshold:
    """A threshold as the table in docs/thresholds.md shows it."""

    room: str
    name: str
    value: Any
    kind: Kind
    reason: str
    seeds: range | None


def physics(value: _Value, reason: str) -> _Value:
    """Return a field whose default follows from a law, an instrument or a standard."""
    return _stated(value, Kind.PHYSICS, reason)


def calibrated(value: _Value, seeds: range, reason: str) -> _Value:
    """Return a field whose default was chosen on the calibration cases of these seeds."""
    return _stated(value, Kind.CALIBRATED, reason, seeds)


def convention(value: _Value, reason: str) -> _Value:
    """Return a field whose default is an agreed limit or a setting of the computation."""
    return _stated(value, Kind.CONVENTION, reason)


def _stated(value: _Value, kind: Kind, reason: str, seeds: range | None = None) -> _Value:
    return field(default=value, metadata={"kind": kind, "reason": reason, "seeds": seeds})


def listed(rooms: Any) -> Iterator[Threshold]:
    """Yield every threshold of a dataclass whose fields are rooms, in their order."""
    for room in fields(rooms):
        thresholds = getattr(rooms, room.name)
        for entry in fields(thresholds):
            yield Threshold(room.name, entry.name, getattr(thresholds, entry.name), **entry.metadata)


MODEL_RAD = 4e-4 * RAD_PER_DEG


@dataclass(frozen=True)
class CompareThresholds:
    """When a run counts as the predicted one, what of it is compared, and when a set-up slip is said."""

    model_rad: float = physics(
        MODEL_RAD,
        "the predicted path agrees with an independent plant to 0.01 mm, 4e-4 degrees at an arm's length",
    )
    progress_off_rad: float = physics(
        2.0 * MODEL_RAD, "twice the accuracy of the predicted joints: less shows no stop along the path"
    )
    progress_off_mm: float = convention(0.5, "a smaller rms of the tip shows no stop along the path")
    progress_step_rad: float = physics(
        1e-4, "shorter ways of the joints are noise of their encoders, not motion"
    )
    progress_step_mm: float = physics(0.5, "shorter ways of the tip are noise of a tracker, not motion")
    trace_least_rows: int = convention(10, "a shorter signal is not examined")
    jump_s: float = physics(
        0.012, "a jump of the force takes a controller cycle; a cutter enters in tenths of a second"
    )
    jump_share: float = calibrated(
        0.1, DEVELOPMENT, "share of the largest force by which it changes in a jump"
    )
    jump_left_out_s: float = calibrated(
        0.02, DEVELOPMENT, "around a jump: removal finds an edge of the cut to a sample"
    )
    joint_moves_rad: float = convention(
        1e-4 * RAD_PER_DEG, "a joint that moves less is at rest and tells nothing"
    )

    clock_reach_s: float = convention(10.0, "largest clock error that is looked for")
    clock_fit_most_s: float = convention(0.5, "largest clock error that is fitted by the rate")
    clock_steps: int = convention(12, "Gauss-Newton steps of a clock")
    clock_settled_s: float = convention(1e-5, "a smaller step ends them")
    clock_large_s: float = calibrated(
        0.025, DEVELOPMENT, "larger offsets are taken off before the effects' linear signatures"
    )
    clock_follows: float = calibrated(
        0.9, DEVELOPMENT, "share of the motion that must follow the prediction at the offset"
    )
    clock_left: float = calibrated(
        0.01,
        DEVELOPMENT,
        "a wrong clock leaves a hundredth of the difference; a wrong time law, taken for one, leaves more",
    )
    clock_nothing: float = convention(1e-7, "share of the signal's variance that is no difference")
    clock_least_rows: int = convention(10, "fewer samples in common give no offset")

    clock_set_share: float = convention(
        0.1, "what remains of the controller's clock mismatch after it was set by the commanded joints"
    )
    clocks_lost: int = calibrated(
        4, DEVELOPMENT, "an instrument's clock is known so many times worse on the run's own timing"
    )
    clocks_of_two: float = convention(2.0, "two clocks are the same within normal mismatch of both")

    stretch_s: float = physics(
        1.0, "longer than an instrument remembers; rows of one stretch stay together in every split"
    )
    stretches_most: int = convention(
        120, "stretches of one run: of more its scatter is known well enough, and their memory grows"
    )
    burst_s: float = convention(0.1, "over which the roughness of a signal tells a burst of its instrument")
    burst_times: float = convention(
        4.0, "times its usual roughness a signal is in a burst; white noise is not in 300,000 rows"
    )
    outlier_deviations: float = convention(
        8.0, "deviations by which a single row beside two that agree is an outlier, of heavy tails too"
    )
    bursts_most: float = convention(
        0.15, "share of a component's rows up to which bursts are left out: more is how the signal is"
    )
    bursty_least: int = calibrated(
        3,
        DEVELOPMENT,
        "bursts from which on a pulse of a tracker or a force sensor is one more: 5 sound links with pulses "
        "had so many, of 46 links with effects and pulses none",
    )
    pulse_around_s: float = convention(0.4, "around a pulse: the level it leaves and comes back to")
    pulse_widths_s: tuple[float, ...] = convention(
        (0.02, 0.05, 0.1), "of pulses that are looked for: blows and snags take 20 to 100 ms"
    )
    pulse_deviations: float = calibrated(
        12.0, DEVELOPMENT, "robust deviations of a pulse; one in 1600 signals of tails, bursts and slow noise"
    )
    event_apart_s: float = convention(0.1, "rough rows that are nearer to each other are one event")
    command_share: float = convention(
        0.1, "of the largest commanded jerk: from here on a signal may be rough in step with it"
    )
    command_lasts_s: float = physics(
        0.15, "after a jerk, a reversal or a jump of the force until servo and arm are calm"
    )
    in_step_p: float = convention(
        0.01, "chance that so many events fall where the command, or another table, changes"
    )
    in_step_least: int = convention(3, "events by which the command tells: two are a coincidence")
    change_level_s: float = convention(0.4, "before and after an event, over which its level is the median")
    change_deviations: float = convention(
        8.0, "robust deviations of that level elsewhere in the run, beyond which a change stays"
    )
    same_place_s: float = convention(0.05, "repeats and tables show one event within this")
    hum_least_rows: int = convention(500, "fewer rows tell no line of a spectrum from its surroundings")
    hum_wander_hz: float = physics(0.1, "a grid keeps its frequency to 20 mHz, its fifth multiple to 0.1")
    hum_around_hz: float = convention(2.0, "beside a line of the mains the level of the noise is looked for")
    hum_beside_hz: float = convention(
        1.0, "a spindle whose speed, or a multiple of it, is as near to the mains hides its hum"
    )
    hum_false: float = convention(1e-3, "chance that noise alone counts as a line of the mains")

    path_on_mm: float = physics(
        0.03, "right on the curve: the predicted path is right to 0.01 mm (docs/diagnose_check.md)"
    )
    path_off_mm: float = calibrated(0.2, WITH_ONCE_SCORED, "a commanded path this far beside is another")
    path_on_decimals: float = convention(2.0, "last decimals of the log that are right on the curve")
    path_off_decimals: float = convention(5.0, "last decimals of the log that are beside it")
    log_most_decimals: int = convention(6, "decimals of a degree that logs are tried for")
    path_mostly: float = calibrated(
        0.8, WITH_ONCE_SCORED, "share of the way on the curve that a frame or tool must give"
    )
    curve_spacing_mm: float = convention(1.0, "longest segment of a curve in the search tree")
    curve_most_points: int = convention(200_000, "points of a curve in the search tree")
    curve_neighbours: int = convention(4, "segments beside which a foot is looked for")
    path_still_mm: float = convention(1e-3, "samples that go no further are at rest")

    fine_step_s: float = physics(0.004, "cycle of a KRC4 under RSI; a blended corner lasts some 5 ms")
    corner_step_s: float = physics(
        0.001, "at 0.2 m/s and 60 m/s2 across a corner of 0.5 mm samples 4 ms apart miss 0.1 mm, these 0.01"
    )
    corner_near_mm: float = convention(
        0.3, "a path that comes by twice passes a corner equally near to within this"
    )
    fine_same_mm: float = convention(
        0.05, "planned anew, a prediction's samples are met to this, or its laws are others"
    )

    holdout_quarters: int = convention(4, "stretches of a single run that are held out in turn")
    holdout_nearly_all: float = calibrated(
        0.75, DEVELOPMENT, "share of the gap in one run from which runs are no longer held out whole"
    )
    holdout_evenly: float = convention(
        0.2, "weight of rows besides the gap's power: those without it belong to a quarter too"
    )
    holdout_least_kept: int = convention(30, "rows that are needed to explain")
    holdout_least_held: int = convention(10, "rows that are needed to test")
    holdout_least_seen: float = calibrated(
        0.1, DEVELOPMENT, "stretches with less of a gap's power cannot tell of it, held out or not"
    )

    load_smooth_s: float = convention(0.05, "the measured force that bends the arm is a mean over this")
    own_model_steps: int = convention(4, "steps that part a controller's own model from its clock")
    rate_step_s: float = convention(1e-3, "half the span of finite differences in time")
    same_path_rad: float = physics(
        2e-5, "0.03 mm at an arm's length: the predicted path and the log's last decimal"
    )

    judged_values: int = convention(
        90_000, "of a link's measured values: of longer runs evenly spread windows are judged"
    )
    judged_window_s: float = convention(2.0, "of such a window: longer than an instrument remembers")
    stepped_windows: int = convention(
        2, "more of these of each run, where the level of the rest changes most: a step is seen in two"
    )
    stepped_times: float = convention(8.0, "the usual change of the level, from which they are judged too")
    remembered_plan_rows: int = convention(150_000, "of the plans of one prediction: some 1.1 kB each")
    remembered_paths: int = convention(64, "commanded paths that are kept")
    remembered_rows: int = convention(200_000, "of these paths together: some 700 bytes each")
    log_ends_s: float = convention(
        0.02, "a log alone may begin in motion: late samples of its first 20 ms have no model"
    )
    clock_difference_s: float = convention(0.004, "span of the finite difference of a signal's clock")

    retime_same_length: float = convention(0.02, "lengths that differ by more are other paths")
    retime_still: float = convention(1e-7, "way for each second of rest, to keep times in order")
    retime_smooth_rows: int = convention(5, "neighbours over which lateness is smoothed")
    retime_negligible_s: float = convention(2e-4, "smaller lateness is left as it is")
    retime_far_s: float = calibrated(
        0.05, DEVELOPMENT, "larger lateness is no matter of small corrections in time"
    )
    retime_rounds: int = convention(3, "rounds of such corrections")
    same_path_share: float = convention(
        0.5, "of the difference at the same time, the most at the same place of a run that is late"
    )
    timing_slow: float = convention(
        0.05, "share of the rms rate below which a sample tells nothing about time"
    )

    scan_reach_mm: float = convention(
        1.0, "a point further from where a floor or a wall should be belongs to neither"
    )
    scan_above_mm: float = convention(0.2, "a tip passes a wall's point at least so far below it")
    scan_inside_mm: float = convention(0.3, "a floor's point lies so far inside the cutter's edge")
    scan_smooth_s: float = convention(0.2, "the tracker's difference from the model is smoothed over this")
    scan_straight: float = convention(1e-6, "a tool axis that turns by less (rad) is one direction")
    scan_least_points: int = convention(30, "points of walls that are needed")

    explained_share: float = calibrated(
        0.9, DEVELOPMENT, "share of the gap's power that a slip, simulated again, must take"
    )

    override_off_percent: float = calibrated(
        5.0, DEVELOPMENT, "an override nearer to 100 % is left to the time laws"
    )
    override_same_length: float = convention(
        0.1, "relative; paths whose lengths differ by more are not compared by their times"
    )
    override_first_tries: tuple[float, ...] = convention(
        (0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1), "times the override by the duration that are simulated first"
    )
    override_widths: tuple[float, ...] = convention(
        (0.02, 0.008, 0.003, 0.001, 4e-4, 1.5e-4), "relative; widths of the search around the best so far"
    )
    still_rad_s: float = convention(1e-3, "joints that move slower are at rest")
    still_mm_s: float = convention(1.0, "a tip that moves slower is at rest")
    motion_step_s: float = convention(0.1, "speeds are taken over so long: no noise of encoders")

    air_share: float = convention(
        0.3,
        "of the tip's error beside the predicted deflection, in each quarter of the cut: where less is left "
        "without it, nothing was cut; an arm of twice the stiffness leaves as much either way",
    )

    force_unit_log: float = calibrated(
        0.15, DEVELOPMENT, "a factor is that of a unit where its logarithm is so near"
    )

    stop_late_s: float = physics(
        0.02, "an exact stop from a slow feed costs some hundredths of a second; time laws agree to 2 ms"
    )
    stop_dropped_delays: int = calibrated(
        4,
        DEVELOPMENT,
        "up to this many of the smallest delays are dropped, one at a time: a last leg may only look late",
    )
    stop_most_corners: float = convention(
        0.5, "where a larger share of the corners is late, it is the time law"
    )
    stop_as_good: float = convention(
        1.1, "of the least rest: fewer stops that leave no more than this are named in place of more"
    )
    stop_explained_share: float = calibrated(
        0.95, DEVELOPMENT, "share of the gap's power that planned stops must take"
    )
    stop_hold_steps: int = convention(4, "steps in which the time of standing is found")
    stop_hold_settled_s: float = convention(1e-3, "a smaller step ends them")

    program_on_share: float = calibrated(
        0.1, WITH_ONCE_SCORED, "share of its way that an edited program keeps to the predicted curve"
    )
    program_off_way_mm: float = calibrated(
        30.0, WITH_ONCE_SCORED, "a stretch beside the curve that is no corner is longer"
    )
    corner_blend_mm: float = physics(
        50.0, "largest approximation distance in KUKA's examples (see the effect `corner`)"
    )
    program_frame_steps: int = convention(8, "steps that bring a path onto the curve as a whole")
    program_frame_share: float = calibrated(
        0.95, WITH_ONCE_SCORED, "share of the way that one frame brings onto the curve where it is a frame"
    )
    program_frame_rows: int = convention(4000, "samples of the path that this is tried with")
    program_corner_rows: int = convention(200, "samples of a stretch that are tried for corners")

    feed_same_curve: float = convention(0.9, "share of the way on the curve from which speeds are compared")
    feed_same_length: float = convention(0.02, "lengths that differ by more are other paths")
    feed_constant: float = convention(0.02, "relative; a speed that changes by less is constant")
    feed_least_s: float = convention(0.05, "shorter stretches of constant speed are not timed")
    feed_edge_share: float = convention(
        0.2, "left out at each end of a stretch: the middle three fifths are timed"
    )
    feed_other: float = calibrated(
        0.05, WITH_ONCE_SCORED, "relative; feeds that differ more from rapids are another program's"
    )
    feed_consistent: float = calibrated(
        0.03, WITH_ONCE_SCORED, "relative; larger scatter of the feeds' ratios says nothing"
    )


@dataclass(frozen=True)
class NoiseThresholds:
    """What is known of noise before the data are looked at."""

    jumps: int = convention(3, "moments at which an effect that begins at a moment is tried")
    jump_halves_s: tuple[float, ...] = convention(
        (0.3, 1.0), "half of the windows in which a jump is looked for: quick motion, and noise"
    )
    least_jump: float = convention(
        25.0, "log-likelihood ratio of a jump in its window; noise without memory shows one in 10,000 times"
    )

    # Noise
    noise_order: int = convention(3, "of the autoregressive model: a drift and an oscillation")
    noise_least_rows: int = convention(60, "fewer rows give no colour: the noise is then taken as white")
    noise_largest_pole: float = convention(0.98, "a model of longer memory than 50 rows is drift, not noise")
    noise_least_scale: float = convention(
        0.3, "of the least rms: what the model leaves unpredicted is never less"
    )
    noise_slow_s: float = calibrated(
        0.5, DEVELOPMENT, "without repeats everything slower may be structure and is no noise"
    )
    noise_least_stated: float = convention(0.9, "of what run.toml states: noise is never taken to be less")
    noise_most_stated: float = convention(
        1.4,
        "times what run.toml states: a data sheet states the best; more than that is a finding, not noise",
    )

    poses_least_again: int = convention(8, "readings of poses visited again from which they tell the noise")
    poses_chance: float = convention(
        0.01, "that one of all signatures explains so much of too few poses by chance: then it is no noise"
    )

    noise_most_lines: int = convention(8, "tones of one signal that are taken off before its noise is learnt")
    noise_false_lines: float = convention(
        1e-3, "chance that a line of noise alone counts as a tone, by an exponential distribution of power"
    )

    # The slow part of noise
    noise_block_s: float = physics(
        0.05, "blocks of the slow part: half of the shortest memory that counts as slow, 0.1 s"
    )
    noise_most_slow: float = convention(
        2.0, "times the short part's rms: an instrument that wanders by more is a finding, not noise"
    )
    noise_slow_gain: float = convention(
        6.0, "twice the log likelihood that a slow part must bring to be in the model"
    )
    noise_second_gain: float = convention(
        12.0, "the same of a second slow part beside the first, whose size few long waves tell"
    )
    noise_as_likely: float = convention(
        2.0,
        "twice the log likelihood by which a longer memory may be behind the best: one and a half deviations",
    )
    noise_most_seen: float = convention(
        1.25, "times the rms of block means: slow noise is no more, of which trends take a part"
    )
    noise_explained: float = calibrated(
        10.5,
        DEVELOPMENT,
        "-log of the probability of the likelihood ratio from which an input, and not slow noise, explains",
    )
    noise_most_explained: int = convention(6, "inputs that take their part of one component's slow noise")
    noise_least_seen: float = convention(
        0.02, "share of an input's power that mismatch leaves, or it explains nothing of its own"
    )


@dataclass(frozen=True)
class ComponentsThresholds:
    """The functions that families are made of."""

    knots: int = convention(12, "of functions of one input, over its range in all runs")
    lengths: tuple[float, ...] = convention(
        (1.0, 3.0, 9.0), "correlation lengths that are tried, in distances of knots"
    )
    harmonics: int = physics(4, "of a motor's turn: eccentricity, the two teeth of a wave, and theirs")


@dataclass(frozen=True)
class PosteriorThresholds:
    """What is known of effects before the data are looked at, and when one is accepted, named or refused."""

    frequency_peaks: int = convention(4, "peaks of a spectrum at which a tone is tried")
    scan_outliers: float = convention(4.0, "robust deviations beyond which a point is left out")
    scan_block_mm: float = convention(
        20.0, "points of one block of the part share what the model of the tip is off by"
    )
    scan_certain: float = convention(4.0, "deviations beyond normal mismatch that make a gap")
    scan_rough_mm: float = convention(1.0, "what is known of a radius or a floor beforehand")
    scan_tip_mm: float = physics(0.003, "the swept surface is known to some micrometres")
    scan_probability: float = convention(
        0.95, "of a diameter that takes `scan_least_shrink` of the scan's gap, or more"
    )
    scan_probability_unsure: float = convention(0.4, "of one that takes less: it is not named")
    scan_least_shrink: float = calibrated(
        0.4, DEVELOPMENT, "share of the scan's gap on points not fitted to, from which a diameter is named"
    )
    poses_mostly_frames: float = convention(
        3.0, "a gap of poses this many times the arm's own errors is one of base and tool, which are effects"
    )
    poses_geometry_share: float = convention(
        0.8, "of the error at places left out, what may be left for the geometry to be a cause"
    )

    # Nuisance
    same_form: float = convention(
        0.98, "share of a nuisance's power that an effect spans: both are then one deviation, judged as one"
    )
    noise_wander_share: float = convention(
        0.2, "of the run that moves most, which each run moves at least: what one run does alone is an event"
    )

    # Numbers of effects
    prior_sizes: float = convention(3.0, "the standard deviation of a size's prior, in typical sizes")
    set_up_sizes: tuple[float, ...] = convention(
        (3.0, 1.0, 0.3),
        "the same of all errors of a set-up together, in typical sizes: the one with most evidence is taken",
    )
    shape_span: float = convention(
        0.8, "of its range: a shape whose 90 % interval is wider was not found, and is not stated"
    )
    number_cost: float = convention(
        0.5, "of two effects that are one to the data the one with fewer numbers is named; as chi2"
    )
    slip_odds: float = convention(
        9.2, "twice log 100, prior odds: slips are gross, and what is slight is another effect; as chi2"
    )

    # Functions
    rows_hz: float = physics(
        50.0, "rows are averaged down to no less than this rate: modes of an arm end at 25 Hz"
    )
    amplitudes: tuple[float, ...] = convention(
        (0.1, 0.4, 1.6, 6.4, 25.6, 102.4), "amplitudes that are tried, in rms of the noise"
    )
    step_s: float = convention(0.5, "between moments at which a step is tried; then a tenth around the best")
    tone_least_hz: float = convention(0.2, "a slower tone is a drift of a short run")

    # Null
    flips: int = convention(200, "random signs of stretches: p of half a percent can be told")
    moves: int = convention(100, "of each run in time: their mean and deviation are known to a tenth")
    significant_p: float = convention(0.01, "a family explains some of the rest from this p on")
    least_evidence: float = convention(4.6, "log 100: less evidence, over its inflation, is none")

    gap_p: float = convention(
        1e-3, "of the best family by the distribution of the largest over flips: five links, one run in 200"
    )
    gap_evidence: float = calibrated(
        23.0, DEVELOPMENT, "log 1e10, over the inflation: tones at 1.3 times the noise have 60 and more"
    )

    certain_evidence: float = calibrated(
        200.0,
        DEVELOPMENT,
        "nats over the inflation whatever the flips: in few stretches sound links have 80; and nats alone of "
        "what runs moved in time do not have: by the force sound links have 34 and 101",
    )

    excursion_widths_s: tuple[float, ...] = convention(
        (0.1, 0.14, 0.2, 0.28, 0.4),
        "over which what goes one way is no noise of an instrument: what lasts longer its wander imitates",
    )
    form_error: float = convention(
        0.01, "of its amplitude: no form of an effect, and no robot, is known better; less is no gap"
    )

    # Names
    form_ratio: float = calibrated(
        0.85,
        DEVELOPMENT,
        "of what its own family takes, which the form of a named cause takes at least: right names took 0.95 "
        "and more, another form of wear among them",
    )
    small_errors: float = calibrated(
        0.01,
        DEVELOPMENT,
        "of the power that a base frame takes, what small errors of tool and mastering beside it may: three "
        "to six at once left up to 0.006, unknowns of the same kind 0.02 and more",
    )
    other_share: float = calibrated(
        0.05,
        DEVELOPMENT,
        "of the gap's power: what another family may take beside a named cause; right names leave up to "
        "0.03, imitations 0.1 to 0.8",
    )
    other_power: float = calibrated(
        0.03,
        DEVELOPMENT,
        "of the power in the signal: beside a drift that was a step 0.05 to 0.17 are left, beside the right "
        "clock of a recorded robot 0.013",
    )
    alike_nats: float = convention(
        4.6, "log 100: data that favour one of two families by less do not tell them apart"
    )

    ahead_share: float = calibrated(
        0.02,
        DEVELOPMENT,
        "of its evidence: a family that contains another is told before it from so much more on; beside a "
        "right mastering of A1 a smooth function was ahead of a constant by 0.0003",
    )

    time_ahead_share: float = calibrated(
        0.1,
        DEVELOPMENT,
        "the same of what each run has over time, which fits any input of a slow motion: smooth loops of a "
        "torque were behind it by 0.05",
    )

    # Candidates
    false_alarms: float = convention(
        1e-3, "of each link; five links together stay below one run in a hundred without an effect"
    )
    least_ratio: float = calibrated(
        0.08,
        DEVELOPMENT,
        "share of the noise, nuisance taken out; models of sound machines differ by less",
    )
    reach: float = convention(
        0.02, "share of its range by which a coefficient may be beyond it: it is the first order of an effect"
    )
    bent_reach: float = convention(1.0, "the same of an effect that is not proportional to its size")
    bend_nats: float = calibrated(
        20.0, DEVELOPMENT, "evidence from which the tip does what the measured force says"
    )
    bend_off: float = calibrated(
        0.5,
        DEVELOPMENT,
        "so far from 1 may be how much of it the tip does; of a sensor's error it does none",
    )
    most_causes: int = convention(4, "effects that are accepted in one link")
    most_effects: int = convention(8, "those and effects within normal mismatch")
    most_tried: int = convention(12, "candidates whose gain is judged by its scatter over stretches of time")
    shortlist: int = convention(5, "effects that are refitted in one round, beside those that plan anew")
    close_share: float = calibrated(
        0.15, DEVELOPMENT, "rivals within this share of the best linear gain are refitted too"
    )
    close_gain: float = calibrated(12.0, DEVELOPMENT, "rivals within this gain of the best are refitted too")
    bent_share: float = calibrated(
        0.4,
        DEVELOPMENT,
        "an effect not proportional to its size is refitted from this share of the best linear gain on",
    )
    hopeless: float = calibrated(
        3.0, DEVELOPMENT, "an effect that plans anew and leaves more times the best chi2 is not searched for"
    )
    behind_share: float = calibrated(
        0.2, DEVELOPMENT, "a refit behind the best by this share of its gain after three steps is given up"
    )

    # Acceptance
    left_out_groups: int = convention(
        4, "groups of stretches that are left out in turn when an effect is tested"
    )
    counted_share: float = convention(
        0.05, "of a cause's gain, what another brings that makes its name less sure: smaller ones are details"
    )
    quieter_noise: float = calibrated(
        0.7, DEVELOPMENT, "noise with less of its power beside the causes is learnt anew"
    )
    mismatch_slack: float = convention(1.15, "bounds of normal mismatch are round numbers")
    mismatch_deviations: float = convention(
        1.0, "standard deviations by which an effect's number may be beyond normal mismatch"
    )

    least_part: float = convention(
        0.02, "of what an effect does: a part of the data with less of it does not tell its size"
    )
    most_inconstant: float = calibrated(
        0.2,
        WITH_ONCE_SCORED,
        "spread of a size over runs, halves and joints: of 268 right names 2 had more, other forms by chance",
    )
    inconstant_p: float = convention(0.001, "a spread that chance makes more often than this is none")
    minor_chi2: float = convention(
        6.6, "fall of chi2 over its inflation, one in a hundred by chance: less does not show a minor number"
    )

    # Size of the gap
    significant_sigma: float = convention(
        4.0,
        "excess power over its own standard deviation; one in 30,000 by chance, by fewer stretches as many "
        "deviations as are as rare",
    )
    modelled_freedom: float = convention(
        10.0, "degrees of freedom that the scatter by the noise's model has beside that between stretches"
    )
    least_spread: float = convention(
        0.1, "of the mean over the root of the count: the least standard deviation of a mean square"
    )
    model_off: float = convention(
        2.0,
        "times the accuracy of a model without noise: a moment that is further off is a gap, however short",
    )
    model_off_rows: int = convention(3, "such moments of all runs: fewer are bad rows of a log")
    loud_p: float = convention(1e-3, "chance that so many loud events fall where the command changes")
    named_left: float = calibrated(
        0.25,
        ONCE_SCORED,
        "of the gap, what named causes may leave on data not used: of 177 right names two left more, of 51 "
        "wrong ones nine",
    )
    follows_share: float = calibrated(
        0.3,
        ONCE_SCORED,
        "of a cause's power, what follows an unnamed gap of a link before it where it is none of its own",
    )
    rough_joint: float = convention(
        0.5, "of its noise's power, what one joint has more than most: heavy tails of 1,000 rows have a fifth"
    )
    loud_share: float = calibrated(
        0.25,
        range(20_000, 21_000),
        "power of loud moments in step with the command over that of the noise beyond which it is a gap: the "
        "sampling of corners leaves up to .03, at the tip behind late commands .14, a brake that settles 1.1",
    )
    observable_share: float = convention(
        0.02, "an effect whose power nuisance leaves less of is not observable in that link"
    )

    # Rivals and probability
    temperature: float = calibrated(
        3.0, DEVELOPMENT, "divides differences of chi2: neither noise nor effects are exactly as modelled"
    )
    alike_chi2: float = convention(
        9.2, "twice log 100: data that favour one of two effects by less do not tell them apart"
    )
    most_rivals: int = convention(8, "effects that are refitted in place of a cause")
    rival_share: float = calibrated(
        0.25, DEVELOPMENT, "a rival whose linear gain is lower by more of the cause's is not refitted"
    )
    bent_rival_share: float = calibrated(
        0.7, DEVELOPMENT, "the same of a rival that is not proportional to its size"
    )
    twin_share: float = convention(
        0.8, "of what an effect does while it is small: a candidate that does as much then is refitted"
    )
    most_twins: int = convention(3, "of those that are refitted beside an effect, the nearest first")
    rival_gain: float = calibrated(15.0, DEVELOPMENT, "a rival within this gain of the cause is refitted")
    place_odds: float = calibrated(
        7.0,
        ONCE_SCORED,
        "times the odds that a family is right, those that its place is: of 75 families below .3 the place "
        "of 34 was right, of 191 above that of 180",
    )
    most_alike_families: int = convention(
        2, "families that are declared beside the best one: a set of more than three tells nothing"
    )
    least_unknown: float = convention(0.02, "no probability is nearer to 0 or 1: nothing is certain")

    # Naming
    named: float = convention(0.5, "probability from which on a cause is named")
    together_share: float = convention(
        0.5, "of an effect's data: from here on it acts where the effects before it do"
    )

    # Intervals, as half-widths of 90 %
    model_error: float = calibrated(
        0.03, DEVELOPMENT, "share of a number that the models of effects are off by, whatever the noise"
    )
    law_error: float = calibrated(0.1, DEVELOPMENT, "the same of effects that plan anew")
    inside_bound: float = physics(0.9, "nine in ten of a uniform draw are within this share of its bound")
    least_stretches: int = convention(
        8, "fewer stretches of time cannot tell how scores scatter between them"
    )

    # Clocks that are set before the effects are looked at
    clock_most_s: float = convention(0.02, "larger clock errors of single runs are found by other means")

    # The next run
    settled: float = convention(0.8, "probability from which on a cause without a rival alike is not open")
    least_open: float = convention(0.05, "probability below which an answer is not worth a run")
    most_open_pairs: int = convention(4, "pairs that programs are compared for, the most open first")
    widest_ways: int = convention(
        2, "directions in which an answer's numbers are known least, that a program is judged along too"
    )
    most_log_odds: float = convention(
        6.9, "log 1000: higher odds are not told, as noise is not exactly as learnt"
    )
    enough_nats: float = convention(
        100.0, "log odds beyond which no program is better than another: real runs part less than is expected"
    )
    nearly_best: float = convention(0.1, "programs within this share of the best mean log odds: the shortest")
    told_change: float = convention(
        0.5, "of the largest difference of two answers: from here on their change since the start is told"
    )
    trial_step_s: float = convention(
        0.25, "between values of a program that count as independent; noise forgets within it or counts less"
    )
    trial_rows: int = convention(400, "values of a program at most, so that long ones do not win by length")
    path_off_rad: float = physics(
        3e-3, "a commanded path further off, 5 mm at an arm's length, cannot be caused by a servo or a gear"
    )
    tracker_off_mm: float = physics(
        20.0, "a tip further off cannot be caused by a robot: uncalibrated ones are off by 3 mm"
    )
    frame_turn_rad: float = physics(1e-4, "0.01 mm over 100 mm: a frame turned by less is a shift")
    kabsch_rotation: float = convention(
        1e-3, "the rotation that fits tips is taken where no element differs more from that of the poses"
    )
    frame_fit_steps: int = convention(3, "Gauss-Newton steps of another base and the clock")


@dataclass(frozen=True)
class AnswerThresholds:
    """What of an answer is said."""

    # The answer
    least_probability: float = convention(0.05, "a less probable family is not listed")
    slip_probability: float = convention(
        0.95, "stated for a slip that explains that much of a gap that machines do not have by themselves"
    )

    most_letters: int = convention(240, "of the first sentence in the short form of an answer")
    most_shown: int = convention(12, "causes that a notebook lists")
    most_alike: int = convention(5, "effects that a cause lists as indistinguishable from it")
    timing_share: float = convention(
        0.5, "a gap of the path with more of its power along the motion is one of timing"
    )
    after_event_s: float = physics(
        0.3,
        "a gap this soon after a reversal, an entry or an exit belongs to it: modes of 7 Hz have died down",
    )
    same_interval_s: float = convention(0.2, "intervals that are nearer to each other are one")
    smooth_s: float = convention(
        0.1, "the size of a gap at a time is its rms over this; labels of the check use it too"
    )
    rest_smooth_s: float = convention(
        0.3,
        "what is left without a cause is averaged over this, and shorter stretches are noise: the mean of "
        "noise with a memory of 45 ms then is a third of it",
    )
    joint_moves_rad: float = convention(1e-4, "a joint that moves less never reverses")
    joint_least_share: float = convention(0.01, "joints with less of the gap's power are left out")
    band_low: float = convention(0.1, "share of the power below the band of a gap")
    band_high: float = convention(0.9, "share of the power up to the band's upper end")
    phase_named_share: float = convention(
        0.5, "a phase with less of the gap's power is not in the first sentence"
    )
    geometry_probability: float = convention(
        0.95,
        "of the arm's own geometry, where it takes a fifth and more of the error at places left out of its "
        "fit: no calibration has such cases",
    )
    report_lines: int = convention(8, "intervals, and causes, that the report prints")
    worst_run: float = convention(
        1.25, "a run whose gap is this many times that of all runs is named; nearer sizes are told as one"
    )
    headline_causes: int = convention(3, "causes in the first sentence")
    headline_numbers: int = convention(4, "a cause with more numbers is without them in the first sentence")
    phase_over_rest: float = convention(
        1.5, "a phase is where a gap is if its rms there is this many times that of the other phases"
    )
    in_ms_below_s: float = convention(0.1, "shorter times are written in milliseconds")
    worth_a_word: float = convention(0.1, "a cause without a name is in the first sentence from here on")
    most_of_a_gap: float = convention(0.8, "the report prints the worst stretches until they hold this share")
    form_fits_well: float = convention(
        0.9, "a form that takes a smaller share of what its family takes is said to fit badly"
    )
    constant_least_p: float = convention(0.05, "a size less likely to be one number is said to vary")
    seen_sigma: float = convention(
        2.0, "standard deviations of a mean at a reference point: less is told as nothing"
    )
    parted_odds: float = convention(3.0, "expected odds below which a program is said to part nothing")
    moments_share: float = convention(
        0.05, "of the time: what has half of its power in less is told with the moment of its largest"
    )
    swing_s: float = convention(
        0.025, "two cycles of an interpolator: what swings to and fro so quickly has its moment between"
    )
    impulse_probability: float = convention(
        0.95, "of an impulse that no noise makes, that it is what happened at its place"
    )
    same_moment_s: float = convention(
        0.2, "an impulse and a step that are nearer to each other are one event"
    )
    course_points: int = convention(7, "points at most of how a deviation goes over its input")
    most_bursts: int = convention(3, "bursts of one run whose moments a finding lists")
    same_reading: float = convention(1.05, "two readings of a noise that are nearer to each other are one")
    coarse_steps: float = convention(2.0, "times the noise: readings in such steps are a finding")
    minutes_from_s: float = convention(100.0, "times from here on are told in minutes")


@dataclass(frozen=True)
class Thresholds:
    """Every number that decides an answer, by the room that uses it."""

    compare: CompareThresholds = field(default_factory=CompareThresholds)
    noise: NoiseThresholds = field(default_factory=NoiseThresholds)
    components: ComponentsThresholds = field(default_factory=ComponentsThresholds)
    posterior: PosteriorThresholds = field(default_factory=PosteriorThresholds)
    answer: AnswerThresholds = field(default_factory=AnswerThresholds)


THRESHOLDS = Thresholds()


TABLE = Path(__file__).with_name("probabilities.json")
"""Written by ``benchmarks/blind/calibrate.py``."""


@cache
def stated_table() -> dict[str, Any]:
    """Return the table of the package."""
    table: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


@cache
def declared_nats() -> float:
    """Return by how much an effect may be worse than a cause and still belong to its declared set, in nats.

    The conformal quantile: of cases of the plant with whole effects left out, 95 % of the truths were nearer
    (Vovk, Gammerman & Shafer 2005); at least what the data cannot tell by convention, `alike_chi2`.
    """
    return float(stated_table()["alike_nats"])
