"""The estimate of an arm's stiffness: its band, which arms have one, and that no robot is moved by it."""

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.cell import library, resolve_cell
from gcode2krl.compensation.iteration import refuse_unsure
from gcode2krl.compliance import assumed_stiffness, displace, missing_stiffness, stiffness
from gcode2krl.compliance.estimate import ARM, estimated, left_out, published
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.online.compensator import build_compensator
from gcode2krl.prediction.limits import DeflectionLimit
from gcode2krl.tables import Deflection

TOOL = {"1": {"diameter_mm": 10.0, "teeth": 2, "length_mm": 100.0}}
FRAMES = {
    "tool": {"x_mm": 250.0, "y_mm": 0.0, "z_mm": 250.0, "a_deg": 0.0, "b_deg": -90.0, "c_deg": 0.0},
    "tool_length_mm": 100.0,
}


def cell_of(model: str, **sections):
    return resolve_cell({"robot": {"model": model}, "tool": TOOL, "frames": FRAMES, **sections})


def test_every_arm_of_the_library_bends():
    for model in library.names("robots"):
        cell = cell_of(model)
        shift, _ = displace([[0.0, -1.5, 1.5, 0.0, 1.0, 0.0]], [100.0, 0.0, 0.0], np.zeros(3), cell)
        assert missing_stiffness(cell) is None
        assert 1e-3 < np.linalg.norm(shift) < 20.0, model


def test_the_band_reaches_both_ends_of_the_interval():
    """Middle and half-width give the typical compliance times and over the same factor."""
    residuals = np.concatenate([residual for _, residual in left_out()])
    factor = np.exp(1.6448536 * np.sqrt(np.nanmean(residuals**2)))
    estimate = estimated(300, 2496)
    low, high = 1.0 - estimate.relative_band, 1.0 + estimate.relative_band
    assert high / low == pytest.approx(factor**2)
    k = np.exp(np.array([each.log_k[0] for each in published() if each.robot == "KR 300 R2500 ultra"]))
    inside = estimate.softness[ARM.index("A1"), 2] * np.array([low, high])
    assert inside[0] < 1.0 / (1e3 * k.mean()) < inside[1]


def test_the_band_covers_what_is_published():
    residuals = np.concatenate([residual for _, residual in left_out()])
    residuals = residuals[np.isfinite(residuals)]
    half = np.arctanh(estimated(100, 2000).relative_band)  # (f² - 1)/(f² + 1) = tanh log f
    assert len(residuals) >= 25
    assert np.mean(np.abs(residuals) <= half) >= 0.85


def test_what_is_stated_is_not_estimated():
    stated = {"A2": {"k_c": 1e9, "k_b": 1e9, "k_a": 1e9}}
    known = stiffness(cell_of("KR 210-2", compliance={"virtual_joints": stated}))
    assert known.softness[1] == pytest.approx(1e-9)
    assert "A2" not in known.assumed.split("estimated")[0]
    assert "sensor and spindle taken as rigid" in known.assumed


def test_without_payload_nothing_is_estimated():
    geometry = load_cell().robot.geometry.model_dump(exclude={"source", "sure"})
    issue = missing_stiffness(resolve_cell({"robot": {"geometry": geometry}}))
    assert issue is not None
    assert "mass_kg" in issue.remedy


def test_no_robot_is_moved_by_an_estimate():
    """Whatever the material is known to, and even where only the spindle is not stated."""
    sure = Deflection(deflection_base_mm=np.zeros((1, 3)), correction_base_mm=np.zeros((1, 3)))
    for model in ("KR 210-2", "KR 300 R2500 ultra"):
        cell = cell_of(model)
        assert assumed_stiffness(cell) is not None
        with pytest.raises(RefusedError, match="rigid"):
            refuse_unsure(sure, cell)
        with pytest.raises(NotUnderstoodError, match="rigid"):
            build_compensator(cell, cell.online, tool=1, load_frame="base")


@pytest.mark.parametrize(("known", "severity"), [("", "error"), ("estimated", "warning")])
def test_an_absurd_deflection_by_an_estimate_refuses_nothing(known, severity):
    limit = DeflectionLimit(cell_of("KR 6 R900-2"), known)
    bent = Deflection(deflection_base_mm=np.full((1, 3), 200.0), correction_base_mm=np.zeros((1, 3)))
    limit.take(bent, np.ones(1, dtype=bool), np.ones(1, dtype=np.int32))
    assert limit.absurd.severity == severity
