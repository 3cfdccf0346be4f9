"""Checking a run against a prediction: each slip has its own finding, real gaps have none."""

import hashlib

import numpy as np
import pytest

from gcode2krl.runs import check_against, check_program, load_run
from tests.runs import maker

FAST = {"speed": 500.0}


@pytest.fixture
def found(tmp_path):
    """Return the findings for tables against the prediction of ``how``."""

    def check(head="", how=None, with_joints=True, **tables):
        t = np.arange(0.0, maker.duration(**(how or {})), 0.012)
        position = maker.path(t, **(how or {}))
        joints = np.radians(maker.joints_deg(position)) if with_joints else None
        run = load_run(maker.run_folder(tmp_path / "run-1", head, **tables))
        return check_against(run, t, position, joints)

    return check


def codes(issues):
    return [issue.code for issue in issues]


def moved(change):
    columns = maker.tracker()
    xyz = np.stack([columns[f"{axis}_mm"] for axis in "xyz"], axis=1)
    result = change(xyz)
    return {"t_s": columns["t_s"]} | {f"{axis}_mm": result[:, i] for i, axis in enumerate("xyz")}


def turned(angle_deg, shift_mm):
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return moved(lambda p: p @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + shift_mm)


def test_a_run_of_the_prediction_has_no_finding(found):
    assert found(controller=maker.controller(), tracker=maker.tracker()) == []


def test_real_gaps_are_no_finding(found):
    gaps = moved(lambda p: p + [3.0, -2.0, 1.0] + 0.8 * np.sin(p / 20.0))
    slow = maker.controller(percent=97.0) | {"q4_act_deg": maker.controller(percent=97.0)["q4_act_deg"] + 0.1}
    assert found(tracker=gaps, controller=slow) == []
    assert found(tracker=maker.tracker(offset=0.3)) == []


def test_pauses_are_no_other_program(found):
    assert found(controller=maker.controller(stop=1.1), tracker=maker.tracker(stop=1.1)) == []


@pytest.mark.parametrize("axis", range(3))
def test_metres(found, axis):
    factor = np.where(np.arange(3) == axis, 1e-3, 1.0)
    (issue,) = found(tracker=moved(lambda p: p * factor))
    assert (issue.severity, issue.code, issue.line) == ("error", "run-unit", 2)
    assert f"column {'xyz'[axis]}_mm spans" in issue.message
    assert "1000 times less, so metres" in issue.message
    assert issue.remedy == "multiply the column by 1000"


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "metres"), (1 / 25.4, "inches")])
def test_all_columns_in_another_unit(found, factor, unit):
    issues = found(tracker=moved(lambda p: p * factor))
    assert codes(issues) == ["run-unit"] * 3
    assert all(f"so {unit}" in issue.message for issue in issues)


def test_angles_in_radians_show_where_the_table_alone_cannot(found):
    columns = {n: v for n, v in maker.controller().items() if not n.startswith("q2_act")}
    columns = {n: v for n, v in columns.items() if "_act" not in n}
    columns["q6_cmd_deg"] = np.radians(columns["q6_cmd_deg"])
    (issue,) = found(controller=columns)
    assert "column q6_cmd_deg" in issue.message
    assert "57.3 times less, so radians" in issue.message


def test_swapped_axes(found):
    issues = found(tracker=moved(lambda p: p[:, [1, 0, 2]]))
    assert codes(issues) == ["run-axes"] * 2
    assert "column x_mm follows the predicted y_mm" in issues[0].message
    cycled = found(tracker=moved(lambda p: p[:, [1, 2, 0]]))
    assert [issue.message.split(": ")[1] for issue in cycled] == [
        f"column {a}_mm follows the predicted {b}_mm" for a, b in ("xy", "yz", "zx")
    ]


def test_a_reversed_axis(found):
    (issue,) = found(tracker=moved(lambda p: p * [1, -1, 1]))
    assert "column y_mm runs against the prediction" in issue.message


def test_joints_swapped_in_command_and_actual_alike(found):
    columns = maker.controller()
    for kind in ("cmd", "act"):
        a, b = f"q2_{kind}_deg", f"q3_{kind}_deg"
        columns[a], columns[b] = columns[b], columns[a]
    issues = found(controller=columns)
    assert codes(issues) == ["run-axes"] * 2
    assert "column q2_cmd_deg follows the predicted q3_cmd_deg" in issues[0].message


@pytest.mark.parametrize("offset", [2.0, -2.0, 6.0])
def test_the_clock(found, offset):
    (issue,) = found(tracker=maker.tracker(offset=offset))
    assert (issue.severity, issue.code) == ("warning", "run-clock")
    assert f"column t_s is {offset:+.3f} s off" in issue.message
    assert f"tracker_s = {offset:.3f}" in issue.remedy


def test_the_clock_of_joints_alone(found):
    columns = {n: v for n, v in maker.controller().items() if n == "t_s" or n.startswith("q")}
    columns["t_s"] = columns["t_s"] + 2.0
    (issue,) = found(controller=columns)
    assert issue.code == "run-clock"


@pytest.mark.parametrize("percent", [10, 30, 50, 75, 90, 120])
def test_another_override(found, percent):
    issues = found(controller=maker.controller(percent=percent), tracker=maker.tracker(percent=percent))
    assert codes(issues) == ["run-override"] * 2
    for issue in issues:
        assert f"runs at {percent} % of the predicted speed" in issue.message
        assert f"override_percent = {percent}" in issue.remedy


