"""``gcode2krl identify force run/``: cutting-force coefficients from a measured run."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.identified import save_figure, write_section
from gcode2krl.cli.inputs import VERBOSE, require_fit_outputs
from gcode2krl.errors import Gcode2KrlError, input_error
from gcode2krl.units import MS_PER_S

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.identify.force import ForceFit
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs import Run


@click.command(
    "force",
    epilog=examples("gcode2krl identify force run-1/", "gcode2krl identify force run-1/ --plot fit.png"),
)
@click.argument("run_folder", metavar="RUN")
@click.option("--prediction", metavar="FOLDER", help="Prediction of the program; default: that of run.toml.")
@click.option("--plot", metavar="FIGURE.png", help="Draw measured and fitted forces.")
@click.option("--apply", "apply_to", metavar="CELL.toml", help="Write the coefficients into this cell file.")
@click.option("--zeroed", is_flag=True, help="The sensor was zeroed in air before the run: fit no zero.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but findings.")
@VERBOSE
def command(
    run_folder: str,
    prediction: str | None,
    plot: str | None,
    apply_to: str | None,
    zeroed: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Fit the six coefficients of the linear edge law to the measured force of a run.

    RUN is a folder with run.toml and force.csv. The cutter's engagement comes from the prediction's stock and
    motion; zero and delay of the sensor are fitted too. A coefficient that the run does not determine is
    refused. The band is that of cuts which the fit has not seen: at least three conditions of cut are needed.
    """
    console = Console(quiet, as_json)
    try:
        require_fit_outputs(plot, apply_to, None, run_folder, prediction)
        console.heading.reads(run_folder, prediction)
        run, predicted = _inputs(run_folder, prediction)
        console.heading.has_cell(predicted.cell, None)
        with console.stage("fitting"):
            fit, ranges = _fit(run, predicted, zeroed)
        files = [_save_figure(fit, Path(plot))] if plot is not None else []
        if not as_json:
            _say(fit, ranges, run_folder, console)
        fit.require_all(run_folder)
        if apply_to is not None:
            files.append(_apply(fit, ranges, Path(apply_to), run, predicted.cell))
    except Gcode2KrlError as error:
        return console.refused(error, ["coefficients"], run_folder)
    if as_json:
        return console.record(_record(fit) | ranges, files=files)
    for file in files:
        console.say(f"  wrote      {file}")
    return 0


def _inputs(run_folder: str, prediction: str | None) -> "tuple[Run, Prediction]":
    from gcode2krl.prediction import Prediction
    from gcode2krl.runs import load_run

    run = load_run(run_folder)
    if run.force is None:
        raise input_error(
            "run-force", "the run has no force.csv", "record t_s, fx_N, fy_N, fz_N", source=run_folder
        )
    place = Path(prediction) if prediction is not None else run.path("prediction")
    if place is None:
        raise input_error(
            "run-prediction", "run.toml names no prediction", "give --prediction FOLDER", source=run_folder
        )
    predicted = Prediction.load(place)
    if predicted.motion is None:
        raise input_error(
            "prediction-motion", "the prediction has no motion", "predict again", source=str(place)
        )
    return run, predicted


def _fit(run: "Run", predicted: "Prediction", zeroed: bool) -> "tuple[ForceFit, dict[str, list[float]]]":
    """Return the fit, and between which f_z and a_p its samples are: keys of ``[material]``."""
    from gcode2krl import frames as fr
    from gcode2krl.cutting import cut, force_basis, law
    from gcode2krl.identify.force import fit_force

    motion, force, cell = predicted.motion, run.force, predicted.cell
    if motion is None or force is None:
        raise AssertionError("checked before")
    basis = force_basis(predicted.toolpath, motion, cell)
    frame = run.head.frames.force
    if frame != "base":
        turned = fr.rotation_from_quaternion(motion.rotation)
        if frame == "sensor":
            flange_in_tool = cell.tool_matrix(int(motion.tool[0]))[:3, :3].T
            turned = turned @ flange_in_tool
        basis = np.einsum("mba,mbc->mac", turned, basis)
    fit = fit_force(motion.time_s, basis, force.time_s, force.force_N, zeroed=zeroed)
    depth_mm = (predicted.forces or cut(predicted.toolpath, motion, cell)).a_p_mm[fit.rows]
    teeth = np.array([cell.tool[int(number)].teeth for number in motion.tool[fit.rows]])
    turning = predicted.toolpath.spindle_rad_s[np.clip(motion.move[fit.rows], 0, len(predicted.toolpath) - 1)]
    feed_mm = law.feed_per_tooth(motion.speed_mm_s[fit.rows], turning, 1) / teeth
    between = {"measured_f_z_mm": feed_mm, "measured_a_p_mm": depth_mm}
    return fit, {key: [float(each.min()), float(each.max())] for key, each in between.items()}


