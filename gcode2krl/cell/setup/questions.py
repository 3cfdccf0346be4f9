"""What a person is asked about a cell, in order: each question with the place where the smartPAD shows it.

Menus are those of KUKA System Software 8.x, from memory; versions name some of them differently, and newer
ones have tools and bases under *Start-up > Tool/base management*.

A question is data; `answers` checks what is answered, `cell_text` writes it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gcode2krl.cell import library
from gcode2krl.cell.setup.controller import ArchivedController, NamedFrame, Payload, robots_of_lengths

Answers = Mapping[str, Any]
"""Key of a question → its answer; ``tools`` is a list of such tables."""
Choice = tuple[str, str]
"""A value, and the words beside it in a list."""
Kind = Literal["choice", "text", "name", "number", "whole", "numbers"]
OTHER = "other"
FILE = "file"
LENGTHS_PICTURE = """
        A1 0, A2 -90, A3 90: link arm upright, forearm level

              A3 o- - - - - - - - - - - - - - - - - - - - - -
             |   |\\  a2: axis 4 is so much BELOW A3
          c2 |   | o----------------- o A5 ------------|flange
             |   |        c3                  c4
             |A2 o- - -
          c1 |  /     A1 to A2: a1 forward, c1 up from the floor it stands on
             | /  a1
        =====A1=====
"""
"""Which length is which, for a terminal; docs/own_cell.md has it too."""
UNKNOWN = "unknown"
_TOOL_MENU = "Start-up > Calibrate > Tool > Numeric input"
_OUTPUTS = "Display > Inputs/outputs > Digital I/O"
_FRAME = "X Y Z in mm, A B C in degrees"


def _always(answers: Answers) -> bool:
    return True


def _nothing(controller: ArchivedController, answers: Answers) -> Any:
    return None


@dataclass(frozen=True)
class CellQuestion:
    """A question, asked if ``when`` holds; an empty answer leaves the key out unless it is ``needed``."""

    key: str
    text: str
    where: str
    kind: Kind
    example: Any
    cell_key: str = ""
    """Dotted key of the cell whose possible range the answer must keep."""
    count: int = 1
    needed: bool = False
    of_archive: bool = False
    """Asked at a terminal only where the archive has something to choose from."""
    when: Callable[[Answers], bool] = _always
    choices: Callable[[ArchivedController], list[Choice]] | None = None
    proposal: Callable[[ArchivedController, Answers], Any] = _nothing
    """What the controller's archive states."""
    picture: str = ""


def _is(key: str, *values: Any) -> Callable[[Answers], bool]:
    return lambda answers: answers.get(key) in values


def _states(key: str) -> Callable[[Answers], bool]:
    return lambda answers: bool(answers.get(key))


def _choices(*pairs: Choice) -> Callable[[ArchivedController], list[Choice]]:
    return lambda controller: list(pairs)


# --- what an archive proposes -----------------------------------------------------------------------------


def _entry(frames: tuple[NamedFrame, ...], number: Any) -> list[float] | None:
    return next((list(one.frame) for one in frames if one.number == number), None)


def _only(frames: tuple[NamedFrame, ...]) -> int | None:
    return frames[0].number if len(frames) == 1 else None


def _robots(controller: ArchivedController) -> list[Choice]:
    """Return the robots that can be it: an archive of another arm is no archive of this robot."""
    listed = [(name, "") for name in robots_of_lengths(controller.lengths_mm)]
    where = "those of the file" if controller.is_description else "those of the archive"
    whose = where if controller.lengths_mm else "from its data sheet, with a picture"
    unlisted = [
        (OTHER, f"not in this list: lengths and limits, {whose}"),
        (FILE, "a robot file of yours, my.toml"),
    ]
    return [*listed, *unlisted]


def _robot(controller: ArchivedController, answers: Answers) -> str | None:
    return controller.model or (OTHER if controller.lengths_mm else None)


def _lacks_limits(answers: Answers) -> bool:
    """Tell whether the robot is one whose joint limits the library does not know."""
    robot = str(answers.get("robot"))
    return robot == OTHER or (
        robot in library.names("robots")
        and "q_deg" not in library.read_model("robots", robot).get("limits", {})
    )


