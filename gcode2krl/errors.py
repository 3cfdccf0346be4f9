"""What a user reads: findings with a line and a remedy, and the exceptions that carry them."""

import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from gcode2krl.codes import code_of, follows

Severity = Literal["error", "warning", "note"]
MOST_LINES = 20
"""Most findings that are printed, a line each; the rest is counted."""
MOST_PLACES = 1000
"""Most places of one kind that a check lists."""
_MOST_OF_A_CODE = 8
"""Most lines of one code that are printed, so that one cause never fills the screen."""
_MOST_ALIKE = 5
"""If a code has more different messages, those that differ only in their figures are one line."""
_LINES_NAMED = 3
_RANK: dict[Severity, int] = {"error": 0, "warning": 1, "note": 2}
_MOST_OF_A_REPR = 160
"""Letters of a finding where it is shown on one line among others."""
_FIGURE = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, slots=True, repr=False)
class Issue:
    """One finding.

    ``line`` is the 1-based line of the input file, 0 where the whole file is meant. ``code`` is a stable
    kebab-case word, used by ``--allow CODE:LINE`` and explained in ``codes.toml``. ``excerpt`` quotes the
    input, with a caret before the culprit; ``column`` is the 1-based place of the caret in its line, in
    characters, 0 where it is not known for certain. ``key`` is the dotted key of the cell file that is meant,
    if any. A finding in a subprogram of another file has its ``file``, the ``file_line`` in it, and no line.

    >>> from gcode2krl import predict
    >>> issue = predict("part.nc").issues[0]
    >>> issue
    Issue(note cell-not-verified: the cell has not been confirmed by a person; the program begins with a HALT)
    >>> issue.line
    0
    """

    severity: Severity
    code: str
    line: int
    message: str
    remedy: str = ""
    excerpt: str = ""
    key: str = ""
    column: int = 0
    file: str = ""
    file_line: int = 0

    def __repr__(self) -> str:
        place = f", line {self.line}" if self.line > 0 else ""
        return _shortened(f"Issue({self.severity} {self.code}{place}: {self.message}", _MOST_OF_A_REPR) + ")"

    def advice(self) -> str:
        """Return the remedy of the finding, or else that of its code in the table.

        >>> from gcode2krl import Issue
        >>> Issue("error", "dwell-negative", 6, "a dwell of -1 s").advice()
        'give zero or more seconds'
        """
        entry = None if self.remedy else code_of(self.code)
        if entry is None:
            return self.remedy
        first, _, others = entry.remedy.rstrip(".").partition(" ")
        return f"{first.lower() if first[1:].islower() else first} {others}"

    def text(self, source: str = "", also: str = "") -> str:
        """Return the finding on one line, ``part.nc:120: error: … [code] -> remedy``.

        ``also`` follows the message: where else the same was found.

        >>> from gcode2krl import Issue
        >>> Issue("error", "feed-missing", 7, "no feed", "program F").text("part.nc")
        'part.nc:7: error: no feed [feed-missing] -> program F'
        """
        place = f"{source}:{self.line}" if self.line > 0 and source else source
        if not source and self.line > 0:
            place = f"line {self.line}"
        head = f"{place}: {self.severity}: " if place else f"{self.severity}: "
        advice = self.advice()
        tail = f" -> {advice}" if advice else ""
        near = f", near `{self.excerpt}`" if self.excerpt else ""
        others = f" ({also})" if also else ""
        return f"{head}{self.message}{near}{others} [{self.code}]{tail}"


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


@dataclass(frozen=True, slots=True, repr=False)
class EqualIssues:
    """Equal findings, or findings that differ only in their figures, printed on one line."""

    issues: tuple[Issue, ...]

    def __repr__(self) -> str:
        return f"Finding({len(self.issues)} times {self.first!r})"

    @property
    def first(self) -> Issue:
        """The finding that represents all of them."""
        return self.issues[0]

    def text(self, source: str = "") -> str:
        """Return the first as `Issue.text` does, with the lines of the others."""
        return self.first.text(source, self.others)

    @property
    def others(self) -> str:
        """Where else the same was found, empty if nowhere."""
        count = len(self.issues)
        lines = sorted({issue.line for issue in self.issues} - {self.first.line})
        if not lines:
            return f"{count:,} times" if count > 1 else ""
        places = ", ".join(str(line) for line in lines[:_LINES_NAMED])
        if len(lines) > _LINES_NAMED:
            at_least = "at least " if count >= MOST_PLACES else ""
            places += f" and {at_least}{len(lines) - _LINES_NAMED:,} more"
        same = all(issue.message == self.first.message for issue in self.issues)
        figures = "" if same else "with other figures "
        return f"also {figures}in {'line' if len(lines) == 1 else 'lines'} {places}"


@dataclass(frozen=True, slots=True)
class Told:
    """What is printed of many findings: errors first, each cause once, at most `MOST_LINES`."""

    findings: tuple[EqualIssues, ...]
    left_out: tuple[Issue, ...]
    """Findings that did not fit."""
    consequences: tuple[Issue, ...]
    """Findings that another one may cause (`follows` in ``codes.toml``)."""

    def counts(self) -> tuple[str, ...]:
        """Return the lines that count what is not printed."""
        return (
            *_counted(self.left_out, "more finding", "more findings"),
            *_counted(
                self.consequences, "finding that follows from these", "findings that follow from these"
            ),
        )

    def lines(self, source: str = "") -> list[str]:
        """Return all lines."""
        return [*(finding.text(source) for finding in self.findings), *self.counts()]


