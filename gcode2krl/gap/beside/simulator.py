"""Commanded paths, planned once for all runs of a prediction."""

from collections import OrderedDict
from collections.abc import Hashable, Sequence
from hashlib import blake2b
from weakref import WeakKeyDictionary

from gcode2krl.effects import Applied, Inputs, Signals, commanded
from gcode2krl.gap.beside.planning import with_corners
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


class Simulator:
    """Simulates commanded paths and keeps the last ones, of long runs fewer, by what they were planned from.

    One belongs to one prediction, so that its cell and its laws are the same for all that it keeps.
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, Signals] = OrderedDict()
        self._rows = 0
        """Of all that are kept."""
        self._digests: WeakKeyDictionary[Inputs, bytes] = WeakKeyDictionary()
        self._fine: dict[bytes, Inputs] = {}

    def commanded(self, inputs: Inputs, applied: Sequence[Applied]) -> Signals:
        """Return the signals of the commanded path with effects at work, clocks included."""
        effects = tuple(
            (each.effect.name, each.target, each.planned, *each.values.items()) for each in applied
        )
        if inputs not in self._digests:
            self._digests[inputs] = _digest(inputs)
        key = (self._digests[inputs], effects)
        if key not in self._kept:
            self._kept[key] = commanded(self._with_corners(inputs), applied)
            self._rows += len(self._kept[key].inputs)
            while len(self._kept) > LIMITS.remembered_paths or (
                len(self._kept) > 1 and self._rows > LIMITS.remembered_rows
            ):
                self._rows -= len(self._kept.popitem(last=False)[1].inputs)
        return self._kept[key]

    def _with_corners(self, inputs: Inputs) -> Inputs:
        """Return the inputs sampled often enough for corners, made once."""
        digest = self._digests[inputs]
        if digest not in self._fine:
            fine = with_corners(inputs)
            if fine is inputs:
                return inputs
            self._fine[digest] = fine
        return self._fine[digest]


def _digest(inputs: Inputs) -> bytes:
    """Return a digest of the planned motion: two that agree in it agree in all that is commanded."""
    digest = blake2b(inputs.time_s.tobytes())
    digest.update(inputs.q_cmd_rad.tobytes())
    return digest.digest()
