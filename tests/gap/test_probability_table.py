"""The table of probabilities is a file of the package."""

import json

from gcode2krl.gap.thresholds import TABLE, THRESHOLDS, declared_nats, stated_table


def test_the_table_stands_beside_the_thresholds():
    assert TABLE.is_file()
    assert stated_table() == json.loads(TABLE.read_text(encoding="utf-8"))


def test_declared_sets_are_as_wide_as_the_table_says_and_no_narrower_than_the_convention():
    assert declared_nats() == stated_table()["alike_nats"]
    assert declared_nats() >= THRESHOLDS.posterior.alike_chi2 / 2.0
