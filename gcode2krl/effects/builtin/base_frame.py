"""The measured tip is moved by a frame in $BASE."""

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.frame_effect import frame_of, frame_parameters, is_nothing
from gcode2krl.effects.inputs import Inputs


class BaseFrame(Effect):
    """``$BASE`` is not where it was measured: tip' = frame·tip, in ``$BASE``; joints as commanded."""

    name = "base_frame"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE})
    of_set_up = "frame"
    parameters = frame_parameters(
        most_mm=20.0,
        most_deg=2.0,
        start_mm=0.5,
        start_deg=0.02,
        usual_mm=lambda mismatch: mismatch.frame_mm,
        usual_deg=lambda mismatch: mismatch.frame_deg,
        source="touch-up with a probe tip 0.2-1 mm over some 500 mm; registration of a tracker 0.05-0.2 mm",
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the moved tip."""
        if is_nothing(applied):
            return tcp_mm
        frame = frame_of(applied)
        moved: Floats = tcp_mm @ frame[:3, :3].T + frame[:3, 3]
        return moved

    def orientation(self, rotation: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the turned tool."""
        turned: Floats = frame_of(applied)[:3, :3] @ rotation
        return turned


EFFECT = BaseFrame()
