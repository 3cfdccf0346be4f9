"""Weight, centre and offset come back; the readings are made by independent code."""

import json
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gcode2krl.compliance.sensor import (
    Calibration,
    calibration_toml,
    compensate,
    quadratic_terms,
    read_calibration,
    transfer_to_tcp,
)
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.identify.sensor import identify_sensor
from gcode2krl.identify.sensor_poses import SensorPoses, read_poses
from tests.identify.make_measurements import FOLDER, make, sensor_poses

TRUTH = (make.WEIGHT_N, *make.CENTRE_MM, *make.FORCE_OFFSET_N, *make.MOMENT_OFFSET_NMM)
GRID = make.orientations()
WITHOUT_NOISE = {"force_noise_N": 0.0, "moment_noise_Nmm": 0.0}


def drawn(abc_deg=GRID, seed=1, **more):
    return sensor_poses(make.pose_rows(abc_deg, np.random.default_rng(seed), **more))


def estimates(found):
    return (found.weight_N, *found.centre_mm, *found.force_offset_N, *found.moment_offset_Nmm)


def quaternions(abc_deg):
    return Rotation.from_euler("ZYX", abc_deg, degrees=True).as_quat()


# --- weight, centre, offset -----------------------------------------------------------------------------

angle = st.floats(-180.0, 180.0)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(angle, st.floats(-80, 80), angle), min_size=3, max_size=30),
    st.floats(5.0, 3000.0),
    st.lists(st.floats(-300.0, 300.0), min_size=3, max_size=3),
    st.lists(st.floats(-5e3, 5e3), min_size=6, max_size=6),
)
def test_any_orientations_that_determine_them(abc_deg, weight_N, centre_mm, offset):
    turn = Rotation.from_euler("ZYX", abc_deg, degrees=True)
    pull = turn.inv().apply([0.0, 0.0, -weight_N])
    poses = SensorPoses(turn.as_quat(), pull + offset[:3], np.cross(centre_mm, pull) + offset[3:])
    directions = pull / weight_N
    spread = np.linalg.svd(directions - directions.mean(axis=0))[1][1] / math.sqrt(len(abc_deg))
    assume(abs(spread - 0.05) > 1e-6)
    if spread < 0.05:
        with pytest.raises(RefusedError, match="not determined"):
            identify_sensor(poses)
        return
    found = identify_sensor(poses)
    values = [e.value for e in estimates(found)]
    assert values[0] == pytest.approx(weight_N, rel=1e-6, abs=1e-5)
    assert values[1:4] == pytest.approx(centre_mm, abs=2e-6 * (1e4 / weight_N + 300))
    assert values[4:] == pytest.approx(offset, abs=0.01)


def closed_form(force, moment):
    """The paper's O1, O2, O3, rows 0 to 2, solved from the balance by hand; F_G,z = -W."""
    g_z = force[0, 2] - force[1, 2]  # eq. 12
    offset = [force[0, 0] + g_z / math.sqrt(2), force[0, 1] + g_z / math.sqrt(2), force[0, 2]]  # not eq. 13
    r_z = math.sqrt(2) * (moment[2, 0] - moment[0, 0]) / ((math.sqrt(2) - 1) * g_z)  # eq. 15
    turn = [moment[2, 0] - r_z * g_z, moment[0, 1] + r_z * g_z / math.sqrt(2), moment[1, 2]]  # eq. 14
    r_x = (turn[2] - moment[2, 2]) / g_z  # eq. 15
    r_y = r_x + math.sqrt(2) * (moment[0, 2] - turn[2]) / g_z
    return -g_z, r_x, r_y, r_z, *offset, *turn


def paper_orientations():
    """Rotations of the sensor in the root by where its axes point."""
    down = np.array([0.0, 0.0, -1.0])
    level = np.array([1.0, 0.0, 0.0])
    half = math.sqrt(0.5)
    x1 = half * (down - np.array([0.0, 1.0, 0.0]))
    o1 = np.column_stack([x1, np.cross(level, x1), level])  # z level, x and y 45° down
    o2 = np.column_stack([level, np.cross(down, level), down])  # z down
    o3 = np.column_stack([np.cross(down, level), down, level])  # z level, y down
    return Rotation.from_matrix(np.array([o1, o2, o3]))


def test_the_three_orientations_of_the_paper():
    turn = paper_orientations()
    pull = turn.inv().apply([0.0, 0.0, -make.WEIGHT_N])
    half = make.WEIGHT_N * math.sqrt(0.5)
    assert pull == pytest.approx(
        np.array([[half, half, 0], [0, 0, make.WEIGHT_N], [0, make.WEIGHT_N, 0]]), abs=1e-9
    )
    force = pull + make.FORCE_OFFSET_N
    moment = np.cross(make.CENTRE_MM, pull) + make.MOMENT_OFFSET_NMM
    assert closed_form(force, moment) == pytest.approx(TRUTH, abs=1e-8)
    found = identify_sensor(SensorPoses(turn.as_quat(), force, moment))
    assert [e.value for e in estimates(found)] == pytest.approx(TRUTH, abs=1e-8)
    as_printed = force[0, 0] - math.sqrt(2) * (force[0, 2] - force[1, 2])
    assert abs(as_printed - make.FORCE_OFFSET_N[0]) > make.WEIGHT_N  # eq. 13 as printed


