"""Each code is caused and its remedy carried out: the program is written, or another finding is next.

A table is a module with a `STATE`, which is said to be in order, and `CASES` by code. What has no remedy that
a person carries out in a file stands in ``without.toml`` with its reason.
"""

import tomllib
from pathlib import Path

import pytest

from gcode2krl.codes import all_codes
from tests.remedies import cell, commands, cutting, diagnose, identify, krl, online, program, runs
from tests.remedies.bench import laid, outcome

TABLES = (program, cell, cutting, krl, online, commands, runs, identify, diagnose)
CASES = [(code, table.STATE, case) for table in TABLES for code, case in table.CASES.items()]
WITHOUT = tomllib.loads(Path(__file__).with_name("without.toml").read_text(encoding="utf-8"))
READER = tomllib.loads((Path(__file__).parents[1] / "gcode" / "remedies.toml").read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def written_programs_are_krl():
    """Programs are parsed elsewhere: here they are many and alike."""


def found(issues, code, words):
    return [issue for issue in issues if issue[1] == code and words in issue[3]]


@pytest.mark.slow
@pytest.mark.parametrize(("code", "state", "case"), CASES, ids=[code for code, _, _ in CASES])
def test_who_follows_a_remedy_is_rid_of_the_finding(code, state, case):
    wrong = laid(state, case.wrong)
    _, issues, _ = outcome(wrong)
    assert found(issues, code, case.says), issues
    assert case.remedies
    for remedy in case.remedies:
        exit_code, issues, _ = outcome(laid(wrong, remedy))
        assert not found(issues, code, case.says), remedy
        errors = {issue[1] for issue in issues if issue[0] == "error"}
        assert errors <= set(case.then), issues
        assert exit_code == 0 or errors


def test_every_code_has_its_remedy_carried_out_or_a_reason():
    """What waits is counted: it should be none."""
    told = {code for code, _, _ in CASES} | READER["code"].keys() | READER["elsewhere"].keys()
    nothing = {name for name, code in all_codes().items() if code.remedy.startswith("Nothing")}
    reasons = {code for group in WITHOUT.values() for code in group}
    assert not told & reasons
    assert set(all_codes()) - told - nothing == reasons - nothing
    if WITHOUT["waiting"]:
        print(f"{len(WITHOUT['waiting'])} remedies wait: {', '.join(WITHOUT['waiting'])}")
