"""The sim-to-real gap: where runs differ from their prediction, why, and what is gone once it is modelled."""

from gcode2krl.gap.bounds import Mismatch
from gcode2krl.gap.diagnose import diagnose, diagnose_log
from gcode2krl.gap.report import text_report
from gcode2krl.gap.result import Gap

__all__ = ["Gap", "Mismatch", "diagnose", "diagnose_log", "text_report"]
