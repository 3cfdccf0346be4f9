"""Thresholds of families/: what functions are tried, and when a family forbids a name."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import DEVELOPMENT, calibrated, convention, physics


@dataclass(frozen=True)
class FamilyThresholds:
    """What functions are tried, and when a family forbids a name."""

    # Functions
    rows_hz: float = physics(
        50.0, "rows are averaged down to no less than this rate: modes of an arm end at 25 Hz"
    )
    knots: int = convention(12, "of functions of one input, over its range in all runs")
    lengths: tuple[float, ...] = convention(
        (1.0, 3.0, 9.0), "correlation lengths that are tried, in distances of knots"
    )
    amplitudes: tuple[float, ...] = convention(
        (0.1, 0.4, 1.6, 6.4, 25.6, 102.4), "amplitudes that are tried, in rms of the noise"
    )
    step_s: float = convention(0.5, "between moments at which a step is tried; then a tenth around the best")
    tone_least_hz: float = convention(0.2, "a slower tone is a drift of a short run")
    harmonics: int = physics(4, "of a motor's turn: eccentricity, the two teeth of a wave, and theirs")

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

    # The answer
    least_probability: float = convention(0.05, "a less probable family is not listed")
