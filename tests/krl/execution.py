"""Executes a KRL program of `language.py` on a model of the controller; it imports nothing of gcode2krl.

    program = parse_program({"PART.src": text, "PART.dat": data})
    world = Environment(kinematics=robot, system={"$TRAFONAME": "#KR300R2500"}, tool_data={5: frame})
    run = execute(program, world)                 # Run: .events, .motions, .ended, .controller
    wrong = judge(hostile_run, intended=run)      # list of Wrong: motions that go wrong unguarded

`Environment` is what lies around the program: kinematics, numbered frames and loads, inputs, and the people
and subprograms that act on it. A callable gets the `Controller` and may change anything of it:

- ``externals[name](controller, *arguments)``, or ``other_external(controller, name, *arguments)`` for those
  without one: a subprogram that is declared EXT and defined nowhere;
- ``on_halt(controller, halt)``: a person at a HALT. It may jog and set, and returns at the press of start;
  it raises `Cancelled` to end the program. ``halt.message`` was shown before, ``halt.in_loop`` tells a
  HALT inside a loop (a guard, which looks again) from one that goes on;
- ``on_wait(controller, statement)``: WAIT FOR something that is false; still false afterwards, the run ends.

`Controller` has ``system`` (``controller.system["$VEL"]["CP"]``), ``outputs``, ``analog_outputs``, ``q_deg``,
``external`` (E1 to E6), ``flange`` (4, 4 in ``$WORLD``), ``intended_q_deg`` (where the last motion of the
program led, `None` before), ``jog(q_deg, external)`` and ``set(name, value)``; jog and set count as touching.

`Motion` holds what was in force: ``settings`` (``settings["$VEL.CP"]``), the flange at its start and its end,
the axes, file and line. `judge` compares the motions of two runs of one program: one with subprograms and
people that change nothing, one with others. Wrong is a motion that ends elsewhere, a LIN, CIRC or SPL that
starts elsewhere, a motion with other settings; unless a guard (a HALT with a message, in a loop) came between
the last touch and it. Approximate: blending is recorded, not computed; a TRIGGER acts at the start of its
motion; interrupts
are recorded, never run; the advance run does not exist.
"""

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import acos, atan2, cos, degrees, hypot, isclose, radians, sin, sqrt, tan
from typing import Any, Protocol

import numpy as np

from tests.krl.language import AXIS_KEYS, EXTERNAL_KEYS, POSE_KEYS, Program, Routine, Statement, Variable

FRAME_KEYS = POSE_KEYS[:6]
CP_SETTINGS = (
    *("$BASE", "$TOOL", "$LOAD", "$VEL.CP", "$VEL.ORI1", "$VEL.ORI2", "$ACC.CP", "$ACC.ORI1", "$ACC.ORI2"),
    *("$APO.CDIS", "$ORI_TYPE", "$IPO_MODE", "$ADVANCE"),
)
PTP_SETTINGS = ("$BASE", "$TOOL", "$LOAD", "$VEL_AXIS", "$ACC_AXIS", "$IPO_MODE", "$ADVANCE")
SAME_MM, SAME_SHARE = 0.01, 1e-5
"""What two flanges may differ by: distance, and entries of the rotation."""


class Cancelled(Exception):  # noqa: N818
    """A person ends the program."""


class Fault(Exception):  # noqa: N818
    """The controller stops with an error."""


class Kinematics(Protocol):
    """The arm alone: axes in degrees to the flange in the robot root (4, 4) and back."""

    def flange(self, q_deg: np.ndarray) -> np.ndarray:
        """Return the flange."""

    def joints(
        self, flange: np.ndarray, near_deg: np.ndarray, status: int | None = None, turn: int | None = None
    ) -> np.ndarray | None:
        """Return the axes with status and turn, or without them those nearest; None out of reach."""


@dataclass
class Motion:
    """A motion as it was executed."""

    kind: str
    file: str
    line: int
    target: dict[str, float]
    """Components as written."""
    blend: str
    settings: dict[str, Any]
    start: np.ndarray
    flange: np.ndarray
    q_deg: np.ndarray | None
    external_start: dict[str, float]
    external: dict[str, float]
    via: np.ndarray | None = None
    """The auxiliary point of a CIRC in ``$BASE`` (4, 4)."""
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    """The target in ``$BASE`` (4, 4), of a motion to a pose."""

    @property
    def is_cp(self) -> bool:
        """True for a motion along a path: LIN, CIRC, SPL."""
        return not self.kind.startswith(("PTP", "SPTP"))


