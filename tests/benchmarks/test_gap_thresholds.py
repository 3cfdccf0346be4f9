"""A threshold changed in a process of its own, and what is counted of the answers."""

import json
import subprocess
import sys
from importlib import import_module

import pytest

from tests.benchmarks.hand_made import BENCHMARKS, cause, effect, record
from tests.conftest import ROOT

tool = import_module("gap_thresholds")
changed = import_module("gap_thresholds_changed")

PROBE = """
import sys
sys.path[:0] = [{root!r}, {benchmarks!r}]
from gap_thresholds_changed import Setting, change
change(Setting({room!r}, {name!r}, {factor!r}))
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.gap.choose.judged import NAMED
import gcode2krl.gap as gap
print(THRESHOLDS.{room}.{name}, NAMED, callable(gap.diagnose))
"""


def probe(room, name, factor):
    text = PROBE.format(root=str(ROOT), benchmarks=str(BENCHMARKS), room=room, name=name, factor=factor)
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_the_whole_diagnosis_sees_the_changed_threshold():
    assert probe("choose", "named", 0.5) == ["0.25", "0.25", "True"]
    assert probe("choose", "most_causes", 2.0)[:2] == ["8", "0.5"]


def test_a_threshold_is_not_changed_under_a_loaded_diagnosis():
    import gcode2krl.gap  # noqa: F401 - loaded is what matters

    with pytest.raises(RuntimeError, match="loaded before"):
        changed.change(changed.Setting("choose", "named", 0.5))


def test_what_can_be_halved():
    applies = changed.Setting.applies
    assert applies(0.5, 0.5)
    assert applies(4, 0.5)
    assert applies((0.1, 2), 2.0)
    for value in (1, True, "words", (), ("a",), 0.0):
        assert not applies(value, 0.5)
    assert changed._times((3, 0.5), 0.5) == (2, 0.25)


def test_every_threshold_is_listed_with_its_reason(capsys):
    assert tool.main(["list"]) == 0
    out = capsys.readouterr().out
    assert "| choose.named " in out
    assert "convention" in out
    assert all(each.reason in out for each in changed.thresholds())


def test_settings_of_named_thresholds():
    assert [str(each) for each in tool.settings(["choose.named"])] == ["choose.namedx0.5", "choose.namedx2"]
    with pytest.raises(ValueError, match=r"choose\.nothing"):
        tool.settings(["choose.nothing"])
    assert len(tool.settings([])) > 50


def test_scored_seeds_are_refused(tmp_path, capsys):
    assert tool.main(["make", str(tmp_path), "--seed", "30000"]) == 2
    assert "thresholds are never set on them" in capsys.readouterr().err
    assert tool.main(["table", str(tmp_path)]) == 2
    assert tool.main(["screen"]) == 2


def test_changes_and_figures():
    before = {"a": tool.judge(record([effect()], [cause()])), "b": tool.judge(record(kind="null"))}
    after = {"a": tool.judge(record([effect()], [cause("friction")])), "b": before["b"]}
    assert tool.changed(before, after) == 1
    assert tool._figures(before) == ("0/1", "1/1", "0/2", "0/0", "0/0")
    assert tool._figures(after) == ("0/1", "0/1", "1/2", "0/0", "0/0")


def test_stored_answers_of_this_code_are_not_asked_again(tmp_path, monkeypatch):
    case = {"case": {"seed": 1, "kind": "null", "without": []}, "label": {"effects": []}}
    asked = []

    def answers(folder, cases, setting):
        asked.extend(cases)
        return {name: {"result": record()["result"], "error": None} for name in cases}

    monkeypatch.setattr(tool, "_asked", answers)
    for _ in range(2):
        judged = tool.judgements(tmp_path, {"null-00001": case}, changed.BASE)
        assert judged["null-00001"].exact
    assert asked == ["null-00001"]
    monkeypatch.setattr(tool, "fingerprint", lambda: "other code")
    tool.judgements(tmp_path, {"null-00001": case}, changed.BASE)
    assert asked == ["null-00001", "null-00001"]


def test_cases_of_a_check_are_taken_with_their_answers(tmp_path, monkeypatch, capsys):
    check, folder = tmp_path / "check", tmp_path / "thresholds"
    monkeypatch.setattr(tool, "fingerprint", lambda: "this code")
    monkeypatch.setattr(tool, "_asked", lambda *_: pytest.fail("asked again"))
    with pytest.raises(ValueError, match="--keep"):
        tool.take(folder, check, 0)
    for kind, seed, code in (("null", 1, "this code"), ("null", 2, "this code"), ("open", 3001, "other")):
        made = record(kind=kind) | {"code": code, "diagnosis_cpu_s": 6.0}
        made["case"] |= {"seed": seed, "without": []}
        (check / "results").mkdir(parents=True, exist_ok=True)
        file = check / "results" / f"{kind}-{seed:05d}.json"
        file.write_text(json.dumps(made), encoding="utf-8")
        (check / "cases" / file.stem / "case" / "run-1").mkdir(parents=True)
    assert tool.main(["take", str(folder), "--check", str(check), "--cases", "2"]) == 0
    assert "2 cases" in capsys.readouterr().err
    assert set(tool.stored(folder, 0)) == {"null-00001", "open-03001"}  # kinds in turn
    assert (folder / "cases" / "open-03001" / "run-1").is_dir()
    null = {"null-00001": tool.stored(folder, 0)["null-00001"]}
    assert tool.judgements(folder, null, changed.BASE)["null-00001"].exact  # the check's own answer
    assert tool.told_cost(folder, ["null-00001"], 20) == "20 settings of 1 cases, 6 s each: 2 min of a core"
    assert tool.main(["take", str(folder)]) == 2


def test_scored_cases_are_not_taken(tmp_path):
    made = record(kind="null") | {"code": "a"}
    made["case"] |= {"seed": 30000, "without": []}
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "null-30000.json").write_text(json.dumps(made), encoding="utf-8")
    (tmp_path / "cases" / "null-30000" / "case").mkdir(parents=True)
    with pytest.raises(ValueError, match="scored cases set no thresholds"):
        tool.take(tmp_path / "thresholds", tmp_path, 0)


def test_the_screen_is_of_one_kind():
    every, calibrated = tool.settings([]), tool.settings([], "calibrated")
    assert 10 < len(calibrated) < len(every)
    kinds = {(each.room, each.name): each.kind.value for each in changed.thresholds()}
    assert {kinds[each.room, each.name] for each in calibrated} == {"calibrated"}


def test_a_few_stored_cases_are_of_all_kinds(tmp_path):
    (tmp_path / "labels").mkdir()
    for name in ("null-00001", "null-00002", "open-03001", "single-01001", "single-01002"):
        (tmp_path / "labels" / f"{name}.json").write_text(json.dumps({"name": name}), encoding="utf-8")
    assert set(tool.stored(tmp_path, 3)) == {"null-00001", "open-03001", "single-01001"}
    assert len(tool.stored(tmp_path, 0)) == 5


@pytest.mark.slow
def test_a_case_that_breaks_is_no_answer(tmp_path):
    command = [sys.executable, str(BENCHMARKS / "gap_thresholds_changed.py")]
    task = {"setting": ["choose", "named", 0.5], "cases": {"null-00001": [str(tmp_path), []]}}
    done = subprocess.run(command, input=json.dumps(task), capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)["null-00001"]
    assert found["result"] is None
    assert found["error"]
