"""The pilot force: knots of a sparse polyline along the path, and the file that carries them."""

from gcode2krl.pilot.knots import Knots, force_at, in_contact, knots_of, to_pilot_frame
from gcode2krl.pilot.sidecar import SCHEMA, PilotHeader, knot_rows, read_pilot, sidecar_head, sidecar_text

__all__ = [
    "SCHEMA",
    "Knots",
    "PilotHeader",
    "force_at",
    "in_contact",
    "knot_rows",
    "knots_of",
    "read_pilot",
    "sidecar_head",
    "sidecar_text",
    "to_pilot_frame",
]