def test_intervals_cover_as_often_as_they_say():
    rng = np.random.default_rng(5)
    clean = drawn(with_hose=False, **WITHOUT_NOISE)
    for level in (0.90, 0.95):
        hits = []
        for _ in range(150):
            noise_N = rng.normal(0.0, make.FORCE_NOISE_N, clean.force_N.shape)
            noise_Nmm = rng.normal(0.0, make.MOMENT_NOISE_NMM, clean.force_N.shape)
            poses = SensorPoses(clean.rotation, clean.force_N + noise_N, clean.moment_Nmm + noise_Nmm)
            found = identify_sensor(poses, level=level)
            hits.append([e.contains(true) for e, true in zip(estimates(found), TRUTH, strict=True)])
        # the ten values of a draw depend on each other: the spread is taken from the draws
        spread = np.std(np.mean(hits, axis=1)) / math.sqrt(len(hits))
        assert np.mean(hits) == pytest.approx(level, abs=3 * spread)


def test_stated_noise_widens_the_intervals():
    poses = drawn(with_hose=False)
    own = identify_sensor(poses)
    assert own.force_noise_N == pytest.approx(make.FORCE_NOISE_N, rel=0.25)
    assert own.moment_noise_Nmm == pytest.approx(make.MOMENT_NOISE_NMM, rel=0.25)
    wide = identify_sensor(poses, noise_N=5.0, noise_Nmm=600.0)
    ratio = (wide.weight_N.high - wide.weight_N.value) / (own.weight_N.high - own.weight_N.value)
    assert ratio == pytest.approx(5.0 / own.force_noise_N, rel=1e-9)
    assert identify_sensor(poses, noise_N=1e-6).weight_N == own.weight_N


def test_a_robot_on_the_wall():
    turn = Rotation.from_quat(quaternions(GRID))
    pull = turn.inv().apply([make.WEIGHT_N, 0.0, 0.0])
    poses = SensorPoses(turn.as_quat(), pull, np.cross(make.CENTRE_MM, pull))
    found = identify_sensor(poses, (9.81, 0.0, 0.0))
    assert found.calibration.gravity_root == (1.0, 0.0, 0.0)
    assert found.weight_N.value == pytest.approx(make.WEIGHT_N)
    assert identify_sensor(drawn(), (0.0, 0.0, -2.0)).weight_N == identify_sensor(drawn()).weight_N
    with pytest.raises(NotUnderstoodError, match="gravity: a direction of length 0"):
        identify_sensor(poses, (0.0, 0.0, 0.0))


# --- what cannot be determined --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("abc_deg", "words"),
    [
        ([(0, 90, 0)] * 5, "weight, centre of gravity and offset: gravity has the same direction"),
        ([(a, 40, 30) for a in range(0, 360, 30)], "same direction in the sensor in all 12 orientations"),
        ([(0, 90, 0), (0, 40, 0), (80, 40, 0)], "centre of gravity and moment offset: gravity has only two"),
        ([(0, 90, 0), (0, 40, 0)], "2 orientations, at least 3"),
    ],
)
def test_orientations_that_do_not_determine_are_refused(abc_deg, words):
    with pytest.raises(RefusedError, match=words):
        identify_sensor(drawn(abc_deg, with_hose=False))


def test_a_weight_below_the_noise_is_refused():
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 1.0, (2, 27, 3))
    with pytest.raises(RefusedError, match=r"not determined: the weight: .* lost in the noise"):
        identify_sensor(SensorPoses(quaternions(GRID), noise[0], noise[1]))


def test_reaction_and_newton_metres_are_told():
    poses = drawn(with_hose=False)
    turned = SensorPoses(poses.rotation, -poses.force_N, -poses.moment_Nmm)
    assert [i.code for i in identify_sensor(turned).issues if i.severity == "warning"] == ["weight-sign"]
    metres = SensorPoses(poses.rotation, poses.force_N, poses.moment_Nmm / 1000.0)
    assert [i.code for i in identify_sensor(metres).issues if i.severity == "warning"] == ["moment-unit"]


# --- what remains ---------------------------------------------------------------------------------------


