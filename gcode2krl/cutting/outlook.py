"""What has to be known of a whole motion before the first of it is cut."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.compiled.inputs import distinct
from gcode2krl.cutting.dexels import Dexels
from gcode2krl.tables import Motion

_SAME_AXIS = 1e-9
_EVERY = 64
"""Samples to a place: enough to divide the work evenly."""


@dataclass(frozen=True)
class Outlook:
    """A glance at a motion."""

    to_field: Floats
    """(3, 3) rotation from ``$BASE`` to a frame whose z is the tool axis, none where it turns."""
    numbers: tuple[int, ...]
    """Tools that move, rising."""
    lowest_mm: tuple[float, ...]
    """The lowest tip of each, in that frame."""
    places_mm: Floats
    """(o, 3) points all over the path, in that frame."""
    turns: bool = False
    """True where the tool axis changes: one height field cannot hold what is cut."""

    def on(self, material: object) -> "Outlook":
        """Return what is needed to go on with what lines before have left: where those are dexels, dexels."""
        return replace(self, to_field=np.eye(3), turns=True) if isinstance(material, Dexels) else self


class Watch:
    """Makes the `Outlook` of a motion that comes some samples at a time."""

    def __init__(self) -> None:
        """Begin in front of the first sample."""
        self._axis = np.zeros(3)
        self._to_field = np.eye(3)
        self._lowest_mm: dict[int, float] = {}
        self._places_mm: list[Floats] = []
        self._turns = False

    def take(self, motion: Motion) -> None:
        """Look at the next samples."""
        if not len(motion):
            return
        if not self._places_mm:
            self._axis = fr.rotation_from_quaternion(motion.rotation[:1])[0][:, 2]
            self._to_field = to_axis(self._axis)
        self._turns |= _leaves(motion.rotation, self._axis)
        height_mm = turned(motion.position_mm, self._to_field)[:, 2]
        numbers = distinct(motion.tool)
        for number in numbers.tolist():
            lowest_mm = float((height_mm[motion.tool == number] if len(numbers) > 1 else height_mm).min())
            self._lowest_mm[number] = min(self._lowest_mm.get(number, np.inf), lowest_mm)
        self._places_mm.append(turned(motion.position_mm[::_EVERY], self._to_field))

    def outlook(self) -> Outlook:
        """Return what was seen."""
        numbers = tuple(sorted(self._lowest_mm))
        lowest_mm = tuple(self._lowest_mm[number] for number in numbers)
        to_field = np.eye(3) if self._turns else self._to_field
        return Outlook(to_field, numbers, lowest_mm, np.concatenate(self._places_mm), self._turns)


def outlook_of(blocks: Iterable[Motion]) -> Outlook:
    """Return the outlook of a motion in blocks."""
    watch = Watch()
    for motion in blocks:
        watch.take(motion)
    return watch.outlook()


def turned(vectors: Floats, rotation: Floats) -> Floats:
    """Return vectors (m, 3) turned by a rotation (3, 3), contiguous."""
    if (rotation == np.eye(3)).all():
        return vectors + 0.0  # as a product does, without a negative zero
    return np.ascontiguousarray(vectors @ rotation.T)


def _leaves(rotation: Floats, axis: Floats) -> bool:
    """Tell whether the tool axis of quaternions (m, 4) is another one."""
    x, y, z, w = (rotation[:1] if rotation.strides[0] == 0 else rotation).T
    column = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)
    return bool(np.abs(column - axis).max() > 1e-6)


def to_axis(axis: Floats) -> Floats:
    """Return the rotation (3, 3) from ``$BASE`` to a frame whose z is a tool axis (3,)."""
    if axis[2] > 1.0 - _SAME_AXIS:
        return np.eye(3)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    return np.stack([np.cross(across, axis), across, axis])
