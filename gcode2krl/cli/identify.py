"""``gcode2krl identify``: fits the cell to measurements; a file for each kind."""

import click

from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.on_use import CommandsOnUse

_WHAT = {
    "controller": "Fit how the controller plans to a recorded trace: k, effective CDIS, the law.",
    "stiffness": "Fit the stiffness of joints and links to distances of measuring cubes, of axes to pulls.",
    "sensor": "Fit weight, centre of gravity and offsets to readings of the unloaded force sensor.",
    "kinematics": "Fit frames, zeros, lengths, axes, bending and play of an arm to measured poses.",
    "force": "Fit the six coefficients of the linear edge law to the measured force of a run.",
}


@click.command(
    "identify",
    epilog=examples(
        "gcode2krl identify controller trace.csv", "gcode2krl identify stiffness examples/identify/robot.toml"
    ),
    cls=CommandsOnUse,
    summaries=_WHAT,
    module="gcode2krl.cli.identify_{}",
)
def command() -> None:
    """Fit the cell to measurements: controller, stiffness, sensor, kinematics, cutting force."""
