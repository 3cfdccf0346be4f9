"""The clock of an instrument's table."""

from dataclasses import replace

from gcode2krl.cell import Cell
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, Target
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import Parameter
from gcode2krl.effects.signals import CLOCKS, Clock, Signals

_LINKS = {
    "tracker": frozenset({"mechanics"}),
    "force": frozenset({"force"}),
    "controller": frozenset({"timing", "path", "mechanics"}),
    "q_load": frozenset({"gear"}),
    "q_cmd": frozenset({"timing", "path", "servo"}),
}


class WrongClock(Effect):
    """A table's clock is set off and runs wrong: t_table = t·(1 + skew) + offset_s.

    With ``offset_s`` > 0 the samples are older than their time stamp. ``controller`` stamps all of the
    controller's table; ``q_load`` and ``q_cmd`` come on top for those columns (encoders of their own, an
    interpolator that is ahead of the drives).
    """

    name = "clock"
    family = "timing"
    is_clock = True
    links = frozenset().union(*_LINKS.values())
    where = frozenset({Where.JOINT, Where.TIP, Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.VELOCITY, Dependence.RUN_TIME})
    parameters = (
        Parameter(
            name="offset_s",
            unit="s",
            low=-0.5,
            high=0.5,
            nominal=0.0,
            start=0.01,
            source="tables started by hand or over a network up to some 0.1 s; interpolator 40-100 ms ahead",
        ),
        Parameter(
            name="skew",
            unit="",
            low=-1e-3,
            high=1e-3,
            nominal=0.0,
            start=1e-4,
            linear=True,
            minor=True,
            source="free quartz oscillators 10-100 ppm, a wrong cycle time 1000 ppm",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the tables and columns with a clock."""
        return CLOCKS

    def links_at(self, target: Target) -> frozenset[str]:
        """Return the links between this table and another one."""
        return _LINKS.get(target or "", self.links)

    def searched(self, link: str, target: Target, examined: frozenset[str]) -> bool:
        """Leave out clocks of the controller that an earlier link has set right."""
        if not super().searched(link, target, examined):
            return False
        if link == "path":
            return target == "controller"
        if link == "servo":
            return target == "q_cmd"
        return target != "controller" or "path" not in examined

    def usual(self, mismatch: Mismatch, duration_s: float, clocks: int = 1) -> dict[str, float]:
        """Return what the clocks may be off by; the skew adds that much over the run."""
        offset_s = clocks * mismatch.clock_s
        return {"offset_s": offset_s, "skew": offset_s / duration_s}

    def instruments(self, signals: Signals, applied: Applied) -> Signals:
        """Return the signals with that clock."""
        before = signals.clocks.get(applied.target or "", Clock())
        clock = Clock(before.offset_s + applied["offset_s"], before.skew + applied["skew"])
        return replace(signals, clocks={**signals.clocks, applied.target or "": clock})


EFFECT = WrongClock()
