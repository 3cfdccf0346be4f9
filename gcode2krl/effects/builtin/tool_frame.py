"""The measured tip is moved by a frame in the tool."""

from gcode2krl.arrays import Floats
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
    parameters = frame_parameters(
        20.0, 2.0, 0.3, 0.05, source="XYZ 4-point measurement of a tool 0.3-1 mm; ABC 0.05-0.5 deg"
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
