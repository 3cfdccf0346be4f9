"""The text of a new cell file: every answer under its key, commented; what was not answered says so.

Nothing is made up: a key without an answer stands in a comment with an example, and `verified` is left to the
person who compares the file with the real cell.
"""

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomli_w

from gcode2krl import frames as fr
from gcode2krl.cell import controller_axes
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.descriptions import Description, descriptions_of
from gcode2krl.cell.sections import Clearance, Frame, Frames, Home, Load, Robot, Spindle
from gcode2krl.cell.sections import Controller as ControllerSection
from gcode2krl.cell.setup.answers import frame_table
from gcode2krl.cell.setup.controller import ArchivedController, ExternalData
from gcode2krl.cell.setup.questions import FILE, GENERAL_QUESTIONS, OTHER, UNKNOWN, Answers
from gcode2krl.units import DEG_PER_RAD

_COMMENT_COLUMN = 30
_LONGEST_LINE = 110
_HEAD = """#:schema {schema}
# Cell file of gcode2krl: what the G-code cannot say. Written by `gcode2krl init`.
#
# Each program begins with a HALT until a person has compared every value below with the real cell, and again
# after each edit. This signs the file at its end, section by section:
#   gcode2krl models confirm CELL.toml
"""
_LOAD_KEYS = {
    "load_centre_mm": ("x_mm", "y_mm", "z_mm"),
    "load_inertia_kgm2": ("jx_kgm2", "jy_kgm2", "jz_kgm2"),
}
_ANALOG_SPEED = "$ANOUT[{{ spindle.speed_analog_output }}]={{ '%.4f' % (rpm / spindle.max_rpm) }}"
_SPEED_BY_HAND = "HALT ; set the drive of the spindle to {{ '%.0f' % rpm }} rpm, then start"


