"""What the commands print: findings, progress on a terminal, JSON."""

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from gcode2krl.cli.standard_files import closed, tell
from gcode2krl.errors import Gcode2KrlError, Issue, told
from gcode2krl.progress import Begin, Progress, unseen
from gcode2krl.result import issue_dicts, record_of

__all__ = ["Console", "issue_dicts"]
_COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}


class Console:
    """Findings and progress go to standard error, results to standard output."""

    def __init__(self, quiet: bool = False, as_json: bool = False, command: str = "") -> None:
        self.quiet, self.as_json, self.command = quiet, as_json, command

    def findings(self, issues: Iterable[Issue], source: str, notes: bool = True) -> None:
        """Print a line a finding, at most 20, then the counts; errors first, equal findings as one."""
        shown = told(issue for issue in issues if notes or issue.severity != "note")
        for finding in shown.findings:
            word = f"{finding.first.severity}:"
            coloured = click.style(word, fg=_COLOURS[finding.first.severity])
            tell(finding.text(source).replace(word, coloured, 1))
        for line in shown.counts():
            tell(line)

    def explain_hint(self, issues: Iterable[Issue]) -> None:
        """Say on a terminal how to learn more about the first error."""
        findings = told(issues).findings
        if findings and sys.stderr.isatty():
            self.hint(f"`gcode2krl explain {findings[0].first.code}` says more")

    def failed(self, message: str, code: int) -> int:
        """Print one error line and return the exit code."""
        tell(f"{click.style('error:', fg='red')} {message}")
        return code

    def refused(self, error: Gcode2KrlError) -> int:
        """Print the record of a command that an error ended, under ``--json``; return the exit code."""
        if self.as_json:
            self.json(record_of(self.command, {}, error.issues, exit_code=error.exit_code))
        return error.exit_code

    def say(self, text: str) -> None:
        """Print a line of the result for a person."""
        if not self.quiet and not self.as_json:
            click.echo(text)

    def hint(self, text: str) -> None:
        """Print a hint on standard error."""
        if not self.quiet:
            tell(text)

    def json(self, result: dict[str, Any]) -> None:
        """Print the one JSON object of a command."""
        if sys.stdout is None:
            raise closed("standard output")
        click.echo(json.dumps(result, indent=2, allow_nan=False))

    @contextmanager
    def stages(self) -> Iterator[Begin]:
        """Show a bar a stage while a command works: share, remaining time; nothing but on a terminal.

        Yields the function that begins a stage; see `gcode2krl.progress`. The bars vanish at the end.
        """
        if self.quiet or not sys.stderr.isatty():
            yield unseen
            return
        from gcode2krl.cli.terminal_bars import bars

        with bars() as begin:
            yield begin

    @contextmanager
    def stage(self, name: str) -> Iterator[Progress]:
        """Show the bar of a single stage; yields the function that tells how far it is."""
        with self.stages() as begin:
            yield begin(name)
