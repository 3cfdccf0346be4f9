"""Arms from URDF files: lengths, zeros and signs of both customs in which such files are written."""

import numpy as np
import pytest

from gcode2krl.cell import library
from gcode2krl.cell.setup.urdf import read_arm
from gcode2krl.errors import NotUnderstoodError
from tests.cli.test_batch import GOOD
from tests.conftest import ROOT

KEYS = ("a1_mm", "a2_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm")
LIMITS = ((-185, 185), (-140, -5), (-120, 155), (-350, 350), (-120, 130), (-300, 320))
LINKS = ("base_link", "l1", "l2", "l3", "l4", "l5", "l6", "flange")


def joint(number, xyz_m, axis, limits_deg, kind="revolute", rpy="0 0 0"):
    xyz = " ".join(f"{value:.6f}" for value in xyz_m)
    low, high = (f"${{radians({end})}}" for end in limits_deg)
    parent, child = LINKS[number - 1 : number + 1]
    return f"""<joint name="${{prefix}}j{number}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>
      <parent link="${{prefix}}{parent}"/><child link="${{prefix}}{child}"/>
      <axis xyz="{axis}"/>
      <limit lower="{low}" upper="{high}" velocity="${{speed * {number}}}" effort="0"/></joint>"""


def file_of(tmp_path, joints):
    head = (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="speed" value="${pi / 6}"/>'
    )
    file = tmp_path / "arm_macro.xacro"
    text = "".join(joints)
    file.write_text(
        f'{head}<xacro:macro name="arm" params="prefix">{text}</xacro:macro></robot>', encoding="utf-8"
    )
    return file


def stretched(lengths_mm):
    """An arm whose zeros are KUKA's: link arm and forearm along X; axes as KUKA counts."""
    a1, a2, c1, c2, c3, c4 = (value / 1000.0 for value in lengths_mm)
    places = [(0, 0, 0), (a1, 0, c1), (c2, 0, 0), (0, 0, -a2), (c3, 0, 0), (0, 0, 0)]
    axes = ["0 0 -1", "0 1 0", "0 1 0", "-1 0 0", "0 1 0", "-1 0 0"]
    turning = [joint(n + 1, places[n], axes[n], LIMITS[n]) for n in range(6)]
    return [*turning, joint(7, (c4, 0, 0), "1 0 0", (0, 0), kind="fixed")]


def upright(lengths_mm):
    """The same arm, upright and its forearm ahead at zero; A1, A4 and A6 are counted the other way."""
    a1, a2, c1, c2, c3, c4 = (value / 1000.0 for value in lengths_mm)
    places = [
        (0, 0, c1 / 2),
        (a1, 0.1, c1 / 2),
        (0, -0.2, c2),
        (c3 / 3, 0.1, -a2),
        (c3 * 2 / 3, 0, 0),
        (0, 0, 0),
    ]
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
    shift = (0, 90, -90, 0, 0, 0)
    limits = [(low + turn, high + turn) for (low, high), turn in zip(LIMITS, shift, strict=True)]
    limits = [(-high, -low) if n in (0, 3, 5) else (low, high) for n, (low, high) in enumerate(limits)]
    turning = [joint(n + 1, places[n], axes[n], limits[n]) for n in range(6)]
    return [*turning, joint(7, (c4, 0, 0), "1 0 0", (0, 0), kind="fixed")]


@pytest.mark.parametrize("described", [stretched, upright])
@pytest.mark.parametrize("model", library.names("robots"))
def test_lengths_limits_and_speeds_are_those_of_the_arm(tmp_path, model, described):
    geometry = library.read_model("robots", model)["geometry"]
    lengths = tuple(float(geometry[key]) for key in KEYS)
    arm = read_arm(file_of(tmp_path, described(lengths)))
    np.testing.assert_allclose(arm.lengths_mm, lengths, atol=2e-3)
    np.testing.assert_allclose(arm.limits_deg, LIMITS, atol=1e-2)
    np.testing.assert_allclose(arm.speeds_deg_s, [30.0 * n for n in range(1, 7)], atol=1e-2)


KR = (330.0, -115.0, 645.0, 1150.0, 1220.0, 215.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda joints: joints[1:], "5 turning joints"),
        (
            lambda joints: [j.replace('axis xyz="0 1 0"', 'axis xyz="1 0 0"', 1) for j in joints],
            "parallel|horizontal",
        ),
        (
            lambda joints: [joints[0], joints[1].replace("0.330000 0.0", "0.330000 0.004"), *joints[2:]],
            "beside",
        ),
        (lambda joints: [j.replace("${radians(", "${system(") for j in joints], "URDF"),
        (lambda joints: [j.replace("0.645000", "a lot") for j in joints], "URDF"),
        (
            lambda joints: [
                *joints[:5],
                joints[5].replace('xyz="0.000000 0.0', 'xyz="0.000000 0.09'),
                joints[6],
            ],
            "wrist",
        ),
    ],
)
def test_another_arm_is_refused_with_one_sentence(tmp_path, change, words):
    with pytest.raises(NotUnderstoodError, match=words) as refused:
        read_arm(file_of(tmp_path, change(stretched(KR))))
    assert len(refused.value.issues) == 1


@pytest.mark.parametrize("text", ["", "<robot>", "<!DOCTYPE a><robot/>", "<robot/>", "\x00"])
def test_what_is_no_urdf_is_refused(tmp_path, text):
    (tmp_path / "a.urdf").write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError):
        read_arm(tmp_path / "a.urdf")


def test_an_arm_of_no_library_becomes_a_cell_and_a_program(run, tmp_path):
    file_of(tmp_path, stretched((330.0, -115.0, 645.0, 1350.0, 2020.0, 215.0)))
    answers = (ROOT / "examples/cells/answers/change_by_hand.toml").read_text(encoding="utf-8")
    stated = [line for line in answers.splitlines() if not line.startswith(("robot =", "limits_deg"))]
    (tmp_path / "answers.toml").write_text("\n".join(stated), encoding="utf-8")
    run("init", "cell.toml", "--controller", "arm_macro.xacro", "--answers", "answers.toml", code=0)
    cell = (tmp_path / "cell.toml").read_text(encoding="utf-8")
    assert "c3_mm = 2020" in cell
    assert "arm_macro.xacro, its joints" in cell
    (tmp_path / "part.nc").write_text(GOOD.format(x=50), encoding="ascii")
    run("part.nc", "--cell", "cell.toml", "-o", "PART.src", code=0)


@pytest.mark.parametrize(
    ("placeholder", "read"), [(False, (80.0, 70.0, 60.0, 50.0, 40.0, 30.0)), (True, None)]
)
def test_masses_are_those_of_the_moving_links_and_placeholders_are_none(tmp_path, placeholder, read):
    links = [
        f'<link name="${{prefix}}{name}"><inertial><mass value="{2.0 if placeholder else 90.0 - 10.0 * n}"/>'
        "</inertial></link>"
        for n, name in enumerate(LINKS[:7])
    ]
    assert read_arm(file_of(tmp_path, [*links, *stretched(KR)])).link_mass_kg == read
    assert read_arm(file_of(tmp_path, stretched(KR))).link_mass_kg is None
