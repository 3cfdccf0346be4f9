"""``gcode2krl identify stiffness``: stiffness of the virtual joints from measuring cubes, or from pulls."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.identified import save_figure
from gcode2krl.cli.inputs import cell_files, common_options, read_cell, require_fit_outputs
from gcode2krl.errors import Gcode2KrlError, input_error
from gcode2krl.units import UM_PER_MM

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.identify.estimate import Estimate
    from gcode2krl.identify.stiffness import JointFit, StiffnessIdentification


@click.command(
    "stiffness",
    epilog=examples(
        "gcode2krl identify stiffness examples/identify/robot.toml",
        "gcode2krl identify stiffness examples/identify/robot.toml --plot fit.png --apply cell.toml",
        "gcode2krl identify stiffness --pulls form.csv --cell cell.toml",
    ),
)
@click.argument("measurements")
@common_options
@click.option(
    "--plot", metavar="FIGURE.png", help="Draw measured against model angles, residuals, intervals."
)
@click.option("--apply", "apply_to", metavar="CELL.toml", help="Write the stiffness into this cell file.")
@click.option(
    "--pulls", "is_pulls", is_flag=True, help="MEASUREMENTS is a form of pulls; it is written if not there."
)
@click.option("--poses", type=click.IntRange(4, 40), default=10, show_default=True, help="Of a new form.")
@click.option(
    "--force",
    "force_N",
    type=click.FloatRange(min=1.0),
    metavar="N",
    help="Of a new form; default: half payload.",
)
@click.option(
    "--point",
    "point_mm",
    nargs=3,
    type=float,
    metavar="X Y Z",
    help="Where to pull, in mm of the flange frame; default: a bar along its x.",
)
@click.option(
    "--balance",
    "balance_percent",
    type=click.FloatRange(0.0, 50.0),
    default=1.0,
    show_default=True,
    help="1-sigma of the force in percent; 0: weighed masses.",
)
def command(
    measurements: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    plot: str | None,
    apply_to: str | None,
    is_pulls: bool,
    poses: int,
    force_N: float | None,
    point_mm: tuple[float, float, float] | None,
    balance_percent: float,
) -> int:
    """Fit the stiffness of joints and links to distances of measuring cubes, of axes to pulls.

    MEASUREMENTS is the TOML head that describes cubes, lasers and load, or the CSV with the readings beside
    it; docs/identification.md has the format. A stiffness that the readings do not determine is named, not
    applied.

    With --pulls MEASUREMENTS is a CSV form: poses for this cell, a bar at the flange to pull at, a dial
    gauge. Where the file is not there, it is written; filled in, it gives the stiffness about A1 to A6.
    """
    console = Console(quiet, as_json)
    if is_pulls and not Path(measurements).exists():
        from gcode2krl.cli.pulls import write_form

        try:
            cell = read_cell(cell_path)
            inputs = [Path(file) for file in cell_files(cell_path)]
            return write_form(Path(measurements), cell, poses, force_N, point_mm, inputs, console)
        except Gcode2KrlError as error:
            return console.refused(error, ("k_Nmm_rad", "level", "relative_band"), measurements)
    console.heading.reads(measurements)
    if is_pulls:
        return _pulls(measurements, cell_path, plot, apply_to, balance_percent, console)
    try:
        result, files = _run(measurements, cell_path, plot, apply_to, console)
    except Gcode2KrlError as error:
        return console.refused(error, _KEYS, measurements)
    exit_code = 1 if result.errors() else 0
    if as_json:
        figures = _record(result, read_cell(cell_path))
        console.record(figures, result.issues, exit_code=exit_code, files=files)
    else:
        _say(result, read_cell(cell_path), console)
        console.findings(result.issues, result.source)
        for file in files:
            console.say(f"  wrote  {file}")
    return exit_code


def _pulls(
    form: str, cell_path: str | None, plot: str | None, apply_to: str | None, percent: float, console: Console
) -> int:
    """Fit a filled-in form of pulls."""
    from gcode2krl.cli import pulls
    from gcode2krl.identify.pulls import fit, read_form

    try:
        if plot is not None:
            raise input_error("option-value", "--plot: not of --pulls", "leave it out")
        cell = read_cell(cell_path)
        require_fit_outputs(None, apply_to, cell_path, form, form)
        result = fit(read_form(form), cell, percent / 100.0)
        is_applied = apply_to is not None and not result.errors()
        files = [pulls.apply(result, Path(apply_to))] if apply_to is not None and is_applied else []
    except Gcode2KrlError as error:
        return console.refused(error, pulls.KEYS, form)
    exit_code = 1 if result.errors() else 0
    if console.as_json:
        return console.record(pulls.record_of(result), result.issues, exit_code=exit_code, files=files)
    pulls.say_fit(result, console)
    console.findings(result.issues, result.source)
    for file in files:
        console.say(f"  wrote  {file}")
    return exit_code


def _run(
    measurements: str, cell_path: str | None, plot: str | None, apply_to: str | None, console: Console
) -> "tuple[StiffnessIdentification, list[Path]]":
    from gcode2krl.identify.measurements import read_measurements
    from gcode2krl.identify.stiffness import identify_stiffness

    cell = read_cell(cell_path)
    readings = read_measurements(measurements)
    require_fit_outputs(plot, apply_to, cell_path, measurements, readings.source)
    with console.stage("fitting"):
        result = identify_stiffness(readings, cell)
    files = []
    if plot is not None:
        files.append(_save_figure(result, Path(plot), cell))
    if apply_to is not None and not result.errors():
        from gcode2krl.cli.stiffness_apply import apply

        files.append(apply(result, Path(apply_to), cell))
    return result, files


# --- words ----------------------------------------------------------------------------------------------


def _say(result: "StiffnessIdentification", cell: "Cell", console: Console) -> None:
    console.say(f"{result.source}: stiffness in N·mm/rad, {result.level:.0%} intervals")
    console.say("  joint       about  stiffness    interval                 in the cell  readings  noise µm")
    for fit in result.joints:
        for axis, estimate in enumerate(fit.k_Nmm_rad):
            console.say(_line(fit, axis, estimate, cell))
    for name, (k, origin) in result.known.items():
        console.say(f"  {name} taken as known, {origin}: k_c {k.k_c:.3g}, k_b {k.k_b:.3g}, k_a {k.k_a:.3g}")


def _line(fit: "JointFit", axis: int, estimate: "Estimate | None", cell: "Cell") -> str:
    from gcode2krl.identify.stiffness import AXES, KEYS, in_cell

    in_file = in_cell(cell, fit.joint, KEYS[axis])
    head = f"  {fit.joint if axis == 0 else '':<11} {AXES[axis]} {KEYS[axis]}  "
    tail = f"{in_file:11.3e}" if in_file else f"{'-':>11}"
    if estimate is None:
        return f"{head}{'not determined':<37} {tail}"
    counts = f"  {len(fit.row):8d}  {fit.noise_mm * UM_PER_MM:8.2f}" if axis == 0 else ""
    return f"{head}{estimate.value:9.3e}    {estimate.low:9.3e} .. {estimate.high:9.3e}   {tail}{counts}"


_KEYS = ("joints", "known", "level", "stated_noise_mm")


def _record(result: "StiffnessIdentification", cell: "Cell") -> dict[str, Any]:
    known = {
        name: {"k_c": value.k_c, "k_b": value.k_b, "k_a": value.k_a, "source": origin}
        for name, (value, origin) in result.known.items()
    }
    joints = {fit.joint: _joint_record(fit, cell) for fit in result.joints}
    return dict(zip(_KEYS, (joints, known, result.level, result.stated_noise_mm), strict=True))


def _joint_record(fit: "JointFit", cell: "Cell") -> dict[str, Any]:
    from gcode2krl.identify.stiffness import KEYS, in_cell

    record: dict[str, Any] = {"readings": len(fit.row), "noise_mm": fit.noise_mm, "known": list(fit.known)}
    for axis, (key, estimate) in enumerate(zip(KEYS, fit.k_Nmm_rad, strict=True)):
        largest = float(abs(fit.moment_Nmm[:, axis]).max(initial=0.0))
        record[key] = {
            "value": estimate.value if estimate else None,
            "interval": [estimate.low, estimate.high] if estimate else None,
            "cell": in_cell(cell, fit.joint, key),
            "largest_moment_Nmm": largest,
        }
    return record


# --- the figure -----------------------------------------------------------------------------------------


def _save_figure(result: "StiffnessIdentification", file: Path, cell: "Cell") -> Path:
    from gcode2krl.cli.stiffness_figure import figure
    from gcode2krl.report.drawing import look

    with look():
        return save_figure(figure(result, cell), file)
