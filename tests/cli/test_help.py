"""What the command line says of itself: help, explanations of findings, completion."""

import inspect
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest

from gcode2krl.cli.completion import SHELLS, VARIABLE, script
from gcode2krl.cli.main import _COMMANDS, commands
from gcode2krl.cli.on_use import CommandsOnUse
from gcode2krl.codes import all_codes
from tests.conftest import ROOT

HEAVY = ("pydantic", "jinja2", "numba", "scipy", "polars", "matplotlib", "rich")
WITH_NUMPY = ("predict", "online", "stiffness-map", "identify controller", "identify force")
"""Commands whose own file uses numpy."""


def groups(command, path=()):
    if isinstance(command, click.Group):
        yield path, command
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from groups(command.get_command(context, name), (*path, name))


def listed(group):
    context = click.Context(group)
    return {name: group.get_command(context, name) for name in group.list_commands(context)}


ON_USE = [group for _, group in groups(commands) if isinstance(group, CommandsOnUse)]


@pytest.mark.parametrize("group", ON_USE, ids=lambda group: group.name)
def test_summaries_are_the_first_paragraphs_of_the_commands(group):
    for name, command in listed(group).items():
        first = inspect.cleandoc(command.help).partition("\n\n")[0]
        assert group.summaries[name] == " ".join(first.split())
        assert command.name == name


@pytest.mark.parametrize("width", [40, 60, 80, 200])
@pytest.mark.parametrize("group", ON_USE, ids=lambda group: group.name)
def test_a_list_of_commands_is_what_click_makes_of_the_commands(group, width):
    context = click.Context(group)
    ours, clicks = click.HelpFormatter(width=width), click.HelpFormatter(width=width)
    group.format_commands(context, ours)
    click.Group.format_commands(group, context, clicks)
    assert ours.getvalue() == clicks.getvalue()
    assert all(name in ours.getvalue() for name in listed(group))


def test_there_are_groups_on_use():
    assert {group.name for group in ON_USE} == {"commands", "identify", "runs"}


def test_a_help_text_imports_nothing_heavy():
    """One after the other in one process, those that may load numpy last: what each has loaded more."""
    all_words = [[*path, name, "--help"] for path, group in groups(commands) for name in listed(group)]
    all_words = sorted([["--help"], ["models", "list"], *all_words], key=lambda words: may_use_numpy(words))
    script = (
        "import json, sys\n"
        "from gcode2krl.cli.main import commands\n"
        f"for words in {all_words!r}:\n"
        "    before = set(sys.modules)\n"
        "    commands.main(words, standalone_mode=False)\n"
        "    print(json.dumps([words, *set(sys.modules) - before]), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = {" ".join(words): set(more) for words, *more in map(json.loads, done.stderr.splitlines())}
    assert len(loaded) == len(all_words)
    assert {words: more & set(HEAVY) for words, more in loaded.items() if more & set(HEAVY)} == {}
    assert [
        words for words, more in loaded.items() if "numpy" in more and not words.startswith(WITH_NUMPY)
    ] == []


def may_use_numpy(words):
    return " ".join(words).startswith(WITH_NUMPY)


def test_libraries_for_matrices_use_one_thread_unless_told_otherwise():
    """They read it when they are loaded, so it is set before."""
    script = (
        "import os, sys; from gcode2krl.cli.main import main\n"
        "assert 'numpy' not in sys.modules\n"
        "try: main(['--version'])\n"
        "except SystemExit: print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['MKL_NUM_THREADS'])\n"
    )
    environment = {**os.environ, "MKL_NUM_THREADS": "2"}
    environment.pop("OPENBLAS_NUM_THREADS", None)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[-2:] == ["1", "2"]


@pytest.mark.parametrize("word", ["spindle-off", "Spindle-Off", "spindle-off:12", "[spindle-off]"])
def test_explains_a_code_as_it_is_printed(run, word):
    text = run("explain", word, code=0).out
    first, *rest = text.splitlines()
    assert first == "spindle-off: error, warning"
    assert [line.split()[0] for line in rest if line.startswith("  ") and line[2] != " "] == [
        "why",
        "example",
        "remedy",
        "allow",
    ]
    assert "M6 stops the spindle" in text
    assert max(map(len, rest)) <= 100


def test_lists_all_codes_with_one_line_each(run):
    lines = run("explain", code=0).out.splitlines()
    assert [line.split()[0] for line in lines] == list(all_codes())
    assert max(map(len, lines)) <= 110


def test_an_unknown_code_is_answered_with_the_nearest(run):
    assert "did you mean 'spindle-off'?" in run("explain", "spindel-off", code=2).err
    assert "lists all" in run("explain", "qqqq", code=2).err


def test_json_holds_every_column(run):
    (record,) = json.loads(run("explain", "no-feed", "--json", code=0).out)["codes"]
    assert record["code"] == "no-feed"
    assert set(record) == {"code", "severity", "why", "example", "remedy", "allow", "follows"}
    assert len(json.loads(run("explain", "--json", code=0).out)["codes"]) == len(all_codes())
    assert json.loads(run("explain", "nofeed", "--json", code=2).out)["issues"][0]["code"] == "code-unknown"


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("predct", "no command 'predct': did you mean 'predict'?"),
        ("Verify", "no command 'Verify': did you mean 'verify'?"),
        ("diganose", "did you mean 'diagnose'?"),
        ("qqqq", "no such file 'qqqq'"),
        ("q" * 300, "no such file"),
    ],
)
def test_a_mistyped_command_is_one_line(run, word, said):
    lines = run(word, "x.nc", code=2).err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]


