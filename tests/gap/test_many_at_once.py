"""Several small errors of a set-up at once: the model with what is named is as good as with the truth."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
cases, score = import_module("blind.cases"), import_module("blind.score")


@pytest.mark.slow
def test_a_base_frame_beside_two_wrong_masterings_has_its_name(tmp_path):
    case = cases.Case(14007, "many", None)
    record = cases.run_case(
        case, tmp_path, cases.How(oracle=False), cases.predictions(tmp_path / "predictions")
    )
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
