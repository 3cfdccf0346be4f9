"""Identification recovers the stiffness that moved the cubes; the cubes are moved by independent code."""

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import load_cell
from gcode2krl.cell import resolve_cell
from gcode2krl.compliance import deflection
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.identify.arm_frames import joint_frames
from gcode2krl.identify.cubes import Layout, distances, motion_covariance, motion_of
from gcode2krl.identify.estimate import student
from gcode2krl.identify.measurements import Lasers, read_measurements
from gcode2krl.identify.stiffness import KEYS, identify_stiffness
from gcode2krl.robot.kinematics import flange_pose
from tests.identify.make_measurements import FOLDER, SENSOR, clean_rows, make, measurements, setup_of

JOINTS = ("A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6")
LAYOUT = Layout.of()


@pytest.fixture(scope="module")
def rows():
    """All pairs, poses and loads of the example, without noise."""
    return clean_rows()


STIFFNESS = ("identify", "stiffness")


def write(folder, rows, name="m", **head):
    """Write head and readings; returns the head's path."""
    text = make.cube_head(make.PAIRS, make.CUBES, **{"known": SENSOR, **head})
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    (folder / f"{name}.csv").write_text(make.cube_csv(rows), encoding="utf-8")
    return folder / f"{name}.toml"


# --- cubes and frames -----------------------------------------------------------------------------------

small = st.floats(-0.03, 0.03)
near = st.floats(-8.0, 8.0)


@settings(max_examples=60, deadline=None)
@given(st.tuples(near, near, near), st.tuples(small, small, small), st.integers(0, 2**32 - 1))
def test_motion_from_six_distances(place, angles, seed):
    stands = make.pose_of(*np.random.default_rng(seed).uniform(-170, 170, 6))
    turn = make.rz(angles[2]) @ make.ry(angles[1]) @ make.rx(angles[0])
    moved = make.rigid(turn, place)
    longer = make.laser_distances(stands, stands @ moved) - make.laser_distances(stands, stands)
    assert distances(moved[None], LAYOUT)[0] == pytest.approx(longer, abs=1e-9)
    assert motion_of(longer[None], LAYOUT)[0] == pytest.approx(moved, abs=1e-9)


def test_no_motion_is_the_identity_and_too_large_a_one_is_nan():
    assert motion_of(np.zeros((1, 6)), LAYOUT)[0] == pytest.approx(np.eye(4), abs=1e-15)
    assert motion_of(np.zeros((0, 6)), LAYOUT).shape == (0, 4, 4)
    far = np.array([[90.0, -90.0, 0.0, 0.0, 0.0, 0.0]])
    assert np.isnan(motion_of(far, LAYOUT)[0, 0, 0])


def test_covariance_of_a_motion_against_drawn_noise():
    rng = np.random.default_rng(8)
    noise = 0.005
    read = rng.normal(0.0, noise, (2, 40_000, 6))
    motion = motion_of(read[1] - read[0], LAYOUT)
    turn = np.stack([motion[:, 2, 1], motion[:, 0, 2], motion[:, 1, 0]], axis=1)
    drawn = np.cov(np.hstack([turn, motion[:, :3, 3]]).T) / noise**2
    expected = motion_covariance(LAYOUT)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert drawn / scale == pytest.approx(expected / scale, abs=0.03)
    # lasers 80 mm apart, each read twice: the angle about x comes from z3 against the mean of z1 and z2
    assert np.sqrt(np.diag(expected)[:3]) == pytest.approx(np.sqrt([3.0, 4.0, 4.0]) / 80.0)


def test_frames_of_the_joints_against_the_examples_and_the_kinematics(cell):
    q_deg = np.random.default_rng(1).uniform(-180, 180, (50, 6))
    frames = joint_frames(np.radians(q_deg), cell)
    for q, found in zip(q_deg, frames, strict=True):
        assert found == pytest.approx(np.array(make.bodies(q)[1:]), abs=1e-9)
    other = resolve_cell({"based_on": "demonstration", "robot": {"model": "KR 210 R2700-2"}})
    place, turn = flange_pose(np.radians(q_deg), other.robot.geometry.array())
    flange = joint_frames(np.radians(q_deg), other)[:, JOINTS.index("A6")]
    assert flange[:, :3, 3] == pytest.approx(place, abs=1e-9)
    assert flange[:, :3, :3] == pytest.approx(turn, abs=1e-12)