def test_ten_terms_are_those_of_the_rotation_matrix():
    q = Rotation.random(60, random_state=4).as_quat()
    assert quadratic_terms(q) == pytest.approx(quadratic_terms(-q), abs=0.0)
    assert np.linalg.matrix_rank(quadratic_terms(q)) == 10
    entries = np.hstack([np.ones((60, 1)), Rotation.from_quat(q).as_matrix().reshape(60, 9)])
    fitted = quadratic_terms(q) @ np.linalg.lstsq(quadratic_terms(q), entries, rcond=None)[0]
    assert fitted == pytest.approx(entries, abs=1e-12)
    linear = np.hstack([np.ones((60, 1)), q, quadratic_terms(q)])  # eq. 17 as printed
    assert np.linalg.matrix_rank(linear) == 14  # its constant is the sum of the squares


def test_hose_pack_is_taken_off_between_the_orientations():
    poses = drawn(with_hose=True)
    found = identify_sensor(poses)
    assert found.force_left_out_N < found.force_rms_N[0]
    assert found.force_rms_N[1] < found.force_rms_N[0]
    between = [(a, b, c) for a in (-30, 40) for b in (60, 115) for c in (-35, 25)]
    new = drawn(between, with_hose=True, **WITHOUT_NOISE)
    plain = found.calibration.model_copy(
        update={
            "force_terms_N": Calibration.model_fields["force_terms_N"].default,
            "moment_terms_Nmm": Calibration.model_fields["moment_terms_Nmm"].default,
        }
    )
    rest, without = (
        compensate(new.force_N, new.moment_Nmm, new.rotation, c) for c in (found.calibration, plain)
    )
    rms = [float(np.sqrt(np.mean(values**2))) for values in (*rest, *without)]
    assert rms[0] < 0.35 * rms[2]
    assert rms[1] < 0.35 * rms[3]
    assert rms[0] < 1.2 * found.force_left_out_N  # what is said of a reading left out holds for new ones


def test_quadratic_forms_are_recovered_exactly():
    rng = np.random.default_rng(12)
    q = Rotation.random(27, random_state=2).as_quat()
    form = rng.normal(0.0, 5.0, (10, 6))
    load = quadratic_terms(q) @ form
    pull = Rotation.from_quat(q).inv().apply([0.0, 0.0, -300.0])
    poses = SensorPoses(q, pull + load[:, :3], 50.0 * load[:, 3:] + np.cross([10, 20, 200], pull))
    found = identify_sensor(poses)
    other = Rotation.random(50, random_state=3).as_quat()
    load = quadratic_terms(other) @ form
    pull = Rotation.from_quat(other).inv().apply([0.0, 0.0, -300.0])
    force, moment = compensate(
        pull + load[:, :3], 50.0 * load[:, 3:] + np.cross([10, 20, 200], pull), other, found.calibration
    )
    assert force == pytest.approx(np.zeros((50, 3)), abs=1e-8)
    assert moment == pytest.approx(np.zeros((50, 3)), abs=1e-6)


def test_the_sign_of_a_quaternion_does_not_matter():
    poses = drawn()
    sign = np.where(np.arange(27) % 2, 1.0, -1.0)[:, None]
    turned = SensorPoses(poses.rotation * sign, poses.force_N, poses.moment_Nmm)
    found, other = identify_sensor(poses), identify_sensor(turned)
    assert np.array(other.calibration.force_terms_N) == pytest.approx(
        np.array(found.calibration.force_terms_N), abs=1e-9
    )
    one, two = (
        compensate(poses.force_N, poses.moment_Nmm, q, found.calibration)
        for q in (poses.rotation, turned.rotation)
    )
    assert (one[0] == two[0]).all()
    assert (one[1] == two[1]).all()


def test_noise_alone_gets_no_terms_and_few_or_like_orientations_neither():
    found = identify_sensor(drawn(with_hose=False, seed=2))
    assert not np.any(found.calibration.force_terms_N)
    assert "left out of the fit" in found.issues[0].message
    few = identify_sensor(drawn(GRID[:19]))
    assert few.force_left_out_N is None
    assert "19 orientations, 20 are needed" in few.issues[0].message
    alike = [(a, b, 0.0) for a in range(-60, 61, 30) for b in (20, 60, 100, 140)]
    flat = identify_sensor(drawn([*alike, (0.0, 90.0, 20.0)]))
    assert not np.any(flat.calibration.force_terms_N)
    assert "too similar" in flat.issues[0].message


