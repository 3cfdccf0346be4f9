"""The measured tip is moved by a frame in the tool."""

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.frame_effect import FRAME_NAMES, frame_of, frame_parameters, is_nothing
from gcode2krl.effects.inputs import Inputs


class ToolFrame(Effect):
    """``$TOOL`` is not where it was measured: pose' = pose·frame; joints as commanded.

    A turn of the tool frame does not move the tip: only an instrument that sees the orientation shows it.
    """

    name = "tool_frame"
    family = "geometry"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.CONSTANT, Dependence.PLACE})
    of_set_up = "small"
    parameters = frame_parameters(
        most_mm=20.0,
        most_deg=2.0,
        start_mm=0.3,
        start_deg=0.05,
        usual_mm=lambda mismatch: mismatch.frame_mm,
        usual_deg=lambda mismatch: mismatch.frame_deg,
        source="XYZ 4-point measurement of a tool 0.3-1 mm; ABC 0.05-0.5 deg",
    )

    def tcp(self, tcp_mm: Floats, deflection_mm: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the moved tip; the shift turns with the commanded tool."""
        return (
            tcp_mm if is_nothing(applied) else tcp_mm + inputs.tool_rotation @ applied.vector(FRAME_NAMES[:3])
        )

    def orientation(self, rotation: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the turned tool."""
        turned: Floats = rotation @ frame_of(applied)[:3, :3]
        return turned


EFFECT = ToolFrame()
