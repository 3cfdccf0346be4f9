"""The blend of section 2.3: threshold, linear blend to the estimate and back, and a wrong estimate."""

import numpy as np

from gcode2krl.cell.sections.online import Online
from gcode2krl.online.compensator import blend_start, blended

SETTINGS = Online()


def run(measured_x, estimate_x, known=None, settings=SETTINGS):
    count = len(measured_x)
    measured = np.zeros((count, 6))
    measured[:, 0] = measured_x
    measured[:, 3:] = 10.0
    estimate = np.zeros((count, 3))
    estimate[:, 0] = estimate_x
    known = np.ones(count, dtype=bool) if known is None else known
    return blended(blend_start(), measured, estimate, known, settings)[1]


def test_below_the_threshold_the_measurement_counts():
    blend = run(np.full(200, 500.0), np.full(200, 351.0))
    assert (blend.load[:, 0] == 500.0).all()
    assert (blend.weight == 0.0).all()


def test_beyond_it_the_signal_goes_over_linearly_within_80_ms():
    estimate = np.linspace(0.0, -40.0, 60)
    blend = run(np.full(60, 500.0), estimate)
    ramp = np.minimum(np.arange(1, 61) * 0.004 / 0.080, 1.0)
    np.testing.assert_allclose(blend.weight, ramp, atol=1e-12)
    np.testing.assert_allclose(blend.load[:, 0], (1 - ramp) * 500.0 + ramp * estimate, atol=1e-9)
    np.testing.assert_allclose(blend.load[:, 3], (1 - ramp) * 10.0, atol=1e-12)


def test_it_comes_back_the_same_way():
    measured = np.concatenate([np.full(40, 500.0), np.zeros(60)])
    blend = run(measured, np.zeros(100))
    assert blend.weight[39] == 1.0
    np.testing.assert_allclose(np.diff(blend.weight[39:60]), -0.05, atol=1e-12)
    assert blend.weight[-1] == 0.0


def test_the_difference_is_that_of_the_vectors():
    measured = np.zeros((5, 6))
    measured[:, :3] = 80.0, 80.0, 80.0  # no component differs by 150, the vector by 139
    _, blend = blended(blend_start(), measured, np.zeros((5, 3)), np.ones(5, dtype=bool), SETTINGS)
    assert blend.weight[-1] == 0.0
    measured[:, 2] = 110.0
    _, blend = blended(blend_start(), measured, np.zeros((5, 3)), np.ones(5, dtype=bool), SETTINGS)
    assert blend.weight[-1] > 0.0


def test_an_estimate_wrong_in_a_steady_cut_is_not_trusted_until_both_agree():
    settings = SETTINGS
    patience_s = settings.pilot_lead_s + settings.blend_s + 2.0 * settings.filter_s
    measured = np.full(400, 546.0)
    estimate = np.full(400, 300.0)
    estimate[300:] = 500.0
    blend = run(measured, estimate)
    first = np.argmax(blend.distrusted)
    assert abs(first * 0.004 - patience_s) <= 0.008
    assert blend.weight[first - 1] == 1.0
    assert (blend.load[first + 20 : 300, 0] == 546.0).all()
    assert not blend.distrusted[300:].any()


def test_an_estimate_that_changes_is_an_event_and_stays_trusted():
    estimate = np.linspace(0.0, -3000.0, 300)
    assert not run(np.full(300, 500.0), estimate).distrusted.any()


def test_where_there_is_no_estimate_the_last_one_fades():
    known = np.ones(60, dtype=bool)
    known[30:] = False
    blend = run(np.full(60, 500.0), np.zeros(60), known)
    assert blend.weight[29] == 1.0
    assert blend.weight[-1] == 0.0
    assert np.abs(np.diff(blend.load[:, 0])).max() < 26.0
