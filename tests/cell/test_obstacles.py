"""What stands in the cell: one shape each, with errors that name key and line."""

import pytest

from gcode2krl import load_cell
from gcode2krl.cell import cell_from_resolved
from gcode2krl.cell.definition import as_toml
from gcode2krl.errors import NotUnderstoodError

HEAD = 'based_on = "demonstration"\n\n'


def refused(tmp_path, text):
    """Return (line, message) of each finding on a cell file."""
    file = tmp_path / "cell.toml"
    file.write_text(HEAD + text)
    with pytest.raises(NotUnderstoodError) as caught:
        load_cell(file)
    return [(issue.line, issue.message) for issue in caught.value.issues]


def test_obstacles_of_each_kind_are_read(tmp_path):
    (tmp_path / "vice.stl").write_text("solid s\nendsolid s\n")
    file = tmp_path / "cell.toml"
    file.write_text(
        HEAD
        + '[[obstacle]]\nname = "clamp"\nbox_mm = [[0, 0, 0], [10, 10, 10]]\n'
        + '[[obstacle]]\nname = "vice"\nframe = "robroot"\nmesh = "vice.stl"\n'
        + '[[obstacle]]\nname = "floor"\nframe = "robroot"\n'
        + "plane = { point_mm = [0, 0, -1], normal = [0, 0, 2] }\n"
        + "[collision]\nclearance_mm = 8\n"
        + "[spindle.body]\ncapsules = [{ from_mm = [0, 0, 20], to_mm = [240, 0, 180], radius_mm = 70 }]\n"
    )
    cell = load_cell(file)
    assert [each.name for each in cell.obstacle] == ["clamp", "vice", "floor"]
    assert cell.obstacle[1].mesh == str((tmp_path / "vice.stl").resolve())  # it holds from anywhere
    assert cell.collision.clearance_mm == 8
    assert cell.spindle.body.capsules[0].radius_mm == 70
    assert cell_from_resolved(as_toml(cell), "cell") == cell


def test_a_cell_without_obstacles_has_none_and_5_mm():
    cell = load_cell()
    assert cell.obstacle == ()
    assert cell.spindle.body is None
    assert cell.collision.clearance_mm == 5


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ("", "give one of box_mm, mesh and plane, found none"),
        ('mesh = "a.stl"\nbox_mm = [[0, 0, 0], [1, 1, 1]]', "found box_mm and mesh"),
        (
            "box_mm = [[0, 5, 0], [10, -5, 10]]",
            "box_mm: y from 5 is not below -5: the low corner comes first",
        ),
        ("plane = { point_mm = [0, 0, 0], normal = [0, 0, 0] }", "normal is zero"),
        ('mesh = "missing.stl"', "there is no file 'missing.stl'"),
        (f'mesh = "{"m" * 400}.stl"', f"there is no file '{'m' * 80}'"),
        ("box_mm = [[0, 0, 0], [1, 1]]", "obstacle.0.box_mm.1.2: missing"),
        ('box_mm = [[0, 0, 0], [1, 1, 1]]\nframe = "tool"', "allowed: 'base', 'robroot' or 'world'"),
        ("box_mm = [[0, 0, 0], [1, 1, nan]]", "obstacle.0.box_mm.1.2"),
        ("box_mm = [[0, 0, 0], [1, 1, 1e7]]", "obstacle.box_mm = 1e+07 is not possible"),
    ],
)
def test_a_wrong_shape_is_named_with_key_and_line(tmp_path, shape, words):
    found = refused(tmp_path, f'[[obstacle]]\nname = "clamp"\n{shape}\n')
    assert any(words in message and line >= 3 for line, message in found), found


def test_two_obstacles_of_one_name_are_refused(tmp_path):
    one = '[[obstacle]]\nname = "clamp"\nbox_mm = [[0, 0, 0], [1, 1, 1]]\n'
    assert refused(tmp_path, one + one) == [(7, "obstacle.1.name: 'clamp' names two obstacles")]


def test_a_name_cannot_begin_another_line_of_the_program(tmp_path):
    found = refused(tmp_path, '[[obstacle]]\nname = "a\\nHALT"\nbox_mm = [[0, 0, 0], [1, 1, 1]]\n')
    assert found[0][1].startswith("obstacle.0.name: ")


def test_own_obstacles_replace_those_of_the_base(tmp_path):
    (tmp_path / "base.toml").write_text(HEAD + '[[obstacle]]\nname = "a"\nbox_mm = [[0, 0, 0], [1, 1, 1]]\n')
    (tmp_path / "same.toml").write_text('based_on = "base.toml"\n')
    (tmp_path / "own.toml").write_text(
        'based_on = "base.toml"\n[[obstacle]]\nname = "b"\nbox_mm = [[0, 0, 0], [1, 1, 1]]\n'
    )
    same, own = load_cell(tmp_path / "same.toml"), load_cell(tmp_path / "own.toml")
    assert [each.name for each in same.obstacle] == ["a"]
    assert any(taken.key == "obstacle" for taken in same.taken_over)
    assert [each.name for each in own.obstacle] == ["b"]
