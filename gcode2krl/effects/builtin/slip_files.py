"""Set-up slips of files: the run of another program, a column in another unit."""

from dataclasses import replace

from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import Signals
from gcode2krl.errors import input_error

_COLUMNS = {
    "tracker": ("tcp_base_mm",),
    "force": ("force_meas_base_N", "moment_meas_base_Nmm"),
    "controller": ("q_cmd_rad", "q_act_rad", "q_load_rad"),
}
_LINKS = {"tracker": "mechanics", "force": "force", "controller": "path"}


class OtherProgram(Effect):
    """The run is that of another program. Which one is not known, so nothing can be predicted from it."""

    name = "other_program"
    family = "set-up slips"
    links = frozenset({"path", "timing"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.TRAVEL})
    kind = "slip"

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Refuse: a prediction of the program that was run says what it does."""
        raise input_error(
            "effect-impossible",
            "other_program can be found but not predicted",
            "predict the program that was run",
        )


class Unit(Effect):
    """A table's values are ``factor`` times what its column names say: m for mm, radians for degrees."""

    name = "unit"
    family = "set-up slips"
    links = frozenset(_LINKS.values())
    where = frozenset({Where.JOINT, Where.TIP, Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.OWN_ANGLE, Dependence.PLACE, Dependence.FORCE})
    kind = "slip"
    parameters = (
        Parameter(
            name="factor",
            unit="",
            low=1e-4,
            high=1e4,
            nominal=1.0,
            start=1000.0,
            minimum=1e-9,
            source="1000, 25.4, 57.3 and their inverses",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the tables."""
        return tuple(_COLUMNS)

    def links_at(self, target: Target) -> frozenset[str]:
        """Return the link of the table."""
        return frozenset({_LINKS[target]}) if target in _LINKS else self.links

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with that table in the other unit."""
        names = _COLUMNS[applied.target or ""]
        return replace(signals, **{name: getattr(signals, name) * applied["factor"] for name in names})


EFFECT = (OtherProgram(), Unit())
