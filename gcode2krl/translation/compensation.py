"""``--compensate offline``: the prediction with targets moved against its own deflection."""

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gcode2krl.errors import Issue, RefusedError
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Motion
from gcode2krl.translation.outputs import require_other

if TYPE_CHECKING:
    from gcode2krl.compensation.iteration import Compensated


def compensated(
    prediction: Prediction, plot: str | Path | None, inputs: Sequence[str | Path] = ()
) -> Prediction:
    """Return the prediction of the compensated program; ``plot`` draws the path before and after.

    ``inputs`` are files that the drawing must not overwrite.

    Raises
    ------
    RefusedError
        Where there is no deflection, or it is too uncertain to move a robot by it.
    """
    from gcode2krl.blockwise import plan_course
    from gcode2krl.compensation.iteration import compensate

    motion, forces, deflection = prediction.motion, prediction.forces, prediction.deflection
    if motion is None or forces is None or deflection is None:
        raise RefusedError(
            Issue(
                "error",
                "no-deflection",
                0,
                "--compensate offline: there is no predicted deflection",
                "state material, stock and stiffness in the cell; leave out --no-forces",
            )
        )
    toolpath, cell = prediction.toolpath, prediction.cell
    done = compensate(toolpath, prediction.targets, cell, motion, forces)
    motion, joints, kept, bent = done.evaluated
    # forces and part are those of the intended path at equal places, and so are the findings on them
    forces, deflection = (
        replace(kept, issues=forces.issues),
        replace(bent, issues=deflection.issues),
    )
    if plot is not None:
        _draw(done, motion, Path(plot), inputs)
    near = plan_course(done.targets, cell, float(prediction.inputs["dt_s"]), keeps=True).samples().clearance
    return replace(
        prediction,
        targets=done.targets,
        motion=motion,
        joints=joints,
        forces=forces,
        deflection=deflection,
        inputs={**prediction.inputs, "compensate": "offline", **done.figures},
        clearance=near,
    )


def _draw(done: "Compensated", motion: Motion, file: Path, inputs: Sequence[str | Path]) -> None:
    """Draw the bent path without and with the correction."""
    from gcode2krl.files import write_together
    from gcode2krl.report.compensation_figures import compensation_figure
    from gcode2krl.report.drawing import look

    require_other(file, *inputs)
    picture = io.BytesIO()
    before, after = ((one.intended_mm, one.offset_mm, one.cuts) for one in (done.before, done.after))
    with look():
        figure = compensation_figure(before, after, motion.position_mm)
        figure.savefig(picture, format=file.suffix.lower().removeprefix("."), dpi=130)
    write_together({file: picture.getvalue()}, inputs)
