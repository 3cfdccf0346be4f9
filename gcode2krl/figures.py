"""The figures of a prediction, a function a figure; ``predict --plot`` and ``Prediction.plot`` draw these."""

from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.carried import vectors_turned
from gcode2krl.errors import input_error
from gcode2krl.prediction import Prediction
from gcode2krl.prediction.plots import FIGURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEEDS = {
    "path": ("motion",),
    "axes": ("motion",),
    "kinematics": ("motion",),
    "joints": ("motion", "joints"),
    "spin": ("motion", "joints"),
    "force": ("motion", "forces"),
    "force_path": ("motion", "forces"),
    "deflection": ("motion", "deflection"),
    "deflection_path": ("motion", "deflection"),
    "deflection_joints": ("motion", "joints", "forces", "deflection"),
    "part": ("motion", "forces"),
}
"""Figure to the stages that it draws."""
_REMEDIES = {
    "forces": "state [material], [stock] and the tools in the cell, and predict with forces",
    "deflection": "state [compliance.virtual_joints] in the cell, and predict with forces",
}


def figure_of(prediction: Prediction, name: str) -> "Figure":
    """Return a figure of `FIGURES`; raises `NotUnderstoodError` where the stage that it draws did not run."""
    from gcode2krl.report.figures import shown_in_notebooks

    for stage in _missing(prediction, name):
        sentence = f"{name} cannot be drawn: the prediction has no {stage}"
        raise input_error("prediction-empty", sentence, _REMEDIES.get(stage, "predict the part again"))
    draw = {
        "path": _path,
        "axes": _axes,
        "kinematics": _kinematics,
        "joints": _joints,
        "spin": _spin,
        "force": _force,
        "force_path": _force_path,
        "deflection": _deflection,
        "deflection_path": _deflection_path,
        "deflection_joints": _deflection_joints,
        "part": _part,
    }[name]
    return shown_in_notebooks(draw(prediction))


def figures_of(prediction: Prediction) -> "dict[str, Figure]":
    """Return the figures of all stages that ran."""
    return {name: figure_of(prediction, name) for name in FIGURES if not _missing(prediction, name)}


def _missing(prediction: Prediction, name: str) -> list[str]:
    """Return the stages that a figure draws and that did not run."""
    return [stage for stage in _NEEDS[name] if getattr(prediction, stage) is None]


def _path(prediction: Prediction) -> "Figure":
    from gcode2krl.report.path import path_figure

    assert prediction.motion is not None
    return path_figure(prediction.toolpath, prediction.targets, prediction.motion)


def _axes(prediction: Prediction) -> "Figure":
    from gcode2krl.report.axes import axes_figure

    cell = prediction.cell
    stock_mm = None if cell.stock is None else cell.stock.box_mm
    return axes_figure(prediction.toolpath, stock_mm, None if cell.table is None else cell.table.z_mm)


def _kinematics(prediction: Prediction) -> "Figure":
    from gcode2krl.report.kinematics import kinematics_figure

    assert prediction.motion is not None
    return kinematics_figure(prediction.toolpath, prediction.motion)


def _joints(prediction: Prediction) -> "Figure":
    from gcode2krl.report.joints import joints_figure

    assert prediction.motion is not None
    assert prediction.joints is not None
    robot = prediction.cell.robot
    limits = np.array(robot.limits.q_deg) if robot.limits.q_deg is not None else None
    speeds = np.array(robot.speeds.qd_deg_s) if robot.speeds.qd_deg_s is not None else None
    return joints_figure(prediction.motion, prediction.joints, limits, speeds, prediction.toolpath)


def _spin(prediction: Prediction) -> "Figure":
    from gcode2krl.pose import spin_map
    from gcode2krl.report.spins import spin_map_figure

    assert prediction.motion is not None
    assert prediction.joints is not None
    seen = spin_map(prediction.motion, prediction.joints, prediction.cell)
    return spin_map_figure(seen.path_mm, seen.spin_rad, seen.chosen_rad, *seen.quality)


def _force(prediction: Prediction) -> "Figure":
    from gcode2krl.report.forces import force_figure

    assert prediction.motion is not None
    assert prediction.forces is not None
    return force_figure(prediction.toolpath, prediction.motion, prediction.forces)


def _force_path(prediction: Prediction) -> "Figure":
    assert prediction.forces is not None
    return _coloured(prediction, prediction.forces.force_base_N, "force (N)", "Cutting force on the path")


def _deflection(prediction: Prediction) -> "Figure":
    from gcode2krl.report.deflections import deflection_figure

    assert prediction.motion is not None
    assert prediction.deflection is not None
    return deflection_figure(prediction.toolpath, prediction.motion, prediction.deflection)


def _deflection_path(prediction: Prediction) -> "Figure":
    assert prediction.deflection is not None
    bent_mm = prediction.deflection.deflection_base_mm
    return _coloured(prediction, bent_mm, "deflection (mm)", "Deflection on the path")


def _coloured(prediction: Prediction, vectors: Floats, label: str, title: str) -> "Figure":
    from gcode2krl.report.coloured_path import coloured_path_figure

    assert prediction.motion is not None
    size = np.linalg.norm(vectors, axis=1)
    return coloured_path_figure(prediction.toolpath, prediction.motion, size, label, title)


def _deflection_joints(prediction: Prediction) -> "Figure":
    from gcode2krl.report.deflections import share_figure

    assert prediction.motion is not None
    names, share_mm = _shares(prediction)
    return share_figure(prediction.toolpath, prediction.motion, names, share_mm)


def _part(prediction: Prediction) -> "Figure":
    from gcode2krl.cutting import history_of
    from gcode2krl.report.part import part_figure

    assert prediction.motion is not None
    return part_figure(prediction, history_of(prediction.toolpath, prediction.motion, prediction.cell))


def against_nominal(prediction: Prediction, above_mm: Floats, at_mm: Floats | None) -> "Figure":
    """Return the finished part coloured by its difference to the nominal one, see `report.part_error`."""
    from gcode2krl.cutting import history_of
    from gcode2krl.report.part import nominal_figure

    assert prediction.motion is not None
    history = history_of(prediction.toolpath, prediction.motion, prediction.cell)
    return nominal_figure(prediction, history, above_mm, at_mm)


def _shares(prediction: Prediction) -> tuple[tuple[str, ...], Floats]:
    """Return the virtual joints and how much each adds along the deflection (m, 10)."""
    from gcode2krl.cell.sections import VIRTUAL_JOINTS
    from gcode2krl.compliance import joint_shares

    joints, forces, deflection = prediction.joints, prediction.forces, prediction.deflection
    if joints is None or forces is None or deflection is None:
        raise AssertionError("a deflection is known only of joints and forces")
    base = prediction.cell.base_in_root(joints.external[:1])
    if prediction.cell.external:
        base = prediction.cell.base_in_root(joints.external)
    force, moment, total = (
        vectors_turned(vector, base)
        for vector in (forces.force_base_N, forces.moment_base_Nmm, deflection.deflection_base_mm)
    )
    shares = joint_shares(joints.q_rad, force, moment, prediction.cell, forces.tool)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return VIRTUAL_JOINTS, np.einsum("mjk,mk->mj", shares, total / np.where(size > 0.0, size, 1.0))
