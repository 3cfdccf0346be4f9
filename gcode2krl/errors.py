"""What a user is told: findings with a line and a remedy, and the exceptions that carry them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True)
class Issue:
    """One finding.

    ``line`` is the 1-based line of the input file, 0 where the whole file is meant. ``code`` is a stable
    kebab-case word, used by ``--allow CODE:LINE``. ``excerpt`` quotes the input, with a caret
    before the culprit.
    """

    severity: Severity
    code: str
    line: int
    message: str
    remedy: str = ""
    excerpt: str = ""

    def text(self, source: str = "") -> str:
        """Return the finding on one line, ``part.nc:120: error: … [code] — remedy``."""
        place = f"{source}:{self.line}" if self.line > 0 and source else source
        if not source and self.line > 0:
            place = f"line {self.line}"
        head = f"{place}: {self.severity}: " if place else f"{self.severity}: "
        tail = f" -> {self.remedy}" if self.remedy else ""
        near = f", near `{self.excerpt}`" if self.excerpt else ""
        return f"{head}{self.message}{near} [{self.code}]{tail}"


class Gcode2KrlError(Exception):
    """Base of all errors a user can act on; ``issues`` holds every finding, ``source`` the file's name."""

    exit_code = 2

    def __init__(self, issues: Issue | Iterable[Issue], source: str = "") -> None:
        self.issues: tuple[Issue, ...] = (issues,) if isinstance(issues, Issue) else tuple(issues)
        self.source = source
        super().__init__("\n".join(issue.text(source) for issue in self.issues))


class NotUnderstoodError(Gcode2KrlError):
    """The input cannot be understood: unreadable file, G-code, cell or option (exit code 2)."""


class RefusedError(Gcode2KrlError):
    """The input is understood and must not become a program: reach, limits, tool, … (exit code 1)."""

    exit_code = 1


def input_error(
    code: str, message: str, remedy: str = "", *, line: int = 0, source: str = ""
) -> NotUnderstoodError:
    """Return a `NotUnderstoodError` with one finding."""
    return NotUnderstoodError(Issue("error", code, line, message, remedy), source)
