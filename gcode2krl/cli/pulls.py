"""``gcode2krl identify stiffness --pulls form.csv``: a form with poses and pulls, and its fit."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcode2krl.cli.console import Console
from gcode2krl.cli.identified import section_in, write_section
from gcode2krl.files import write_together
from gcode2krl.units import NMM_PER_NM

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.identify.pulls import PullFit

KEYS = ("k_Nmm_rad", "level", "relative_band")
RIGID = 9.9e99
LUMPED_BAND = 0.35
"""Half-width of the band of an arm whose links and bearings are taken as springs of its axes: what
was measured once at poses that the fit had not seen."""


def write_form(
    file: Path,
    cell: "Cell",
    count: int,
    force_N: float | None,
    point_mm: tuple[float, float, float] | None,
    inputs: list[Path],
    console: Console,
) -> int:
    """Write the form of pulls for this cell."""
    from gcode2krl.clearance import watch_of
    from gcode2krl.identify.pulls import form, propose

    watch = watch_of(cell)
    tool = cell.usual_tool or 0

    def gap(q_rad: Any) -> Any:
        assert watch is not None
        return watch.poses(q_rad, tool, 1000.0)

    is_watched = watch is not None and tool in cell.tool
    point = None if point_mm is None else np.array(point_mm)
    with console.stage("choosing poses"):
        pulls = propose(cell, gap if is_watched else None, count, force_N, point)
    write_together({file: form(pulls).encode("utf-8")}, inputs)
    if console.as_json:
        return console.record(dict.fromkeys(KEYS), files=[file])
    x, y, z = pulls.point_mm[0]
    size_N = float(np.linalg.norm(pulls.force_N[0]))
    console.say(f"{file}: {len(pulls.q_rad)} pulls at {count} poses of the {cell.robot.title}")
    if not is_watched:
        console.say("  NOT CHECKED for collisions: the cell describes no arm, tool or surroundings")
    console.say(f"  1. Bolt a stiff bar to the flange: force and dial at x {x:g}, y {y:g}, z {z:g} mm of it.")
    console.say(
        "  2. Jog to each pose in T1. Dial (0.01 mm) along its direction of the robot root, on a stand"
    )
    console.say("     that is not on the robot: unloaded_mm. No person under the load.")
    console.say(
        f"  3. Pull with about {size_N:g} N along `pull`: balance, or weight and pulley. Write force_N as"
    )
    console.say("     it was (or a column mass_kg instead, of weights), and the dial again: loaded_mm.")
    console.say(f"  4. gcode2krl identify stiffness --pulls {file} --cell CELL --apply CELL")
    return 0


def say_fit(fit: "PullFit", console: Console) -> None:
    """Print the stiffness of each axis with its interval, beside what the arm's class suggests."""
    from gcode2krl.identify.pulls import AXES

    console.say(f"{fit.source}: stiffness about each axis in N·m/rad, {fit.level:.0%} intervals")
    for axis, k in zip(AXES, fit.k_Nmm_rad, strict=True):
        words = "not determined"
        if k is not None:
            words = f"{k.value / NMM_PER_NM:9.3e}   {k.low / NMM_PER_NM:9.3e} .. {k.high / NMM_PER_NM:9.3e}"
        console.say(f"  {axis}  {words}")
    console.say(f"  displacement under load known to +- {fit.band:.0%} ({len(fit.residual_sigma)} pulls)")


def record_of(fit: "PullFit") -> dict[str, Any]:
    """Return the figures of the record."""
    from gcode2krl.identify.pulls import AXES

    values = {
        axis: None if k is None else {"value": k.value, "interval": [k.low, k.high]}
        for axis, k in zip(AXES, fit.k_Nmm_rad, strict=True)
    }
    return dict(zip(KEYS, (values, fit.level, fit.band), strict=True))


def apply(fit: "PullFit", file: Path) -> Path:
    """Write the arm's virtual joints into a cell file.

    Links, and the joints about other axes than their own, are rigid: what they bend is in A1 to A6.
    """
    from gcode2krl.compliance.estimate import ARM
    from gcode2krl.identify.pulls import AXES

    section = section_in(file, "compliance", "virtual_joints")
    joints = {name: {"k_c": RIGID, "k_b": RIGID, "k_a": RIGID} for name in ARM}
    for axis, k in zip(AXES, fit.k_Nmm_rad, strict=True):
        assert k is not None  # a fit with an axis that is not determined is not applied
        joints[axis]["k_a"] = float(f"{k.value:.4g}")
    name = Path(fit.source).name
    section = {
        **section,
        "virtual_joints": {**section.get("virtual_joints", {}), **joints},
        "relative_band": round(min(0.99, math.hypot(LUMPED_BAND, fit.band)), 3),
        "robot_source": f"A1 to A6 about their axes identified from {name}, {len(fit.residual_sigma)} pulls, "
        f"displacement within {fit.band:.0%} ({fit.level:.0%}); what links bend is in them",
        "robot_sure": "checked",
    }
    return write_section(file, "compliance", section)
