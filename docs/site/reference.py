"""The page of the Python interface: every public name, its text taken from the docstring at build."""

import importlib
import inspect

import gcode2krl
from gcode2krl import tables

_HEAD = """# Python reference

What scripts may rely on; everything else may change. All of it stands in `gcode2krl` unless its heading names
another module. [One stage alone](code.md#one-stage-alone) shows the stages in a row.

"""
_TABLES = (
    tables.Toolpath,
    tables.Targets,
    tables.Motion,
    tables.Joints,
    tables.Forces,
    tables.Deflection,
)
_ROOMS = {
    "gcode2krl.krc4": ("corner", "effective_acceleration", "jerk", "speed_step"),
    "gcode2krl.robot": ("forward", "inverse", "jacobian"),
    "gcode2krl.cutting": ("mean_force",),
    "gcode2krl.compliance": ("displace", "project_normal"),
    "gcode2krl.effects": ("Effect", "Parameter", "Role", "Where", "Dependence"),
}
"""Functions on arrays that others build on, and what an effect of one's own is made of."""


def page() -> str:
    """Return the page; mkdocstrings fills in signatures and docstrings."""
    public = [getattr(gcode2krl, name) for name in gcode2krl.__all__ if not name.startswith("__")]
    functions = [each for each in public if not inspect.isclass(each)]
    classes = [each for each in public if inspect.isclass(each)]
    parts = [_HEAD, _section("Functions", functions), _section("Objects", classes)]
    parts.append(_section("Tables", _TABLES))
    for room, names in _ROOMS.items():
        module = importlib.import_module(room)
        parts.append(_section(f"`{room}`", [getattr(module, name) for name in names]))
    return "".join(parts)


def _section(title: str, objects) -> str:
    """Return a heading and an entry for each object, by the module in which it is written."""
    return f"## {title}\n\n" + "".join(f"::: {each.__module__}.{each.__qualname__}\n\n" for each in objects)
