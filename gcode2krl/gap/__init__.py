"""The sim-to-real gap: where runs differ from their prediction, why, and what is gone once it is modelled."""

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.result import Gap
from gcode2krl.gap.answer.words import text_report
from gcode2krl.gap.diagnosis import diagnose, diagnose_log

__all__ = ["Gap", "Mismatch", "diagnose", "diagnose_log", "text_report"]