def told(issues: Iterable[Issue]) -> Told:
    """Return what to print of findings: equal ones as one, consequences counted only."""
    ordered = sorted(issues, key=lambda issue: _RANK[issue.severity])
    causes, consequences = _split_consequences(ordered)
    findings: list[EqualIssues] = []
    left_out: list[Issue] = []
    of_code: Counter[str] = Counter()
    for finding in _joined(causes):
        of_code[finding.first.code] += 1
        if of_code[finding.first.code] > _MOST_OF_A_CODE or len(findings) == MOST_LINES:
            left_out += finding.issues
        else:
            findings.append(finding)
    return Told(tuple(findings), tuple(left_out), tuple(consequences))


def _split_consequences(issues: Sequence[Issue]) -> tuple[list[Issue], list[Issue]]:
    """Return causes and consequences; a cause is at least as severe and not in a later line."""
    if len({issue.code for issue in issues}) < 2:
        return list(issues), []
    first_line: dict[tuple[str, int], int] = {}
    for issue in issues:
        key = issue.code, _RANK[issue.severity]
        first_line[key] = min(issue.line, first_line.get(key, issue.line))

    def is_consequence(issue: Issue) -> bool:
        ranks = range(_RANK[issue.severity] + 1)
        causes = (first_line.get((code, rank)) for code in follows(issue.code) for rank in ranks)
        return any(line is not None and line <= issue.line for line in causes)

    consequences = [issue for issue in issues if is_consequence(issue)]
    following = set(map(id, consequences))
    return [issue for issue in issues if id(issue) not in following], consequences


def _joined(issues: Sequence[Issue]) -> list[EqualIssues]:
    """Join equal findings; if a code has many messages, also those that differ only in their figures."""
    equal = _grouped(issues, lambda issue: (issue.severity, issue.code, issue.message, issue.remedy))
    sentences = Counter(group[0].code for group in equal)
    many = {code for code, count in sentences.items() if count > _MOST_ALIKE}

    def without_figures(issue: Issue) -> Hashable:
        if issue.code not in many:
            return issue.severity, issue.code, issue.message, issue.remedy
        return issue.severity, issue.code, _FIGURE.sub("", issue.message), _FIGURE.sub("", issue.remedy)

    return [EqualIssues(group) for group in _grouped(issues, without_figures)]


def _grouped(issues: Iterable[Issue], key: Callable[[Issue], Hashable]) -> list[tuple[Issue, ...]]:
    groups: dict[Hashable, list[Issue]] = {}
    for issue in issues:
        groups.setdefault(key(issue), []).append(issue)
    return [tuple(group) for group in groups.values()]


def _counted(issues: Sequence[Issue], singular: str, plural: str) -> Iterator[str]:
    """Yield the line that counts findings with their codes, nothing where there are none."""
    if issues:
        counts = Counter(issue.code for issue in issues)
        named = ", ".join(f"{code} {count:,}" for code, count in counts.most_common())
        yield f"… and {len(issues):,} {singular if len(issues) == 1 else plural}: {named}"


class Gcode2KrlError(Exception):
    """Base of all errors a user can act on; ``issues`` holds every finding, ``source`` the file's name.

    Its text is what the commands print: `told` of the findings.

    >>> from gcode2krl import Gcode2KrlError, read_gcode
    >>> try:
    ...     read_gcode("missing.nc")
    ... except Gcode2KrlError as error:
    ...     print(error.exit_code, error.issues[0].code)
    2 file-unreadable
    """

    exit_code = 2

    def __init__(self, issues: Issue | Iterable[Issue], source: str = "") -> None:
        self.issues: tuple[Issue, ...] = (issues,) if isinstance(issues, Issue) else tuple(issues)
        self.source = source
        super().__init__("\n".join(told(self.issues).lines(source)))

    def __reduce__(self) -> tuple[type["Gcode2KrlError"], tuple[tuple[Issue, ...], str]]:
        """Let it pass from one process to another: an exception is made again from what it was made from."""
        return type(self), (self.issues, self.source)


class NotUnderstoodError(Gcode2KrlError):
    """The input cannot be understood: unreadable file, G-code, cell or option (exit code 2)."""


class InstallationError(Gcode2KrlError):
    """A part of the package is missing or does not fit the rest (exit code 2)."""


class RefusedError(Gcode2KrlError):
    """The input is understood and must not become a program: reach, limits, tool, … (exit code 1)."""

    exit_code = 1


def input_error(
    code: str, message: str, remedy: str = "", *, line: int = 0, source: str = ""
) -> NotUnderstoodError:
    """Return a `NotUnderstoodError` with one finding."""
    return NotUnderstoodError(Issue("error", code, line, message, remedy), source)


def install_command(extra: str) -> str:
    """Return the command that installs the packages of an extra, wherever the package itself came from."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        stated = requires("gcode2krl") or []
    except PackageNotFoundError:
        stated = []
    packages = [need.partition(";")[0].strip() for need in stated if extra in need.partition("extra ==")[2]]
    return "python -m pip install " + " ".join(f'"{package}"' for package in packages)


def extra_missing(extra: str, user: str, source: str = "") -> NotUnderstoodError:
    """Return the error for something whose packages a plain installation leaves out."""
    remedy = install_command(extra)
    sentence = f"{user} needs packages that are not installed: the extra {extra}"
    return input_error("extra-missing", sentence, remedy, source=source)
