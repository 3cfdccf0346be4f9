"""The release workflow: its matrix builds what pyproject.toml says, with commands that exist."""

import itertools
import os
import shutil
import subprocess
import sys
import tomllib

import pytest
import yaml

from tests.conftest import ROOT

FILE = ROOT / ".github" / "workflows" / "release.yml"
WORKFLOW = yaml.safe_load(FILE.read_text(encoding="utf-8"))
WHEELS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["cibuildwheel"]
MATRIX = WORKFLOW["jobs"]["wheel"]["strategy"]["matrix"]["include"]
OF_RUNNER = {"ubuntu": "linux", "macos": "macos", "windows": "windows"}


def test_the_matrix_is_that_of_the_project():
    stated = {(system, arch) for system in ("linux", "macos", "windows") for arch in WHEELS[system]["archs"]}
    assert {(one["system"], one["archs"]) for one in MATRIX} == stated
    assert len(MATRIX) == len(stated) == 5
    for one in MATRIX:
        assert OF_RUNNER[one["runner"].split("-")[0]] == one["system"]
    (count,) = (step["run"] for step in WORKFLOW["jobs"]["attach"]["steps"] if "Five" in step.get("name", ""))
    assert f"-eq {len(MATRIX)}" in count


def test_it_keeps_to_its_schema():
    command = [
        sys.executable,
        "-m",
        "check_jsonschema",
        "--builtin-schema",
        "vendor.github-workflows",
        str(FILE),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_nothing_is_sent_to_an_index():
    """The name on the index is not ours."""
    text = FILE.read_text(encoding="utf-8")
    assert "publish" not in text
    assert "twine" not in text


@pytest.mark.parametrize("one", MATRIX, ids=lambda one: f"{one['system']}-{one['archs']}")
def test_one_wheel_a_platform_is_chosen(one):
    """The dry run of cibuildwheel, where it is installed."""
    program = os.environ.get("CIBUILDWHEEL") or shutil.which("cibuildwheel")
    if program is None:
        pytest.skip("cibuildwheel is not installed")
    steps = [
        step["run"] for step in WORKFLOW["jobs"]["wheel"]["steps"] if "--print-build" in step.get("run", "")
    ]
    words = (
        steps[0].replace("${{ matrix.system }}", one["system"]).replace("${{ matrix.archs }}", one["archs"])
    )
    options = list(itertools.dropwhile(lambda word: not word.startswith("--"), words.split()))
    done = subprocess.run([program, *options, str(ROOT)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.split()) == 1
    assert done.stdout.startswith("cp311-")
