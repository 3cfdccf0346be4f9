"""``predict --allow``: findings that a person releases, shown as they would count for a program.

The prediction keeps its findings as they are, so that a program made from it is judged by its own releases.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcode2krl.errors import Issue
    from gcode2krl.prediction import Prediction

_KEY = "allow"
"""What a prediction's inputs say of releases."""


def with_allowed(
    prediction: "Prediction", allow: Sequence[str], allow_where_found: Sequence[str]
) -> "Prediction":
    """Return the prediction with releases among its inputs; those of many programs where they match.

    Raises `NotUnderstoodError` where one has no such form, matches nothing, or may not be given.
    """
    from gcode2krl.krl.release import matching, with_releases

    words = (*allow, *matching(prediction.issues, allow_where_found))
    with_releases(prediction.issues, words)
    return replace(prediction, inputs={**prediction.inputs, _KEY: list(words)}) if words else prediction


def as_allowed(prediction: "Prediction") -> "list[Issue]":
    """Return the findings of a prediction, those that were released as warnings."""
    from gcode2krl.krl.release import with_releases

    return with_releases(prediction.issues, prediction.inputs.get(_KEY, ()))
