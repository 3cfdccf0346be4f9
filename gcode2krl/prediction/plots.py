"""The figures of a prediction by name: what ``prediction.plot`` offers."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Plots:
    """Matplotlib figures of a prediction, those that ``gcode2krl predict --plot`` writes.

    Each method raises `NotUnderstoodError` where the stage that it draws did not run. A figure is shown by a
    notebook and saved by ``savefig``; no window is opened.
    """

    def __init__(self, draw: "Callable[[str], Figure]") -> None:
        """Take what draws a figure of a name."""
        self._draw = draw

    def __repr__(self) -> str:
        return f"Plots({', '.join(FIGURES)})"

    def path(self) -> "Figure":
        """Draw the path: programmed moves, what the controller makes of them, corners enlarged.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.path().savefig("path.png")
        """
        return self._draw("path")

    def axes(self) -> "Figure":
        """Draw the tips from above and from two sides, each with its tool as a short line.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.axes().savefig("axes.png")
        """
        return self._draw("axes")

    def kinematics(self) -> "Figure":
        """Draw speed, acceleration and jerk over time.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.kinematics().savefig("kinematics.png")
        """
        return self._draw("kinematics")

    def joints(self) -> "Figure":
        """Draw the six joint angles and speeds over time, with their limits.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.joints().savefig("joints.png")
        """
        return self._draw("joints")

    def spin(self) -> "Figure":
        """Draw the turn about the tool axis along the path, and where others would be or hit something.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.spin().savefig("spin.png")
        """
        return self._draw("spin")

    def force(self) -> "Figure":
        """Draw force and engagement over time.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.force().savefig("force.png")
        """
        return self._draw("force")

    def force_path(self) -> "Figure":
        """Draw the path coloured by the size of the force.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.force_path().savefig("force_path.png")
        """
        return self._draw("force_path")

    def deflection(self) -> "Figure":
        """Draw the deflection of the tip over time.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.deflection().savefig("deflection.png")
        """
        return self._draw("deflection")

    def deflection_path(self) -> "Figure":
        """Draw the path coloured by the size of the deflection.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.deflection_path().savefig("deflection_path.png")
        """
        return self._draw("deflection_path")

    def deflection_joints(self) -> "Figure":
        """Draw what each virtual joint adds to the deflection.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.deflection_joints().savefig("deflection_joints.png")
        """
        return self._draw("deflection_joints")

    def part(self) -> "Figure":
        """Draw the finished part from three sides, coloured by the error that the deflection leaves on it.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").plot.part().savefig("part.png")
        """
        return self._draw("part")


FIGURES = (
    "path",
    "axes",
    "kinematics",
    "joints",
    "spin",
    "force",
    "force_path",
    "deflection",
    "deflection_path",
    "deflection_joints",
    "part",
)
"""Names of the figures, in the order in which the command writes them."""
