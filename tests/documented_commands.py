"""The commands that the documents name outside ``sh`` blocks: in text blocks, within lines, in tables."""

import re
from pathlib import Path
from typing import NamedTuple

import click

_PROGRAMS = (
    *(
        "gcode2krl",
        "python",
        "py",
        "pip",
        "pytest",
        "ruff",
        "mypy",
        "lint-imports",
        "import-linter",
        "mkdocs",
        "taplo",
    ),
    *("bash", "cat", "eval", "source", "git", "docker", "podman", "pre-commit", "dask"),
    *("cmd", "cmd.exe", "powershell", "powershell.exe"),
    *("act", "gitlab-runner", "jupyter", "nbconvert"),
)
"""What a line begins with that is a command."""
_BLOCK = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```$", re.M | re.S)
_NO_COMMANDS = {"python", "toml", "math", "yaml", "json"}
"""Languages of blocks without commands."""
_SPAN = re.compile(r"(?<!`)(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.S)


class Named(NamedTuple):
    """A command and the document that names it."""

    document: str
    command: str


def named(path: Path, name: str, with_sh: bool = False) -> list[Named]:
    """Return the commands of a document, without what describes them; one word, as ``ruff``, is a name.

    Blocks ``sh`` are left out, as `tests.test_documents` runs them, unless ``with_sh``.
    """
    text = path.read_text(encoding="utf-8")
    shown = set(re.findall(r"<!-- output: (.*?)(?: \| .*?)? -->", text))
    shown = {command.replace("{tmp}/", "") for command in shown}
    found = [
        without_description(line.strip())
        for _, language, block in _BLOCK.findall(text)
        if not _NO_COMMANDS.intersection(language.split()) and (with_sh or "sh" not in language.split())
        for line in block.splitlines()
    ]
    found += [" ".join(span.split()) for _, span in _SPAN.findall(_BLOCK.sub("", text))]
    return [Named(name, each) for each in dict.fromkeys(found) if _is_command(each) and each not in shown]


def without_description(line: str) -> str:
    """Return the command of a line: what stands before a comment or, in a table, before two blanks."""
    return re.split(r"  +|\s#\s", line.removeprefix("$ "))[0]


def _is_command(text: str) -> bool:
    first, _, rest = text.partition(" ")
    return first in _PROGRAMS and bool(rest) and not re.match(r"(install|->|\.\.\.|=)", rest)


def is_mention(command: str, commands: click.Group) -> bool:
    """Return whether it only names a command of gcode2krl, without anything that could be run."""
    words = command.split()
    if words[0] != "gcode2krl":
        return False
    group = commands
    for word in words[1:]:
        group = group.get_command(click.Context(group), word) if isinstance(group, click.Group) else None
        if group is None:
            return False
    return True


def script_of(command: str) -> str | None:
    """Return the script that a ``python`` command runs, as ``benchmarks/mistakes.py``."""
    words = command.split()
    return words[1] if words[0] == "python" and len(words) > 1 and words[1].endswith(".py") else None
