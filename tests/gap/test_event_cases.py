"""Whole cases of the plant: what happens in one stretch with its moment, and several small errors at once."""

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


def test_a_base_frame_beside_two_wrong_masterings_has_its_name(predictions, tmp_path):
    """The model with what is named is as good as with the truth."""
    case = cases.Case(14007, "many", None)
    record = cases.run_case(case, tmp_path, cases.How(oracle=False), predictions)
    assert record["error"] is None, record["error"]
    assert {effect for effect, _ in map(score.truth_of, record["label"]["effects"])} == {
        "base_frame",
        "mastering",
    }
    judged = score.judge(record)
    assert ("base_frame", None) in judged.named
    assert not judged.is_wrongly_named
    before, left, true = record["rests"]["MECHANICS"]
    assert before > 4.0 * true
    assert left < 1.1 * true
