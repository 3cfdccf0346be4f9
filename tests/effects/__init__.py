"""Effects on the signals of a run."""

from gcode2krl.effects import parse, simulate


def run(inputs, known, *texts, **more):
    """Return the signals under effects as the command line states them."""
    return simulate(inputs, [parse(text, known, inputs.cell) for text in texts], **more)
