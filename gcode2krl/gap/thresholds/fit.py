"""Thresholds of fit/: what is known of an effect's numbers and of the noise before the data are looked at."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import DEVELOPMENT, calibrated, convention, physics


@dataclass(frozen=True)
class FitThresholds:
    """What is known of an effect's numbers and of the noise before the data are looked at."""

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
    poses_mostly_frames: float = convention(
        3.0, "a gap of poses this many times the arm's own errors is one of base and tool, which are effects"
    )
    poses_geometry_share: float = convention(
        0.8, "of the error at places left out, what may be left for the geometry to be a cause"
    )
    poses_chance: float = convention(
        0.01, "that one of all signatures explains so much of too few poses by chance: then it is no noise"
    )

    noise_most_lines: int = convention(8, "tones of one signal that are taken off before its noise is learnt")
    noise_false_lines: float = convention(
        1e-3, "chance that a line of noise alone counts as a tone, by an exponential distribution of power"
    )

    # Nuisance
    same_form: float = convention(
        0.98, "share of a nuisance's power that an effect spans: both are then one deviation, judged as one"
    )

    # The slow part of noise
    noise_block_s: float = physics(
        0.05, "blocks of the slow part: half of the shortest memory that counts as slow, 0.1 s"
    )
    noise_most_slow: float = convention(
        2.0, "times the short part's rms: an instrument that wanders by more is a finding, not noise"
    )
    noise_wander_share: float = convention(
        0.2, "of the run that moves most, which each run moves at least: what one run does alone is an event"
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

    # Numbers of effects
    prior_sizes: float = convention(3.0, "the standard deviation of a size's prior, in typical sizes")
    shape_span: float = convention(
        0.8, "of its range: a shape whose 90 % interval is wider was not found, and is not stated"
    )
    number_cost: float = convention(
        0.5, "of two effects that are one to the data the one with fewer numbers is named; as chi2"
    )
    slip_odds: float = convention(
        9.2, "twice log 100, prior odds: slips are gross, and what is slight is another effect; as chi2"
    )
