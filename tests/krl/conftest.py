"""A small part with everything that becomes KRL: two tools, spindle, coolant, dwell, blending."""

import io
from functools import partial
from pathlib import Path

import pytest

from gcode2krl import set_targets, verify_krl, write_krl
from gcode2krl.gcode import read_stream
from gcode2krl.krl.verify import VerifyReport
from tests.cells import over_demonstration

PART = """G21 G90 G17 G40 G49 G80 G94
G54 G64 P0.02
T1 M6
S8000 M3
M8
G0 G43 H1 Z20
G0 X0 Y0
G0 Z2
G1 Z-2 F600
G1 X40 F1500
G1 Y30.5
G4 P0.75
G1 X20 Y40
G1 X0 Y20
G1 Y0
G0 Z20
T2 M6
S12000 M3
G0 G43 H2 Z20
G0 X10 Y10
G0 Z2
G1 Z-1 F300
G1 X30 F900
G1 Y25
G1 X10 Y10
G0 Z20
M9
M5
M30
"""


class Made:
    """A part translated: what went in and what came out."""

    def __init__(
        self,
        folder: Path,
        text: str = PART,
        stem: str = "part",
        data: dict | None = None,
        into_folder: bool = False,
        **options,
    ):
        self.part = folder / f"{stem}.nc"
        self.part.write_text(text)
        self.cell = over_demonstration(data)
        self.toolpath = read(text, self.cell, self.part.name if into_folder else "part.nc")
        self.targets = set_targets(self.toolpath, self.cell)
        output = folder if into_folder else folder / f"{stem}.src"
        self.program = write_krl(self.targets, output, self.cell, **options)
        self.src = self.program.files[0]

    @property
    def text(self) -> str:
        return self.src.read_bytes().decode("ascii")

    def verified(self, **options) -> VerifyReport:
        return verified(self.src, self.toolpath, self.cell, **options)

    @property
    def lines(self) -> list[str]:
        return self.src.read_bytes().decode("utf-8").split("\n")[:-1]


verified = partial(verify_krl, forces=False)
"""The text is read back and compared; hazards with forces have tests/cli/test_verify_hazards.py."""


def read(text: str, cell, name: str = "part.nc"):
    """Read G-code from a string."""
    return read_stream(io.BytesIO(text.encode()), name, cell)


@pytest.fixture
def make(tmp_path):
    """Translate a part: ``make(text, stem=…, data=keys of the cell, **options of write_krl)``.

    With ``into_folder`` the output is a folder, and the program is named after the G-code.
    """

    def make(text: str = PART, **options) -> Made:
        return Made(tmp_path, text, **options)

    return make
