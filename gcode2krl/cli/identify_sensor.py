"""``gcode2krl identify sensor``: weight, centre of gravity and offsets of the force sensor."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.identified import gravity_option
from gcode2krl.cli.inputs import cell_files, common_options, read_cell, require_other
from gcode2krl.errors import Gcode2KrlError

if TYPE_CHECKING:
    from gcode2krl.identify.estimate import Estimate
    from gcode2krl.identify.sensor import SensorIdentification


@click.command(
    "sensor", epilog=examples("gcode2krl identify sensor examples/identify/orientations.csv -o sensor.toml")
)
@click.argument("poses")
@common_options
@click.option("-o", "--output", metavar="SENSOR.toml", help="Write the calibration for the online side.")
@gravity_option
@click.option(
    "--noise-N",
    "noise_N",
    type=click.FloatRange(min=0.0),
    default=0.0,
    metavar="N",
    help="Known 1-sigma of a force component.",
)
@click.option(
    "--noise-Nmm",
    "noise_Nmm",
    type=click.FloatRange(min=0.0),
    default=0.0,
    metavar="N·MM",
    help="Known 1-sigma of a moment component.",
)
def command(
    poses: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    output: str | None,
    gravity: tuple[float, float, float],
    noise_N: float,
    noise_Nmm: float,
) -> int:
    """Fit weight, centre of gravity and offsets to readings of the unloaded force sensor.

    POSES is CSV: fx_N, fy_N, fz_N, mx_Nmm, my_Nmm, mz_Nmm, and the orientation of the sensor in the robot
    root as a_deg, b_deg, c_deg, as qx, qy, qz, qw, or as joint angles q1_deg to q6_deg. At least three
    orientations; 20 and more (the paper takes 27) also give the remaining offset, such as the pull of a hose
    pack.
    """
    console = Console(quiet, as_json)
    files: list[Path] = []
    try:
        from gcode2krl.identify.sensor import identify_sensor
        from gcode2krl.identify.sensor_poses import read_poses

        console.heading.reads(poses)
        if output is not None:
            calibration = read_cell(cell_path).online.calibration  # will be measured again
            others = (file for file in cell_files(cell_path) if str(file.resolve()) != calibration)
            require_other(Path(output), poses, *others)
        result = identify_sensor(read_poses(poses, read_cell(cell_path)), gravity, noise_N, noise_Nmm)
        if output is not None:
            files.append(_write(result, Path(output)))
    except Gcode2KrlError as error:
        return console.refused(error, _KEYS, poses)
    if as_json:
        return console.record(_record(result), result.issues, files=files)
    console.findings(result.issues, poses)
    _say(result, poses, console)
    for file in files:
        console.say(f"  wrote   {file}")
    return 0


def _write(result: "SensorIdentification", file: Path) -> Path:
    from gcode2krl.compliance.sensor import calibration_toml
    from gcode2krl.files import write_together

    write_together({file: calibration_toml(result.calibration).encode("utf-8")})
    return file


def _say(result: "SensorIdentification", poses: str, console: Console) -> None:
    console.say(
        f"{poses}: {result.poses} orientations, {result.level:.0%} intervals, along the sensor's axes"
    )
    console.say(f"  weight  {_words(result.weight_N, 2)} N")
    for name, triple, digits, unit in (
        ("centre", result.centre_mm, 2, "mm"),
        ("force", result.force_offset_N, 2, "N offset"),
        ("moment", result.moment_offset_Nmm, 0, "N·mm offset"),
    ):
        for axis, estimate in zip("xyz", triple, strict=True):
            console.say(f"  {name if axis == 'x' else '':<7} {axis} {_words(estimate, digits)} {unit}")
    for what, (before, after), unit, left_out in (
        ("force", result.force_rms_N, "N", result.force_left_out_N),
        ("moment", result.moment_rms_Nmm, "N·mm", result.moment_left_out_Nmm),
    ):
        words = f"  rest    {what} {before:.3g} {unit} rms"
        if left_out is not None:
            words += (
                f", with ten quadratic terms {after:.3g}, at readings left out of their fit {left_out:.3g}"
            )
        console.say(words)


def _words(estimate: "Estimate", digits: int) -> str:
    return f"{estimate.value:10.{digits}f}  +- {estimate.high - estimate.value:.{digits}f}"


_KEYS = (
    "weight_N",
    "weight_interval_N",
    "centre_mm",
    "centre_interval_mm",
    "force_offset_N",
    "force_offset_interval_N",
    "moment_offset_Nmm",
    "moment_offset_interval_Nmm",
    "poses",
    "level",
    "force_noise_N",
    "moment_noise_Nmm",
    "force_rms_N",
    "moment_rms_Nmm",
    "force_left_out_N",
    "moment_left_out_Nmm",
    "calibration",
)


def _record(result: "SensorIdentification") -> dict[str, Any]:
    triples = (result.centre_mm, result.force_offset_N, result.moment_offset_Nmm)
    values = (
        result.weight_N.value,
        _interval(result.weight_N),
        *(item for triple in triples for item in ([e.value for e in triple], [_interval(e) for e in triple])),
        result.poses,
        result.level,
        result.force_noise_N,
        result.moment_noise_Nmm,
        list(result.force_rms_N),
        list(result.moment_rms_Nmm),
        result.force_left_out_N,
        result.moment_left_out_Nmm,
        result.calibration.model_dump(mode="json"),
    )
    return dict(zip(_KEYS, values, strict=True))


def _interval(estimate: "Estimate") -> list[float]:
    return [estimate.low, estimate.high]
