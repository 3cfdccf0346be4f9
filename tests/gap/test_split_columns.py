"""Columns by runs and components: against the whole array."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.gap.fit.split_columns import SplitColumns

GENERATOR = np.random.default_rng(1)


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
    assert all(
        np.shares_memory(each.values, split.parts[i].values)
        for each, i in zip(part.parts, (1, 4), strict=True)
    )
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
