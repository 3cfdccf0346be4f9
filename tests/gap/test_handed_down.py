"""What one link has named is part of the model of the links behind it, and is not named there again."""

import pytest

from gcode2krl.gap import diagnose
from tests.gap.synthetic import applied, prediction, runs

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("text", "signals"),
    [
        # the load encoders saw a transmission error of the same size and the other sign
        ("encoder_interpolation:target=A5,amplitude_deg=0.004,periods=2,phase=3", {"force": False}),
        # the tip moved by what the pull bent, as if an axis were not parallel
        ("cable_pull:target=A3,N_per_deg=3,direction=-0.4/0.9/0", {}),
    ],
)
def test_a_cause_that_shows_in_two_links_is_named_once(text, signals):
    effect, target = text.split(":")[0], text.split("target=")[1].split(",")[0]
    gap = diagnose(prediction(), runs(applied(text), 2, 5, load_encoders=True, **signals))
    assert [(each.effect, each.target) for each in gap.named_causes] == [(effect, target)]
    assert gap.verdict == "explained"
    assert all(link.verdict in ("explained", "no_gap") for link in gap.links)