def _limits(controller: ArchivedController, answers: Answers) -> list[float] | None:
    return [limit for pair in controller.limits_deg for limit in pair] if controller.limits_deg else None


def _mounting(controller: ArchivedController, answers: Answers) -> str | None:
    if controller.robroot is None:
        return None
    return OTHER if any(controller.robroot) else "floor"


def _home(controller: ArchivedController, answers: Answers) -> list[float] | None:
    return list(controller.home_deg) if controller.home_deg else None


def _payload(controller: ArchivedController, answers: Answers) -> Payload | None:
    """Return the load of the tool that the answers name, or the only load."""
    loads = controller.loads or {}
    numbers = [answers.get("reference_number"), *(tool.get("data") for tool in answers.get("tools", ()))]
    named = [loads[number] for number in numbers if number in loads]
    return named[0] if named else (next(iter(loads.values())) if len(loads) == 1 else None)


def _mass(controller: ArchivedController, answers: Answers) -> float | None:
    load = _payload(controller, answers)
    return load.mass_kg if load else None


def _centre(controller: ArchivedController, answers: Answers) -> list[float] | None:
    load = _payload(controller, answers)
    return list(load.centre_mm) if load else None


def _inertia(controller: ArchivedController, answers: Answers) -> list[float] | None:
    load = _payload(controller, answers)
    return list(load.inertia_kgm2) if load and load.inertia_kgm2 else None


_AXES = _choices(
    ("+z", "jog Z+ and the tool leaves the work"),
    ("-z", "jog Z- and the tool leaves the work"),
    ("+x", "jog X+ and the tool leaves the work"),
    ("-x", "jog X- and the tool leaves the work"),
    ("+y", "jog Y+ and the tool leaves the work"),
    ("-y", "jog Y- and the tool leaves the work"),
)
_AXIS_PLACE = "jog with TOOL as the coordinate system: which direction pulls the tool out of the work?"

# --- the questions ----------------------------------------------------------------------------------------

