"""The tracker states the tip in another frame than ``$BASE``."""

from collections.abc import Mapping, Sequence

import numpy as np

from gcode2krl.effects import Applied, Effect
from gcode2krl.gap.beside.links import MECHANICS
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.frames import frame_values
from gcode2krl.gap.slips.slip import Slip, rms_before, rms_left, slip_if_explained
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs.matching import rotation_between

_NAME = "base_frame"


class TrackerFrameTest:
    """Another frame of the tracker, far from ``$BASE`` (Kabsch 1976)."""

    effects = (_NAME,)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the frame that puts the tracked tips onto the predicted ones."""
        traces = [
            trace for trace in MECHANICS.traces(pairs) if not (trace.in_sensor_frame or trace.in_tool_frame)
        ]
        effect = library.get(_NAME)
        if effect is None or not traces or rms_before(traces) < THRESHOLDS.slips.tracker_off_mm:
            return []
        predicted_mm = np.concatenate([trace.nominal for trace in traces])
        measured_mm = np.concatenate([trace.measured for trace in traces])
        rotation, shift_mm = rotation_between(predicted_mm, measured_mm)
        frame = Applied(effect, None, frame_values(shift_mm, rotation))
        words = (
            f"the tracker is in another frame: $BASE shifted by {np.linalg.norm(shift_mm):.0f} mm and turned"
        )
        return slip_if_explained(traces, frame, rms_left(traces, frame), words)
