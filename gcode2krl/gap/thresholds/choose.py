"""Thresholds of choose/: when an effect is accepted and named, and how sure its numbers are."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import (
    DEVELOPMENT,
    ONCE_SCORED,
    WITH_ONCE_SCORED,
    calibrated,
    convention,
    physics,
)


@dataclass(frozen=True)
class ChooseThresholds:
    """When an effect is accepted and named, and how sure its numbers are."""

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
    prune_share: float = convention(
        0.05, "an effect that brings less of the whole gain where it acts is dropped"
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