def test_simulated_robot_bends_as_the_model_does(cell):
    tip_mm = cell.tool_matrix(1)[:3, 3]
    q_deg, force = (12.5, -60.25, 95.75, 33.3, 88.8, -140.1), np.array([300.0, -500.0, 200.0])
    moment = np.array([10e3, 20e3, -15e3])
    bent = make.bodies(q_deg, make.TABLE_1, tip_mm, force, moment)[-1]
    still = make.bodies(q_deg)[-1]
    from_flange = np.append(tip_mm - [0, 0, 56], 1.0)
    shift, _ = deflection.displace(np.radians([q_deg]), force[None], moment[None], cell, 1)
    assert ((bent - still) @ from_flange)[:3] == pytest.approx(shift[0], abs=1e-9)


# --- recovery -------------------------------------------------------------------------------------------


def ratios(result, truth=make.TABLE_1):
    return {
        (fit.joint, key): k and k.value / true
        for fit in result.joints
        for key, k, true in zip(KEYS, fit.k_Nmm_rad, truth[fit.joint], strict=True)
    }


@pytest.mark.parametrize("use", ["motion", "rotation"])
def test_without_noise_table_1_comes_back(rows, cell, use):
    result = identify_stiffness(measurements(rows, setup_of(extra=f'use = "{use}"')), cell)
    assert [fit.joint for fit in result.joints] == list(JOINTS)
    assert not result.issues
    assert list(ratios(result).values()) == pytest.approx(np.ones(24), rel=1e-6)
    for fit in result.joints:
        assert fit.angle_rad == pytest.approx(fit.model_rad, abs=1e-11)


