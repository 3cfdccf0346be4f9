"""Help texts: the summaries are those of the commands, and nothing heavy is imported for a text."""

import inspect
import json
import os
import subprocess
import sys

import click
import pytest

from gcode2krl.cli.main import commands
from gcode2krl.cli.on_use import CommandsOnUse

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
