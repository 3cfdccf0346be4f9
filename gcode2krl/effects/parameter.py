"""A number of an effect: its plausible range, its role in a fit, and its usual bound."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from gcode2krl.effects.mismatch import Mismatch

DIRECTION = ("direction_x", "direction_y", "direction_z")
Bound = Callable[[Mismatch], float]


class Role(Enum):
    """What a fit does with a parameter."""

    SIZE = "size"
    """How much of the effect there is: none at the nominal value. Fitted within its range."""
    SHAPE = "shape"
    """A form that a search tries at the values of the grid and a fit then changes within its range."""
    PHASE = "phase"
    """Angle in rad in a sine whose amplitude is the one size; both are fitted as two amplitudes."""
    COUNT = "count"
    """A form that a fit keeps at the values of the grid: an order, a number of teeth."""
    FREQUENCY = "frequency"
    """A form in Hz that a search tries at the peaks of the spectrum and a fit then changes."""
    MOMENT = "moment"
    """A time in s since the earliest run started, at which something changes for good; a search tries the
    change points of the residual, and a fit then changes it."""
    DIRECTION = "direction"
    """A component of `Effect.direction`. Fitted with the one size as a vector."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in the unit that its name carries."""

    name: str
    unit: str
    low: float
    high: float
    """Plausible range: the bounds of a fit."""
    nominal: float | None
    """Value at which the effect is not there; NaN = the model's own value (see `Effect.nominal`), None = the
    parameter only shapes an effect whose size another one gives."""
    start: float
    """A typical value: where a fit begins, and what a shape takes when it is not given."""
    source: str
    """Where the plausible range comes from."""
    linear: bool = False
    """True where the signals are proportional to (value - nominal), exactly or for small values."""
    grid: tuple[float, ...] = ()
    """Values of a shape from which a search should begin."""
    minimum: float = -math.inf
    """Below this the effect has no meaning; such a value is refused."""
    role: Role | None = None
    """Not stated: a shape where ``nominal`` is None, else a size. Never None once made."""
    usual: Bound | None = None
    """By how much a size may be off its nominal value in a sound machine, of the table of bounds."""
    minor: bool = False
    """A size beside a larger one, nominal unless the data show it: a clock's skew beside its offset."""

    def __post_init__(self) -> None:
        """Set the role that the nominal value implies where none is stated."""
        if self.role is None:
            object.__setattr__(self, "role", Role.SHAPE if self.nominal is None else Role.SIZE)

    @property
    def is_shape(self) -> bool:
        """Tell whether the parameter gives a form, not a size."""
        return self.role is not Role.SIZE

    @property
    def unset(self) -> float:
        """Return the value where none is given: no effect for a size, the typical one for a shape."""
        return self.start if self.nominal is None else self.nominal


def direction_parameters(source: str) -> tuple[Parameter, ...]:
    """Return the three components of a direction, along z where nothing is given."""
    return tuple(
        Parameter(
            name=name,
            unit="",
            low=-1.0,
            high=1.0,
            nominal=None,
            start=float(name == DIRECTION[2]),
            role=Role.DIRECTION,
            source=source,
        )
        for name in DIRECTION
    )


def size_from_zero(name: str, unit: str, *, high: float, start: float, source: str) -> Parameter:
    """Return a size of one sign that the effect is proportional to: none of it at 0."""
    return Parameter(
        name=name,
        unit=unit,
        low=0.0,
        high=high,
        nominal=0.0,
        start=start,
        linear=True,
        minimum=0.0,
        source=source,
    )


def phase_parameter(grid: tuple[float, ...] = ()) -> Parameter:
    """Return the phase of a sine, any angle in rad."""
    return Parameter(
        name="phase",
        unit="rad",
        low=-math.pi,
        high=math.pi,
        nominal=None,
        start=0.0,
        grid=grid,
        role=Role.PHASE,
        source="any",
    )
