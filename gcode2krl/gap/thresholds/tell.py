"""Thresholds of tell/: what of an answer is said, and where a gap is said to be."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import convention, physics


@dataclass(frozen=True)
class TellThresholds:
    """What of an answer is said."""

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
