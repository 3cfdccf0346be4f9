"""Columns beside tangents and nuisance, by inner products: against the rows themselves."""

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.gap.posterior.families import Beside, Columns, View
from gcode2krl.gap.posterior.study import Steps
from tests.gap import constructed as c
from tests.gap.test_families import view_of

GENERATOR = np.random.default_rng(1)


def beside():
    """Return columns beside three tangents and two nuisances, and their projected rows."""
    traces = [c.trace(c.noise(400, run), number=run) for run in range(2)]
    waves = [
        [c.columns_nuisance("wave", np.sin((2.0 + run) * trace.time_s))] for run, trace in enumerate(traces)
    ]
    rows, plain, _ = view_of(traces, waves)
    tangents = [GENERATOR.standard_normal((*trace.shape[::-1], 3)) for trace in traces]
    view = View.of(rows, [trace.residual for trace in traces], tangents)
    columns = Columns(GENERATOR.standard_normal((len(rows), 5)))
    assert plain.nuisance.dense.any()
    return Beside(view, columns), view.without_fixed(columns.values)


def test_products_are_those_of_the_projected_rows():
    found, projected = beside()
    values = found.columns.values
    np.testing.assert_allclose(found.gram, values.T @ projected, atol=1e-9)
    np.testing.assert_allclose(found.score, values.T @ found.view.projected, atol=1e-9)


def test_scores_are_those_of_the_projected_rows():
    found, projected = beside()
    view = found.view
    expected = view.members @ (projected * view.projected[:, None])
    np.testing.assert_allclose(found.scores, expected, atol=1e-9)
    weights = GENERATOR.standard_normal(5)
    left = view.projected - projected @ weights
    np.testing.assert_allclose(
        found.scores_without(found.explained(weights)), view.members @ (projected * left[:, None]), atol=1e-9
    )


def test_blocks_of_steps_are_those_of_their_columns():
    traces = [c.trace(c.noise(500, run, 1.0, 2), number=run) for run in range(3)]
    rows, _, grid = view_of(traces)
    for place in grid.places:
        steps = Steps(rows, place)
        moments = steps.coarse()
        expected = rows.of(steps.columns(moments), place.component)
        np.testing.assert_allclose(steps.blocks(moments), expected, atol=1e-12)


def test_views_of_one_component_may_keep_different_nuisance():
    count, joints = 200, 5
    rate = np.tile(np.sin(0.05 * np.arange(count)), joints)
    members = csr_array(np.ones((1, count * joints)))
    nothing = np.zeros((count * joints, 0))
    components = np.repeat(np.arange(joints), count)
    clock = c.split(rate[:, None], components)
    plain = View(rate, nothing, clock, members, components, np.zeros(count * joints, dtype=int))
    alike = plain.beside(rate, 50.0 * rate[:, None])
    assert plain.at(2).kept == ()
    assert alike.at(2).kept == (0,)
    columns = Columns(GENERATOR.standard_normal((count, 3)))
    for view in (plain.at(2), alike.at(2)):
        np.testing.assert_allclose(Beside(view, columns).fixed, columns.values.T @ view.fixed, atol=1e-12)
