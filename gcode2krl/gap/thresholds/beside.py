"""Thresholds of beside/: when a run counts as the predicted one, and what of it is compared."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import DEVELOPMENT, WITH_ONCE_SCORED, calibrated, convention, physics
from gcode2krl.units import RAD_PER_DEG

MODEL_RAD = 4e-4 * RAD_PER_DEG


@dataclass(frozen=True)
class BesideThresholds:
    """When a run counts as the predicted one, and what of it is compared."""

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
    frequency_peaks: int = convention(4, "peaks of a spectrum at which a tone is tried")
    jumps: int = convention(3, "moments at which an effect that begins at a moment is tried")
    jump_halves_s: tuple[float, ...] = convention(
        (0.3, 1.0), "half of the windows in which a jump is looked for: quick motion, and noise"
    )
    least_jump: float = convention(
        25.0, "log-likelihood ratio of a jump in its window; noise without memory shows one in 10,000 times"
    )

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
    scan_outliers: float = convention(4.0, "robust deviations beyond which a point is left out")
    scan_block_mm: float = convention(
        20.0, "points of one block of the part share what the model of the tip is off by"
    )
    scan_least_points: int = convention(30, "points of walls that are needed")
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
