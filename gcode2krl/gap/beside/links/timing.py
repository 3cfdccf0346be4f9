"""The link of timing: by how much the run is late along its path."""

from gcode2krl.gap.beside.links.base import Link


class TimingLink(Link):
    """What of the path link lies along the motion, as time; it has no trace of its own."""

    name = "timing"
    signal = "timing"
    unit = "s"
    needs = "controller.csv with q1_cmd_deg …, and a prediction"
