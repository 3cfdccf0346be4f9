"""The CI files of ``examples/ci/``: valid, and their shell steps do here what they do in the service."""

import json
import re
import subprocess
import sys

import pytest
import yaml
from junitparser import JUnitXml

from tests.conftest import ROOT
from tests.examples.shell import BAD, CI, GOOD, Repository, needs

INSTALL = 'python -m pip install "$GCODE2KRL"'
MATCHER = CI / "problem-matcher.json"


@pytest.fixture
def repository(tmp_path):
    return Repository(tmp_path)


def read(name):
    return yaml.safe_load((CI / name).read_text(encoding="utf-8"))


def lines_of(repository):
    text = (repository.folder / "out" / "results.jsonl").read_text(encoding="ascii")
    return {line["part"]: line for line in map(json.loads, text.splitlines())}


@pytest.mark.parametrize(
    ("schema", "file"),
    [
        ("vendor.github-workflows", CI / "github-actions.yml"),
        ("vendor.gitlab-ci", CI / "gitlab-ci.yml"),
        ("vendor.github-workflows", ROOT / ".github" / "workflows" / "release.yml"),
    ],
)
def test_the_file_keeps_to_its_schema(schema, file):
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, str(file)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


class Workflow:
    """The steps of the GitHub workflow that are commands; those that are actions need the service."""

    def __init__(self, repository: Repository) -> None:
        self.repository = repository
        self.file = read("github-actions.yml")
        self.steps = {step["name"]: step for step in self.file["jobs"]["translate"]["steps"] if "run" in step}
        repository.write(".github/problem-matcher.json", MATCHER.read_text(encoding="ascii"))
        self.summary = repository.folder.parent / "summary.md"

    def run(self, name):
        workspace = str(self.repository.folder)
        stated = self.file["env"] | self.steps[name].get("env", {})
        known = {key: value.replace("${{ github.workspace }}", workspace) for key, value in stated.items()}
        assert "${{" not in "".join(known.values()) + self.steps[name]["run"]
        return self.repository.run(self.steps[name]["run"], **known, GITHUB_STEP_SUMMARY=str(self.summary))


@pytest.mark.slow
def test_the_github_workflow(repository):
    workflow = Workflow(repository)
    assert list(workflow.steps) == ["Install", "Translate", "Summary", "Keep for the next comparison"]
    assert workflow.steps["Install"]["run"] == INSTALL
    done = workflow.run("Translate")
    assert done.returncode == 1, done.stderr
    assert (repository.folder / "out" / "good.src").is_file()
    assert workflow.run("Summary").returncode == 0
    assert workflow.run("Keep for the next comparison").returncode == 0
    first = workflow.summary.read_text(encoding="utf-8")
    assert first.startswith("# 1 of 2 parts written, 1 not understood")
    assert "Against the last run" not in first

    workflow.summary.unlink()
    repository.write("parts/sub/bad.nc", GOOD)
    done = workflow.run("Translate")
    assert done.returncode == 0, done.stderr
    assert workflow.run("Summary").returncode == 0
    second = workflow.summary.read_text(encoding="utf-8")
    assert second.startswith("# All 2 parts were written")
    assert "| sub/bad.nc | written, was not understood |" in second
    assert [line["cached"] for line in lines_of(repository).values()] == [True, False]


@pytest.mark.slow
def test_the_workflow_uploads_what_a_batch_writes(repository):
    workflow = Workflow(repository)
    workflow.run("Translate")
    steps = read("github-actions.yml")["jobs"]["translate"]["steps"]
    used = {step["uses"].partition("@")[0]: step.get("with", {}) for step in steps if "uses" in step}
    assert (repository.folder / used["github/codeql-action/upload-sarif"]["sarif_file"]).is_file()
    assert (repository.folder / used["actions/upload-artifact"]["path"] / "index.html").is_file()
    assert used["actions/cache/save"]["path"] == used["actions/cache/restore"]["path"] == ".gcode2krl"
    sarif = json.loads((repository.folder / "out" / "findings.sarif").read_text(encoding="ascii"))
    errors = [one for one in sarif["runs"][0]["results"] if one["level"] == "error"]
    (location,) = errors[0]["locations"]
    place = location["physicalLocation"]["artifactLocation"]
    assert (repository.folder / place["uri"]).read_text(encoding="ascii") == BAD


def matches(text):
    """Return what the problem matcher takes from each line of an output: (file, line, severity, code)."""
    patterns = [
        one["pattern"][0] for one in json.loads(MATCHER.read_text(encoding="ascii"))["problemMatcher"]
    ]
    found = []
    for line in text.splitlines():
        for pattern in patterns:
            if match := re.search(pattern["regexp"], line):
                groups = [match[pattern[key]] if key in pattern else "" for key in ("file", "line")]
                found.append((*groups, match[pattern["severity"]], match[pattern["code"]]))
    return found