@dataclass(frozen=True)
class _Writer:
    """Answers, and what the controller's archive states."""

    answers: Answers
    controller: ArchivedController
    is_of_archive: Mapping[str, bool]
    """Question → whether its answer is what the archive states."""

    def text(self, schema: str) -> str:
        """Return the cell file."""
        blocks = [
            (_HEAD.format(schema=schema).rstrip("\n"),),
            self._top(),
            self._robot(),
            self._controller(),
            self._frames(),
            self._home(),
            *(self._external(axis) for axis in self.controller.externals),
            self._heights(),
            self._load(),
            *(self._tool(tool) for tool in self.answers.get("tools", ())),
            self._spindle(),
            self._program(),
            self._m_codes(),
            self._further(),
        ]
        return "\n\n".join("\n".join(lines) for lines in map(tuple, blocks) if lines) + "\n"

    def _top(self) -> Iterator[str]:
        yield from self._key(Cell, "name", self.answers.get("name"), "name")
        yield from self._key(Cell, "mounted_tool", self.answers.get("mounted_tool"), "mounted_tool")
        change, magazine = self.answers.get("tool_change"), self.answers.get("magazine")
        text = {
            "hand": "HALT ; change to tool {{ tool }} by hand, then start",
            "magazine": f"{magazine}({{{{ tool }}}})",
            "none": "; tool {{ tool }} stays in the spindle",
        }.get(str(change))
        if text is not None:
            yield from self._key(Cell, "tool_change", text, "tool_change")
        if not self.answers.get("tools"):
            yield "# NOT ANSWERED: no tool. Each T of the G-code needs a table [tool.<number>]."

    def _robot(self) -> Iterator[str]:
        controller, robot = self.controller, self.answers.get("robot")
        yield "[robot]"
        if robot == FILE:
            yield from self._key(Robot, "model", self.answers.get("robot_file"), "robot_file")
        elif robot != OTHER:
            yield from self._key(Robot, "model", robot, "robot")
        if controller.trafo_name:
            yield from _line(Robot, "trafo_name", controller.trafo_name)
            yield from _line(Robot, "trafo_source", f"archive {controller.source}, $TRAFONAME[]")
            yield from _line(Robot, "trafo_sure", "verified")
        if robot == OTHER:
            yield from self._key(Robot, "name", self.answers.get("robot_name"), "robot_name")
            yield from _line(Robot, "note", "not in the library")
        lengths, speeds = self.answers.get("lengths_mm"), self.answers.get("speeds_deg_s")
        if lengths:
            yield from ("", "[robot.geometry]")
            keys = ("a1_mm", "a2_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm")
            yield from (f"{key} = {_number(v)}" for key, v in zip(keys, lengths, strict=True))
            is_read = bool(self.is_of_archive.get("lengths_mm"))
            yield from self._said("$LENGTH_A, $LENGTH_B, $TIRORO, $TX3P3, $TFLWP", is_read)
        yield from self._limits()
        if speeds:
            yield from ("", "[robot.speeds]")
            yield f"qd_deg_s = {toml_value(list(speeds))}"
            yield from self._said(
                "$VEL_AXIS_MA over $RAT_MOT_AX", bool(self.is_of_archive.get("speeds_deg_s"))
            )
        yield from self._drives()
        rated = (("mass_kg", "payload_kg"), ("reach_mm", "reach_mm"))
        stated = [(key, self.answers[asked]) for key, asked in rated if self.answers.get(asked)]
        if stated:
            yield from ("", "[robot.payload]", *(f"{key} = {_number(value)}" for key, value in stated))
            yield from self._said("", False)

    def _drives(self) -> Iterator[str]:
        """Write what nobody is asked for: ratios of an archive, masses of a URDF."""
        ratios, masses = self.controller.gear_ratio, self.controller.link_mass_kg
        if ratios is None and masses is None:
            return
        yield from ("", "[robot.drives]")
        for key, numbers in (("gear_ratio", ratios), ("link_mass_kg", masses)):
            if numbers is not None:
                yield f"{key} = {toml_value([round(number, 4) for number in numbers])}"
        yield from self._said("$RAT_MOT_AX", True)

    def _controller(self) -> Iterator[str]:
        kss = self.answers.get("kss", UNKNOWN)
        if kss != UNKNOWN:
            yield "[controller]"
            yield from _line(ControllerSection, "kss", kss)

    def _limits(self) -> Iterator[str]:
        """Write the limits that were typed, else those of the archive; the library's need not be written."""
        typed = self.answers.get("limits_deg")
        pairs = list(zip(typed[::2], typed[1::2], strict=True)) if typed else self.controller.limits_deg
        if pairs:
            yield from ("", "[robot.limits]", f"q_deg = {toml_value(pairs)}")
            is_read = self.controller.limits_deg is not None and tuple(pairs) == self.controller.limits_deg
            yield from self._said("$SOFTN_END and $SOFTP_END", is_read)

    def _frames(self) -> Iterator[str]:
        answers = self.answers
        yield "[frames]"
        if answers.get("mounting") == OTHER:
            yield from self._frame("robroot", answers.get("robroot"))
        if answers.get("base_number") and answers.get("base"):
            yield from self._key(Frames, "base_data", answers["base_number"], "base_number")
        yield from self._frame("base", answers.get("base"))
        stated = ["base"]
        if answers.get("tools_by") == "length":
            yield from self._reference()
            stated.append("reference_frame")
        yield from _commented('# spin = "auto"', descriptions_of(Frames)["spin"].sentence())
        yield from self._said("BASE_DATA and TOOL_DATA", all(map(self.is_of_archive.get, stated)))

    def _reference(self) -> Iterator[str]:
        """Write the measured tool; the cell's frame has z from tip to holder, whatever the controller's."""
        numbers, axis = self.answers.get("reference_frame"), self.answers.get("reference_axis")
        if numbers is not None and axis not in (None, "+z"):
            yield f"# on the controller {_krl_frame(numbers)}, {axis} to the holder; here with z to it"
            numbers = _turned(numbers, axis)
        yield from self._frame("tool", numbers)
        length_mm = self.answers.get("reference_length_mm")
        yield from self._key(Frames, "tool_length_mm", length_mm, "reference_length_mm")

    def _home(self) -> Iterator[str]:
        yield "[home]"
        yield from self._key(Home, "q_deg", self.answers.get("home"), "home")

    def _external(self, axis: ExternalData) -> Iterator[str]:
        """Write what the archive states of an external axis, as a comment, as its place is not in it."""
        numbers = f"[{axis.number + 6}]"
        rail = axis.is_linear is not False
        yield f"# NOT ANSWERED: E{axis.number}, of which the archive does not state direction and place."
        yield "# Without this table it is not moved and must stand still (docs/external_axes.md)."
        yield f"# [external.E{axis.number}]"
        yield f'# kind = "{"rail" if rail else "turntable"}"  # or "tilt" ($AXIS_TYPE{numbers})'
        yield f'# axis = "{"y" if rail else "z"}"  # direction of travel, or of the turn, as seen from origin'
        yield "# origin = { x_mm = 0.0, y_mm = 0.0, z_mm = 0.0, a_deg = 0.0, b_deg = 0.0, c_deg = 0.0 }"
        limits = toml_value(list(axis.limits)) if axis.limits else ""
        yield f"# limits = {limits}  # $SOFTN_END{numbers}, $SOFTP_END{numbers}"
        speed = "" if axis.speed_deg_s is None else _number(axis.speed_deg_s)
        yield f"# speed = {speed}  # mm/s or deg/s"
        yield "# acceleration =   # mm/s2 or deg/s2"
        if axis.home is not None:
            yield f"# home = {_number(axis.home)}  # XHOME"

    def _heights(self) -> Iterator[str]:
        yield "[clearance]"
        yield from self._key(Clearance, "z_mm", self.answers.get("clearance_mm"), "clearance_mm")
        if self.answers.get("table_mm") is not None:
            yield from ("", "[table]", f"z_mm = {_number(self.answers['table_mm'])}")

    def _load(self) -> Iterator[str]:
        answers = self.answers
        yield "[load]"
        yield from self._key(Load, "mass_kg", answers.get("load_kg"), "load_kg")
        for key, names in _LOAD_KEYS.items():
            numbers = answers.get(key) or [None] * 3
            for name, number in zip(names, numbers, strict=True):
                yield from self._key(Load, name, number, key)
        if answers.get("load_kg") is not None:
            yield from self._said("LOAD_DATA", self.is_of_archive.get("load_kg", False))

    def _tool(self, tool: Answers) -> Iterator[str]:
        yield f"[tool.{tool['number']}]"
        names = ["kind", "diameter_mm", "teeth", "corner_radius_mm", "length_mm"]
        if tool["model"] != OTHER:
            names = ["model", "length_mm"]
        for name in names:
            if tool.get(name) is not None:
                yield f"{name} = {toml_value(tool[name])}"
        if "length_mm" not in tool and tool.get("frame") is None:
            yield "# NOT ANSWERED: length_mm, from the spindle's gauge line to the tip"
        if tool.get("frame") is not None:
            if tool.get("data"):
                yield f"tool_data = {tool['data']}"
            yield f"axis = {toml_value(tool['axis'])}"
            yield f"frame = {_frame(tool['frame'])}"
        elif tool.get("tools_by") == "number":
            yield "# NOT ANSWERED: tool_data, axis and frame of this tool"

    def _spindle(self) -> Iterator[str]:
        keys = {
            "max_rpm": "spindle_max_rpm",
            "speed_analog_output": "speed_output",
            "run_cw_output": "run_output",
            "run_ccw_output": "ccw_output",
            "at_speed_input": "at_speed_input",
            "start_s": "start_s",
            "stop_s": "stop_s",
            "flood_output": "flood_output",
            "mist_output": "mist_output",
        }
        yield "[spindle]"
        for name, key in keys.items():
            if self.answers.get(key) is not None or name in ("max_rpm", "run_cw_output"):
                yield from self._key(Spindle, name, self.answers.get(key), key)
        yield from self._said("", False)

    def _program(self) -> Iterator[str]:
        if self.answers.get("tool_change") == "magazine":
            yield "[program]"
            yield f"externals = {toml_value([self.answers['magazine'] + '(INT :IN)'])}"

    def _m_codes(self) -> Iterator[str]:
        codes = dict(_m_codes(self.answers))
        yield "[m_code]  # an M-code without an entry is refused; docs/cell.md: what templates may say"
        if "M3" not in codes:
            yield "# NOT ANSWERED: the output that runs the spindle, so that M3 and M5 have no KRL"
        for code, lines in codes.items():
            text = "\n".join(lines)
            yield f'{code} = """\n{text}"""' if len(lines) > 1 else f"{code} = {toml_value(text)}"

    def _further(self) -> Iterator[str]:
        yield "# For forces and deflection, as your part needs them (docs/cell.md):"
        yield '# [material]\n# model = "AW-2017A"  # gcode2krl models list materials'
        yield "# [stock]\n# box_mm = [[0.0, 0.0, -20.0], [200.0, 100.0, 0.0]]  # in $BASE"

    # --- a line -------------------------------------------------------------------------------------------

    def _key(self, section: Any, name: str, value: Any, question: str) -> Iterator[str]:
        if value is not None:
            yield from _line(section, name, value)
        elif question in _NEEDED_BY_PROGRAMS:
            known = descriptions_of(section)[name]
            yield from _commented(
                f"# {name} = {toml_value(known.example)}", f"NOT ANSWERED: {known.sentence()}"
            )

    def _frame(self, name: str, numbers: Sequence[float] | None) -> Iterator[str]:
        known = descriptions_of(Frames)[name]
        if numbers is None:
            example = f"# {name} = {_frame(list(known.example.values()))}"
            yield from _commented(example, f"NOT ANSWERED: {known.sentence()}")
        else:
            yield from _commented(f"{name} = {_frame(numbers)}", known.sentence())

    def _said(self, what: str, is_read: bool) -> Iterator[str]:
        """Yield where the values of a table come from: read in the archive, or typed."""
        read = f"{self.controller.source}, its joints"
        sure = "checked"
        if not self.controller.is_description:
            read, sure = f"archive {self.controller.source}, {what}", "verified"
        yield f"source = {toml_value(read if is_read else 'typed at gcode2krl init')}"
        yield f'sure = "{sure if is_read else "memory"}"'


