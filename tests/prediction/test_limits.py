"""Predicted figures beyond limits and data sheet, and absurd ones: a warning, an error, no figure."""

import io
import json
import math
import re

import numpy as np
import pytest

from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.prediction.limits import DeflectionLimit, cycle_acceleration
from gcode2krl.tables import Deflection, Motion
from gcode2krl.units import GRAVITY_M_S2
from tests.cells import over_demonstration

HEAD = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\n"
SLOT = "G0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X60\nG0 Z30\n"
STOCK = {"box_mm": [[-20, -20, -20], [80, 20, 0]], "resolution_mm": 0.5}


def predicted(text=HEAD + SLOT, *, instead=None, **data):
    """``instead`` replaces sections by values that a cell file may not state."""
    cell = over_demonstration({"stock": STOCK, **data})
    cell = cell.model_copy(update=instead(cell) if instead else {})
    toolpath = read_stream(io.BytesIO((text + "M5\nM30\n").encode()), "part.nc", cell)
    return predict_toolpath(toolpath, cell)


def found(prediction, code):
    return [(issue.severity, issue.line) for issue in prediction.issues if issue.code == code]


@pytest.mark.parametrize(
    ("key", "code", "line"),
    [
        ("force_N", "force-high", 7),
        ("torque_Nm", "torque-high", 7),
        ("deflection_mm", "deflection-high", 7),
        ("acceleration_mm_s2", "acceleration-high", None),
    ],
)
def test_a_figure_beyond_its_limit_is_a_warning_with_the_line_of_the_largest(key, code, line):
    plain = predicted()
    assert not found(plain, code)
    issues = [issue for issue in predicted(limits={key: 1.0}).issues if issue.code == code]
    assert [issue.severity for issue in issues] == ["warning"]
    assert key in issues[0].remedy
    if line is not None:
        largest = {
            "force_N": np.linalg.norm(plain.forces.force_base_N, axis=1),
            "torque_Nm": plain.forces.torque_Nmm,
            "deflection_mm": np.linalg.norm(plain.deflection.deflection_base_mm, axis=1),
        }[key]
        wanted = plain.toolpath.source_line[plain.motion.move[int(largest.argmax())]]
        assert issues[0].line == wanted


def test_lost_time_beyond_its_share_is_a_warning():
    assert ("note", "exact-stops") in [
        (i.severity, i.code) for i in predicted(limits={"lost_time_share": 1.0}).issues
    ]
    stops = [
        issue for issue in predicted(limits={"lost_time_share": 0.01}).issues if issue.code == "exact-stops"
    ]
    assert [issue.severity for issue in stops] == ["warning"]


def test_a_slip_in_the_spindle_speed_exceeds_the_robot():
    prediction = predicted((HEAD + SLOT).replace("S9000", "S90"))
    ((severity, line),) = found(prediction, "payload")
    assert severity == "error"
    assert line in (7, 8)
    assert found(prediction, "feed-per-tooth")[0] == ("warning", 7)


def test_the_payload_bears_the_load_and_the_force_together():
    force_N = predicted().forces.force_base_N
    mass = np.linalg.norm(force_N, axis=1).max() / GRAVITY_M_S2

    def judged(rated_kg, own_kg, **more):
        def loaded(cell):
            payload = cell.robot.payload.model_copy(update={"mass_kg": rated_kg})
            robot = cell.robot.model_copy(update={"payload": payload})
            return {"load": cell.load.model_copy(update={"mass_kg": own_kg}), "robot": robot}

        return found(predicted(instead=loaded, **more), "payload")

    assert judged(1.02 * mass, 0.0) == []
    assert judged(0.98 * mass, 0.0)[0][0] == "error"
    cuts_N = force_N[force_N.any(axis=1)]
    both = np.linalg.norm(cuts_N - [0.0, 0.0, 1.5 * mass * GRAVITY_M_S2], axis=1).max() / GRAVITY_M_S2
    assert both > 1.5 * mass
    assert judged(0.999 * both, 1.5 * mass)[0][0] == "error"
    assert judged(1.001 * both, 1.5 * mass) == []
    guessed = {"resolution_mm": 0.5}
    assert judged(0.8 * mass, 0.0, stock=guessed)[0][0] == "warning"
    assert judged(0.3 * mass, 0.0, stock=guessed)[0][0] == "error"


SOFTEST = ("A1", "A2", "A3", "sensor", "spindle")


def _soft(k_Nmm_rad):
    def instead(cell):
        joint = cell.compliance.virtual_joints["A1"].model_copy(
            update=dict.fromkeys(("k_c", "k_b", "k_a"), k_Nmm_rad)
        )
        joints = cell.compliance.virtual_joints | dict.fromkeys(SOFTEST, joint)
        return {"compliance": cell.compliance.model_copy(update={"virtual_joints": joints})}

    return instead


@pytest.mark.parametrize("k_Nmm_rad", [1e4, 5e-324])
def test_a_deflection_beyond_sense_is_an_error_that_names_the_key_and_no_figure(k_Nmm_rad):
    prediction = predicted(instead=_soft(k_Nmm_rad))
    (issue,) = [issue for issue in prediction.issues if issue.code == "deflection-absurd"]
    assert issue.severity == "error"
    assert "virtual_joints" in issue.remedy
    assert prediction.deflection is None
    assert prediction.forces is not None


