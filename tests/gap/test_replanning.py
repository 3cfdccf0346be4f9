"""A time law far from the plan is found by the times at places, where least squares on the path are not."""

from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.gap.components import Block
from gcode2krl.gap.posterior.examination import PlaceTimes
from gcode2krl.gap.posterior.likelihood import refit
from gcode2krl.gap.posterior.selection import replanned
from tests.gap.constructed import applied, likelihood
from tests.gap.test_examination import SLOWER, run

SIGMA = 1e-4


def _found(share):
    """Return as much of an examination as a refit looks at: one run that takes longer by a share."""
    traces = (run(share, noise_rad=SIGMA),)
    return SimpleNamespace(
        data=SimpleNamespace(place_times=PlaceTimes(traces), values=traces[0].measured.size),
        likelihood=likelihood(traces, sigma=SIGMA),
        applied=(),
        traces=traces,
        fitted=refit(likelihood(traces, sigma=SIGMA), ()),
    )


@pytest.mark.parametrize("share", [0.35, -0.2])
def test_the_share_of_a_slower_run_comes_back(share):
    found = _found(share)
    fitted = replanned(found, Block(SLOWER, None), applied(SLOWER, 0.01, None), np.inf)
    assert fitted.applied[0].values["share"] == pytest.approx(share, abs=2e-3)
    alone = refit(found.likelihood, (applied(SLOWER, 0.01, None),), steps=2)
    assert fitted.chi2 < 0.1 * alone.chi2


def test_one_that_is_hopeless_is_not_searched_for():
    found = _found(0.35)
    linear = applied(SLOWER, 0.01, None)
    rough = replanned(found, Block(SLOWER, None), linear, 0.0)
    assert rough.chi2 >= replanned(found, Block(SLOWER, None), linear, np.inf).chi2


def test_a_run_in_time_is_given_up_after_a_few_steps():
    """Another effect takes half of the rest; a share that is not there brings nothing."""
    found = _found(0.0)
    linear = applied(SLOWER, 0.01, None)
    started = replanned(found, Block(SLOWER, None), linear, 0.5 * found.fitted.chi2)
    assert started.chi2 == refit(found.likelihood, (linear,), steps=3).chi2