_NEEDED_BY_PROGRAMS = (
    "home",
    "clearance_mm",
    "base",
    "robroot",
    "load_kg",
    "reference_frame",
    "reference_length_mm",
    "spindle_max_rpm",
    "run_output",
)
"""Questions whose key stands in a comment where nobody answered."""


def text_of_cell(answers: Answers, controller: ArchivedController, schema: str) -> str:
    """Return the text of the cell file; ``schema`` is the path of its JSON schema, for editors."""
    proposed = {one.key: one.proposal(controller, answers) for one in GENERAL_QUESTIONS}
    equal = {key: value is not None and answers.get(key) == value for key, value in proposed.items()}
    return _Writer(answers, controller, equal).text(schema)


def _m_codes(answers: Answers) -> Iterator[tuple[str, list[str]]]:
    """Yield the KRL of the M-codes that the outputs of spindle and coolant allow."""
    if answers.get("run_output") is not None:
        speed = _ANALOG_SPEED if answers.get("speed_output") else _SPEED_BY_HAND
        wait = "WAIT FOR $IN[{{ spindle.at_speed_input }}]"
        if answers.get("at_speed_input") is None:
            wait = "WAIT SEC {{ '%.1f' % spindle.start_s }}"
        runs = [("M3", "run_cw_output")]
        if answers.get("ccw_output") is not None:
            runs.append(("M4", "run_ccw_output"))
        for code, output in runs:
            yield code, [speed, f"$OUT[{{{{ spindle.{output} }}}}]=TRUE", wait]
        off = [f"$OUT[{{{{ spindle.{output} }}}}]=FALSE" for _, output in runs]
        yield "M5", [*off, "WAIT SEC {{ '%.1f' % spindle.stop_s }}"]
    coolants = [("M7", "mist_output"), ("M8", "flood_output")]
    stated = [(code, output) for code, output in coolants if answers.get(output) is not None]
    for code, output in stated:
        yield code, [f"$OUT[{{{{ spindle.{output} }}}}]=TRUE"]
    if stated:
        yield "M9", [f"$OUT[{{{{ spindle.{output} }}}}]=FALSE" for _, output in stated]


