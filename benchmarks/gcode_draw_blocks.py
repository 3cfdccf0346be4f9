"""Random blocks that may go together or not: both readers must say the same of them."""

import numpy as np

HEAD = "G21 G90 G17 G94 F500\nT1 M6\nS1000 M3\nG0 X0 Y0 Z5\n"
END = "\nG0 X1 Y2 Z3\nM2\n"
_ALONE = (
    *("G80", "G17", "G18", "G19", "G90", "G91", "G90.1", "G91.1", "G20", "G21", "G93", "G94", "G95"),
    *("G94 F100", "G95 F0.1", "G93 F4", "G92.1", "G92.2", "G92.3", "G54", "G55", "G59.3", "G28.1", "G30.1"),
    *(
        "G43",
        "G43 H1",
        "G43 H2",
        "G43 H0",
        "G49",
        "G43.1 Z4",
        "G43.2 H2",
        "T1 M6",
        "T2 M6",
        "T7 M6",
        "M6",
        "T1",
    ),
    *("T0 M6", "M3 S500", "M4 S600", "M5", "S0", "S900", "G4 P1", "G4 P0", "G61", "G61.1", "G64", "G64 P0.1"),
    *("G64 P0.1 Q0.2", "G40", "G40 G1 X-5 Y2", "M7", "M9", "M8 M7", "X[#5420 + 1] Y2", "G0 Y#5421"),
)
_CYCLES = ("G81", "G82", "G83", "G73", "G85", "G86", "G89", "G84", "G74", "")


class Blocks:
    """Draws blocks, each with words that may be missing or too many."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def any_of(self, *choices: str) -> str:
        return choices[int(self.rng.integers(len(choices)))]

    def axes(self, share: float) -> str:
        return " ".join(
            f"{axis}{self.rng.uniform(-20, 20):.3f}" for axis in "XYZ" if self.rng.random() < share
        )

    def block(self) -> str:
        any_of = self.any_of
        x, y = f"X{self.rng.uniform(0, 20):.3f}", f"Y{self.rng.uniform(0, 20):.3f}"
        kinds = (
            f"{any_of('G0', 'G1', '')} {self.axes(0.5)} {any_of('', 'F200', 'F9')}",
            f"{any_of('G2', 'G3', '')} {x} {y} R{any_of('30', '-30', '25', '20')} {any_of('', 'Z3', 'P2')}",
            f"{any_of('G2', 'G3')} {any_of('I5', 'J-5', 'I3 J4', 'K4 I1', 'J2 K2')} {any_of('', 'Z3', 'P2')}",
            " ".join(
                (
                    f"{any_of('G98', 'G99', '')} {any_of(*_CYCLES)} {self.axes(0.4)}",
                    f"{any_of('Z-5', 'Y-9', 'X-7', '', '')} {any_of('R2', 'R1', 'R-3', '')}",
                    f"{any_of('', '', 'P0.5', 'P1')} {any_of('', 'Q1', 'Q2')}",
                    any_of("", "", "L2", "L0", "L3"),
                )
            ),
            f"{any_of('G92', 'G52', 'G28', 'G30')} {self.axes(0.5)}",
            f"G10 {any_of('L2', 'L20')} P{any_of(*'0129')} {self.axes(0.5)} {any_of('', '', 'R30', 'R-90')}",
            f"G10 {any_of('L1', 'L10', 'L11')} P{any_of(*'127')} {any_of('Z5', 'Z-3', 'Z5 R2', '')}",
            f"G53 {any_of('G0', 'G1', '')} {self.axes(0.6)}",
            f"{any_of('G41.1', 'G42.1')} D{any_of('2', '0', '-1', '6')} {any_of('', 'G1 X5', 'G1 X30 Y3')}",
            f"G0 @{self.rng.uniform(1, 20):.3f} ^{self.rng.uniform(-180, 180):.3f}",
            any_of(*_ALONE),
        )
        weights = np.array([5, 3, 3, 6, 3, 2, 1, 1, 1, 1, 14], dtype=float)
        return kinds[int(self.rng.choice(len(kinds), p=weights / weights.sum()))]


def blocks(rng: np.random.Generator) -> bytes:
    """Return a program of a few random blocks."""
    drawn = Blocks(rng)
    return (HEAD + "\n".join(drawn.block() for _ in range(int(rng.integers(1, 7)))) + END).encode("ascii")
