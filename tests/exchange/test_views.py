"""Names of functions in a table are no imports: here each is resolved."""

from inspect import isfunction

import pytest

from gcode2krl.exchange.views import VIEWS, view


@pytest.mark.parametrize("name", VIEWS)
def test_what_shows_a_result_is_there(name):
    assert isfunction(view(name))