def test_another_robot_and_another_stiffness(monkeypatch):
    cell = resolve_cell(
        {
            "based_on": "demonstration",
            "robot": {"model": "KR 210 R2700-2"},
            "compliance": {"sensor_height_mm": 40.0},
        }
    )
    a1, a2, c1, c2, c3, c4 = cell.robot.geometry.array()
    steps = {
        "A1": (0, 0, c1, 0),
        "A2": (-90, a1, 0, 0),
        "linked_arm": (0, c2 / 2, 0, 0),
        "A3": (0, c2 / 2, 0, -90),
        "arm": (-90, -a2, c3 / 2, 0),
        "A4": (0, 0, c3 / 2, 0),
        "A5": (90, 0, 0, 0),
        "A6": (-90, 0, c4, 180),
        "sensor": (0, 0, 20, 0),
        "spindle": (0, 0, 20, 0),
    }
    monkeypatch.setattr(make, "FRAMES", steps)
    truth = {name: tuple(1.7 * k for k in reversed(values)) for name, values in make.TABLE_1.items()}
    rows = clean_rows(stiffness=truth)
    result = identify_stiffness(measurements(rows, setup_of(known={"sensor": truth["sensor"]})), cell)
    assert list(ratios(result, truth).values()) == pytest.approx(np.ones(24), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("stated_mm", [0.0, make.MEAN_NOISE_MM])
def test_intervals_cover_as_often_as_they_say(rows, cell, stated_mm):
    draws = 40
    rng = np.random.default_rng(2020)
    covered = {0.90: [], 0.95: []}
    for _ in range(draws):
        drawn = measurements(rows, setup_of(noise_mm=stated_mm), rng=rng)
        for level, hits in covered.items():
            result = identify_stiffness(drawn, cell, level)
            assert not result.errors()
            for fit in result.joints:
                hits += [k.contains(t) for k, t in zip(fit.k_Nmm_rad, make.TABLE_1[fit.joint], strict=True)]
    for level, hits in covered.items():
        sigma = np.sqrt(level * (1 - level) / len(hits))
        least, most = level - 3 * sigma, 1.0 if stated_mm else level + 3 * sigma
        assert least < np.mean(hits) < most  # the larger of two noises makes them wider, never narrower


def test_rotation_alone_is_less_sure(rows, cell):
    rng = np.random.default_rng(3)
    both = [
        identify_stiffness(measurements(rows, setup_of(extra=f'use = "{use}"'), rng=rng), cell)
        for use in ("motion", "rotation")
    ]
    width = [np.array([k.high / k.low - 1 if k else np.inf for k in r.joint("A1").k_Nmm_rad]) for r in both]
    assert (width[0] * 2 < width[1]).all()


def test_student_against_tables():
    assert student(0.90, 1) == pytest.approx(6.313752, abs=1e-6)
    assert student(0.90, 10) == pytest.approx(1.812461, abs=1e-6)
    assert student(0.95, 30) == pytest.approx(2.042272, abs=1e-6)
    assert student(0.90, 0) == np.inf


def test_noise_of_the_residuals_is_that_of_the_lasers(rows, cell):
    result = identify_stiffness(measurements(rows, rng=np.random.default_rng(4), noise_mm=0.005), cell)
    freedom = sum(fit.residual.size - 3 for fit in result.joints)
    pooled = np.sqrt(np.mean([fit.noise_mm**2 for fit in result.joints]))
    assert pooled == pytest.approx(0.005, rel=4.0 / np.sqrt(2 * freedom))


def test_stated_noise_counts_where_it_is_larger(rows, cell):
    drawn = [np.random.default_rng(5) for _ in range(2)]
    own, stated = (
        identify_stiffness(measurements(rows, setup_of(noise_mm=n), rng=rng), cell)
        for n, rng in zip((0.0, 0.0015), drawn, strict=True)
    )
    for a, b in zip(own.joints, stated.joints, strict=True):
        assert b.noise_used_mm == 0.0015
        assert b.noise_mm == a.noise_mm
        assert 1 / b.k_Nmm_rad[2].low - 1 / b.k_Nmm_rad[2].value == pytest.approx(
            (1 / a.k_Nmm_rad[2].low - 1 / a.k_Nmm_rad[2].value) * 0.0015 / a.noise_mm, rel=1e-9
        )


# --- where the load is, what is known -------------------------------------------------------------------


def test_load_at_the_tcp_of_the_cell_and_along_the_flange(cell):
    tip_mm = cell.tool_matrix(1)[:3, 3]
    rows = clean_rows(point_mm=tip_mm, along="flange")
    text = make.cube_head(make.PAIRS, make.CUBES, along="flange", known=SENSOR, noise_mm=0.0)
    lines = [line for line in text.splitlines() if not line.startswith("point_flange_mm")]
    setup = type(setup_of()).model_validate(tomllib.loads("\n".join(lines)))
    result = identify_stiffness(measurements(rows, setup), cell)
    assert list(ratios(result).values()) == pytest.approx(np.ones(24), rel=1e-6)
    empty = cell.model_copy(update={"tool": {}, "mounted_tool": None})
    with pytest.raises(NotUnderstoodError, match=r"load\.point_flange_mm: missing"):
        identify_stiffness(measurements(rows, setup), empty)


def test_axis_6_is_split_with_the_sensor_of_head_or_cell(rows, cell):
    stated = identify_stiffness(measurements(rows), cell)
    assert stated.known["sensor"][1] == "stated"
    assert stated.joint("A6").known == ("sensor",)
    taken = identify_stiffness(measurements(rows, setup_of(known={})), cell)
    assert taken.known["sensor"][1] == "from the cell"
    stiff = setup_of(known={"sensor": (9.9e99,) * 3})
    lumped = identify_stiffness(measurements(rows, stiff), cell).joint("A6").k_Nmm_rad
    series = 1 / (1 / make.TABLE_1["A6"][2] + 1 / make.TABLE_1["sensor"][2])  # about z both see one moment
    assert lumped[2].value == pytest.approx(series, rel=1e-3)
    assert taken.joint("A6").k_Nmm_rad[2].value == pytest.approx(make.TABLE_1["A6"][2], rel=1e-6)


@pytest.mark.parametrize("sought", ["A4", "A5", "A6", "sensor"])
def test_one_unknown_among_many_known_ones(cell, sought):
    pairs = {"hand": ("arm_front", "flange")}
    known = {name: make.TABLE_1[name] for name in ("A4", "A5", "A6", "sensor") if name != sought}
    rows = clean_rows(pairs)
    result = identify_stiffness(measurements(rows, setup_of(pairs, known=known)), cell)
    assert [fit.joint for fit in result.joints] == [sought]
    assert list(ratios(result).values()) == pytest.approx(np.ones(3), rel=1e-6)


def test_two_unknown_joints_between_two_cubes(cell):
    pairs = {"hand": ("arm_front", "hand")}
    with pytest.raises(
        NotUnderstoodError, match=r"pair\.hand: between its cubes lie A4, A5, unknown of them A4, A5"
    ):
        identify_stiffness(measurements(clean_rows(pairs), setup_of(pairs)), cell)


def test_two_pairs_of_cubes_for_one_joint(cell):
    cubes = {**make.CUBES, "carousel_2": ("A1", (-300, 300, 800, 0, 0, 30))}
    pairs = {"one": ("pedestal", "carousel"), "two": ("pedestal", "carousel_2")}
    rows = clean_rows(pairs, cubes=cubes)
    fit = identify_stiffness(measurements(rows, setup_of(pairs, cubes)), cell).joint("A1")
    assert len(fit.row) == len(rows)
    assert [k.value for k in fit.k_Nmm_rad] == pytest.approx(make.TABLE_1["A1"], rel=1e-6)


# --- what the readings do not determine -----------------------------------------------------------------


def errors_of(result):
    return [issue.message for issue in result.errors()]


def test_an_axis_that_no_load_turns_is_named(cell):
    pairs = {"A4": make.PAIRS["A4"]}
    straight = ((0, -90, 90, 0, 0, 0),)
    rows = clean_rows(pairs, straight, (((0, 2000, 0), (0, 0, 0)), ((0, 0, -2000), (0, 0, 0))))
    rng = np.random.default_rng(6)
    result = identify_stiffness(measurements(rows * 8, setup_of(pairs), rng=rng, noise_mm=0.001), cell)
    assert [k is None for k in result.joint("A4").k_Nmm_rad] == [False, False, True]
    assert len(errors_of(result)) == 1
    assert errors_of(result)[0].startswith(
        "k_a of A4: not determined: no load case turns this joint about its z"
    )
    with pytest.raises(RefusedError, match="k_a of A4"):
        result.require_all()


def test_noise_above_the_angles_names_the_stiffness(rows, cell):
    result = identify_stiffness(measurements(rows, rng=np.random.default_rng(7), noise_mm=0.005), cell)
    assert {message[:10] for message in errors_of(result)} >= {"k_b of arm"}
    assert "µrad (90%)" in errors_of(result)[0]
    assert result.joint("A1").complete()


def test_a_pair_without_rows_and_one_with_a_single_row(rows, cell):
    kept = [row for row in rows if row[0] == "A1"] + [next(row for row in rows if row[0] == "A2")]
    setup = setup_of({name: make.PAIRS[name] for name in ("A1", "A2", "A3")}, extra='use = "rotation"')
    messages = errors_of(identify_stiffness(measurements(kept, setup), cell))
    assert len(messages) == 6
    assert sum("the file has no row of its pair" in message for message in messages) == 3
    assert any("k_a of A2" in message and "too few readings" in message for message in messages)


def test_loads_with_the_wrong_sign_are_told(rows, cell):
    wrong = [[row[0], *row[1:7], *(-x for x in row[7:13]), *row[13:]] for row in rows]
    result = identify_stiffness(measurements(wrong, rng=np.random.default_rng(9)), cell)
    assert len(errors_of(result)) == 24
    assert sum("against the load" in message for message in errors_of(result)) >= 20


def test_a_touched_cube_and_a_wrong_place_are_told(rows, cell):
    touched = [list(row) for row in rows]
    touched[5][13 + 18] += 0.2
    setup = setup_of(noise_mm=make.MEAN_NOISE_MM)
    result = identify_stiffness(measurements(touched, setup, rng=np.random.default_rng(10)), cell)
    stray = [issue for issue in result.issues if issue.code == "stray-reading"]
    assert [issue.line for issue in stray] == [7]
    assert [i.message.split(":")[0] for i in result.issues if i.code == "model-misfit"] == [touched[5][0]]
    x, y, z, *turn = make.CUBES["carousel"][1]
    misplaced = {**make.CUBES, "carousel": ("A1", (x + 100, y + 150, z, *turn))}
    wrong = setup_of(cubes=misplaced, noise_mm=make.MEAN_NOISE_MM)
    result = identify_stiffness(measurements(rows, wrong, rng=np.random.default_rng(11)), cell)
    assert "A1" in [i.message.split(":")[0] for i in result.issues if i.code == "model-misfit"]


# --- files ----------------------------------------------------------------------------------------------


def as_cells(text):
    return [[number(cell) for cell in line.split(",")] for line in text.splitlines()]


def number(cell):
    try:
        return float(cell)
    except ValueError:
        return cell


def test_example_files_are_those_of_their_script():
    for name, text in make.files().items():
        stored = (FOLDER / name).read_text(encoding="utf-8")
        last_digit = 1.01 if name == "orientations.csv" else 1.01e-4  # another libm may round otherwise
        for found, made in zip(as_cells(stored), as_cells(text), strict=True):
            assert found == pytest.approx(made, abs=last_digit) if name.endswith("csv") else found == made


def test_examples_recover_table_1(cell):
    found = {}
    for name in ("robot.toml", "robot.csv", "holder.toml"):
        result = identify_stiffness(read_measurements(FOLDER / name), cell)
        assert not result.issues
        found.update({fit.joint: fit.k_Nmm_rad for fit in result.joints})
    assert len(found) == 9
    inside = [
        k.contains(t) for joint, ks in found.items() for k, t in zip(ks, make.TABLE_1[joint], strict=True)
    ]
    off = [
        abs(1 / k.value - 1 / t) / (1 / k.low - 1 / k.value)
        for joint, ks in found.items()
        for k, t in zip(ks, make.TABLE_1[joint], strict=True)
    ]
    assert np.mean(inside) > 0.8  # 90 % intervals of 27 values
    assert max(off) < 2.0


def broken(text, row, column, value):
    lines = text.splitlines()
    cells = lines[row - 1].split(",")
    cells[lines[0].split(",").index(column)] = value
    lines[row - 1] = ",".join(cells)
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda t: broken(t, 4, "fx_N", "1,5".replace(",", ";")),
            "m.csv:4: .*row 4, column fx_N: '1;5' is not",
        ),
        (lambda t: broken(t, 3, "lower_loaded_2_mm", ""), "row 3, column lower_loaded_2_mm: empty"),
        (lambda t: broken(t, 3, "q4_deg", "inf"), "row 3, column q4_deg: 'inf' is not a finite number"),
        (lambda t: broken(t, 5, "pair", "A9"), "row 5, column pair: found 'A9', allowed: A1, A2, link"),
        (
            lambda t: broken(t, 2, "upper_loaded_6_mm", "85.3"),
            r"row 2, column upper_loaded_6_mm: \+2.* mm from",
        ),
        (lambda t: t.replace("mz_Nmm", "mz_Nm"), "column mz_Nmm: missing; the file has pair, q1_deg"),
        (lambda t: t.splitlines()[0], "no row below the header"),
        (lambda t: "", "the file is empty"),
    ],
)
def test_wrong_readings_are_told_with_row_and_column(rows, tmp_path, change, words):
    head = write(tmp_path, rows[:8])
    readings = tmp_path / "m.csv"
    readings.write_text(change(readings.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match=words):
        read_measurements(head)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'lower = "pedestal"',
            'lower = "pedestral"',
            "pair.A1.lower: found 'pedestral', allowed: pedestal, ",
        ),
        ('lower = "pedestal"', 'lower = "carousel"', "pair.A1: no virtual joint lies between"),
        ('body = "A4"', 'body = "A7"', "cube.wrist.body: found 'A7', allowed: 'root', 'A1'"),
        ("x_mm = 250", "x = 250", "cube.pedestal.x: there is no such key"),
        ("[tracker]", "[laser]", "tracker: missing"),
        (
            "noise_mm = 0.00125",
            "noise_mm = -1",
            "lasers.noise_mm: found -1, allowed: greater than or equal to 0",
        ),
        ('along = "root"', 'along = "base"', "load.along: found 'base', allowed: 'root' or 'flange'"),
        ("[lasers]", "[lasers", "m.toml:3: error"),
    ],
)
def test_wrong_heads_are_told_with_their_key(rows, tmp_path, old, new, words):
    head = write(tmp_path, rows[:8])
    text = head.read_text(encoding="utf-8")
    assert old in text
    head.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match=words):
        read_measurements(head)


