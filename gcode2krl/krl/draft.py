"""A program written down and read back."""

from dataclasses import dataclass

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.krl.announce import PilotPlan
from gcode2krl.krl.composition import Layout, compose
from gcode2krl.krl.pilot_check import PilotCase
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.places import ProgramFiles
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.verify import VerifyReport, compare
from gcode2krl.tables import Joints, Targets, Toolpath


@dataclass(frozen=True)
class Content:
    """What a program says: its motions, and a pilot force or none."""

    targets: Targets
    joints: Joints
    text: PilotText | None = None
    case: PilotCase | None = None

    @classmethod
    def of(cls, plan: PilotPlan) -> "Content":
        """Return the content with a pilot force."""
        return cls(plan.targets, plan.joints, plan.text, plan.case)


class Composer:
    """Writes the files of a program, and reads them back."""

    def __init__(self, cell: Cell, files: ProgramFiles, original: Toolpath | None) -> None:
        """Take where the files go, and the Toolpath that the program is held against."""
        self._cell, self._files, self._original = cell, files, original

    def composed(self, content: Content, layout: Layout) -> VerifyReport:
        """Write a program; return what reading it back finds."""
        targets, joints, files = content.targets, content.joints, self._files
        files.write(compose(targets, joints, self._cell, files.name, layout, content.text))
        program = read_texts(files.texts, f"{files.name}{w.SOURCE_SUFFIX}")
        return compare(program, targets, joints, self._cell, pilot=content.case, original=self._original)
