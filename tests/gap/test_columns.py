"""Columns beside tangents and nuisance, by inner products: against the rows themselves."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.gap.families.columns import Beside, Columns
from gcode2krl.gap.families.split_columns import SplitColumns
from gcode2krl.gap.families.steps import Steps
from gcode2krl.gap.families.view import View
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
    clock = SplitColumns.of_dense(rate[:, None], components)
    plain = View(rate, nothing, clock, members, components)
    alike = plain.beside(rate, 50.0 * rate[:, None])
    assert plain.at(2).kept == ()
    assert alike.at(2).kept == (0,)
    columns = Columns(GENERATOR.standard_normal((count, 3)))
    for view in (plain.at(2), alike.at(2)):
        np.testing.assert_allclose(Beside(view, columns).fixed, columns.values.T @ view.fixed, atol=1e-12)


def test_split_columns_are_those_of_one_array():
    """Products, parts of the rows with some of the columns, and what is not zero: against the whole array."""
    components = np.repeat([0, 1, 2, 0, 1, 2], [40, 40, 40, 60, 60, 60])
    whole, columns = GENERATOR.standard_normal((300, 2)), GENERATOR.standard_normal((300, 7))
    columns[:120, 4:] = columns[120:, :2] = 0.0
    columns[np.ix_(components == 1, [3, 6])] = 0.0
    split = replace(SplitColumns.of_dense(columns, components), whole=whole)
    dense = np.concatenate([whole, columns], axis=1)
    left, right = GENERATOR.standard_normal((5, 300)), GENERATOR.standard_normal((9, 4))
    sums = csr_array(left * (left > 1.0))
    some, kept = components == 1, np.array([True, False, True, True, False, True, True])
    part = split.of(some, kept)
    inner = columns[np.ix_(some, kept)]
    assert sum(each.values.size for each in split.parts) == np.count_nonzero(columns)
    assert all(np.shares_memory(each.values, split.parts[i].values) for each, i in zip(part.parts, (1, 4)))
    np.testing.assert_array_equal(split.used(some), dense[some].any(axis=0))
    for found, expected in (
        (split.dense, dense),
        (split @ right, dense @ right),
        (left @ split, left @ dense),
        (left[0] @ split, left[0] @ dense),
        (sums @ split, sums @ dense),
        (split.gram, dense.T @ dense),
        (part.dense, inner),
        (part.gram, inner.T @ inner),
        (left[:, some] @ part, left[:, some] @ inner),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-12)