PLACE_QUESTIONS = (
    CellQuestion("name", "What is the cell called?", "yours to choose", "name", "Milling cell 2"),
    CellQuestion(
        "robot",
        "Which robot is it?",
        "Help > Info > Robot, and the plate on the arm",
        "choice",
        "KR 16-2",
        needed=True,
        choices=_robots,
        proposal=_robot,
    ),
    CellQuestion(
        "robot_file",
        "Name of the robot file, from the cell file's folder",
        "yours, laid out like those of `gcode2krl models show`",
        "text",
        "my.toml",
        needed=True,
        when=_is("robot", FILE),
    ),
    CellQuestion(
        "robot_name",
        "What is the robot called?",
        "the plate on the arm",
        "name",
        "KR 120 R3900 K",
        when=_is("robot", OTHER),
        proposal=lambda controller, _: controller.name or None,
    ),
    CellQuestion(
        "lengths_mm",
        "a1 a2 c1 c2 c3 c4 in mm; a2 is negative where axis 4 lies above A3",
        "the dimensioned drawing on the data sheet",
        "numbers",
        [350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0],
        "robot.geometry",
        6,
        needed=True,
        when=_is("robot", OTHER),
        proposal=lambda controller, _: list(controller.lengths_mm) if controller.lengths_mm else None,
        picture=LENGTHS_PICTURE,
    ),
    CellQuestion(
        "reach_mm",
        "Maximum reach in mm, which the lengths are checked with",
        "the data sheet; the number behind R in the name is near it",
        "number",
        2496.0,
        "robot.payload.reach_mm",
        when=_is("robot", OTHER),
    ),
    CellQuestion(
        "payload_kg",
        "Rated payload in kg",
        "the data sheet; the number behind KR in the name",
        "number",
        300.0,
        "robot.payload.mass_kg",
        when=_is("robot", OTHER),
    ),
    CellQuestion(
        "speeds_deg_s",
        "Largest speeds of A1 to A6 in degrees a second",
        "the data sheet",
        "numbers",
        [105.0, 101.0, 107.0, 122.0, 113.0, 175.0],
        "robot.speeds.qd_deg_s",
        6,
        when=_is("robot", OTHER),
        proposal=lambda controller, _: list(controller.speeds_deg_s) if controller.speeds_deg_s else None,
    ),
    CellQuestion(
        "limits_deg",
        "Joint limits in degrees: low and high of A1, then of A2 to A6",
        "Start-up > Service > Software limit switch",
        "numbers",
        [-185.0, 185.0, -140.0, -5.0, -120.0, 155.0, -350.0, 350.0, -125.0, 125.0, -350.0, 350.0],
        "robot.limits.q_deg",
        12,
        when=_lacks_limits,
        proposal=_limits,
    ),
    CellQuestion(
        "kss",
        "Which KUKA System Software does the controller run?",
        "Help > Info",
        "choice",
        "8.6",
        choices=_choices(
            (UNKNOWN, "KSS 8.x is assumed, and each program says so"),
            *((kss, "") for kss in ("8.3", "8.5", "8.6", "8.7")),
            ("iiqka", "no program is written for it"),
        ),
        proposal=lambda controller, _: controller.kss or UNKNOWN,
    ),
    CellQuestion(
        "mounting",
        "How is it mounted?",
        "Display > Variable > Single, $ROBROOT: all zero is floor",
        "choice",
        "floor",
        needed=True,
        choices=_choices(
            ("floor", "upright at the origin of WORLD: $ROBROOT is zero"),
            (OTHER, "hangs, on a slope, on a pedestal: $ROBROOT is not zero"),
        ),
        proposal=_mounting,
    ),
    CellQuestion(
        "robroot",
        f"$ROBROOT: {_FRAME}",
        "Display > Variable > Single, $ROBROOT",
        "numbers",
        [0.0, 0.0, 3200.0, 0.0, 0.0, 180.0],
        "frames.robroot",
        6,
        when=_is("mounting", OTHER),
        proposal=lambda controller, _: list(controller.robroot) if controller.robroot else None,
    ),
    CellQuestion(
        "home",
        "HOME: A1 to A6 in degrees",
        "Display > Actual position > Axis-specific, with the robot at HOME",
        "numbers",
        [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
        "home.q_deg",
        6,
        proposal=_home,
    ),
    CellQuestion(
        "base_number",
        "Number of the base in which the work lies; 0: the program writes $BASE itself",
        "Start-up > Calibrate > Base, or Display > Actual position",
        "whole",
        3,
        "frames.base_data",
        choices=lambda controller: [(str(one.number), one.text()) for one in controller.bases],
        proposal=lambda controller, _: _only(controller.bases),
    ),
    CellQuestion(
        "base",
        f"That base: {_FRAME}",
        "Start-up > Calibrate > Base > Numeric input",
        "numbers",
        [1450.0, 20.0, 700.0, 0.0, 0.0, 0.0],
        "frames.base",
        6,
        proposal=lambda controller, answers: _entry(controller.bases, answers.get("base_number")),
    ),
    CellQuestion(
        "clearance_mm",
        "Height in that base above which the robot can go anywhere over the work, in mm",
        "jog the tip above clamps and probes, then Display > Actual position > Cartesian, with this base",
        "number",
        150.0,
        "clearance.z_mm",
    ),
    CellQuestion(
        "table_mm",
        "Height of the table in that base, in mm; empty: not checked",
        "touch the table with the tip, then Display > Actual position > Cartesian, with this base",
        "number",
        -38.0,
        "table.z_mm",
    ),
)
"""Robot, HOME, base and planes."""

REFERENCE_QUESTIONS = (
    CellQuestion(
        "tools_by",
        "How are the tools measured?",
        "Start-up > Calibrate > Tool: one entry, or one for each cutter",
        "choice",
        "number",
        needed=True,
        choices=_choices(
            ("number", "each cutter has a TOOL_DATA number of its own"),
            ("length", "one tool was measured; the others differ from it by their length"),
        ),
    ),
    CellQuestion(
        "reference_number",
        "TOOL_DATA number of the tool that was measured",
        _TOOL_MENU,
        "whole",
        1,
        "tool.1.tool_data",
        of_archive=True,
        when=_is("tools_by", "length"),
        choices=lambda controller: [(str(one.number), one.text()) for one in controller.tools],
        proposal=lambda controller, _: _only(controller.tools),
    ),
    CellQuestion(
        "reference_frame",
        f"Its frame: {_FRAME}",
        _TOOL_MENU,
        "numbers",
        [250.0, 0.0, 250.0, 0.0, -90.0, 0.0],
        "frames.tool",
        6,
        when=_is("tools_by", "length"),
        proposal=lambda controller, answers: _entry(controller.tools, answers.get("reference_number")),
    ),
    CellQuestion(
        "reference_axis",
        "Which axis of that frame points from the tip to the holder?",
        _AXIS_PLACE,
        "choice",
        "+z",
        needed=True,
        when=_is("tools_by", "length"),
        choices=_AXES,
    ),
    CellQuestion(
        "reference_length_mm",
        "Length of the tool that was measured, from the spindle's gauge line to the tip, in mm",
        "tool presetter, or a height gauge",
        "number",
        100.0,
        "frames.tool_length_mm",
        when=_is("tools_by", "length"),
    ),
)
"""How the tools are measured."""

TOOL_QUESTIONS = (
    CellQuestion(
        "number", "Tool number, T of the G-code", "the CAM's tool list", "whole", 1, "tool.1", needed=True
    ),
    CellQuestion(
        "model",
        "Which cutter is it?",
        "the CAM's tool list",
        "choice",
        "flat 16 z3",
        needed=True,
        choices=lambda _: [*((name, "") for name in library.names("tools")), (OTHER, "another one")],
    ),
    CellQuestion(
        "kind",
        "Its shape",
        "the CAM's tool list",
        "choice",
        "flat",
        needed=True,
        when=_is("model", OTHER),
        choices=_choices(("flat", ""), ("bull-nose", ""), ("ball", ""), ("tapered", ""), ("drill", "")),
    ),
    CellQuestion(
        "diameter_mm",
        "Its diameter in mm",
        "the cutter's shank or catalogue",
        "number",
        10.0,
        "tool.1.diameter_mm",
        needed=True,
        when=_is("model", OTHER),
    ),
    CellQuestion(
        "teeth",
        "Its number of teeth",
        "the cutter",
        "whole",
        3,
        "tool.1.teeth",
        needed=True,
        when=_is("model", OTHER),
    ),
    CellQuestion(
        "corner_radius_mm",
        "Its corner radius in mm",
        "the cutter's catalogue",
        "number",
        1.0,
        "tool.1.corner_radius_mm",
        needed=True,
        when=_is("kind", "bull-nose"),
    ),
    CellQuestion(
        "length_mm",
        "Its length from the spindle's gauge line to the tip, in mm",
        "tool presetter, or the CAM's tool list",
        "number",
        112.5,
        "tool.1.length_mm",
    ),
    CellQuestion(
        "data",
        "Its TOOL_DATA number",
        _TOOL_MENU,
        "whole",
        5,
        "tool.1.tool_data",
        when=_is("tools_by", "number"),
        choices=lambda controller: [(str(one.number), one.text()) for one in controller.tools],
    ),
    CellQuestion(
        "frame",
        f"Its frame: {_FRAME}",
        _TOOL_MENU,
        "numbers",
        [250.0, 0.0, 250.0, 0.0, 0.0, 180.0],
        "tool.1.frame",
        6,
        when=_is("tools_by", "number"),
        proposal=lambda controller, answers: _entry(controller.tools, answers.get("data")),
    ),
    CellQuestion(
        "axis",
        "Which axis of its frame points from the tip to the holder?",
        _AXIS_PLACE,
        "choice",
        "+x",
        needed=True,
        when=_is("tools_by", "number"),
        choices=_AXES,
    ),
)
"""Asked of each tool."""

MACHINE_QUESTIONS = (
    CellQuestion(
        "tool_change",
        "How are tools changed?",
        "your magazine's program, if there is one",
        "choice",
        "hand",
        needed=True,
        choices=_choices(
            ("hand", "by hand: the program halts on the clearance plane"),
            ("magazine", "by a subprogram of the controller that is given the tool's number"),
            ("none", "never: one tool a program"),
        ),
    ),
    CellQuestion(
        "magazine",
        "Name of that subprogram; it takes the tool's number (INT :IN)",
        "the Navigator, R1\\Program",
        "name",
        "MAGAZINE",
        needed=True,
        when=_is("tool_change", "magazine"),
    ),
    CellQuestion(
        "mounted_tool",
        "Tool that is in the spindle when a program starts, until its first M6; empty: none",
        "look into the spindle",
        "whole",
        1,
        "tool.1",
    ),
    CellQuestion(
        "load_kg",
        "Mass on the flange in kg: spindle, bracket, sensor, holder and tool",
        "Start-up > Calibrate > Tool > Payload data (M)",
        "number",
        42.0,
        "load.mass_kg",
        proposal=_mass,
    ),
    CellQuestion(
        "load_centre_mm",
        "Its centre of gravity in the flange frame: X Y Z in mm",
        "Start-up > Calibrate > Tool > Payload data (X, Y, Z)",
        "numbers",
        [110.0, 0.0, 160.0],
        "load.x_mm",
        3,
        when=_states("load_kg"),
        proposal=_centre,
    ),
    CellQuestion(
        "load_inertia_kgm2",
        "Its inertia about x, y and z in kg m2; empty: 0",
        "Start-up > Calibrate > Tool > Payload data (JX, JY, JZ)",
        "numbers",
        [1.5, 1.5, 0.8],
        "load.jx_kgm2",
        3,
        when=_states("load_kg"),
        proposal=_inertia,
    ),
    CellQuestion(
        "spindle_max_rpm",
        "Largest speed of the spindle in rpm; with an analog output the speed at its full value",
        "the spindle's plate, and its drive's settings",
        "number",
        18000.0,
        "spindle.max_rpm",
    ),
    CellQuestion(
        "spindle_speed",
        "How is its speed set?",
        "Configuration > Inputs/outputs, and the wiring of the drive",
        "choice",
        "analog",
        needed=True,
        choices=_choices(
            ("analog", "by an analog output"),
            ("drive", "at its drive, by hand; the robot only switches it on and off"),
        ),
    ),
    CellQuestion(
        "speed_output",
        "Number of the analog output, $ANOUT[n]",
        "Display > Inputs/outputs > Analog I/O",
        "whole",
        1,
        "spindle.speed_analog_output",
        needed=True,
        when=_is("spindle_speed", "analog"),
    ),
    CellQuestion(
        "run_output",
        "Digital output that runs the spindle clockwise, $OUT[n]",
        _OUTPUTS,
        "whole",
        11,
        "spindle.run_cw_output",
    ),
    CellQuestion(
        "ccw_output",
        "Digital output that runs it counter-clockwise; empty: none",
        _OUTPUTS,
        "whole",
        12,
        "spindle.run_ccw_output",
        when=_states("run_output"),
    ),
    CellQuestion(
        "at_speed_input",
        "Digital input that is on at speed, $IN[n]; empty: there is none",
        _OUTPUTS,
        "whole",
        17,
        "spindle.at_speed_input",
        when=_states("run_output"),
    ),
    CellQuestion(
        "start_s",
        "Seconds to run up",
        "a watch",
        "number",
        5.0,
        "spindle.start_s",
        when=lambda answers: bool(answers.get("run_output")) and not answers.get("at_speed_input"),
    ),
    CellQuestion(
        "stop_s",
        "Seconds to stop",
        "a watch",
        "number",
        8.0,
        "spindle.stop_s",
        when=_states("run_output"),
    ),
    CellQuestion(
        "flood_output",
        "Digital output of flood coolant or suction (M8); empty: none",
        _OUTPUTS,
        "whole",
        13,
        "spindle.flood_output",
    ),
    CellQuestion(
        "mist_output",
        "Digital output of mist or air blast (M7); empty: none",
        _OUTPUTS,
        "whole",
        14,
        "spindle.mist_output",
    ),
)
"""Tool change, load, spindle and coolant."""

GENERAL_QUESTIONS = (*PLACE_QUESTIONS, *REFERENCE_QUESTIONS, *MACHINE_QUESTIONS)