def test_layouts_that_do_not_determine_a_motion():
    face = [(x, y, 50.0) for x in (-40.0, 40.0) for y in (-40.0, 0.0, 40.0)]
    with pytest.raises(ValueError, match="do not determine a motion"):
        Lasers(point_mm=face, direction=[(0, 0, -1)] * 6)
    points = [(x, y, -z) for x, y, z in make_points()]
    with pytest.raises(ValueError, match="comes out of the cube"):
        Lasers(point_mm=points, direction=[beam for _, beam in make.BEAMS])
    assert Lasers(point_mm=make_points(), direction=[beam for _, beam in make.BEAMS]) == Lasers()


def make_points():
    return [point for point, _ in make.BEAMS]


def test_readings_named_in_the_head(rows, tmp_path):
    head = write(tmp_path, rows[:8])
    (tmp_path / "m.csv").rename(tmp_path / "other.csv")
    head.write_text('readings = "other.csv"\n' + head.read_text(encoding="utf-8"), encoding="utf-8")
    assert len(read_measurements(head).row) == 8
    (tmp_path / "other.csv").unlink()
    with pytest.raises(NotUnderstoodError, match=r"other.csv: error: cannot read"):
        read_measurements(head)


# --- the command ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_command_prints_json_draws_and_applies(run, tmp_path):
    cell_file = tmp_path / "cell.toml"
    cell_file.write_text(
        'name = "mine"\nbased_on = "demonstration"\n[compliance]\nsensor_height_mm = 56.0\n', encoding="utf-8"
    )
    for _ in range(2):  # applying again changes nothing
        options = ("--json", "--plot", tmp_path / "f.png", "--apply", cell_file)
        out = run(*STIFFNESS, FOLDER / "robot.toml", *options, code=0).out
        first = cell_file.read_text(encoding="utf-8")
    result = json.loads(out)
    assert set(result["joints"]) == set(JOINTS)
    a1 = result["joints"]["A1"]["k_a"]
    assert a1["interval"][0] < a1["value"] < a1["interval"][1]
    assert a1["cell"] == 7.5e9
    assert result["known"]["sensor"]["source"] == "stated"
    assert len(result["files"]) == 2
    assert (tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")
    cell = load_cell(cell_file)
    assert cell.name == "mine"
    assert cell.compliance.virtual_joints["A1"].k_a == pytest.approx(a1["value"], rel=1e-3)
    assert cell.compliance.robot_sure == "checked"
    assert cell.compliance.robot_source.startswith(
        "A1, A2, linked_arm, A3, arm, A4, A5, A6 identified from robot.csv"
    )
    assert (
        "sensor as stated in the head of robot.csv; others: sensor and spindle: Haehn"
        in cell.compliance.source
    )
    for _ in range(2):
        done = run(*STIFFNESS, FOLDER / "holder.csv", "--apply", cell_file, "--cell", cell_file, code=0)
        assert done.err == ""
    assert "spindle     x k_c  1.8" in done.out
    both = load_cell(cell_file).compliance
    assert both.source.count("identified from holder.csv") == 1
    assert both.virtual_joints["A1"] == cell.compliance.virtual_joints["A1"]
    assert first != cell_file.read_text(encoding="utf-8")


def test_command_refuses_to_apply_what_is_not_determined(run, tmp_path, rows):
    head = write(tmp_path, [row for row in rows if row[0] != "A4"], noise_mm=0.0)
    done = run(*STIFFNESS, head, "--apply", tmp_path / "cell.toml", "--plot", tmp_path / "f.svg", code=1)
    assert done.err.count("error: k_") == 3
    assert "k_a of A4: not determined: the file has no row of its pair of cubes" in done.err
    assert "A4          x k_c  not determined" in done.out
    assert not (tmp_path / "cell.toml").exists()
    assert (tmp_path / "f.svg").exists()


def test_command_says_what_is_wrong(run, tmp_path, rows):
    assert "none.toml: error: cannot read" in run(*STIFFNESS, tmp_path / "none.toml", code=2).err
    record = json.loads(run(*STIFFNESS, tmp_path / "none.toml", "--json", code=2).out)
    assert record["issues"][0]["code"] == "file-unreadable"
    head = write(tmp_path, rows[:48])
    run(*STIFFNESS, head, "--plot", tmp_path / "f.txt", code=2)
    run(*STIFFNESS, head, "--apply", head, code=2)
