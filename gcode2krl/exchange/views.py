"""What shows a result and stands above it: looked up by its name when it is asked for.

A result may be drawn only by what knows it. Imports go from the drawing to the result and never back, so
the way back is a name; a test resolves all of them.
"""

from importlib import import_module
from typing import Any

VIEWS = {
    "prediction figure": "gcode2krl.figures:figure_of",
    "gap words": "gcode2krl.gap.answer.words:gap_words",
    "gap page": "gcode2krl.gap.answer.words:gap_html",
    "gap figure": "gcode2krl.gap.answer.drawing:figure_of_run",
}
"""What is shown to module and function."""


def view(name: str) -> Any:
    """Return the function that shows something."""
    module, function = VIEWS[name].split(":")
    return getattr(import_module(module), function)
