"""Coefficients are recovered from forces made with them; coefficients that are not determined are refused."""

import json
import tomllib

import numpy as np
import pytest

from gcode2krl.cell.library import read_model
from gcode2krl.cell.sections import Material
from gcode2krl.errors import RefusedError
from gcode2krl.identify.force import NAMES, UNTESTED_BAND, fit_force
from tests.identify.measured_slots import MILLS, error_of, fit_of, held_out

TRUE = np.array([850.0, 200.0, 180.0, 20.0, 24.0, 3.0])
ZERO = np.array([5.0, -8.0, 3.0])
N = 3
AUTHOR = np.array([958.86, 250.863, 146.361, 15.758, 19.434, 18.2075])
"""What the author of the measured slots fitted to them."""
FLAT = MILLS["flat"]


def slot_basis(f_z_mm, a_p_mm):
    """Mean forces of a full slot by the printed formula, one column a coefficient."""
    c, e = N * a_p_mm * f_z_mm / 4.0, N * a_p_mm / np.pi
    half = N * a_p_mm * f_z_mm / np.pi
    basis = np.zeros((len(f_z_mm), 3, 6))
    basis[:, 0, 1], basis[:, 0, 4] = -c, -e
    basis[:, 1, 0], basis[:, 1, 3] = c, e
    basis[:, 2, 2], basis[:, 2, 5] = half, N * a_p_mm / 2.0
    return basis


def a_run(feeds, rng, noise_N=4.0, delay_s=0.0):
    f_z = np.concatenate([np.r_[np.zeros(40), np.full(200, feed), np.zeros(40)] for feed in feeds])
    time = np.arange(len(f_z)) * 0.012
    basis = slot_basis(f_z, np.full(len(f_z), 4.0)) * (f_z > 0)[:, None, None]
    measured_s = np.arange(0.0, time[-1], 0.004)
    force = basis @ TRUE
    measured = np.stack([np.interp(measured_s - delay_s, time, force[:, axis]) for axis in range(3)], axis=1)
    return time, basis, measured_s, measured + rng.normal(ZERO, noise_N, measured.shape)


def test_slots_at_three_feeds_give_all_six():
    fit = fit_force(*a_run((0.03, 0.08, 0.15), np.random.default_rng(1)))
    assert fit.determined.all()
    np.testing.assert_allclose(fit.value, TRUE, rtol=0.02, atol=0.3)
    np.testing.assert_allclose(fit.zero_N, ZERO, atol=1.5)
    assert fit.relative_band < 0.05
    assert np.nanmax(fit.misfit) < fit.relative_band


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(2)
    inside = []
    for _ in range(60):
        time, basis, measured_s, measured = a_run((0.03, 0.08, 0.15), rng)
        fit = fit_force(time, basis, measured_s, measured)
        inside.append(np.abs(fit.value - TRUE) <= fit.half)
    assert 0.80 <= np.mean(inside) <= 0.97


def test_a_late_sensor_is_found():
    fit = fit_force(*a_run((0.03, 0.08, 0.15), np.random.default_rng(3), delay_s=0.06))
    assert fit.delay_s == pytest.approx(0.06, abs=0.006)
    np.testing.assert_allclose(fit.value, TRUE, rtol=0.03, atol=0.6)


def test_one_feed_cannot_tell_cutting_from_edge():
    fit = fit_force(*a_run((0.08,), np.random.default_rng(4)))
    assert not fit.determined.all()
    with pytest.raises(RefusedError) as refused:
        fit.require_all("run")
    assert any(name in str(refused.value.issues[0].message) for name in NAMES)


def test_one_confounding_leaves_the_other_coefficients_alone():
    """At one depth without air the edges' force is a constant, as the sensor's zero is."""
    fit = fit_of(FLAT, FLAT.cuts, zeroed=False)
    np.testing.assert_array_equal(fit.determined, [True, True, True, False, False, False])
    np.testing.assert_allclose(fit.value[:3], AUTHOR[:3], rtol=0.014)
    with pytest.raises(RefusedError, match="Kte, Kre, Kae") as refused:
        fit.require_all("run")
    assert "--zeroed" in refused.value.issues[0].remedy


@pytest.mark.parametrize("told", [{"zeroed": True}, {"zeroed": False, "in_air": 40}])
def test_a_known_zero_gives_what_the_author_found(told):
    fit = fit_of(FLAT, FLAT.cuts, **told)
    assert fit.determined.all()
    np.testing.assert_allclose(fit.value, AUTHOR, rtol=0.014)


