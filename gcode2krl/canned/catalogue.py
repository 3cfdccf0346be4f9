"""The canned programs by name: what each separates, and its moves between the reference points."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from gcode2krl.canned.draft import REFERENCES, Draft
from gcode2krl.canned.turning import joint_reversals, tilts

REVERSAL_SPEEDS_MM_S = (5.0, 25.0)
CIRCLE_SPEED_MM_S = 25.0
_STROKES = 3
_STROKE_SHARE = 0.25
"""Of the size: a reversal needs a few millimetres of travel on either side."""
_AWAY = (1.0, 1.0, -1.0)
_CIRCLES = 2
SPINDLE_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Of the largest speed of spindle and tool."""
_SPINDLE_DWELL_S = 20.0
_WARM_DWELL_S = 300.0
_WARM_DWELLS = 6
_LOAD_DWELL_S = 10.0
WEIGHT_N = 200.0
"""Twenty kilograms: bends a large arm by tenths of a millimetre, and one person can hang it."""
_PULLS = (("down", (0.0, 0.0, -1.0)), ("along x", (1.0, 0.0, 0.0)), ("along y", (0.0, 1.0, 0.0)))

Body = Callable[[Draft], None]


@dataclass(frozen=True, kw_only=True)
class CannedProgram:
    """One program."""

    name: str
    separates: str
    """For a person."""
    body: Body
    turns: bool = False
    """Its main part turns the tool, which only the KRL form can say."""
    takes_part: bool = False
    """It runs a G-code that is given."""


def _reversals(draft: Draft) -> None:
    stroke_mm = _STROKE_SHARE * draft.place.size_mm
    draft.spindle(draft.place.idle_rpm)
    for speed_mm_s in REVERSAL_SPEEDS_MM_S:
        for axis, name in enumerate("xyz"):
            draft.say(f"reversals in {name} at {speed_mm_s:g} mm/s")
            away = [_AWAY[number] * stroke_mm if number == axis else 0.0 for number in range(3)]
            for _ in range(_STROKES):
                draft.feed((away[0], away[1], away[2]), speed_mm_s)
                draft.feed((0.0, 0.0, 0.0), speed_mm_s)
    draft.spindle(0.0)


def _circle(draft: Draft) -> None:
    radius_mm = 0.5 * draft.place.size_mm
    draft.spindle(draft.place.idle_rpm)
    draft.say("wide circles, there and back; no stops within")
    draft.lines.append("G64 P0.02")
    x, y, _ = draft.at()
    rate = draft.feed_rate(CIRCLE_SPEED_MM_S)
    for word in ("G2", "G3"):
        draft.lines += [f"{word} X{x:.3f} Y{y:.3f} I{radius_mm:.3f} J0 F{rate:g}"] * _CIRCLES
        draft.stay(1.0)
    draft.lines.append("G61")
    draft.spindle(0.0)


def _weights(draft: Draft) -> None:
    draft.say("spindle off and locked. the robot moves only without weights")
    for number, point in enumerate(REFERENCES, 1):
        draft.go(*(value * draft.place.size_mm for value in point))
        draft.stay(_LOAD_DWELL_S)
        for name, direction in _PULLS:
            draft.halt(f"pose {number}: nothing but {WEIGHT_N:g} N {name} on the tool, go out, start")
            draft.pull(_scaled(direction, WEIGHT_N))
            draft.stay(_LOAD_DWELL_S)
        draft.halt(f"pose {number}: take all weights off, go out, start")
        draft.pull((0.0, 0.0, 0.0))
        draft.stay(_LOAD_DWELL_S)


def _sync(draft: Draft) -> None:
    for _ in range(3):
        draft.gesture()


def _orientation(draft: Draft) -> None:
    draft.say("changed orientation about the reference points: only in the krl form")
    for point in REFERENCES:
        draft.go(*(value * draft.place.size_mm for value in point))
        draft.turn(tilts)


def _repeat(draft: Draft) -> None:
    """Leave room: the program that is run again comes between the reference points."""


def _dwell(draft: Draft) -> None:
    draft.say("at rest, measured again and again")
    for _ in range(_WARM_DWELLS):
        draft.stay(_WARM_DWELL_S)
        draft.references()


def _spindle(draft: Draft) -> None:
    draft.say("spindle off and on in air, at rest")
    draft.stay(_SPINDLE_DWELL_S)
    for share in SPINDLE_SHARES:
        draft.spindle(share * draft.place.most_rpm)
        draft.stay(_SPINDLE_DWELL_S)
        draft.spindle(0.0)
        draft.stay(_SPINDLE_DWELL_S)


def _single_joint(draft: Draft) -> None:
    draft.say("each joint reversed alone: only in the krl form")
    for joint in range(6):
        draft.go()
        draft.turn(partial(joint_reversals, joint))


def _scaled(direction: tuple[float, float, float], size: float) -> tuple[float, float, float]:
    x, y, z = direction
    return size * x, size * y, size * z


PROGRAMS = {
    program.name: program
    for program in (
        CannedProgram(
            name="reversals",
            separates="play, friction and servo lag, by joint and by speed",
            body=_reversals,
        ),
        CannedProgram(
            name="circle",
            separates="an angle of a joint from a frame; errors of the gear from play",
            body=_circle,
        ),
        CannedProgram(
            name="weights",
            separates="stiffness, its limits and hysteresis, by the direction of the load",
            body=_weights,
        ),
        CannedProgram(name="sync", separates="clocks from delays and lag", body=_sync),
        CannedProgram(
            name="orientation",
            separates="errors of the tool from those of base and joints",
            body=_orientation,
            turns=True,
        ),
        CannedProgram(
            name="repeat",
            separates="what comes back from what happened once",
            body=_repeat,
            takes_part=True,
        ),
        CannedProgram(name="dwell", separates="drift with time from steps and from place", body=_dwell),
        CannedProgram(
            name="spindle", separates="what the spindle does from what cutting does", body=_spindle
        ),
        CannedProgram(
            name="single-joint",
            separates="a joint from all others",
            body=_single_joint,
            turns=True,
        ),
    )
}
NAMES = tuple(PROGRAMS)
REPEAT = next(program.name for program in PROGRAMS.values() if program.takes_part)
