"""Seeded real mistakes are refused with the line and a remedy; clean programs are translated."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
mistakes = import_module("mistakes")


@pytest.mark.parametrize("case", mistakes.MISTAKES, ids=lambda case: case.title)
def test_mistake_is_refused(case, tmp_path):
    verdict = mistakes.judge(case, tmp_path)
    assert verdict.refused, verdict.printed
    assert verdict.right_line, f"expected line {verdict.expected}\n{verdict.printed}"
    assert verdict.remedy, verdict.printed


@pytest.mark.parametrize("case", mistakes.FIVE_AXES, ids=lambda case: case.title)
def test_wrong_five_axis_machine_is_told(case, tmp_path):
    verdict = mistakes.judge(case, tmp_path)
    assert verdict.passed, verdict.printed


@pytest.mark.parametrize("case", mistakes.CLEAN, ids=lambda case: case.title)
def test_clean_program_is_translated(case, tmp_path):
    outcome = mistakes.judge_clean(case, tmp_path)
    assert outcome.exit_code == 0, outcome.printed
    assert "out.src" in outcome.new_files


def test_titles_are_distinct():
    titles = [case.title for case in (*mistakes.MISTAKES, *mistakes.CLEAN)]
    assert len(titles) == len(set(titles))
    assert len(mistakes.MISTAKES) >= 50


def test_no_tool_change_by_hand_while_the_spindle_turns(tmp_path):
    case = mistakes.Clean("M5 missing before the second M6", change={20: "G4 P0.5"})
    outcome = mistakes.judge_clean(case, tmp_path)
    if outcome.exit_code == 0:
        program = (tmp_path / "out.src").read_text(encoding="utf-8")
        before_change = program[: program.index("change to tool 14 by hand")]
        assert before_change.rindex("$OUT[1]=TRUE") < before_change.rfind("$OUT[1]=FALSE")
