"""Effects on the signals of a run."""

from gcode2krl.effects import library, parse, simulate

KNOWN = library()


def run(inputs, *texts, **more):
    """Return the signals under effects as the command line states them."""
    return simulate(inputs, [parse(text, KNOWN, inputs.cell) for text in texts], **more)


def moved_by(inputs, *texts):
    """Return how far effects move the tip (m, 3) in mm."""
    return run(inputs, *texts).tcp_base_mm - simulate(inputs).tcp_base_mm
