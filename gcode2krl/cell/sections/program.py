"""Sections of the program: its layout, the pilot, who verified the cell, and what it took over."""

import datetime
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from gcode2krl.cell.sections.fields import Finite, OneLine, Positive, Section
from gcode2krl.cell.sections.surroundings import Point
from gcode2krl.cell.template_rules import external_problem

# Only variables of sensors, or the integrator's own: never one of the planner, a frame or an output.
_OWN = r"[A-FH-Za-fh-z][A-Za-z0-9_]{0,23}"
_PILOT_VARIABLE = rf"^(\$SEN_PINT\[[0-9]{{1,2}}\]|{_OWN}(\[[0-9]{{1,3}}\])?)$"
_PILOT_ARRAY = rf"^(\$SEN_PREA|{_OWN})$"


class Pilot(Section):
    """How the program carries the pilot force."""

    form: Literal["index", "values", "none"] = "index"
    frame: Literal["tcp", "base"] = "tcp"
    """Frame in which knots state force and deflection."""
    lead_s: Positive = 0.040
    """Least time between the announcement of a knot and the knot."""
    tolerance_N: Positive | None = None
    """Largest error of the knots' polyline; default: the larger of 10 N and 3 % of the peak."""
    index_variable: Annotated[str, Field(pattern=_PILOT_VARIABLE)] = "$SEN_PINT[1]"
    hash_variable: Annotated[str, Field(pattern=_PILOT_VARIABLE)] = "$SEN_PINT[2]"
    value_variable: Annotated[str, Field(pattern=_PILOT_ARRAY)] = "$SEN_PREA"
    max_active: Annotated[int, Field(strict=True, ge=1, le=8)] = 8
    """Triggers that may wait at the same time."""


_EXTERNAL = r"^[A-Za-z][A-Za-z0-9_]{0,23} ?\([A-Za-z0-9_ :,\[\]]*\)$"


class Start(Section):
    """How the machine stands and in which modes its control is when a program starts that does not say so.

    The tool that is mounted then is `Cell.mounted_tool`.
    """

    motion: Literal["G0", "G1"] | None = None
    plane: Literal["G17", "G18", "G19"] | None = None
    unit: Literal["G20", "G21"] | None = None
    distance: Literal["G90", "G91"] | None = None
    feed: Literal["G94", "G95"] | None = None
    retract: Literal["G98", "G99"] | None = None
    spindle_rpm: Positive | None = None
    """Of a spindle that is switched by hand: the program halts until a person has seen it turn."""
    position_mm: Point | None = None
    """Where the tip stands, in ``$BASE``: the program goes there first."""

    def modes(self) -> dict[str, str]:
        """Return the modes that are stated, G-codes by their group: ``{"distance": "G90"}``."""
        return self.model_dump(exclude_none=True, exclude={"spindle_rpm", "position_mm"})


class Cutter(Section):
    """What a Fanuc's parameters say of cutter compensation (G41, G42); without both it is refused."""

    lead_in: Literal["a", "b", "c-a", "c-b"] | None = None
    """Type A leads at right angles to the first move of the contour, type B around the corner (5003)."""
    d: Literal["radius", "diameter", "wear"] | None = None
    """What the offset D holds: the tool's radius, its diameter, or its wear alone."""


class Program(Section):
    """How the program is read, and how the KRL text is laid out."""

    max_lines: Annotated[int, Field(strict=True, ge=100)] = 5000
    comment_every: Annotated[int, Field(strict=True, ge=0, le=10**9)] = 50
    """A comment with the G-code line after this many motions; 0 = only at events."""
    tool_length: Literal["g43", "from_table"] = "g43"
    """Who applies the length of a tool: ``g43`` in the G-code, or ``from_table`` of the cell while it is in
    the spindle, for posts that set lengths by touching off and never write G43."""
    start: Start = Start.model_construct()
    cutter: Cutter = Cutter.model_construct()
    warn_size_mb: Positive = 4.0
    externals: tuple[Annotated[str, Field(pattern=_EXTERNAL)], ...] = ()
    """Subprograms that templates call, as in KRL: ``SPINDLE_ON(INT :IN)``."""
    prologue: str = ""
    """KRL (Jinja2) between the guard and the first motion."""
    epilogue: str = ""
    """KRL (Jinja2) after the last motion."""
    memory_moves: Annotated[int, Field(strict=True, ge=1)] = 30000
    """LIN lines that any controller can hold."""

    @field_validator("externals")
    @classmethod
    def _subprograms(cls, externals: tuple[str, ...]) -> tuple[str, ...]:
        for problem in filter(None, map(external_problem, externals)):
            raise ValueError(problem)
        return externals


_Day = Annotated[str, Field(pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}$")]
_Person = Annotated[OneLine, Field(min_length=1, max_length=100)]
_KEY_DIGESTS = r"^[^ ,]+ [0-9a-f]{8}(, [^ ,]+ [0-9a-f]{8})*$"


class SignedSection(Section):
    """The signature of a section: a hash of who confirmed what of it."""

    hash: Annotated[str, Field(pattern=r"^[0-9a-f]{12}$")]
    by: _Person | None = None
    """Who confirmed this section; None: who confirmed the cell."""
    date: _Day | None = None


class Verified(Section):
    """Who confirmed which values; `gcode2krl models confirm` writes it, and without sections it is none."""

    by: _Person
    date: _Day
    sections: dict[str, SignedSection] = Field(default_factory=dict)
    values: dict[str, Any] = Field(default_factory=dict)
    """Dotted key -> the value that was confirmed."""
    digests: dict[str, Annotated[str, Field(pattern=_KEY_DIGESTS)]] = Field(default_factory=dict)
    """Section -> ``key hash, key hash, …`` of the confirmed values that are not written out."""

    @field_validator("date")
    @classmethod
    def _day(cls, given: str) -> str:
        try:
            datetime.date.fromisoformat(given)
        except ValueError:
            raise ValueError(f"{given} is not a date (year-month-day)") from None
        return given


class Unconfirmed(Section):
    """A value, or a section, that differs from what was confirmed."""

    key: str
    """Dotted; of a section whose signature does not fit, or that has none, the section."""
    kind: Literal["changed", "new", "removed", "forged", "unsigned"]
    now: str = ""
    was: str = ""
    """The confirmed value; empty where only its hash was kept."""
    by: str = ""
    date: str = ""


ToolNumber = Annotated[int, Field(ge=1, le=99999)]


class TakenOver(Section):
    """A value that a cell took over from the one it is based on."""

    key: str
    """Dotted, as in the file: ``frames.base``."""
    value: str
    source: str
    """The file, or ``demonstration``."""
    verified: bool
    """True where that file is verified."""


class EffectEntry(Section):
    """Something that the nominal model leaves out, as `gcode2krl diagnose --apply` writes it."""

    name: str
    target: str | None = None
    parameters: dict[str, Finite | tuple[Finite, ...]] = Field(default_factory=dict)
    source: str = ""
