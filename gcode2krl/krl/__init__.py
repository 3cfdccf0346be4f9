"""KRL: written, read back, verified."""

from gcode2krl.krl.names import suggested_name
from gcode2krl.krl.pilot_check import PilotFigures
from gcode2krl.krl.places import output_files, program_file
from gcode2krl.krl.read import read_krl
from gcode2krl.krl.verify import VerifyReport, verify_krl
from gcode2krl.krl.write import WrittenProgram, write_krl

__all__ = [
    "PilotFigures",
    "VerifyReport",
    "WrittenProgram",
    "output_files",
    "program_file",
    "read_krl",
    "suggested_name",
    "verify_krl",
    "write_krl",
]
