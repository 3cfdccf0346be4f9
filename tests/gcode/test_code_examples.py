"""The examples in the table of codes are true: read as G-code, each causes its finding."""

import io
import re

import pytest

from gcode2krl import load_cell
from gcode2krl.cell.sections import Machine
from gcode2krl.codes import all_codes
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gcode import read_stream
from gcode2krl.gcode.findings import all_findings

_HEAD = "G21 G90 G17 G94 F500 S8000 M3\nG0 X0 Y0 Z0\n"
_WORDS_BEHIND = re.compile(r" \(|, | in a cell| before | without ")
_NO_GCODE = {"line-too-long", "undefined-position"}
"""The example is a whole file, or a later check of the program finds it too."""


_FIVE_AXES = Machine(kind="head-head", axes=("C", "A"), signs=(1, 1), tcpm=True)


def _found(text: str, machine: Machine | None, dialect: str) -> set[str]:
    cell = load_cell().model_copy(update={"machine": machine})
    try:
        toolpath = read_stream(io.BytesIO(f"{text}\nM30\n".encode()), "part.nc", cell, dialect=dialect)
    except Gcode2KrlError as error:
        return {issue.code for issue in error.issues}
    return {issue.code for issue in toolpath.issues}


def _texts(example: str) -> list[str]:
    """Return the G-code in an example: without the words behind it, and as it stands."""
    parts = [_WORDS_BEHIND.split(example)[0], example]
    return [head + part.replace(" followed by ", "\n") for part in parts for head in ("", _HEAD)]


@pytest.mark.parametrize("code", sorted({finding.code for finding in all_findings().values()} - _NO_GCODE))
def test_the_example_of_a_code_causes_it(code: str) -> None:
    example = all_codes()[code].example
    example, _, dialect = example.partition(", with --dialect ")
    spoken = dialect or "linuxcnc"
    machines = (None, _FIVE_AXES)
    assert any(code in _found(text, made, spoken) for text in _texts(example) for made in machines), example
