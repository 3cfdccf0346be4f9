"""A declared five-axis machine has a sense: sound programs are silent, a doubt names its key.

Wrong declarations through the command line are in ``benchmarks/mistake_cases.py``, run by
``tests/test_mistakes.py``.
"""

import io

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode
from gcode2krl.cell.sections import Machine, Stock, Table
from gcode2krl.gcode import read_stream
from gcode2krl.report.axes import axes_figure
from tests.conftest import ROOT
from tests.gcode import five_axis_programs as programs

BOX = ((-60.0, -60.0, -50.0), (60.0, 60.0, 0.0))
AGAINST_ISO = "table-table AC, other signs"
TABLE, HEAD = "table-table AC", "head-head CA"
TIP, AXES = "G43.4 H1", "G43 H1"


def declared(name, *, tcpm=False, **values):
    keys = {**programs.MACHINES[name], **programs.LENGTHS, **values}
    return Machine(
        tcpm=tcpm, **{key: tuple(value) if isinstance(value, list) else value for key, value in keys.items()}
    )


def read(text, machine, box=BOX, table_mm=None):
    cell = load_cell().model_copy(
        update={
            "machine": machine,
            "stock": None if box is None else Stock(box_mm=box),
            "table": None if table_mm is None else Table(z_mm=table_mm),
        }
    )
    return read_stream(io.BytesIO(text.encode()), "five axes", cell)


def said(toolpath, code="machine-doubtful"):
    return [issue for issue in toolpath.issues if issue.code == code]


def posted(program, name, tip=TIP, **options):
    return programs.posted(program, {**programs.MACHINES[name], **programs.LENGTHS}, tip=tip, **options)


@pytest.mark.parametrize("program", programs.SOUND)
def test_sound_programs_are_not_doubted(program):
    """On seven machines, by tip and by axes; a warning only where signs are against ISO 841."""
    for name in programs.MACHINES:
        for tip in (TIP, AXES):
            toolpath = read(posted(program, name, tip), declared(name))
            assert not said(toolpath), (name, tip, said(toolpath))
            warned = [issue for issue in said(toolpath, "machine-untold") if issue.severity == "warning"]
            assert not warned or name == AGAINST_ISO


@pytest.mark.slow
@pytest.mark.parametrize("program", programs.SOUND)
@pytest.mark.parametrize("by_time", [False, True])
def test_sound_programs_without_stock_or_under_inverse_time(program, by_time):
    for name in programs.MACHINES:
        for tip in (TIP, AXES):
            toolpath = read(posted(program, name, tip, per_block_time=by_time), declared(name), box=None)
            assert not said(toolpath), (name, tip, said(toolpath))


def test_the_example_is_not_doubted():
    folder = ROOT / "examples" / "five_axis"
    toolpath = read_gcode(folder / "five_axis.nc", load_cell(folder / "cell.toml"))
    assert not [issue for issue in toolpath.issues if issue.code.startswith("machine-")]


@pytest.mark.parametrize(
    ("values", "severity", "key", "better"),
    [
        ({"signs": (1, -1)}, "warning", "machine.signs", "signs = [-1, -1]"),
        ({"signs": (-1, 1)}, "warning", "machine.signs", "signs = [-1, -1]"),
        ({"axes": ("C", "A")}, "error", "machine.axes", 'axes = ["A", "C"]'),
        ({"kind": "head-head"}, "error", "machine.kind", 'kind = "table-table"'),
        ({"centre_mm": (0.0, 0.0, -0.06)}, "warning", "machine.centre_mm", "metres"),
    ],
)
def test_wrong_machines_of_the_example(values, severity, key, better):
    folder = ROOT / "examples" / "five_axis"
    cell = load_cell(folder / "cell.toml")
    wrong = cell.machine.model_copy(update=values)
    (issue,) = said(read_gcode(folder / "five_axis.nc", cell.model_copy(update={"machine": wrong})))
    assert (issue.severity, issue.key) == (severity, key)
    assert better in issue.message
    assert issue.advice()


def test_what_no_move_tells_is_said():
    """The ring leans evenly: mirrored it would be as sound."""
    ring = posted("leaning ring", TABLE)
    (note,) = said(read(ring, declared(TABLE)), "machine-untold")
    assert (note.severity, note.key) == ("note", "machine.signs")
    (warning,) = said(read(ring, declared(TABLE, signs=(1, -1))), "machine-untold")
    assert warning.severity == "warning"
    assert "ISO 841" in warning.message


def test_a_holder_below_the_table_is_an_error():
    """A over 120 degrees: the tool points upwards into the part."""
    text = "G21 G90\nT1 M6\nG43.4 H1\nS1000 M3\nG0 X0 Y-70 Z-20 A120 C0\nG1 Y-50 F500\nX20\nG49\nM30\n"
    (issue,) = said(read(text, declared(TABLE)))
    assert (issue.severity, issue.line) == ("error", 6)
    assert "below the part, at Z -50" in issue.message
    (issue,) = said(read(text, declared(TABLE), box=None, table_mm=-55.0))
    assert issue.severity == "error"
    assert not said(read(text, declared(TABLE), box=None))


@pytest.mark.parametrize(
    ("comment", "tcpm", "tip", "key"),
    [
        ("(HEAD-HEAD MACHINE)", False, TIP, "machine.kind"),
        ("(RTCP ON)", False, AXES, "machine.tcpm"),
        ("(TCP: OFF)", True, AXES, "machine.tcpm"),
        ("(TABLE/TABLE, TCPM ON)", False, TIP, ""),
        ("(BLOCK WITH A HEAD)", False, TIP, ""),
    ],
)
def test_comments_that_name_the_machine(comment, tcpm, tip, key):
    text = posted("tilted planes", TABLE, tip).replace("G21", f"{comment}\nG21", 1)
    found = said(read(text, declared(TABLE, tcpm=tcpm)))
    assert [issue.key for issue in found] == ([key] if key else [])
    assert not key or found[0].line == 3


def test_a_small_offset_of_the_centre_is_no_metre():
    text = posted("dome raster", TABLE)
    assert not said(read(text, declared(TABLE, centre_mm=(0.012, -0.008, 0.0))))
    assert said(read(text, declared(TABLE, centre_mm=(0.0, 0.0, -0.14))))


def test_three_axes_are_not_looked_at():
    text = "G21 G90\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F300\nX50\nG0 Z20\nM30\n"
    toolpath = read(text, declared(TABLE, centre_mm=(0.0, 0.0, -0.14)))
    assert not [issue for issue in toolpath.issues if issue.code.startswith("machine-")]


def test_tools_are_drawn_from_the_tip_towards_the_holder():
    toolpath = read(posted("tilted holes", TABLE), declared(TABLE))
    figure = axes_figure(toolpath, BOX, -50.0)
    front = figure.axes[1]
    tools = max(front.collections, key=lambda lines: lines.get_zorder())
    drawn = np.array(tools.get_segments())
    feed = ~toolpath.rapid & ~toolpath.machine & toolpath.known.all(axis=1)
    np.testing.assert_allclose(drawn[:, 0], toolpath.position_mm[feed][:, [0, 2]])
    way = drawn[:, 1] - drawn[:, 0]
    across = way[:, 0] * toolpath.axis[feed, 2] - way[:, 1] * toolpath.axis[feed, 0]
    np.testing.assert_allclose(across, 0.0, atol=1e-9)
    assert (way[:, 1] > 0.0).all()
