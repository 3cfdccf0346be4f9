"""Every kind of case is whole, the same twice, and says in its label what the README promises."""

import json

import numpy as np
import pytest

from tests.plant import kinds
from tests.plant.confounded import PAIRS
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN
from tests.plant.effects.depends import FORMS, LINKS, ON, WHERE
from tests.plant.kinds import KINDS, draw_case, plan_of

FIELDS = {"schema", "kind", "seed", "made_with", "asked", "null", "slip", "in_library", "visible", "answers"}
FIELDS |= {"effects", "instruments", "foreign_noise", "mismatch_law", "robot_mismatch", "runs"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_case_of_each_kind(kind, tmp_path):
    label = draw_case(kind, 21, tmp_path / "case")
    stored = json.loads((tmp_path / "case.label.json").read_text(encoding="utf-8"))
    assert set(stored) >= FIELDS
    assert stored["kind"] == kind
    assert stored["null"] == kind.startswith("null")
    least, most = {"double": (2, 2), "many": kinds.MANY}.get(kind, (0, 0) if stored["null"] else (1, 1))
    assert least <= len(stored["effects"]) <= most
    assert len({(each["effect"], each["target"]) for each in stored["effects"]}) == len(stored["effects"])
    for entry in stored["effects"]:
        assert entry["depends"]["where"] in WHERE
        assert set(entry["depends"]["on"]) <= set(ON)
        assert entry["depends"]["form"] in FORMS
        assert set(entry["depends"]["links"]) <= set(LINKS)
    assert (tmp_path / "case" / "run-3" / "run.toml").exists()
    again = draw_case(**label["made_with"], folder=tmp_path / "again")
    assert json.dumps(again, default=str) == json.dumps(label, default=str)
    for file in (tmp_path / "case").rglob("*"):
        twin = tmp_path / "again" / file.relative_to(tmp_path / "case")
        if file.is_file():
            assert file.read_bytes() == twin.read_bytes()


def test_kinds_draw_from_their_shelves():
    for seed in range(60):
        assert plan_of("open", seed)[0].faults[0].kind in UNKNOWN.values()
        assert plan_of("slip", seed)[0].faults[0].kind in SLIPS.values()
        assert plan_of("single", seed)[0].faults[0].kind in LIBRARY.values()
        plan, more = plan_of("deleted", seed)
        assert more["delete"] == plan.faults[0].kind.name
        assert more["answers"] == []
        plan, more = plan_of("missing", seed)
        assert not set(kinds.MISSING[more["missing"]]) & set(plan.how.tables)
        assert plan.how.tables
        plan, more = plan_of("confounded", seed)
        answers = [(a["effect"], a["target"]) for a in more["answers"]]
        assert plan.faults[0].kind.name in [name for name, _ in answers]
        assert len(answers) > 1


def test_a_third_are_other_forms_and_sizes_are_spread():
    plans = [plan_of("single", seed)[0] for seed in range(1200)]
    able = [p for p in plans if p.faults[0].kind.others]
    assert 0.25 < np.mean([not p.faults[0].same for p in able]) < 0.42
    ratios = np.array([p.ratio for p in plans])
    assert ratios.min() >= 0.25
    assert ratios.max() <= 4.0
    assert 0.4 < np.mean(ratios > 1.0) < 0.6


@pytest.mark.parametrize("name", ["coolant_jet", "chatter", "load_inertia", "stress_release"])
def test_open_cases_have_the_ratio_that_was_drawn(name, tmp_path):
    label = draw_case("open", 33, tmp_path / "case", f"open:{name}")
    assert label["effects"][0]["ratio"] == pytest.approx(label["wanted_ratio"], rel=0.1)


def test_missing_columns_are_not_written(tmp_path):
    for seed in range(200):
        if plan_of("missing", seed)[1]["missing"] == "load_encoders_of_a1_a2_a3":
            break
    label = draw_case("missing", seed, tmp_path / "case", "backlash@A2")
    file = next((tmp_path / "case" / "run-1").glob("controller.csv"), None)
    if file is None:
        file = next((tmp_path / "case" / "run-2").glob("controller.*"))
    head = file.read_bytes()[:4000]
    assert b"q4_load_deg" not in head
    assert b"q4_act_deg" in head
    assert label["visible"] in (True, False)


def test_a_step_tells_when_and_where_to(tmp_path):
    step = draw_case("single", 5, tmp_path / "case", "step@tip", "same")["effects"][0]["step"]
    assert set(step) == {"run", "at_s", "size", "unit", "direction"}
    assert step["unit"] == "mm"


def test_mistakes_are_told():
    with pytest.raises(ValueError, match="no kind"):
        plan_of("nothing", 1)
    with pytest.raises(ValueError, match="no pair"):
        plan_of("confounded", 1, "backlash")
    assert len(PAIRS) >= 8


def test_the_command_line(tmp_path, capsys):
    assert kinds.main(["null", "--seed", "4", "-o", str(tmp_path)]) == 0
    assert "null-00004" in capsys.readouterr().out
    assert kinds.main(["null", "--seed", "4", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert kinds.main(["names"]) == 0
    assert {"backlash", "open:chatter"} <= set(capsys.readouterr().out.split())
