"""Whole cases of the plant in which nearly all that happens is in one stretch: flagged, and when it was."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
cases = import_module("blind.cases")
score = import_module("blind.score")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def predictions(tmp_path_factory):
    return cases.predictions(tmp_path_factory.mktemp("predictions"))


@pytest.mark.parametrize(
    ("seed", "kind", "effect"),
    [
        pytest.param(26008, "story", "collision", id="a blow of three rows in a force in pieces"),
        pytest.param(26001, "story", "jerk", id="a following error in step with the jerk"),
        pytest.param(26011, "story", "snag", id="a cable that pulls and jerks free"),
        pytest.param(26108, "open", "open:cable_jerks_free", id="a pull no larger than the noise"),
        pytest.param(26114, "open", "open:floor_sways", id="a floor that sways"),
    ],
)
def test_what_happens_in_one_stretch_is_told_with_its_moment(seed, kind, effect, predictions, tmp_path):
    label = cases.made(cases.Case(seed, kind, effect), tmp_path / "case", predictions)
    answer = cases.answer(tmp_path / "case")
    assert answer["verdict"] != "no_gap"
    assert score.moment_hit(label["effects"], answer) in (True, None)
    assert list(score.told_moments(answer))
