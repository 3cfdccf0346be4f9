"""Pairs that the data of a case cannot part: what acts, and all answers that are right.

Every program of the plant holds the tool upright, so an error that is constant in the tool is constant in
the base. Which answers are equal is geometry, not a matter of a method.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Pair:
    """A true effect (`name@target`) and the answers that fit its data as well."""

    effect: str
    answers: tuple[tuple[str, str | None], ...]
    why: str
    apart: tuple[str, ...]  # canned programs that part them


SAME: dict[tuple[str, str | None], tuple[tuple[str, str | None], ...]] = {
    ("mastering", "A1"): (("base_frame", None),),
    ("mastering", "A6"): (("tool_frame", None),),
    ("link_length", "c1"): (("base_frame", None),),
    ("link_length", "c4"): (("tool_frame", None),),
    ("axis_parallelism", "A6"): (("tool_frame", None),),
    ("tracker_drift", None): (("thermal", None),),
}
"""Truth -> what can do the same to every motion of the robot, so that no program parts the two.

A turn or a lift in front of all joints is one of the base, one behind all joints is one of the tool; a
tracker that creeps sees what it would see of a robot that creeps the other way.
"""

PAIRS = {
    "a1_or_base": Pair(
        "mastering@A1",
        (("mastering", "A1"), ("base_frame", None)),
        "turning about A1 is turning the base about the same line",
        ("orientation",),
    ),
    "a6_or_frames": Pair(
        "mastering@A6",
        (("mastering", "A6"), ("tool_frame", None), ("base_frame", None)),
        "at one orientation A6 moves the tip by a vector that is constant but for the turn of A1",
        ("orientation",),
    ),
    "tool_or_base": Pair(
        "tool_frame",
        (("tool_frame", None), ("base_frame", None), ("link_length", "c4")),
        "at one orientation a shift in the tool is a shift in the base",
        ("orientation",),
    ),
    "c1_or_frames": Pair(
        "link_length@c1",
        (("link_length", "c1"), ("link_length", "c4"), ("base_frame", None), ("tool_frame", None)),
        "with the tool upright c1, c4 and the frames' z all lift the tip",
        ("orientation",),
    ),
    "c4_or_frames": Pair(
        "link_length@c4",
        (("link_length", "c1"), ("link_length", "c4"), ("base_frame", None), ("tool_frame", None)),
        "with the tool upright c1, c4 and the frames' z all lift the tip",
        ("orientation",),
    ),
    "arm_or_linked_arm": Pair(
        "stiffness@arm",
        (("stiffness", "arm"), ("stiffness", "linked_arm")),
        "near one pose two springs in a row move the tip alike under the cut's force",
        ("weights",),
    ),
    "linked_arm_or_arm": Pair(
        "stiffness@linked_arm",
        (("stiffness", "linked_arm"), ("stiffness", "arm")),
        "near one pose two springs in a row move the tip alike under the cut's force",
        ("weights",),
    ),
    "weight_or_offset": Pair(
        "tool_weight",
        (("tool_weight", None), ("force_offset", None), ("hose_pack", None)),
        "at one orientation a weight is a constant force in the sensor",
        ("orientation",),
    ),
    "offset_or_weight": Pair(
        "force_offset",
        (("force_offset", None), ("hose_pack", None)),
        "at one orientation the hose's first term is a constant force in the sensor",
        ("orientation",),
    ),
    "thermal_or_tracker_drift": Pair(
        "tracker_drift",
        (("tracker_drift", None), ("thermal", None)),
        "a straight creep over hours is the beginning of any warming",
        ("dwell",),
    ),
    "refraction_or_base": Pair(
        "tracker_refraction",
        (
            ("tracker_refraction", None),
            ("base_frame", None),
            ("tool_frame", None),
            ("link_length", "c1"),
            ("link_length", "c4"),
        ),
        "over a small work the bend of the beam is a lift and a tilt",
        ("circle",),
    ),
}
