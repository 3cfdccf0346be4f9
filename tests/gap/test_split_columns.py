"""Columns by runs and components: against the whole array."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from tests.gap.constructed import split

GENERATOR = np.random.default_rng(1)


def test_split_columns_are_those_of_one_array():
    """Products, parts of the rows with some of the columns, and what is not zero: against the whole array."""
    components = np.repeat([0, 1, 2, 0, 1, 2], [40, 40, 40, 60, 60, 60])
    whole, columns = GENERATOR.standard_normal((300, 2)), GENERATOR.standard_normal((300, 7))
    columns[:120, 4:] = columns[120:, :2] = 0.0
    columns[np.ix_(components == 1, [3, 6])] = 0.0
    joined = replace(split(columns, components), whole=whole)
    dense = np.concatenate([whole, columns], axis=1)
    left, right = GENERATOR.standard_normal((5, 300)), GENERATOR.standard_normal((9, 4))
    sums = csr_array(left * (left > 1.0))
    some, kept = components == 1, np.array([True, False, True, True, False, True, True])
    part = joined.of(some, kept)
    inner = columns[np.ix_(some, kept)]
    assert sum(each.values.size for each in joined.parts) == np.count_nonzero(columns)
    assert all(
        np.shares_memory(each.values, joined.parts[i].values)
        for each, i in zip(part.parts, (1, 4), strict=True)
    )
    np.testing.assert_array_equal(joined.used(some), dense[some].any(axis=0))
    for found, expected in (
        (joined.dense, dense),
        (joined @ right, dense @ right),
        (left @ joined, left @ dense),
        (left[0] @ joined, left[0] @ dense),
        (sums @ joined, sums @ dense),
        (joined.gram, dense.T @ dense),
        (part.dense, inner),
        (part.gram, inner.T @ inner),
        (left[:, some] @ part, left[:, some] @ inner),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-12)