def test_a_declared_override(found):
    half = {"controller": maker.controller(percent=50.0), "tracker": maker.tracker(percent=50.0)}
    assert found("override_percent = 50", **half) == []
    (issue,) = found("override_percent = 50", tracker=maker.tracker(percent=75.0))
    assert "75 % of the predicted speed, 50 % are declared" in issue.message


def test_t1(found):
    capped = {
        "how": FAST,
        "controller": maker.controller(top=250.0, **FAST),
        "tracker": maker.tracker(top=250.0, **FAST),
    }
    issues = found(**capped)
    assert codes(issues) == ["run-t1"] * 2
    assert "no faster than 250 mm/s" in issues[0].message
    assert found('mode = "T1"', **capped) == []
    assert found(how=FAST, controller=maker.controller(**FAST), tracker=maker.tracker(**FAST)) == []


def test_another_frame(found):
    (issue,) = found(tracker=turned(37.0, [1500.0, -300.0, 800.0]), controller=maker.controller())
    assert (issue.severity, issue.code) == ("error", "run-frame")
    assert "turned by 37.0 deg and shifted by (1500.0, -300.0, 800.0) mm" in issue.message
    assert found('[frames]\ntracker = "sensor"', tracker=turned(37.0, [1500.0, -300.0, 800.0])) == []


def test_a_frame_that_is_only_shifted(found):
    (issue,) = found(tracker=turned(0.0, [0.0, 100.0, 0.0]))
    assert (issue.severity, issue.code) == ("warning", "run-frame")
    assert "100.00" in issue.message


def test_another_pose_of_the_same_path(found):
    columns = maker.controller()
    for kind in ("cmd", "act"):
        columns[f"q1_{kind}_deg"] = columns[f"q1_{kind}_deg"] + 12.0
    (issue,) = found(controller=columns)
    assert (issue.code, "12.00" in issue.message) == ("run-frame", True)
    assert found('angles = "relative"', controller=columns) == []


@pytest.mark.parametrize("other", [maker.WAYPOINTS[[0, 1, 3, 5, 2, 7, 4, 6, 8]], maker.WAYPOINTS * 1.5])
def test_another_program(found, other):
    issues = found(controller=maker.controller(waypoints=other), tracker=maker.tracker(waypoints=other))
    assert codes(issues) == ["run-program"] * 2
    assert "does not follow the predicted path" in issues[0].message


def test_a_robot_that_did_not_move(found):
    (issue,) = found(tracker=moved(lambda p: p * 0.0 + 5.0))
    assert "never move" in issue.message
    noise = np.random.default_rng(0).normal(0.0, 0.03, (len(maker.tracker()["t_s"]), 3))
    assert codes(found(tracker=moved(lambda p: noise))) == ["run-program"]


def test_recordings_longer_and_shorter_than_the_program(found):
    t = np.arange(-5.0, 19.0, 0.01)
    position = (
        maker.path(t) + np.clip(-t, 0, 4)[:, None] * [90, 50, 80] + np.clip(t - 13.5, 0, 4)[:, None] * 70
    )
    longer = {"t_s": t} | {f"{axis}_mm": position[:, i] for i, axis in enumerate("xyz")}
    assert found(tracker=longer) == []
    assert found(tracker=maker.tracker(t=np.arange(5.0, 9.0, 0.01))) == []
    (issue,) = found(tracker=maker.tracker(t=np.arange(5.0, 9.0, 0.01), offset=1.5))
    assert issue.code == "run-clock"


def raster(rows, hold, scale=1.0):
    ends = np.array(
        [
            [[0, y, 0], [400, y, 1]] if r % 2 == 0 else [[400, y, 1], [0, y, 0]]
            for r, y in enumerate(0.25 * np.arange(rows))
        ],
        dtype=float,
    ).reshape(-1, 3)
    length = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    start = np.concatenate([[0.0], np.cumsum(length / 80.0 + hold)]) / scale
    t = np.arange(0.0, start[-1], 0.02)
    return t, np.stack([np.interp(t, start, ends[:, axis]) for axis in range(3)], axis=1)


@pytest.mark.parametrize(("hold", "scale"), [(0.05, 0.99), (0.15, 1.0), (0.05, 1.0)])
def test_a_long_raster_whose_time_law_drifts_is_the_same_program(tmp_path, hold, scale):
    t, position = raster(60, hold, scale)
    position += np.random.default_rng(3).normal(0.0, 0.05, position.shape)
    tracker = {"t_s": t} | {f"{axis}_mm": position[:, i] for i, axis in enumerate("xyz")}
    run = load_run(maker.run_folder(tmp_path / "run", "", tracker=tracker))
    assert check_against(run, *raster(60, 0.05)) == []


def test_the_program_by_its_hash(tmp_path):
    folder = maker.run_folder(tmp_path / "run", 'program = "part.nc"')
    run = load_run(folder)
    assert check_program(run, "0" * 64) == []
    (folder / "part.nc").write_bytes(b"G1 X10\n")
    assert check_program(run, hashlib.sha256(b"G1 X10\n").hexdigest()) == []
    (issue,) = check_program(run, hashlib.sha256(b"G1 X11\n").hexdigest())
    assert (issue.severity, issue.code) == ("error", "run-program")
    assert "part.nc" in issue.message
