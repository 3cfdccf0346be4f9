"""What a KRC4 does beyond the measured corner: known in public, assumed, and what would settle it.

The paper measured two LIN of equal speed and acceleration (Bigliardi et al. 2022). The lines to run are KRL:
take the positions of the test program (`make-test controller`), stop before and after, and record as for it.
"""

from typing import NamedTuple


class Question(NamedTuple):
    """A question to the controller."""

    what: str
    known: str
    """From a public source that was read; empty where there is none."""
    assumed: str
    run: tuple[str, ...]
    """KRL, between two exact stops, whose trace settles it."""


QUESTIONS = (
    Question(
        "two moves of unequal speed",
        "equal speeds and accelerations make the parabola symmetrical (Bigliardi et al. 2022, section 3)",
        "the corner runs at the slower speed, and the change of speed is before or after it",
        ("$VEL.CP=0.05", "LIN P2 C_DIS", "$VEL.CP=0.2", "LIN P3"),
    ),
    Question(
        "two moves of unequal acceleration",
        "as for unequal speeds",
        "the acceleration of each move holds on its own line; the corner has none of them",
        ("$ACC.CP=1", "LIN P2 C_DIS", "$ACC.CP=4", "LIN P3"),
    ),
    Question(
        "$APO.CDIS that changes between two moves",
        "CDIS is at most half of the shorter line (Bigliardi et al. 2022, figure 4, for equal lines)",
        "at P2 the distance that is set when LIN P2 is planned holds, at P3 the next one",
        ("$APO.CDIS=5", "LIN P2 C_DIS", "$APO.CDIS=20", "LIN P3 C_DIS", "LIN P4"),
    ),
    Question(
        "PTP that blends into LIN",
        "a PTP in front of a LIN needs a second criterion beside C_PTP: distance, orientation or speed "
        "(Beckhoff TF5120, structure APO)",
        "nothing: no program of gcode2krl blends a PTP",
        ("$APO.CPTP=50", "$APO.CDIS=10", "PTP P2 C_PTP C_DIS", "LIN P3"),
    ),
    Question(
        "how far ahead the controller plans",
        "",
        "it can stop at the end of the moves that $ADVANCE lets it see",
        ("$ADVANCE=3", "forty LIN of 1 mm with C_DIS at 0.2 m/s", "the same with $ADVANCE=5"),
    ),
)
