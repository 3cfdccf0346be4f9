"""The controller's modal state: what is in force, and which statements leave it unknown.

Whoever is called, and whoever jogs at a HALT, may change every modal setting and may move the arm: a
subprogram taught with inline forms leaves its own ``$BASE``, ``$TOOL``, speeds, accelerations and position
behind. The writer asks here what to write behind such a statement (`arm_guard`, `settings_again`), the reader
where it forgets speed and approximation (`may_disturb`), and the rules whether a program as read knows its
state at every motion (`ControllerState`).
"""

import re
from dataclasses import dataclass, field

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.cell.template_rules import calls, statements
from gcode2krl.krl import statements as st
from gcode2krl.krl.number_text import fixed

STOOD = f"{w.OWN_PREFIX}STOOD"
"""Variable that holds where the arm stood before a statement that may move it."""
STOOD_DECLARATION = f"{w.DECL} E6AXIS {STOOD}"
TOLERANCE_DEG = 0.1
"""An arm that came back differs by less, in deg or mm of an external axis: 4 mm at a reach of 2.5 m. Assumed:
brakes that close and open again move an axis by a few hundredths of a degree."""
_ADVANCE_OF_UNLIMITED = 5
_OWN_INTERRUPTS = (w.RSI_INTERRUPT, w.STOP_INTERRUPT)
_STARTS_INTERRUPT = re.compile(r"(?:GLOBAL )?INTERRUPT (?:DECL|ON|ENABLE) ?(\d*)")
_HARMLESS_CALLS = w.FUNCTIONS | {w.BAS, w.PULSE, "EK", "IR_STOPM"}
_OWN_CALLS = ("RSI_", w.OWN_PREFIX)
_SETS = {
    w.BASE: r"\$BASE=|BAS\(#BASE,",
    w.TOOL: r"\$TOOL=|BAS\(#TOOL,",
    w.LOAD: r"\$LOAD=|BAS\(#TOOL,",
    "$VEL_AXIS": r"BAS\(#VEL_PTP,",
    "$ACC_AXIS": r"BAS\(#ACC_PTP,",
    "$ACC.CP": r"\$ACC\.CP=",
    "$VEL.ORI1": r"\$VEL\.ORI1=",
    "$VEL.ORI2": r"\$VEL\.ORI2=",
    "$ACC.ORI1": r"\$ACC\.ORI1=",
    "$ACC.ORI2": r"\$ACC\.ORI2=",
    "$ORI_TYPE": r"\$ORI_TYPE=",
    "$CIRC_TYPE": r"\$CIRC_TYPE=",
    "$IPO_MODE": r"\$IPO_MODE=",
    "$ADVANCE": r"\$ADVANCE=",
}
"""Modal settings that motions depend on, and what sets each. ``$VEL.CP`` and ``$APO.CDIS`` are not among
them: they stand at the motions, and the reader forgets them by itself (`krl.read`)."""
_SETTERS = {name: re.compile(pattern) for name, pattern in _SETS.items()}
_COMPARES_ARM = re.compile(r"WHILE.*" + ".*".join(rf"\$AXIS_ACT\.A{k}-" for k in range(1, 7)))


def disturbs(statement: str) -> bool:
    """Tell whether a KRL statement may change modal state or move the arm; upper case, single spaces.

    That is a HALT, a call of a subprogram that is not the program's own, and whatever lets an interrupt call
    one.
    """
    if statement == w.HALT:
        return True
    interrupt = _STARTS_INTERRUPT.match(statement)
    if interrupt:
        return not interrupt[1] or int(interrupt[1]) not in _OWN_INTERRUPTS
    return any(name not in _HARMLESS_CALLS and not name.startswith(_OWN_CALLS) for name in calls(statement))


def may_disturb(text: str) -> bool:
    """Tell whether a statement of KRL text may change modal state or move the arm."""
    return any(map(disturbs, statements(text)))