@dataclass
class Output:
    """``$OUT[number]`` or, with ``analog``, ``$ANOUT[number]`` is set."""

    number: int
    value: Any
    analog: bool
    file: str
    line: int


@dataclass
class Halt:
    """A HALT; ``message`` was shown since the last motion or HALT, empty where none was."""

    message: str
    in_loop: bool
    file: str
    line: int


@dataclass
class Message:
    """A message of SET_KRLMSG with its kind, such as ``#QUIT``."""

    kind: str
    text: str
    file: str
    line: int


@dataclass
class Step:
    """Something else that is recorded: wait, call, trigger, interrupt, rsi, touch."""

    kind: str
    text: str
    file: str
    line: int


@dataclass
class Environment:
    """What lies around a program; see the module."""

    kinematics: Kinematics | None = None
    root: Callable[[Mapping[str, float]], np.ndarray] = lambda external: np.eye(4)
    """The robot root in ``$WORLD`` (4, 4) of E1 to E6; a coupled rail moves it."""
    table: Callable[[int, Mapping[str, float]], np.ndarray] = lambda machine, external: np.eye(4)
    """The table of ``MACHINE_DEF[n]`` in ``$WORLD`` (4, 4), for EK."""
    system: Mapping[str, Any] = field(default_factory=dict)
    base_data: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    tool_data: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    load_data: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    inputs: Mapping[int, bool | Callable[["Controller"], bool]] = field(default_factory=dict)
    q_deg: tuple[float, ...] = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
    """Where the arm stands at first."""
    externals: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    other_external: Callable[..., Any] = lambda controller, name, *arguments: None
    on_halt: Callable[["Controller", Halt], None] = lambda controller, halt: None
    on_wait: Callable[["Controller", Statement], None] = lambda controller, statement: None
    most_statements: int = 1_000_000


@dataclass
class Run:
    """What happened: ``ended`` is "end", "cancelled", or begins with "fault: "."""

    events: list[Any]
    controller: "Controller"
    ended: str = "end"

    @property
    def motions(self) -> list[Motion]:
        """Return the motions in their order."""
        return [event for event in self.events if isinstance(event, Motion)]

    def of(self, kind: type) -> list[Any]:
        """Return the events of a kind: Motion, Output, Halt, Message, Step."""
        return [event for event in self.events if isinstance(event, kind)]


# --- frames --------------------------------------------------------------------------------------------


def matrix_of(frame: Mapping[str, float]) -> np.ndarray:
    """Return a KRL frame, mm and degrees, as a transform (4, 4): Rz(A) Ry(B) Rx(C)."""
    a, b, c = (radians(frame.get(key, 0.0)) for key in "ABC")
    sa, ca, sb, cb, sc, cc = sin(a), cos(a), sin(b), cos(b), sin(c), cos(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc, frame.get("X", 0.0)],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc, frame.get("Y", 0.0)],
            [-sb, cb * sc, cb * cc, frame.get("Z", 0.0)],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def frame_of(matrix: np.ndarray) -> dict[str, float]:
    """Return a transform (4, 4) as a KRL frame."""
    r = matrix
    b = atan2(-r[2, 0], hypot(r[0, 0], r[1, 0]))
    if abs(cos(b)) > 1e-9:
        a, c = atan2(r[1, 0], r[0, 0]), atan2(r[2, 1], r[2, 2])
    else:
        a, c = atan2(-r[0, 1], r[1, 1]), 0.0
    angles = (degrees(a), degrees(b), degrees(c))
    return dict(zip(FRAME_KEYS, (*map(float, matrix[:3, 3]), *angles), strict=True))


