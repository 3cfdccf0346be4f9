"""The cell: robot, controller, tools, frames and outputs, read from ``cell.toml`` over ``models/``.

Nothing is assumed: what a cell file does not state is missing, and a stage that needs it raises
`RefusedError` with the key's name. ``based_on`` names a cell whose values are taken over; each value taken
over is listed in ``taken_over``. Without a file, the demonstration cell serves: the KR 300 R2500 ultra of
Hähn & Weigold 2020. Every key carries its unit; `sections` has the tables.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.cell import carriers
from gcode2krl.cell.descriptions import NOT_OF_A_FILE, described_schema
from gcode2krl.cell.sections import (
    Axis,
    Cables,
    Clearance,
    Collision,
    Compliance,
    Controller,
    EffectEntry,
    Frame,
    Frames,
    GuardInput,
    Home,
    Load,
    Machine,
    Material,
    Obstacle,
    OneLine,
    Pilot,
    Program,
    ResultLimits,
    Robot,
    Section,
    Spindle,
    Stock,
    Table,
    TakenOver,
    Tool,
    ToolNumber,
    Unconfirmed,
    Verified,
    missing,
)
from gcode2krl.cell.sections.external import EXTERNAL_NAMES, ExternalAxis, ExternalName
from gcode2krl.cell.sections.online import Online
from gcode2krl.exchange.html import block, text_table
from gcode2krl.units import RAD_PER_DEG

# A cell on one line, and as a notebook shows it.

_MOST_LETTERS = 40
"""Of a name on one line."""


def cell_words(name: str, robot: str, tools: int, is_confirmed: bool) -> str:
    """Return ``my cell: KR 300 R2500 ultra, 3 tools, not verified``."""
    facts = [robot[:_MOST_LETTERS] or "no robot", f"{tools} tool{'' if tools == 1 else 's'}"]
    facts.append("verified" if is_confirmed else "not verified")
    return f"{name[:_MOST_LETTERS] or 'without a name'}: {', '.join(facts)}"


def cell_html(title: str, facts: Mapping[str, object], tools: Mapping[int, Sequence[object]]) -> str:
    """Return the facts of a cell and its tools (model, diameter, teeth, length) as HTML."""
    rows = [(name, "not stated" if value is None or value == "" else value) for name, value in facts.items()]
    listed = [
        (f"T{number}", *("" if value is None else value for value in tool)) for number, tool in tools.items()
    ]
    head = ("tool", "model", "diameter (mm)", "teeth", "length (mm)")
    return block(title, text_table((), rows), text_table(head, listed) if listed else "")


CODES_WITHOUT_SIGNALS = {
    "M0": "HALT",
    "M1": "; optional stop (M1) is not used",
    "M2": "; program end (M2)",
    "M30": "; program end (M30)",
}
"""KRL of the M-codes that switch no signal of a cell; a cell file may replace it."""
_WORK_OFFSET = r"^G(5[4-9]|59\.[123]|5(0[5-9]|[1-9]\d)|54\.1P([1-9]\d?|[12]\d\d|300))$"


class Cell(Section):
    """A resolved cell; what its file and its base do not state is None, empty or a documented default.

    >>> from gcode2krl import load_cell
    >>> cell = load_cell()
    >>> cell
    Cell(KR 300 R2500 ultra, demonstration: KR 300 R2500 ultra, 20 tools, not verified)
    >>> cell.controller.cycle_s, cell.tool[1].diameter_mm
    (0.012, 16.0)
    """

    name: OneLine = ""
    based_on: OneLine = ""
    """The cell whose values are taken over: ``demonstration`` or another cell file."""
    verified: Verified | None = None
    robot: Robot = Robot.model_construct()
    controller: Controller = Controller.model_construct()
    machine: Machine | None = None
    """The machine tool that a five-axis program was made for."""
    tool: dict[ToolNumber, Tool] = Field(default_factory=dict)
    mounted_tool: Annotated[int, Field(strict=True, ge=1, le=99999)] | None = None
    """The tool in the spindle when a program starts, until its first M6."""
    frames: Frames = Frames.model_construct()
    work_offsets: dict[Annotated[str, Field(pattern=_WORK_OFFSET)], Frame] = Field(default_factory=dict)
    """Zeros of the program; a Fanuc's G54.1 P3 is ``G54.1P3``."""
    external: dict[ExternalName, ExternalAxis] = Field(default_factory=dict)
    """Axes beside A1 to A6."""
    home: Home = Home.model_construct()
    clearance: Clearance = Clearance.model_construct()
    material: Material | None = None
    stock: Stock | None = None
    table: Table | None = None
    obstacle: Annotated[tuple[Obstacle, ...], Field(max_length=100)] = ()
    """What stands in the cell."""
    collision: Collision = Collision.model_construct()
    cables: Cables | None = None
    limits: ResultLimits = ResultLimits.model_construct()
    load: Load = Load.model_construct()
    compliance: Compliance = Compliance.model_construct()
    pilot: Pilot = Pilot.model_construct()
    online: Online = Online.model_construct()
    spindle: Spindle = Spindle.model_construct()
    effects: tuple[EffectEntry, ...] = ()
    guard_inputs: tuple[GuardInput, ...] = ()
    program: Program = Program.model_construct()
    m_code: dict[Annotated[str, Field(pattern=r"^M(0|[1-9][0-9]{0,3})$")], str] = Field(default_factory=dict)
    """KRL (Jinja2) for each M-code, ``M3 = "…"``; an M-code without an entry is refused."""
    tool_change: str = ""
    """KRL (Jinja2) that changes the tool on the clearance plane."""
    taken_over: tuple[TakenOver, ...] = ()
    """What came from ``based_on``; only the reader of cell files writes it."""
    defaults: tuple[str, ...] = ()
    """Dotted keys of documented defaults that nobody stated; only the reader of cell files writes it."""
    unconfirmed: tuple[Unconfirmed, ...] | None = None
    """What differs from what was confirmed, as the reader of cell files compared it; None: nobody confirmed
    it, or the values were replaced since."""

    @property
    def is_confirmed(self) -> bool:
        """True if a person confirmed every value as it is; values that were taken over are never covered.

        >>> from gcode2krl import load_cell
        >>> load_cell().is_confirmed
        False
        """
        return self.verified is not None and self.unconfirmed == () and not self.taken_over

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy; one with other values is confirmed by nobody.

        >>> from gcode2krl import load_cell
        >>> load_cell().model_copy(update={"name": "mine"}).is_confirmed
        False
        """
        changed: dict[str, Any] = {} if update is None or "unconfirmed" in update else {"unconfirmed": None}
        return super().model_copy(update={**(update or {}), **changed}, deep=deep)

    def under(self, **sections: Any) -> Self:
        """Return the cell under a job or options, which its confirmation does not speak of.

        >>> from gcode2krl import load_cell
        >>> load_cell().under(stock=None).stock is None
        True
        """
        return self.model_copy(update={**sections, "unconfirmed": self.unconfirmed})

    @property
    def usual_tool(self) -> int | None:
        """The mounted tool, else that of the smallest number; None where the cell has none.

        >>> from gcode2krl import load_cell
        >>> load_cell().usual_tool
        1
        """
        return self.mounted_tool if self.mounted_tool is not None else min(self.tool, default=None)

    @property
    def clearance_z_mm(self) -> float | None:
        """Height of the clearance plane in ``$BASE``, None where the cell has none.

        >>> from gcode2krl import load_cell
        >>> load_cell().clearance_z_mm
        100.0
        """
        z_mm = self.clearance.z_mm
        return None if z_mm is None or z_mm == "none" else float(z_mm)

    def home_q_rad(self) -> Floats:
        """Return HOME (6,) in radians; raises `RefusedError` where it is not stated.

        >>> from gcode2krl import load_cell
        >>> float(load_cell().home_q_rad()[1]).__round__(4)
        -1.5708
        """
        if self.home.q_deg is None:
            raise missing("home.q_deg")
        return np.array(self.home.q_deg) * RAD_PER_DEG

    def base_matrix(self) -> Floats:
        """Return ``$BASE`` in the robot root (4, 4), the external axes at rest.

        Raises `RefusedError` where it is not stated.

        >>> from gcode2krl import load_cell
        >>> float(load_cell().base_matrix()[0, 3])
        1500.0
        """
        if self.external:
            at_rest: Floats = self.base_in_root(self.external_rest()[None])[0]
            return at_rest
        base = self.base_in_world()
        robroot = self.frames.robroot
        return base if robroot is None else fr.invert(robroot.matrix()) @ base

    def base_in_root(self, external: Floats) -> Floats:
        """Return ``$BASE`` in the robot root (n, 4, 4), E1 to E6 at (n, 6) in mm and degrees.

        >>> from gcode2krl import load_cell
        >>> cell = load_cell()
        >>> cell.base_in_root(cell.external_rest()[None]).shape
        (1, 4, 4)
        """
        robroot = self.frames.robroot
        root = carriers.root_in_world(
            self.external, external, np.eye(4) if robroot is None else robroot.matrix()
        )
        base = carriers.base_in_world(self.external, external, self.stated_base(), self.frames.base_on)
        return np.asarray(fr.invert(root) @ base)

    def base_in_world(self) -> Floats:
        """Return ``$BASE`` in ``$WORLD`` (4, 4), the external axes at rest.

        The z of ``$WORLD`` points upwards, however the robot is mounted. Raises `RefusedError` where it is
        not stated.

        >>> from gcode2krl import load_cell
        >>> load_cell().base_in_world().shape
        (4, 4)
        """
        at = self.external_rest()[None]
        base: Floats = carriers.base_in_world(self.external, at, self.stated_base(), self.frames.base_on)[0]
        return base

    def stated_base(self) -> Floats:
        """Return ``$BASE`` (4, 4) as it is stated: in ``$WORLD``, or in the table that carries it.

        >>> from gcode2krl import load_cell
        >>> float(load_cell().stated_base()[0, 3])
        1500.0
        """
        if self.frames.base is None:
            raise missing("frames.base")
        return self.frames.base.matrix()

    def external_rest(self) -> Floats:
        """Return E1 to E6 (6,) in mm and degrees where nobody says where they are; 0 without the axis.

        >>> from gcode2krl import load_cell
        >>> load_cell().external_rest().tolist()
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        """
        known = self.external
        return np.array([known[name].resting_place() if name in known else 0.0 for name in EXTERNAL_NAMES])

    def tool_matrix(self, number: int) -> Floats:
        """Return the tool frame (4, 4) in the flange whose z points from tip to holder.

        A tool of another length than ``frames.tool_length_mm`` has its tip shifted along that axis. Raises
        `RefusedError` where the cell does not state the tool, the frame or a length.

        >>> from gcode2krl import load_cell
        >>> [float(value) for value in load_cell().tool_matrix(1)[:3, 3]]
        [250.0, 0.0, 250.0]
        """
        lacking = self.missing_of_tool(number)
        tool, frame = self.tool.get(number), self.frames.tool
        if tool is not None and tool.frame is not None:
            return tool.frame.matrix() @ controller_axes(tool.axis or "+z")
        if tool is None or frame is None or lacking:
            raise missing(*lacking)
        longer_mm = (tool.length_mm or 0.0) - (self.frames.tool_length_mm or 0.0)
        shift = fr.transform([0.0, 0.0, -longer_mm], np.eye(3))
        return frame.matrix() @ shift

    def load_of(self, number: int) -> Load:
        """Return what hangs on the flange with a tool: its own ``load``, else that of the cell.

        >>> from gcode2krl import load_cell
        >>> load_cell().load_of(1).mass_kg
        120.0
        """
        tool = self.tool.get(number)
        return self.load if tool is None or tool.load is None else tool.load

    def missing_of_tool(self, number: int) -> tuple[str, ...]:
        """Return the missing keys that the position of a tool's tip depends on; empty if none is missing.

        >>> from gcode2krl import load_cell
        >>> load_cell().missing_of_tool(99)
        ('tool.99',)
        """
        tool = self.tool.get(number)
        if tool is None:
            return (f"tool.{number}",)
        if tool.frame is not None:
            return ()
        stated = {
            "frames.tool": self.frames.tool,
            "frames.tool_length_mm": self.frames.tool_length_mm,
            f"tool.{number}.length_mm": tool.length_mm,
        }
        return tuple(key for key, value in stated.items() if value is None)

    def templates(self) -> dict[str, str]:
        """Return key → template of all KRL that the cell brings along.

        >>> from gcode2krl import load_cell
        >>> load_cell().templates()["m_code.M0"]
        'HALT'
        """
        codes = {f"m_code.{code}": text for code, text in self.m_code.items()}
        others = {
            "tool_change": self.tool_change,
            "program.prologue": self.program.prologue,
            "program.epilogue": self.program.epilogue,
        }
        return codes | {key: text for key, text in others.items() if text}

    def __repr__(self) -> str:
        return f"Cell({cell_words(self.name, self.robot.title, len(self.tool), self.is_confirmed)})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        facts = {
            "robot": self.robot.title,
            "controller": self.controller.model,
            "material": None if self.material is None else self.material.name,
            "stock": None if self.stock is None else "stated",
            "$BASE": None if self.frames.base is None else "stated",
            "spin": self.frames.spin,
            "confirmed": "yes" if self.is_confirmed else f"no, {len(self.taken_over)} values are taken over",
        }
        tools = {
            number: (tool.model, tool.diameter_mm, tool.teeth, tool.length_mm)
            for number, tool in self.tool.items()
        }
        return cell_html(repr(self), facts, tools)


def controller_axes(axis: Axis) -> Floats:
    """Return Q (4, 4) that turns the inner tool frame (z = tip to holder) into the controller's axes.

    ``T_controller = T_inner · Q⁻¹``; Q maps z onto the controller's ``axis``.
    """
    turns = {
        "+z": (0, 0, 0),
        "-z": (0, 0, 180),
        "+x": (0, 90, 0),
        "-x": (0, -90, 0),
        "+y": (0, 0, -90),
        "-y": (0, 0, 90),
    }
    return fr.transform([0.0, 0.0, 0.0], np.round(fr.rotation_from_abc(np.array(turns[axis]) * RAD_PER_DEG)))


def plain_view(cell: Cell) -> dict[str, Any]:
    """Return the cell as plain values: numbers, text, and tables of them, as its templates see it."""
    signature = {"sections", "values", "digests"}
    view = cell.model_dump(mode="python", exclude={*NOT_OF_A_FILE, "verified"})
    view["verified"] = None if cell.verified is None else cell.verified.model_dump(exclude=signature)
    view["clearance_z_mm"] = cell.clearance_z_mm
    return view


def as_toml(cell: Cell) -> dict[str, Any]:
    """Return a resolved cell as plain tables; what is None is left out, as TOML has no null."""
    record = cell.model_dump(mode="json", exclude_none=True)
    record["tool"] = {str(number): tool for number, tool in record["tool"].items()}
    return record


def cell_schema() -> dict[str, Any]:
    """Return the JSON schema of a cell file for editors; nothing is required, as a file may be partial."""
    schema = described_schema(Cell)
    _drop_required(schema)
    schema["title"] = "gcode2krl cell file"
    schema["description"] = schema["description"].partition("\n\n>>>")[0]  # without the example in Python
    return schema


def _drop_required(node: Any) -> None:
    if isinstance(node, dict):
        if isinstance(node.get("required"), list):
            del node["required"]
        for child in node.values():
            _drop_required(child)
    elif isinstance(node, list):
        for child in node:
            _drop_required(child)