# --- compensation and transfer --------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_process_force_comes_back_at_the_tcp(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.random(5, random_state=seed)
    process_N, process_Nmm = rng.normal(0, 400, (5, 3)), rng.normal(0, 5e3, (5, 3))  # in the root, at the TCP
    tcp = make.pose_of(*rng.uniform(-300, 300, 3), *rng.uniform(-170, 170, 3))
    force, moment = [], []
    for r, f, m in zip(turn.as_matrix(), process_N, process_Nmm, strict=True):
        own = make.sensor_reading(r, with_hose=False)
        force.append(own[0] + r.T @ f)
        moment.append(own[1] + r.T @ (m + np.cross(r @ tcp[:3, 3], f)))
    calibration = Calibration(
        weight_N=TRUTH[0], centre_mm=TRUTH[1:4], force_offset_N=TRUTH[4:7], moment_offset_Nmm=TRUTH[7:]
    )
    at_sensor = compensate(force, moment, turn.as_quat(), calibration)
    at_tcp = transfer_to_tcp(*at_sensor, tcp)
    in_tool = (turn * Rotation.from_matrix(tcp[:3, :3])).inv()
    assert at_tcp[0] == pytest.approx(in_tool.apply(process_N), abs=1e-8)
    assert at_tcp[1] == pytest.approx(in_tool.apply(process_Nmm), abs=1e-5)


def test_calibration_survives_its_file(tmp_path):
    found = identify_sensor(drawn()).calibration
    file = tmp_path / "sensor.toml"
    file.write_text(calibration_toml(found), encoding="utf-8")
    assert read_calibration(file) == found
    file.write_text(calibration_toml(found).replace("weight_N", "weight_kg"), encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match=r"sensor\.toml: error: weight_N"):
        read_calibration(file)


# --- files and command ----------------------------------------------------------------------------------


SENSOR = ("identify", "sensor")


def test_orientation_as_angles_quaternions_and_joints(tmp_path, cell):
    q_deg = np.random.default_rng(3).uniform(-100, 100, (6, 6))
    rotations = np.array([make.bodies(q)[make.BODIES.index("sensor")][:3, :3] for q in q_deg])
    turn = Rotation.from_matrix(rotations)
    readings = np.array([np.concatenate(make.sensor_reading(r, False)) for r in rotations])
    heads = {
        "a_deg,b_deg,c_deg": turn.as_euler("ZYX", degrees=True),
        "qx,qy,qz,qw": -turn.as_quat(),
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg": q_deg,
    }
    for head, orientation in heads.items():
        file = tmp_path / "poses.csv"
        header = f"{head},fx_N,fy_N,fz_N,mx_Nmm,my_Nmm,mz_Nmm"
        np.savetxt(file, np.hstack([orientation, readings]), delimiter=",", header=header, comments="")
        found = identify_sensor(read_poses(file, cell))
        assert [e.value for e in estimates(found)] == pytest.approx(TRUTH, rel=1e-6, abs=1e-6)


def test_wrong_files_are_told(tmp_path, cell):
    file = tmp_path / "poses.csv"
    text = (FOLDER / "orientations.csv").read_text(encoding="utf-8")
    cases = (
        (text.replace("a_deg", "A"), r"poses\.csv:1: error: no orientation; the file has A, b_deg"),
        (text.replace("fz_N", "fz"), "column fz_N: missing"),
        (text.replace("-60,35,-70", "-60,x,-70"), "row 2, column b_deg: 'x' is not a finite number"),
        ("qx,qy,qz,qw,fx_N,fy_N,fz_N,mx_Nmm,my_Nmm,mz_Nmm\n1,1,0,0,0,0,0,0,0,0\n", "row 2, .* length 1.414"),
    )
    for wrong, words in cases:
        file.write_text(wrong, encoding="utf-8")
        with pytest.raises(NotUnderstoodError, match=words):
            read_poses(file, cell)


def test_command(run, tmp_path):
    done = run(*SENSOR, FOLDER / "orientations.csv", "-o", tmp_path / "sensor.toml", code=0)
    assert done.err.count("note: ") == 2
    assert "27 orientations, 90% intervals" in done.out
    assert read_calibration(tmp_path / "sensor.toml").weight_N == pytest.approx(make.WEIGHT_N, rel=0.05)
    result = json.loads(run(*SENSOR, FOLDER / "orientations.csv", "--json", "--noise-N", "20").out)
    assert result["force_noise_N"] == 20.0
    assert result["weight_interval_N"][0] < make.WEIGHT_N < result["weight_interval_N"][1]
    assert set(result["calibration"]) == set(Calibration.model_fields)


def test_command_refuses(run, tmp_path):
    file = tmp_path / "same.csv"
    rows = make.pose_rows([(0, 90, 0)] * 4, np.random.default_rng(1))
    file.write_text(make.pose_csv(rows), encoding="utf-8")
    assert (
        "same.csv: error: not determined: weight, centre of gravity and offset"
        in run(*SENSOR, file, "-o", tmp_path / "sensor.toml", code=1).err
    )
    assert not (tmp_path / "sensor.toml").exists()
    assert json.loads(run(*SENSOR, file, "--json", code=1).out)["issues"][0]["code"] == "not-determined"
    run(*SENSOR, file, "-o", file, code=2)