def _say(fit: "ForceFit", ranges: dict[str, list[float]], run_folder: str, console: Console) -> None:
    from gcode2krl.identify.force import NAMES

    console.say(f"{run_folder}: {fit.samples} samples in cut")
    units = ("N/mm2",) * 3 + ("N/mm",) * 3
    for name, value, half, unit, known in zip(NAMES, fit.value, fit.half, units, fit.determined, strict=True):
        words = f"{value:9.2f} +- {half:.2f} {unit}" if known else f"{'':9} not determined"
        console.say(f"  {name}        {words}")
    zero = ", ".join(f"{value:.1f}" for value in fit.zero_N)
    console.say(f"  zero       {zero} N; delay {fit.delay_s * MS_PER_S:.1f} ms")
    console.say(f"  residual   {fit.rms_N:.2f} N rms in cut")
    (feed_low, feed_high), (depth_low, depth_high) = ranges.values()
    console.say(
        f"  range      f_z {feed_low:.3f}..{feed_high:.3f} mm, a_p {depth_low:.2f}..{depth_high:.2f} mm; "
        f"forces there known to +- {fit.relative_band:.1%} (90 %)"
    )
    judged = fit.misfit[np.isfinite(fit.misfit)]
    errors = ", ".join(f"{error:.1%}" for error in judged)
    console.say(
        f"  held out   {errors or 'no condition'}: error of each condition, predicted from the others"
    )


def _record(fit: "ForceFit") -> dict[str, Any]:
    from gcode2krl.identify.force import NAMES

    coefficients = {
        name: {"value": float(value), "low": float(value - half), "high": float(value + half)}
        for name, value, half in zip(NAMES, fit.value, fit.half, strict=True)
    }
    return {
        "coefficients": coefficients,
        "zero_N": fit.zero_N.tolist(),
        "delay_s": fit.delay_s,
        "rms_N": fit.rms_N,
        "relative_band": fit.relative_band,
        "held_out": [float(each) if np.isfinite(each) else None for each in fit.misfit],
        "samples": fit.samples,
    }


def _apply(fit: "ForceFit", ranges: dict[str, list[float]], file: Path, run: "Run", cell: "Cell") -> Path:
    """Write the coefficients as ``[material]`` into a cell file."""
    from gcode2krl.cell.sections.machining import WIDEST_BAND
    from gcode2krl.identify.force import NAMES

    material = cell.material
    section = {
        "name": material.name if material is not None else "",
        "linear_edge": {name: round(float(value), 3) for name, value in zip(NAMES, fit.value, strict=True)},
        "relative_band": min(WIDEST_BAND, round(fit.relative_band, 4)),
        **{key: [round(each, 4) for each in pair] for key, pair in ranges.items()},
        "source": f"identified from {run.name}: {fit.samples} samples in cut, residual {fit.rms_N:.1f} N rms",
        "sure": "checked",
    }
    return write_section(file, "material", section)


def _save_figure(fit: "ForceFit", file: Path) -> Path:
    from matplotlib.figure import Figure

    from gcode2krl.report.drawing import BLUE, GREY, VERMILION, look, thin

    with look():
        figure = Figure(figsize=(11.0, 7.0), layout="constrained")
        for axis, axes in enumerate(figure.subplots(3, 1, sharex=True)):
            axes.plot(*thin(fit.time_s, fit.measured_N[:, axis]), color=BLUE, lw=0.9, label="measured")
            axes.plot(*thin(fit.time_s, fit.fitted_N[:, axis]), color=VERMILION, lw=0.9, label="fitted")
            residual = fit.measured_N[:, axis] - fit.fitted_N[:, axis]
            axes.plot(*thin(fit.time_s, residual), color=GREY, lw=0.6, label="rest")
            axes.set_ylabel(f"F{'xyz'[axis]} (N)")
        axes.set_xlabel("Time (s)")
        handles, names = axes.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=3)
        figure.suptitle("Measured force and the fitted law")
        return save_figure(figure, file)
