"""All stages side by side: a row a time sample."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.errors import input_error
from gcode2krl.exchange import Columns
from gcode2krl.tables import Clearance, Deflection, Forces, Joints, Motion, Toolpath, lengths


def joined_samples(
    toolpath: Toolpath,
    motion: Motion | None,
    joints: Joints | None,
    forces: Forces | None,
    deflection: Deflection | None,
    added: Mapping[str, Floats],
    clearance: Clearance | None = None,
) -> Columns:
    """Return the samples of a motion with what every stage says of them; see `Prediction.samples`."""
    if motion is None:
        raise input_error("prediction-empty", "the prediction has no motion", "predict the part again")
    row = np.clip(motion.move, 0, len(toolpath) - 1)
    rapid = toolpath.rapid[row] | toolpath.machine[row]
    of_motion = motion.columns()
    columns: dict[str, NDArray[Any]] = {
        "time_s": of_motion.pop("time_s"),
        "source_line": toolpath.source_line[row],
        "tool": of_motion.pop("tool"),
        "move": of_motion.pop("move"),
        "kind": _kinds(toolpath)[row],
        "pass": pass_numbers(rapid, motion.tool),
    }
    if forces is not None:
        columns["cutting"] = np.asarray(np.isfinite(forces.phi_rad).any(axis=1))
    columns |= of_motion
    columns["feed_mm_s"] = toolpath.feed_mm_s[row]
    if joints is not None:
        columns |= joints.columns()
    if clearance is not None:
        link, obstacle = clearance.names()
        columns["clearance_mm"] = clearance.clearance_mm
        columns |= {"clearance_link": link, "clearance_obstacle": obstacle}
    if forces is not None:
        of_forces = forces.columns()
        del of_forces["tool"]  # that of the motion
        columns |= {"force_N": lengths(forces.force_base_N), **of_forces}
    if deflection is not None:
        columns |= {"deflection_mm": lengths(deflection.deflection_base_mm), **deflection.columns()}
    return Columns({**columns, **added}, "samples")


def pass_numbers(rapid: Bools, tool: Ints32) -> Ints32:
    """Return (m,) the number, from 1, of the run of feed samples of one tool; 0 on rapids."""
    begins = ~rapid
    begins[1:] &= rapid[:-1] | (tool[1:] != tool[:-1])
    return np.where(rapid, 0, np.cumsum(begins)).astype(np.int32)


def _kinds(toolpath: Toolpath) -> NDArray[np.str_]:
    """Return (n,) what each row of the tool path is."""
    kinds = [toolpath.machine, toolpath.rapid, toolpath.arc >= 0]
    return np.select(kinds, ["machine", "rapid", "arc"], "line")
