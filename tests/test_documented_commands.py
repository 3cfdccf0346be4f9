"""Every command that a document names runs in a test, or is listed with what runs instead."""

import re
import tomllib

import pytest

from gcode2krl.cli.main import commands
from tests.cli.test_help_examples import LINES, ready  # noqa: F401 (a fixture)
from tests.conftest import ROOT
from tests.documented_commands import Named, is_mention, named, script_of
from tests.test_ci import IN_TESTS
from tests.test_documents import DOCUMENTS, ELSEWHERE, folder  # noqa: F401 (a fixture)

LISTED = tomllib.loads((ROOT / "tests" / "documented_commands.toml").read_text(encoding="utf-8"))
CI = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
JOB = "[tool.1]\ndiameter_mm = 16.0\nteeth = 3\nflute_length_mm = 40.0\n"
RSI = 'based_on = "demonstration"\n[online]\n'


def all_named() -> list[Named]:
    """Return each command of each document."""
    paths = {path: path.relative_to(ROOT).as_posix() for path in DOCUMENTS}
    return [each for path, name in paths.items() for each in named(path, name, with_sh=name in ELSEWHERE)]


NAMED = all_named()
MENTIONS = sorted({each.command for each in NAMED if is_mention(each.command, commands)})


def runs_in_ci(command: str) -> bool:
    script = script_of(command)
    if script is None:
        return False
    return script in IN_TESTS or re.search(rf"^python {re.escape(script)}\b", CI, re.M) is not None


def test_every_command_is_run_or_listed():
    known = {*LINES, *LISTED["run"], *LISTED["elsewhere"], *MENTIONS}
    missing = [each for each in NAMED if each.command not in known and not runs_in_ci(each.command)]
    assert missing == []


def test_nothing_is_listed_that_no_document_names():
    listed = {*LISTED["run"], *LISTED["elsewhere"]}
    assert listed - {each.command for each in NAMED} == set()
    assert not set(LISTED["run"]) & set(LISTED["elsewhere"])


def test_what_runs_instead_exists():
    for command, reason in LISTED["elsewhere"].items():
        for path in re.findall(r"tests/[\w/]+\.py", reason):
            assert (ROOT / path).is_file(), command


@pytest.mark.parametrize("command", MENTIONS)
def test_a_command_that_is_named_exists(command, run):
    assert "Usage:" in run(*command.split()[1:], "--help", code=0).out


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(LISTED["run"]))
def test_a_command_runs(command, folder, run, ready):  # noqa: F811
    how = LISTED["run"][command]
    (folder / "job.toml").write_text(JOB, encoding="utf-8")
    (folder / "rsi.toml").write_text(RSI, encoding="utf-8")
    before = how.get("before", [])
    if not before:
        ready(" ".join(how.get("as", [command])))
    for line in (*before, *how.get("as", [command])):
        done = run(*line.split()[1:])
        assert done.code == 0, (line, done.err)


@pytest.mark.parametrize(
    ("text", "commands_of_it"),
    [
        ("```text\ngcode2krl a.nc -o a.src   what it does\n```\n", ["gcode2krl a.nc -o a.src"]),
        ("```bat\npython x.py  # why\n```\n", ["python x.py"]),
        ("use `gcode2krl\nexplain x` now", ["gcode2krl explain x"]),
        ("```sh\ngcode2krl a.nc\n```\n", []),
        ("`gcode2krl` and `ruff` alone are names", []),
    ],
)
def test_commands_are_found(tmp_path, text, commands_of_it):
    (tmp_path / "page.md").write_text(text, encoding="utf-8")
    assert [each.command for each in named(tmp_path / "page.md", "page.md")] == commands_of_it
