"""A view of one component: what couples it with others is what these say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from gcode2krl.gap.posterior.families import View
from gcode2krl.gap.posterior.gram import MOST, SplitColumns
from tests.gap.constructed import split

COUNT = 300
RATES = [np.sin(np.arange(COUNT) * (0.02 + 0.01 * joint)) for joint in range(6)]


def view(late, joints):
    """Return the view of joints that are late by sizes (k,), beside a clock that all of them have."""
    draw = np.random.default_rng(1)
    rows = joints * COUNT
    clock = np.concatenate(RATES[:joints])
    residual = np.concatenate([size * rate for size, rate in zip(late, RATES, strict=False)])
    return View(
        residual=residual + 0.1 * draw.standard_normal(rows),
        tangents=clock[:, None],
        nuisance=SplitColumns(np.zeros((rows, 0)), (), 0),
        members=csr_array(np.ones((1, rows))),
        components=np.repeat(np.arange(joints), COUNT),
        runs=np.zeros(rows, dtype=int),
    )


def test_a_lag_of_one_joint_is_not_taken_for_the_clock_of_all():
    seen = view([1.0, 1.0, 9.0, 1.0, 1.0], 5).at(2)
    assert seen.residual @ RATES[2] / (RATES[2] @ RATES[2]) == pytest.approx(8.0, abs=0.1)


def test_what_all_joints_say_is_the_clock():
    seen = view([3.0] * 5, 5).at(1)
    assert float(np.std(seen.projected)) == pytest.approx(0.1, rel=0.1)


def test_joints_with_usual_lags_of_their_own_let_the_clock_be_unsure():
    """Each of six says another clock; the third is late by a usual lag more than the middle one."""
    sizes, usual = [0.9, 1.0, 3.0, 1.1, 1.2, 1.3], 2.0
    plain = view(sizes, 6)
    lags = np.zeros((6 * COUNT, 6))
    for joint in range(6):
        lags[joint * COUNT : (joint + 1) * COUNT, joint] = usual / MOST * RATES[joint]
    nuisance = split(10.0 * lags, plain.components)
    seen = replace(plain, nuisance=nuisance, tangents=10.0 * plain.tangents, residual=10.0 * plain.residual)
    assert seen.at(2).chi2 == pytest.approx(COUNT, rel=0.15)


def test_two_others_cannot_say_which_of_them_is_wrong():
    seen = view([1.0, 1.0, 9.0], 3).at(2)
    assert seen.tangents.shape == (COUNT, 1)
    assert float(np.std(seen.projected)) == pytest.approx(0.1, rel=0.1)


def test_one_joint_among_the_others_is_outvoted():
    seen = view([1.0, 50.0, 1.0, 1.0, 1.0, 1.0], 6).at(5)
    assert float(np.std(seen.residual)) == pytest.approx(0.1, rel=0.15)


def test_the_whole_is_left_as_it_is():
    whole = view([1.0] * 4, 4)
    assert whole.at(None) is whole
