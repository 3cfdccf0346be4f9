"""The thresholds of the diagnosis: one frozen table by rooms, each with its reason; in docs/thresholds.md."""

from dataclasses import dataclass, field

from gcode2krl.gap.thresholds.beside import BesideThresholds
from gcode2krl.gap.thresholds.choose import ChooseThresholds
from gcode2krl.gap.thresholds.families import FamilyThresholds
from gcode2krl.gap.thresholds.fit import FitThresholds
from gcode2krl.gap.thresholds.slips import SlipThresholds
from gcode2krl.gap.thresholds.tell import TellThresholds

__all__ = ["THRESHOLDS", "Thresholds"]


@dataclass(frozen=True)
class Thresholds:
    """Every number that decides an answer, by the room that uses it."""

    beside: BesideThresholds = field(default_factory=BesideThresholds)
    fit: FitThresholds = field(default_factory=FitThresholds)
    families: FamilyThresholds = field(default_factory=FamilyThresholds)
    choose: ChooseThresholds = field(default_factory=ChooseThresholds)
    slips: SlipThresholds = field(default_factory=SlipThresholds)
    tell: TellThresholds = field(default_factory=TellThresholds)


THRESHOLDS = Thresholds()
