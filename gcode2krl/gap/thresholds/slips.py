"""Thresholds of slips/: when a run is taken for one with another set-up."""

from dataclasses import dataclass

from gcode2krl.gap.thresholds.stated import DEVELOPMENT, WITH_ONCE_SCORED, calibrated, convention, physics


@dataclass(frozen=True)
class SlipThresholds:
    """When a set-up slip is looked for, and when it is said."""

    explained_share: float = calibrated(
        0.9, DEVELOPMENT, "share of the gap's power that a slip, simulated again, must take"
    )
    probability: float = convention(
        0.95, "stated for a slip that explains that much of a gap that machines do not have by themselves"
    )
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