@pytest.mark.slow
def test_the_problem_matcher_finds_what_a_batch_prints(repository):
    done = Workflow(repository).run("Translate")
    assert "::add-matcher::.github/problem-matcher.json" in done.stdout
    found = matches(done.stdout + done.stderr)
    (line,) = {line for line in found if line[2] == "error"}
    assert line == ("parts/sub/bad.nc", "3", "error", "no-number")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["parts/sub/bad.nc", "-o", "bad.src"], [("parts/sub/bad.nc", "3", "error", "no-number")]),
        (["parts/good.nc", "--cell", "cell.toml"], [("cell.toml", "2", "error", "cell-key")]),
        (["missing.nc"], [("missing.nc", "", "error", "file-unreadable")]),
    ],
)
def test_the_problem_matcher_finds_what_translate_prints(repository, words, expected):
    repository.write("cell.toml", 'based_on = "demonstration"\nclearence.z_mm = 5\n')
    done = repository.run(f"gcode2krl {' '.join(words)}")
    assert done.returncode == 2
    assert matches(done.stderr) == expected


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("C:\\a\\b c.nc:12: warning: x: y [force-high]", ("C:\\a\\b c.nc", "12", "warning", "force-high")),
        ("  a:1:2.nc:7: error: at 3: error: [x] [no-feed] -> do: it", ("a:1:2.nc", "7", "error", "no-feed")),
        ("a.nc: warning: no line [after-end] -> x", ("a.nc", "", "warning", "after-end")),
        ("a.nc:3: note: nothing to do [stock-guessed]", None),
        ("written  a.nc  1.0 s, 3 N  [0.1 s]", None),
    ],
)
def test_lines_of_the_problem_matcher(line, expected):
    assert matches(line) == ([expected] if expected else [])


@pytest.mark.slow
def test_the_gitlab_job(repository):
    job = read("gitlab-ci.yml")["robot-programs"]
    assert job["before_script"] == [INSTALL]
    folder = str(repository.folder)
    variables = {name: value.replace("$CI_PROJECT_DIR", folder) for name, value in job["variables"].items()}
    branch = {"CI_COMMIT_BRANCH": "main", "CI_DEFAULT_BRANCH": "main"}
    for exit_code, cached in ((1, [False, False]), (1, [True, True])):
        done = repository.run("\n".join(job["script"]), **variables)
        assert done.returncode == exit_code, done.stderr
        after = repository.run("\n".join(job["after_script"]), **variables, **branch)
        assert after.returncode == 0, after.stderr
        assert [line["cached"] for line in lines_of(repository).values()] == cached
    assert all(line["against"] is not None for line in lines_of(repository).values())
    suites = JUnitXml.fromfile(str(repository.folder / job["artifacts"]["reports"]["junit"]))
    assert {case.name: bool(case.result) for suite in suites for case in suite} == {
        "good.nc": False,
        "bad.nc": True,
    }
    kept = job["artifacts"]["paths"] + job["cache"]["paths"]
    assert all((repository.folder / path).is_dir() for path in kept)


@pytest.mark.slow
def test_the_pre_commit_hook(repository):
    """The hook as it is stated, with the gcode2krl of this checkout in place of an installed one."""
    needs("pre-commit")
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    example = read("pre-commit-config.yaml")["repos"][0]
    assert [one["id"] for one in example["hooks"]] == [hook["id"]]
    local = {"repos": [{"repo": "local", "hooks": [hook | {"language": "system"}]}]}
    repository.write(".pre-commit-config.yaml", yaml.safe_dump(local))
    repository.write(".gitignore", ".gcode2krl/\n")
    repository.write("notes.txt", "G1 X\n")
    own = {"PRE_COMMIT_HOME": str(repository.folder.parent / "pre-commit")}
    names = "-c user.name=x -c user.email=x@example.org"
    assert repository.run("git init -q && git add -A && pre-commit install", **own).returncode == 0
    refused = repository.run(f"git {names} commit -q -m one 2>&1", **own)
    assert refused.returncode == 1
    assert "parts/sub/bad.nc:3: error: X is not followed by a number [no-number]" in refused.stdout
    assert "good.nc:" not in refused.stdout
    repository.write("parts/sub/bad.nc", GOOD)
    taken = repository.run(f"git add -A && git {names} commit -m two 2>&1", **own)
    assert taken.returncode == 0, taken.stdout
    assert "Passed" in taken.stdout
    assert repository.run("git status --porcelain").stdout == ""
    repository.write("notes.txt", "G1\n")
    skipped = repository.run(f"git add -A && git {names} commit -m three 2>&1", **own)
    assert "no files to check" in skipped.stdout


def instructions():
    """Return the instructions of the Containerfile: (name, words)."""
    text = (CI / "Containerfile").read_text(encoding="ascii")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [tuple(line.split(maxsplit=1)) for line in lines]
