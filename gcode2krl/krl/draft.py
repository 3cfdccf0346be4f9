"""A program written down and read back: at once, or in a thread while its forecast is completed."""

import contextvars
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.compiled.memory import give_back
from gcode2krl.compiled.threads import cores
from gcode2krl.krl.announce import PilotPlan
from gcode2krl.krl.composition import Layout, compose
from gcode2krl.krl.pilot_check import PilotCase
from gcode2krl.krl.pilot_text import PilotText
from gcode2krl.krl.places import ProgramFiles
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.verify import VerifyReport, compare
from gcode2krl.tables import Joints, Targets, Toolpath

Result = TypeVar("Result")


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
        self._draft: tuple[Content, Layout, Future[VerifyReport]] | None = None

    def composed(self, content: Content, layout: Layout) -> VerifyReport:
        """Write a program, unless it is the one written last; return what reading it back finds."""
        if self._draft is not None:
            drafted, as_drafted, report = self._draft
            if content is drafted and layout == as_drafted:
                return report.result()
            self._draft = None
        targets, joints, files = content.targets, content.joints, self._files
        files.write(compose(targets, joints, self._cell, files.name, layout, content.text))
        give_back()
        program = read_texts(files.contents, f"{files.name}{w.SOURCE_SUFFIX}")
        return compare(program, targets, joints, self._cell, pilot=content.case, original=self._original)

    def composed_while(self, work: Callable[[], Result], content: Content, layout: Layout) -> Result:
        """Write a program in a thread while ``work`` runs, and return what that returns.

        What goes wrong with the program is raised once `composed` asks for it.
        """
        if cores() < 2:
            return work()
        context = contextvars.copy_context()  # its long columns lie on disk too
        with ThreadPoolExecutor(1) as writer:
            coming = writer.submit(context.run, self.composed, content, layout)
            try:
                result = work()
            except BaseException:  # Ctrl+C too
                self._files.give_up()
                raise
        self._draft = content, layout, coming
        return result