def inverted(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a transform (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = matrix[:3, :3].T
    result[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return result


def same_place(a: np.ndarray, b: np.ndarray) -> bool:
    """Tell whether two transforms are one within `SAME_MM` and `SAME_SHARE`."""
    difference = np.abs(a - b)
    return bool(difference[:3, 3].max() <= SAME_MM and difference[:3, :3].max() <= SAME_SHARE)


# --- the controller ------------------------------------------------------------------------------------

_NULL = dict.fromkeys(FRAME_KEYS, 0.0)


def _initial_system() -> dict[str, Any]:
    """Return the modal state after BAS(#INITMOV,0), with KUKA's usual default values."""
    return {
        "$BASE": dict(_NULL),
        "$TOOL": dict(_NULL),
        "$LOAD": {"M": -1.0},
        "$VEL": {"CP": 3.0, "ORI1": 400.0, "ORI2": 400.0},
        "$ACC": {"CP": 10.0, "ORI1": 1000.0, "ORI2": 1000.0},
        "$APO": {"CDIS": 0.0, "CPTP": 0, "CORI": 0.0, "CVEL": 0},
        "$VEL_AXIS": dict.fromkeys(range(1, 7), 30),
        "$ACC_AXIS": dict.fromkeys(range(1, 7), 30),
        "$ORI_TYPE": "#VAR",
        "$CIRC_TYPE": "#PATH",
        "$IPO_MODE": "#BASE",
        "$ADVANCE": 3,
        "$ACT_BASE": 0,
        "$ACT_TOOL": 0,
    }


class Controller:
    """The state of the controller and of the arm; see the module."""

    def __init__(self, world: Environment) -> None:
        """Begin with the arm where the environment has it."""
        self.world = world
        self.system: dict[str, Any] = {
            **_initial_system(),
            "$OV_PRO": 100,
            "$STOPMESS": False,
            "$EX_AX_NUM": 0,
            "$TRAFONAME": "",
            "$ROBROOT": dict(_NULL),
            "$WORLD": dict(_NULL),
            "$NULLFRAME": dict(_NULL),
            **copy.deepcopy(dict(world.system)),
        }
        self.outputs: dict[int, bool] = {}
        self.analog_outputs: dict[int, float] = {}
        self.external = dict.fromkeys(EXTERNAL_KEYS, 0.0)
        self.q_deg: np.ndarray | None = np.array(world.q_deg)
        self.flange = np.eye(4)
        self.intended_q_deg: np.ndarray | None = None
        self.intended_external: dict[str, float] | None = None
        self.message = ""
        self.is_touched = False
        self.rsi_is_on = False
        self._stand()

    def _stand(self) -> None:
        """Let the flange be where the axes have it."""
        if self.world.kinematics is not None and self.q_deg is not None:
            self.flange = self.world.root(self.external) @ self.world.kinematics.flange(self.q_deg)

    def jog(self, q_deg: Any, external: Mapping[str, float] | None = None) -> None:
        """Move the arm to axes in degrees, and external axes."""
        self.q_deg = np.array(q_deg, dtype=float)
        self.external.update(external or {})
        self.is_touched = True
        self._stand()

    def set(self, name: str, value: Any) -> None:
        """Set a system variable, ``$VEL.CP`` or ``$ORI_TYPE``."""
        head, _, component = name.partition(".")
        if component:
            self.system[head][component] = value
        else:
            self.system[head] = copy.deepcopy(value)
        self.is_touched = True

    def input(self, number: int) -> bool:
        """Return ``$IN[number]``."""
        value = self.world.inputs.get(number, False)
        return value(self) if callable(value) else value

    def base_matrix(self, external: Mapping[str, float] | None = None) -> np.ndarray:
        """Return ``$BASE`` (4, 4) in ``$WORLD``."""
        base = self.system["$BASE"]
        if "EK" in base:
            return self.world.table(base["EK"], external or self.external) @ matrix_of(base)
        return matrix_of(base)

    def pose(self) -> np.ndarray:
        """Return the tool in ``$BASE`` (4, 4)."""
        return inverted(self.base_matrix()) @ self.flange @ matrix_of(self.system["$TOOL"])

    def axes(self) -> dict[str, float]:
        """Return ``$AXIS_ACT``."""
        if self.q_deg is None:
            raise Fault("the axes are not known: no kinematics")
        return {**dict(zip(AXIS_KEYS, map(float, self.q_deg), strict=True)), **self.external}

    def settings(self) -> dict[str, Any]:
        """Return what is in force for a motion, by name."""
        s = self.system
        flat = {f"{head}.{key}": value for head in ("$VEL", "$ACC", "$APO") for key, value in s[head].items()}
        for name in ("$BASE", "$TOOL", "$LOAD", "$VEL_AXIS", "$ACC_AXIS"):
            flat[name] = copy.deepcopy(s[name])
        plain = ("$ORI_TYPE", "$CIRC_TYPE", "$IPO_MODE", "$ADVANCE", "$ACT_BASE", "$ACT_TOOL")
        return {**flat, **{name: s[name] for name in plain}}


# --- execution -----------------------------------------------------------------------------------------


class _Exit(Exception):  # noqa: N818
    pass


class _Return(Exception):  # noqa: N818
    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


def execute(program: Program, world: Environment) -> Run:
    """Run a program until its end, a fault or a cancellation."""
    executor = _Executor(program, world)
    run = Run(executor.events, executor.controller)
    try:
        executor.call_routine(program.main, ())
    except Cancelled:
        run.ended = "cancelled"
    except Fault as fault:
        run.ended = f"fault: {executor.place[0]}:{executor.place[1]}: {fault}"
    return run


class _Executor:
    def __init__(self, program: Program, world: Environment) -> None:
        self.program, self.world = program, world
        self.controller = Controller(world)
        self.events: list[Any] = []
        self.place = ("", 0)
        self.count = self.loops = 0
        self.triggers: list[Statement] = []
        self.data: dict[str, dict[str, Any]] = {}
        self.locals: dict[str, Any] = {}
        self.config: dict[str, Any] = {
            "BASE_DATA": copy.deepcopy(dict(world.base_data)),
            "TOOL_DATA": copy.deepcopy(dict(world.tool_data)),
            "LOAD_DATA": copy.deepcopy(dict(world.load_data)),
            "RSIOK": 0,
            "PI": 3.14159265,
        }
        for file, module in program.modules.items():
            if module.is_data:
                values = {name: self.first_value(v) for name, v in module.variables.items()}
                self.data[file.rsplit(".", 1)[0]] = values

    def first_value(self, variable: Variable) -> Any:
        if variable.initial is not None:
            return self.value(variable.initial)
        if variable.sizes is not None:
            return {}
        if variable.type in ("INT", "REAL", "BOOL", "CHAR"):
            return None  # not initialised: reading it is an error
        return {}

    def step(self, kind: str, text: str) -> None:
        self.events.append(Step(kind, text, *self.place))

    # routines and blocks

    def call_routine(self, routine: Routine, arguments: tuple) -> Any:
        values = [self.value(a) for a in arguments]
        caller, place, loops = self.locals, self.place, self.loops
        inner = {name: self.first_value(v) for name, v in routine.variables.items()}
        inner.update(
            {name: copy.deepcopy(v) for (name, _), v in zip(routine.parameters, values, strict=True)}
        )
        self.locals, self.loops, outer_data = inner, 0, getattr(self, "shared", {})
        self.shared = self.data.get(routine.file.upper().rsplit(".", 1)[0], {})
        result = None
        try:
            self.body(routine.body)
        except _Return as returned:
            result = returned.value
        self.locals, self.shared, self.place, self.loops = caller, outer_data, place, loops
        for (name, way), argument in zip(routine.parameters, arguments, strict=True):
            if way == "OUT" and argument[0] == "reference":
                self.assign(argument, inner[name])
        return result

    def body(self, statements: list[Statement]) -> None:
        for statement in statements:
            self.count += 1
            if self.count > self.world.most_statements:
                raise Fault("the program does not end")
            self.place = (statement.file, statement.line)
            getattr(self, f"do_{statement.kind}")(statement)

    def loop_body(self, statements: list[Statement]) -> bool:
        """Run the body of a loop once; False where EXIT left it."""
        self.loops += 1
        try:
            self.body(statements)
        except _Exit:
            return False
        finally:
            self.loops -= 1
        return True

    def truth(self, expression: tuple) -> bool:
        value = self.value(expression)
        if not isinstance(value, bool):
            raise Fault("a condition is no BOOL")
        return value

    def do_if(self, s: Statement) -> None:
        if self.truth(s.values[0]):
            self.body(s.blocks[0])
        elif len(s.blocks) > 1:
            self.body(s.blocks[1])

    def do_while(self, s: Statement) -> None:
        while self.truth(s.values[0]) and self.loop_body(s.blocks[0]):
            self.place = (s.file, s.line)

    def do_repeat(self, s: Statement) -> None:
        while self.loop_body(s.blocks[0]) and not self.truth(s.values[0]):
            pass

    def do_loop(self, s: Statement) -> None:
        while self.loop_body(s.blocks[0]):
            pass

    def do_for(self, s: Statement) -> None:
        name, first, last, step = s.values
        stride = 1 if step is None else self.value(step)
        at, end = self.value(first), self.value(last)
        while (at <= end) if stride > 0 else (at >= end):
            self.assign(("reference", ((name, None),)), at)
            if not self.loop_body(s.blocks[0]):
                return
            at += stride

    def do_switch(self, s: Statement) -> None:
        value = self.value(s.values[0])
        for cases, body in s.blocks:
            if cases is None or any(self.value(case) == value for case in cases):
                self.body(body)
                return

    def do_exit(self, s: Statement) -> None:
        raise _Exit

    def do_return(self, s: Statement) -> None:
        raise _Return(None if s.values[0] is None else self.value(s.values[0]))

    def do_goto(self, s: Statement) -> None:
        raise Fault("GOTO is not modelled")

    def do_label(self, s: Statement) -> None:
        """Pass a label."""

    def do_continue(self, s: Statement) -> None:
        """Do not stop the advance run, which is not modelled."""

    def do_brake(self, s: Statement) -> None:
        self.step("brake", "")

    def do_resume(self, s: Statement) -> None:
        self.step("resume", "")

    # people, waits, calls

    def do_halt(self, s: Statement) -> None:
        halt = Halt(self.controller.message, self.loops > 0, s.file, s.line)
        self.controller.message = ""
        self.events.append(halt)
        self.controller.is_touched = False
        self.world.on_halt(self.controller, halt)
        self.note_touch("HALT")

    def note_touch(self, who: str) -> None:
        if self.controller.is_touched:
            self.step("touch", who)
        self.controller.is_touched = False

    def do_wait_sec(self, s: Statement) -> None:
        self.step("wait", f"{float(self.value(s.values[0])):g} s")

    def do_wait_for(self, s: Statement) -> None:
        if not self.truth(s.values[0]):
            self.world.on_wait(self.controller, s)
            if not self.truth(s.values[0]):
                raise Fault("waits for ever")
        self.step("wait", "for")

    def do_call_statement(self, s: Statement) -> None:
        self.value(s.values[0])

    def call(self, name: str, arguments: tuple) -> Any:
        routine = self.program.local_routines(self.place[0]).get(name) or self.program.routines.get(name)
        if routine is not None:
            self.step("call", name)
            return self.call_routine(routine, arguments)
        if name in _FUNCTIONS:
            return _FUNCTIONS[name](*(self.value(a) for a in arguments))
        special = getattr(self, f"call_{name.lower()}", None)
        if special is not None:
            return special(*arguments)
        if name not in self.program.externals:
            raise Fault(f"the function {name} is not modelled")
        self.step("call", name)
        values = [self.value(a) for a in arguments]
        self.controller.is_touched = False
        if name in self.world.externals:
            result = self.world.externals[name](self.controller, *values)
        else:
            result = self.world.other_external(self.controller, name, *values)
        self.note_touch(name)
        return result

    def call_bas(self, command: tuple, value: tuple) -> None:
        word, number, system = self.value(command), self.value(value), self.controller.system
        if word == "#INITMOV":
            system.update(_initial_system())
        elif word == "#BASE":
            system["$BASE"] = copy.deepcopy(self.numbered("BASE_DATA", number))
            system["$ACT_BASE"] = number
        elif word == "#TOOL":
            system["$TOOL"] = copy.deepcopy(self.numbered("TOOL_DATA", number))
            system["$LOAD"] = copy.deepcopy(self.config["LOAD_DATA"].get(number, {"M": -1.0}))
            system["$ACT_TOOL"] = number
        elif word in ("#VEL_PTP", "#ACC_PTP"):
            system["$VEL_AXIS" if word == "#VEL_PTP" else "$ACC_AXIS"] = dict.fromkeys(range(1, 7), number)
        elif word == "#VEL_CP":
            system["$VEL"]["CP"] = number
        elif word == "#ACC_CP":
            system["$ACC"]["CP"] = number
        else:
            raise Fault(f"BAS({word}) is not modelled")

    def numbered(self, name: str, number: int) -> Any:
        if number not in self.config[name]:
            raise Fault(f"{name}[{number}] is not set")
        return self.config[name][number]

    def call_set_krlmsg(self, kind: tuple, message: tuple, *_: tuple) -> int:
        text = self.value(message)["MSG_TXT"]
        self.controller.message = text
        self.events.append(Message(self.value(kind), text, *self.place))
        return 1

    def call_ir_stopm(self) -> None:
        """Do what the controller's own interrupt does: nothing that moves."""

    def call_pulse(self, output: tuple, value: tuple, seconds: tuple) -> None:
        self.assign(output, self.value(value))
        self.assign(output, not self.value(value))

    def call_ek(self, root: tuple, _kind: tuple, offset: tuple) -> dict[str, float]:
        ((_, indices), *_) = root[1]
        return {**self.value(offset), "EK": self.value(indices[0])}

    def call_rsi_create(self, *arguments: tuple) -> int:
        self.step("rsi", f"create {self.value(arguments[0])}")
        if len(arguments) > 1:
            self.assign(arguments[1], 1)
        return 0

    def call_rsi_on(self, *arguments: tuple) -> int:
        self.controller.rsi_is_on = True
        self.step("rsi", " ".join(["on", *(str(self.value(a)) for a in arguments)]))
        return 0

    def call_rsi_off(self) -> int:
        self.controller.rsi_is_on = False
        self.step("rsi", "off")
        return 0

    def call_rsi_delete(self, *_: tuple) -> int:
        self.step("rsi", "delete")
        return 0

    def do_interrupt_decl(self, s: Statement) -> None:
        self.step("interrupt", f"declared {self.value(s.values[1])}")

    def do_interrupt(self, s: Statement) -> None:
        number = "" if s.values[1] is None else f" {self.value(s.values[1])}"
        self.step("interrupt", f"{s.values[0].lower()}{number}")

    def do_trigger(self, s: Statement) -> None:
        self.triggers.append(s)

    def pull_triggers(self) -> None:
        waiting, self.triggers = self.triggers, []
        for s in waiting:
            self.step("trigger", f"delay {self.value(s.values[2]):g} ms")
            action = s.values[3]
            if action[0] == "assign":
                self.assign(action[1], self.value(action[2]))
            else:
                self.value(action[1])

    # motions

    def do_move(self, s: Statement) -> None:
        word, target, *rest = s.values
        self.move(s, word, self.value(target), _blend(rest))

    def do_spline_move(self, s: Statement) -> None:
        self.do_move(s)

    def do_arc(self, s: Statement) -> None:
        word, via, target, *rest = s.values
        if word != "CIRC":
            raise Fault(f"{word} is not modelled")
        via_frame = {**frame_of(self.controller.pose()), **self.value(via)}
        self.move(s, word, self.value(target), _blend(rest), matrix_of(via_frame))

    def do_spline_arc(self, s: Statement) -> None:
        raise Fault("SCIRC is not modelled")

    def do_spline(self, s: Statement) -> None:
        self.body(s.blocks[0])

    def do_relative(self, s: Statement) -> None:
        word, offset, *rest = s.values
        values = self.value(offset)
        if word == "PTP_REL" and any(key in AXIS_KEYS for key in values):
            axes = self.controller.axes()
            self.move(s, word, {key: axes[key] + value for key, value in values.items()}, _blend(rest))
            return
        pose = self.controller.pose()
        if "#TOOL" in rest:
            target = frame_of(pose @ matrix_of(values))
        else:
            here = frame_of(pose)
            target = {key: here[key] + values.get(key, 0.0) for key in FRAME_KEYS}
        self.move(s, word, target, _blend(rest))

    def move(
        self, s: Statement, word: str, target: dict[str, float], blend: str, via: np.ndarray | None = None
    ) -> None:
        c, robot = self.controller, self.world.kinematics
        settings, start, external_start = c.settings(), c.flange.copy(), dict(c.external)
        goal = {**c.external, **{key: target[key] for key in EXTERNAL_KEYS if key in target}}
        frame = np.eye(4)
        if any(key in AXIS_KEYS for key in target):
            axes = {**(c.axes() if c.q_deg is not None else {}), **target}
            c.external, c.q_deg = goal, np.array([axes[key] for key in AXIS_KEYS])
            c._stand()
        else:
            here = frame_of(c.pose()) if any(key not in target for key in FRAME_KEYS) else {}
            frame = matrix_of({**here, **{k: v for k, v in target.items() if k in FRAME_KEYS}})
            c.flange = c.base_matrix(goal) @ frame @ inverted(matrix_of(c.system["$TOOL"]))
            c.external = goal
            if robot is None:
                c.q_deg = None
            else:
                in_root = inverted(self.world.root(goal)) @ c.flange
                status, turn = (target.get(key) for key in "ST")
                bits = (None, None) if status is None or word != "PTP" else (int(status), int(turn or 0))
                c.q_deg = robot.joints(in_root, c.q_deg, *bits)
                if c.q_deg is None:
                    raise Fault(f"{word} leads out of reach")
        c.intended_q_deg, c.intended_external = c.q_deg, dict(goal)
        c.message = ""
        self.events.append(
            Motion(
                word, s.file, s.line, target, blend, settings, start, c.flange.copy(), c.q_deg,
                external_start, dict(goal), via, frame,
            )
        )  # fmt: skip
        self.pull_triggers()

    # values

    def do_assign(self, s: Statement) -> None:
        self.assign(s.values[0], copy.deepcopy(self.value(s.values[1])))

    def assign(self, target: tuple, value: Any) -> None:
        (name, indices), *components = target[1]
        c = self.controller
        if name in ("$OUT", "$ANOUT"):
            number = self.value(indices[0])
            (c.outputs if name == "$OUT" else c.analog_outputs)[number] = value
            self.events.append(Output(number, value, name == "$ANOUT", *self.place))
            return
        holder = self.holder(name)
        steps: list[Any] = [name, *self.index(indices)]
        for component, inner in components:
            steps += [component, *self.index(inner)]
        for step in steps[:-1]:
            holder = holder.setdefault(step, {})
        old = holder.get(steps[-1])
        if isinstance(old, dict) and isinstance(value, dict) and name in ("$VEL", "$ACC", "$APO"):
            value = {**old, **value}
        holder[steps[-1]] = value

    def holder(self, name: str) -> dict[str, Any]:
        if name in self.locals:
            return self.locals
        if name in getattr(self, "shared", {}):
            return self.shared
        for data in self.data.values():
            if name in data:
                return data
        return self.config if name in self.config else self.controller.system

    def index(self, indices: tuple | None) -> tuple:
        """Return the key of an element, none for a whole array."""
        if not indices:
            return ()
        values = tuple(self.value(i) for i in indices)
        return (values[0] if len(values) == 1 else values,)

    def value(self, expression: tuple) -> Any:
        node = expression[0]
        if node in ("number", "truth", "text", "enum"):
            return expression[1]
        if node == "aggregate":
            return {components[0]: self.value(inner) for components, inner in expression[1]}
        if node == "reference":
            return self.look_up(expression[1])
        if node == "call":
            return self.call(expression[1], expression[2])
        if node == "unary":
            value = self.value(expression[2])
            return _UNARY[expression[1]](value)
        return _binary(expression[1], self.value(expression[2]), self.value(expression[3]))

    def look_up(self, components: tuple) -> Any:
        name, indices = components[0]
        c = self.controller
        if name == "$IN":
            return c.input(self.value(indices[0]))
        if name == "$OUT":
            return c.outputs.get(self.value(indices[0]), False)
        if name == "$ANOUT":
            return c.analog_outputs.get(self.value(indices[0]), 0.0)
        if name == "$AXIS_ACT":
            value: Any = c.axes()
        elif name == "$POS_ACT":
            value = frame_of(c.pose())
        elif name == "$ROBROOT_C":
            value = frame_of(self.world.root(c.external))
        else:
            holder = self.holder(name)
            if name not in holder or holder[name] is None:
                raise Fault(f"{name} has no value")
            value = holder[name]
        for step in self.index(indices):
            value = self.element(name, value, step)
        for component, inner in components[1:]:
            value = self.element(name, value, component)
            for step in self.index(inner):
                value = self.element(name, value, step)
        return value

    def element(self, name: str, value: Any, key: Any) -> Any:
        if not isinstance(value, dict) or key not in value:
            raise Fault(f"{name} has no element {key}")
        return value[key]


def _blend(rest: list[Any]) -> str:
    return " ".join(part[1] for part in rest if isinstance(part, tuple) and part[0] == "approximation")


def _strcomp(one: str, other: str, case: str) -> bool:
    """Whether two texts are the same."""
    return one == other if case == "#CASE_SENS" else one.upper() == other.upper()


def _strfind(start: int, text: str, part: str, case: str) -> int:
    if case == "#NOT_CASE_SENS":
        text, part = text.upper(), part.upper()
    return text.find(part, start - 1) + 1


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "ABS": abs,
    "SQRT": sqrt,
    "SIN": lambda x: sin(radians(x)),
    "COS": lambda x: cos(radians(x)),
    "TAN": lambda x: tan(radians(x)),
    "ACOS": lambda x: degrees(acos(x)),
    "ATAN2": lambda y, x: degrees(atan2(y, x)),
    "STRFIND": _strfind,
    "STRCOMP": _strcomp,
    "STRLEN": len,
    "INV_POS": lambda frame: frame_of(inverted(matrix_of(frame))),
}
_UNARY: dict[str, Callable[[Any], Any]] = {
    "NOT": lambda a: not a,
    "B_NOT": lambda a: ~a,
    "-": lambda a: -a,
    "+": lambda a: a,
}


def _binary(operator: str, a: Any, b: Any) -> Any:
    if operator == ":":
        return frame_of(matrix_of(a) @ matrix_of(b))
    if operator == "/" and isinstance(a, int) and isinstance(b, int):
        return int(a / b)  # towards zero
    return _BINARY[operator](a, b)


_BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "==": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "AND": lambda a, b: a and b,
    "OR": lambda a, b: a or b,
    "EXOR": lambda a, b: a != b,
    "B_AND": lambda a, b: a & b,
    "B_OR": lambda a, b: a | b,
    "B_EXOR": lambda a, b: a ^ b,
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


# --- the judge -----------------------------------------------------------------------------------------


@dataclass
class Wrong:
    """A motion that goes wrong unguarded: ``reasons`` are "place", "start", "extra" or names of settings."""

    motion: Motion
    reasons: tuple[str, ...]
    after: str
    """Who touched the controller last: a subprogram's name, HALT, or nothing."""

    def __str__(self) -> str:
        at = f"{self.motion.file}:{self.motion.line}"
        return f"{at}: {self.motion.kind} after {self.after or 'nothing'}: {', '.join(self.reasons)}"


def judge(run: Run, intended: Run) -> list[Wrong]:
    """Return the motions of a run that go wrong unguarded, held against the run as intended.

    A PTP that only one of the runs makes is a way back, and no fault if it ends where the last intended
    motion ended; another motion beyond those intended is "extra".
    """
    wrong, expected, at = [], intended.motions, 0
    touched_by, is_warned = "", False
    for event in run.events:
        if isinstance(event, Step) and event.kind == "touch":
            touched_by, is_warned = event.text, False
        elif isinstance(event, Halt):
            is_warned = is_warned or (event.in_loop and bool(event.message))
        elif isinstance(event, Motion):
            same = at < len(expected) and (event.file, event.line) == (expected[at].file, expected[at].line)
            if same:
                reasons = differences(event, expected[at])
                at += 1
            else:
                before = expected[at - 1] if at else None
                returns = before is not None and not event.is_cp and same_place(event.flange, before.flange)
                reasons = () if returns else ("extra",)
            if reasons and not is_warned:
                wrong.append(Wrong(event, reasons, touched_by))
    return wrong


def differences(motion: Motion, intended: Motion) -> tuple[str, ...]:
    """Return in what a motion is not as intended: "place", "start", names of settings."""
    reasons = []
    if not same_place(motion.flange, intended.flange) or motion.external != intended.external:
        reasons.append("place")
    if motion.is_cp:
        moved = motion.external_start != intended.external_start
        if not same_place(motion.start, intended.start) or moved:
            reasons.append("start")
        names = [name for name in CP_SETTINGS if name != "$APO.CDIS" or motion.blend]
        if motion.kind == "CIRC":
            names.append("$CIRC_TYPE")
    else:
        names = list(PTP_SETTINGS)
        if any(key in AXIS_KEYS for key in motion.target):
            names = [name for name in names if name not in ("$BASE", "$TOOL", "$IPO_MODE")]
    reasons += [n for n in names if not _equal(motion.settings.get(n), intended.settings.get(n))]
    return tuple(reasons)


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_equal(a[key], b[key]) for key in a)
    if isinstance(a, int | float) and isinstance(b, int | float):
        return isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)
    return bool(a == b)