@pytest.mark.parametrize("mill", MILLS)
def test_held_out_slots_are_inside_the_band_of_the_others(mill):
    inside = [error <= band for _, error, band, within in held_out(MILLS[mill]) if within]
    assert inside == [True] * 3


@pytest.mark.parametrize("mill", ["bull-nose", "ball"])
def test_slots_with_round_edges_are_inside_the_band_of_the_set_for_their_alloy(mill):
    """The set was not fitted to them."""
    material = Material.model_validate(read_model("materials", "Al 7075-T6"))
    for cut in MILLS[mill].cuts:
        force = MILLS[mill].force_N(cut, material.linear_edge.array())
        assert error_of(force, cut) < (0.25 if cut.a_p_mm == 1.0 else 0.14) < material.relative_band


def test_the_band_is_that_of_cuts_left_out_and_not_of_noise():
    """The law bends below 0.05 mm, which noise-free means cannot show."""
    thicker = fit_of(FLAT, FLAT.cuts[1:])
    assert fit_of(FLAT, FLAT.cuts).relative_band > 1.4 * thicker.relative_band
    assert fit_of(FLAT, FLAT.cuts[2:4]).relative_band >= UNTESTED_BAND


def test_a_run_in_air_is_refused():
    time = np.arange(200) * 0.012
    with pytest.raises(RefusedError, match="in cut"):
        fit_force(time, np.zeros((200, 3, 6)), time, np.zeros((200, 3)))


SLOTS = """G21 G90 G17 G40 G49 G80 G94
T1 M6
S13000 M3
G0 G43 H1 Z20
G0 X-20 Y-40
G0 Z2
G1 Z-3 F1500
G1 X60 F1200
G1 Y0 F6000
G1 X-20 F2600
G1 Y40 F6000
G1 X60 F4400
G0 Z20
M5
M30
"""


def test_the_command_reads_a_run_and_writes_the_cell(run, tmp_path):
    (tmp_path / "slots.nc").write_text(SLOTS, encoding="ascii")
    stock = (
        'based_on = "demonstration"\n'
        + "[stock]\nbox_mm = [[0, -60, -20], [50, 60, 0]]\nresolution_mm = 0.4\n"
    )
    (tmp_path / "cell.toml").write_text(stock, encoding="utf-8")
    assert run("predict", "slots.nc", "-o", "prediction", "--cell", "cell.toml", "-q").code == 0
    from gcode2krl import Prediction
    from gcode2krl.cutting import force_basis

    prediction = Prediction.load("prediction")
    motion = prediction.motion
    force = force_basis(prediction.toolpath, motion, prediction.cell) @ TRUE
    rng = np.random.default_rng(5)
    rows = np.column_stack([motion.time_s, force + rng.normal(0.0, 2.0, force.shape)])
    (tmp_path / "run").mkdir()
    head = "t_s,fx_N,fy_N,fz_N"
    np.savetxt(tmp_path / "run" / "force.csv", rows, delimiter=",", header=head, comments="", fmt="%.4f")
    (tmp_path / "run" / "run.toml").write_text(
        'prediction = "../prediction"\n[frames]\nforce = "base"\n', encoding="utf-8"
    )
    (tmp_path / "found.toml").write_text(stock, encoding="utf-8")
    outcome = run("identify", "force", "run", "--json", "--apply", "found.toml", "--plot", "fit.png", code=0)
    found = json.loads(outcome.out)["coefficients"]
    for name, true in zip(NAMES, TRUE, strict=True):
        assert found[name]["value"] == pytest.approx(true, rel=0.03, abs=0.5)
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    written = tomllib.loads((tmp_path / "found.toml").read_text(encoding="utf-8"))
    low, high = written["material"]["measured_f_z_mm"]
    assert low == pytest.approx(1200 / 13000 / 3, rel=0.02)
    assert high == pytest.approx(4400 / 13000 / 3, rel=0.02)
    again = run("predict", "slots.nc", "-o", "again", "--cell", "found.toml", "-q", code=0)
    assert "force-unmeasured" not in again.err
    (tmp_path / "fast.nc").write_text(SLOTS.replace("F4400", "F9000"), encoding="ascii")
    assert "force-unmeasured" in run("predict", "fast.nc", "-o", "fast", "--cell", "found.toml", "-q").err
    assert run("identify", "force", "prediction").code == 2
