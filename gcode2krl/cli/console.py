"""What the commands print: findings, progress on a terminal, JSON."""

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from gcode2krl.cli.record_head import Heading, heading
from gcode2krl.cli.standard_files import closed, tell
from gcode2krl.errors import Gcode2KrlError, Issue, told
from gcode2krl.progress import Begin, Progress, unseen

_COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}


class Console:
    """Findings and progress go to standard error, results to standard output."""

    def __init__(self, quiet: bool = False, as_json: bool = False, head: Heading | None = None) -> None:
        self.quiet, self.as_json = quiet, as_json
        self.heading = heading() if head is None else head

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

    def say(self, text: str) -> None:
        """Print a line of the result for a person."""
        if not self.quiet and not self.as_json:
            click.echo(text)

    def hint(self, text: str) -> None:
        """Print a hint on standard error."""
        if not self.quiet:
            tell(text)

    def record(
        self,
        figures: Mapping[str, Any],
        issues: Iterable[Issue] = (),
        *,
        exit_code: int = 0,
        files: Iterable[str | Path] = (),
    ) -> int:
        """Print the record of a command under ``--json``; return the exit code."""
        if self.as_json:
            self.json(self.heading.record(figures, issues, exit_code=exit_code, files=files))
        return exit_code

    def refused(self, error: Gcode2KrlError, figures: Iterable[str] = (), source: str = "") -> int:
        """Print the record of a command that an error ended, its figures null; return the exit code.

        Without ``--json`` the error is raised, with the name of its source if it has none.
        """
        if self.as_json:
            return self.record(dict.fromkeys(figures), error.issues, exit_code=error.exit_code)
        error.source = error.source or source
        raise error

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