def test_a_part_may_be_called_much_like_a_command(run):
    Path("predct").write_text("G1 X5\nM30\n")
    said = run("predct", "-o", "part.src", code=2).err
    assert "predct:1: error: feed move without a feed: no F above 0 since the start" in said
    assert "predct.nc: error: cannot read" in run("predct.nc", "-o", "part.src", code=2).err
    assert "[no-feed]" in run("-o", "part.src", "predct", code=2).err


CHECKED_BY = {
    "bash": ["bash", "-n"],
    "zsh": ["zsh", "-n"],
    "fish": ["fish", "--no-execute"],
    "powershell": [
        "pwsh",
        "-NoProfile",
        "-Command",
        "$null = [scriptblock]::Create((Get-Content -Raw $args[0]))",
    ],
}


@pytest.fixture
def answer(tmp_path):
    """Return what the program answers to a shell that completes."""

    def answered(shell, words, current):
        asking = {"COMP_WORDS": words, "COMP_CWORD": current, VARIABLE: f"{shell}_complete"}
        done = subprocess.run(
            [sys.executable, "-m", "gcode2krl"],
            env={**os.environ, **asking, "PYTHONPATH": str(ROOT)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return [line for line in done.stdout.splitlines() if line]

    return answered


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_is_one_that_the_shell_reads(shell, tmp_path, run):
    printed = run("completion", shell).out
    assert printed.strip() == script(shell).strip()
    assert f"{VARIABLE}" in printed
    file = tmp_path / "script"
    file.write_text(printed, encoding="utf-8")
    program, *words = CHECKED_BY[shell]
    if shutil.which(program) is None:
        pytest.skip(f"no {program} here")
    done = subprocess.run([program, *words, str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_first_word_is_a_command_or_a_file(answer):
    assert answer("bash", "gcode2krl ide", "1") == ["plain,identify", "file,ide"]
    assert set(_COMMANDS) <= {line.removeprefix("plain,") for line in answer("bash", "gcode2krl ", "1")}


def test_options_behind_a_part_are_those_of_translate(answer):
    assert answer("bash", "gcode2krl no-such.nc --tol", "2") == ["plain,--tolerance"]
    assert answer("bash", "gcode2krl halfwritten --str", "2") == ["plain,--strict"]


def test_groups_choices_and_files(answer):
    assert answer("bash", "gcode2krl models sh", "2") == ["plain,show"]
    assert answer("bash", "gcode2krl part.nc --pilot v", "3") == ["plain,values"]
    assert answer("bash", "gcode2krl part.nc --cell ", "3") == ["file,"]


def test_powershell_gets_a_help_beside_each_answer_and_no_files(answer):
    assert answer("powershell", "gcode2krl ide", "ide")[0].startswith("identify\tFit the cell")
    assert answer("powershell", "gcode2krl 'C:\\my parts\\a.nc' --str", "--str") == [
        "--strict\tWarnings refuse the program too."
    ]
    assert answer("powershell", "gcode2krl part.nc --cell ", "") == []
    assert answer("powershell", 'gcode2krl "C:\\half', "C:\\half") == []


def test_bash_itself_completes(tmp_path):
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "gcode2krl").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gcode2krl "$@"\n')
    (folder / "gcode2krl").chmod(0o755)
    lines = (
        'eval "$(gcode2krl completion bash)"\n'
        "COMP_WORDS=(gcode2krl predict part.nc --no-f) COMP_CWORD=3\n"
        "_gcode2krl_completion gcode2krl --no-f part.nc\n"
        'echo "${COMPREPLY[@]}"\n'
    )
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", lines],
        env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.stdout.strip() == "--no-forces", done.stderr


def test_no_word_at_all_prints_the_help(run):
    done = run(code=0)
    assert done.out.startswith("Usage: gcode2krl")
    assert done.err == ""