def test_forces_beyond_sense_are_left_out():

    def hard(cell):
        law = cell.material.linear_edge.model_copy(update={"Ktc": 1e9, "Krc": 1e9})
        return {"material": cell.material.model_copy(update={"linear_edge": law})}

    prediction = predicted(instead=hard)
    (issue,) = [issue for issue in prediction.issues if issue.code == "force-absurd"]
    assert issue.severity == "error"
    assert "[material]" in issue.remedy
    assert prediction.forces is None
    assert prediction.deflection is None


def test_no_absurd_figure_is_printed_or_written(run, tmp_path):
    part, cell = tmp_path / "part.nc", tmp_path / "cell.toml"
    part.write_text(HEAD + SLOT + "M5\nM30\n")
    cell.write_text(
        'based_on = "demonstration"\n[compliance.virtual_joints]\n'
        + "".join(f"{name} = {{ k_c = 1e6, k_b = 1e6, k_a = 1e6 }}\n" for name in SOFTEST)
    )
    refused = run("translate", part, "-o", "part.src", "--cell", cell, code=1)
    assert not list(tmp_path.glob("*.src"))
    assert not list(tmp_path.glob("*.csv"))
    assert not re.search(r"\binf\b|\bnan\b|e\+[1-9]\d", refused.out + refused.err)
    line = re.search(r"part\.nc:(\d+): error: .*deflection-absurd", refused.err)[1]
    released = run(
        "translate",
        part,
        "-o",
        "part.src",
        "--cell",
        cell,
        "--allow",
        f"deflection-absurd:{line}",
        "--json",
        code=0,
    )
    figures = json.loads(released.out)
    assert figures["max_deflection_mm"] is None
    assert figures["max_force_N"] > 100.0
    assert not re.search(r"\binf\b|nan|e\+?\d\d\d", (tmp_path / "part.pilot.csv").read_text())


def test_the_acceleration_of_a_short_corner_is_that_over_a_cycle():
    time = np.arange(50) * 0.012
    way = 200.0 * time
    position = np.column_stack([np.minimum(way, 60.0), np.maximum(way - 60.0, 0.0), np.zeros(50)])
    none = np.zeros(50)
    motion = Motion(
        time_s=time,
        position_mm=position,
        rotation=np.tile([0, 0, 0, 1.0], (50, 1)),
        speed_mm_s=none + 200.0,
        acceleration_mm_s2=none + 2.7e5,
        jerk_mm_s3=none,
        path_mm=way,
        move=none,
        corner=none,
        tool=none + 1,
    )
    found = cycle_acceleration(motion, 0.012)
    assert found.max() == pytest.approx(200.0 * 2**0.5 / 0.012, rel=1e-6)
    assert np.count_nonzero(found > 1.0) <= 2
    assert cycle_acceleration(motion, 0.024).max() == pytest.approx(200.0 * 2**0.5 / 0.024, rel=1e-6)


def test_rapids_at_the_default_speed_are_no_finding_and_faster_ones_are():
    text = HEAD + "G0 X0 Y0\nG0 X400\nG0 Y400\nG0 X0\nG0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X60\nG0 Z30\n"
    assert not found(predicted(text), "acceleration-high")
    assert found(predicted(text, controller={"model": "KRC4", "rapid_m_s": 1.5}), "acceleration-high")


def test_the_first_of_the_longest_deflections_counts():
    """Rounded to tenths many are equally long; one that is not known counts as none."""
    chance = np.random.default_rng(5)
    limit = DeflectionLimit(over_demonstration())
    bent_mm, across_mm = np.round(chance.normal(size=(2, 900, 3)), 1)
    reached = chance.random(900) < 0.9
    bent_mm[~reached] = across_mm[~reached] = np.nan
    line = np.arange(100, 1000, dtype=np.int32)
    for rows in np.array_split(np.arange(900), 7):
        deflection = Deflection(deflection_base_mm=bent_mm[rows], correction_base_mm=across_mm[rows])
        limit.take(deflection, reached[rows], line[rows])
    assert limit.absurd is None
    for largest, vectors_mm in ((limit.bent, bent_mm), (limit.across, across_mm)):
        length_mm = np.nan_to_num([math.hypot(*vector) for vector in vectors_mm])
        assert largest.value == pytest.approx(length_mm.max(), rel=1e-15)
        assert largest.line == 100 + np.flatnonzero(np.isclose(length_mm, length_mm.max(), rtol=1e-12))[0]


@pytest.mark.parametrize("value", [math.inf, 1e200, 101.0])
def test_a_deflection_that_is_reached_and_not_known_is_absurd(value):
    bent_mm, line = np.zeros((50, 3)), np.arange(50, dtype=np.int32)
    bent_mm[20:, 1], reached = value, np.arange(50) >= 30
    limit = DeflectionLimit(over_demonstration())
    limit.take(Deflection(deflection_base_mm=bent_mm, correction_base_mm=-bent_mm), reached, line)
    assert limit.absurd is not None
    assert limit.absurd.line == 30