def _turned(numbers: Sequence[float], axis: Any) -> list[float]:
    """Return the frame whose z is what the controller's ``axis`` is."""
    turned = Frame(**frame_table(numbers)).matrix() @ controller_axes(axis)
    abc_deg = np.round(fr.abc_from_rotation(turned[:3, :3]) * DEG_PER_RAD, 6) + 0.0
    return [*numbers[:3], *map(float, abc_deg)]


def _line(section: Any, name: str, value: Any) -> Iterator[str]:
    """Yield ``key = value  # what it is``, the comment above it where the line would be too long."""
    known: Description = descriptions_of(section)[name]
    yield from _commented(f"{name} = {toml_value(value)}", known.sentence())


def _commented(stated: str, comment: str) -> Iterator[str]:
    """Yield a line with its comment behind it, or above it where that would be too long."""
    line = f"{stated:<{_COMMENT_COLUMN}}# {comment}"
    if len(line) <= _LONGEST_LINE and len(stated) < _COMMENT_COLUMN:
        yield line
    else:
        yield from textwrap.wrap(comment, _LONGEST_LINE, initial_indent="# ", subsequent_indent="# ")
        yield stated


def toml_value(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return _number(value) if isinstance(value, float) else tomli_w.dumps({"v": value})[4:].rstrip("\n")


def _number(value: float) -> str:
    return repr(float(value))


def _frame(numbers: Iterable[float]) -> str:
    return toml_value(frame_table(list(numbers)))


def _krl_frame(numbers: Sequence[float]) -> str:
    return "{" + ",".join(f"{name} {n:g}" for name, n in zip("XYZABC", numbers, strict=True)) + "}"
