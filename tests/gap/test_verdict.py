"""When the model of a link counts as lost for the links after it."""

import pytest

from gcode2krl.gap.compare.trace import is_lost
from tests.gap.constructed import stub


@pytest.mark.parametrize(
    ("verdict", "lost"),
    [("no_gap", False), ("explained", False), ("partly_explained", True), ("unexplained", True)],
)
def test_a_model_is_lost_where_something_is_left(verdict, lost):
    assert is_lost(stub(verdict=verdict, nearly_all=False)) is lost


def test_a_model_holds_where_a_small_share_of_the_gap_is_left():
    assert is_lost(stub(verdict="partly_explained", nearly_all=True)) is False


def test_a_link_that_was_not_judged_is_not_lost():
    assert is_lost(None) is False
