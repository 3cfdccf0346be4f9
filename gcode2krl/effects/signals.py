"""What the instruments of one run see, and the clocks that stamp it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from gcode2krl.arrays import Floats
from gcode2krl.effects.inputs import Inputs, resampled


class Clock(NamedTuple):
    """t_table = t·(1 + skew) + offset_s: with offset_s > 0 samples are older than their time stamp."""

    offset_s: float = 0.0
    skew: float = 0.0

    def true_time(self, t_s: Floats) -> Floats:
        """Return the time at which a sample stamped ``t_s`` was true."""
        return (t_s - self.offset_s) / (1.0 + self.skew)


CLOCKS = ("tracker", "force", "controller", "q_load", "q_cmd")
CLOCKS_OF: Mapping[str, tuple[str, ...]] = {
    "tcp_base_mm": ("tracker",),
    "force_meas_base_N": ("force",),
    "moment_meas_base_Nmm": ("force",),
    "q_act_rad": ("controller",),
    "q_load_rad": ("controller", "q_load"),
    "q_cmd_rad": ("controller", "q_cmd"),
}
"""Which clocks stamp which signal: that of its table, then the signal's own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Signals:
    """What instruments would see, on ``time_s`` (that of the inputs unless an effect plans anew)."""

    inputs: Inputs
    """The chain as really planned; its ``time_s``, ``move``, ``path_mm`` belong to these rows."""
    q_cmd_rad: Floats
    q_act_rad: Floats
    """(m, 6) motor side."""
    q_load_rad: Floats
    """(m, 6) behind the gear."""
    q_true_rad: Floats
    """(m, 6) what the axes truly stand at, elastic turns included."""
    tcp_base_mm: Floats
    """(m, 3) tool tip, deflection included."""
    force_base_N: Floats
    """(m, 3) true cutting force on the tool."""
    moment_base_Nmm: Floats
    force_meas_base_N: Floats
    """(m, 3) what the sensor says, turned to the axes of ``$BASE``."""
    moment_meas_base_Nmm: Floats
    tcp_rotation: Floats | None = None
    """(m, 4) quaternion of the true tool frame, where it was asked for."""
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    """Clock of each table that is not right."""
    radius_offset_mm: float = 0.0
    """What the cutter's radius is larger by than the model's; the finished part shows it."""

    part_shift_mm: Floats | None = None
    """(m, 3) by how much the part has given way under the cutter; the finished part shows it, a tracker of
    the tip does not."""

    @property
    def tip_on_part_mm(self) -> Floats:
        """Return where the tip is (m, 3) on the part: in ``$BASE``, less what the part has given way."""
        return self.tcp_base_mm if self.part_shift_mm is None else self.tcp_base_mm - self.part_shift_mm

    @property
    def time_s(self) -> Floats:
        """(m,) true time of the rows."""
        return self.inputs.time_s

    def true_time(self, signal: str, t_s: Floats) -> Floats:
        """Return when the samples of a signal stamped ``t_s`` were true, by the clocks that stamp it."""
        for name in CLOCKS_OF.get(signal, ()):
            t_s = self.clocks.get(name, Clock()).true_time(t_s)
        return t_s

    def table_time(self, signal: str, t_s: Floats) -> Floats:
        """Return the same by the clock of the signal's table alone."""
        for name in CLOCKS_OF.get(signal, ())[:1]:
            t_s = self.clocks.get(name, Clock()).true_time(t_s)
        return t_s

    def own_late_s(self, signal: str, t_s: Floats) -> Floats:
        """Return by how much a signal's own clock is wrong, beside that of its table."""
        late: Floats = self.true_time(signal, t_s) - self.table_time(signal, t_s)
        return late

    def seen(self, signal: str, t_s: Floats | None = None) -> Floats:
        """Return a signal as its table shows it at the stamps ``t_s``; ends are held."""
        stamps = self.time_s if t_s is None else t_s
        values: Floats = getattr(self, signal)
        right = all(name not in self.clocks for name in CLOCKS_OF.get(signal, ()))
        if right and t_s is None:
            return values
        return resampled(values, self.time_s, self.true_time(signal, stamps))