def settings(cell: Cell, base: str, tool: int, *, has_arcs: bool) -> str:
    """Return the statements that set the whole modal state; ``base`` are those of ``$BASE``."""
    controller = cell.controller
    orientation_speed = fixed(controller.vel_ori_deg_s, 3)
    orientation_acceleration = fixed(controller.acc_ori_deg_s2, 3)
    advance = _ADVANCE_OF_UNLIMITED if controller.advance == "unlimited" else controller.advance
    lines = [
        base,
        st.tool_statements(cell, tool),
        f"{w.BAS} (#VEL_PTP,{controller.ptp_percent} )",
        f"{w.BAS} (#ACC_PTP,{controller.ptp_percent} )",
        f"$ACC.CP={fixed(controller.acc_cp_m_s2, 3)}",
        f"$VEL.ORI1={orientation_speed}",
        f"$VEL.ORI2={orientation_speed}",
        f"$ACC.ORI1={orientation_acceleration}",
        f"$ACC.ORI2={orientation_acceleration}",
        "$ORI_TYPE=#VAR",
        *([w.CIRC_TYPE] if has_arcs else []),
        "$IPO_MODE=#BASE",
        f"$ADVANCE={advance}",
    ]
    return "\n".join(lines)


def settings_again(settings_text: str) -> str:
    """Return the settings as they stand behind a statement that may have changed them."""
    return f"{w.FOLD} settings again, as they may have been changed\n{settings_text}\n{w.ENDFOLD} (settings)"


def arm_before() -> str:
    """Return the statements that remember where the arm stands, once it does."""
    return f"{w.WAIT} {w.SEC} 0.0\n{STOOD}=$AXIS_ACT"


def arm_guard(place: str, cell: Cell) -> str:
    """Return the statements that let nobody pass whose arm stands elsewhere than `arm_before` found it.

    ``place`` names the statement in the message: ``Line 12``.
    """
    axes = [*w.AXIS_KEYS, *sorted(cell.external)]
    return (
        st.environment()
        .get_template("stood_guard.j2")
        .render(axes=axes, stood=STOOD, tolerance=TOLERANCE_DEG, place=place)
    )


@dataclass
class ControllerState:
    """What is known of the controller along a program as read.

    At the beginning no setting is known; where the arm stands does not matter before the first motion, which
    is a PTP to HOME.
    """

    names: tuple[str, ...]
    """The settings that the program's motions depend on."""
    unknown: dict[str, str] = field(init=False)
    """Setting → the statement that may have changed it."""
    arm_moved_by: str = ""
    """The statement that may have moved the arm, empty where its place is known."""
    _has_moved: bool = False
    _stood_is_valid: bool = False
    _loops: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.unknown = dict.fromkeys(self.names, "")

    @classmethod
    def at_start(cls, *, has_arcs: bool) -> "ControllerState":
        """Return the state in which a program begins."""
        return cls(tuple(name for name in _SETTERS if has_arcs or name != "$CIRC_TYPE"))

    def move(self) -> None:
        """Take a motion."""
        self._has_moved = True

    def take(self, text: str) -> None:
        """Take a statement that is no motion."""
        statement = re.sub(r"\s+", " ", text).strip().upper()
        squeezed = statement.replace(" ", "")
        if squeezed == f"{STOOD}=$AXIS_ACT":
            self._stood_is_valid = not self.arm_moved_by
        elif statement.startswith("WHILE"):
            self._loops.append(squeezed)
        elif statement == w.BLOCKS["WHILE"] and self._loops:
            # A loop is left only when its condition is false, however often somebody jogged at a HALT in it.
            condition = self._loops.pop()
            if _COMPARES_ARM.match(condition) and (STOOD not in condition or self._stood_is_valid):
                self.arm_moved_by = ""
        elif disturbs(statement):
            if not self._never_left(statement):
                self.unknown = dict.fromkeys(self.names, text)
                self.arm_moved_by = text if self._has_moved else ""
        else:
            for name in [name for name in self.unknown if _SETTERS[name].match(squeezed)]:
                del self.unknown[name]

    def _never_left(self, statement: str) -> bool:
        """Tell whether a HALT stands in a loop that repeats it until the program is cancelled."""
        return statement == w.HALT and bool(self._loops) and w.RSI_RESULT in self._loops[-1]
