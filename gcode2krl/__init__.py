"""G-code in, a verified KUKA KRL program out, with the truth about what the robot will do.

The names below are the public Python interface; they are imported on first use, so that
``import gcode2krl`` stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gcode2krl.version import __version__

_HOMES = {
    "load_cell": "gcode2krl.cell",
    "Cell": "gcode2krl.cell",
    "read_gcode": "gcode2krl.gcode",
    "set_targets": "gcode2krl.pipeline",
    "plan_motion": "gcode2krl.pipeline",
    "predict": "gcode2krl.translation.from_python",
    "predict_many": "gcode2krl.batch.many",
    "Prediction": "gcode2krl.prediction",
    "solve_joints": "gcode2krl.pipeline",
    "write_krl": "gcode2krl.krl",
    "verify_krl": "gcode2krl.krl",
    "cut": "gcode2krl.cutting",
    "diagnose": "gcode2krl.gap",
    "deflect": "gcode2krl.compliance",
    "load_run": "gcode2krl.runs",
    "run_from": "gcode2krl.runs.foreign",
    "Run": "gcode2krl.runs",
    "Gcode2KrlError": "gcode2krl.errors",
    "Issue": "gcode2krl.errors",
}
__all__ = [
    "Cell",
    "Gcode2KrlError",
    "Issue",
    "Prediction",
    "Run",
    "__version__",
    "cut",
    "deflect",
    "diagnose",
    "load_cell",
    "load_run",
    "plan_motion",
    "predict",
    "predict_many",
    "read_gcode",
    "run_from",
    "set_targets",
    "solve_joints",
    "verify_krl",
    "write_krl",
]

if TYPE_CHECKING:
    from gcode2krl.batch.many import predict_many
    from gcode2krl.cell import Cell, load_cell
    from gcode2krl.compliance.deflection_table import deflect
    from gcode2krl.cutting.milling import cut
    from gcode2krl.errors import Gcode2KrlError, Issue
    from gcode2krl.gap.diagnosis import diagnose
    from gcode2krl.gcode import read_gcode
    from gcode2krl.krl import verify_krl, write_krl
    from gcode2krl.pipeline import plan_motion, set_targets, solve_joints
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs import Run, load_run
    from gcode2krl.runs.foreign import run_from
    from gcode2krl.translation.from_python import predict


def __getattr__(name: str) -> Any:
    """Import a public name from its room on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module 'gcode2krl' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """Name what is public; not what happens to have been imported."""
    return __all__
