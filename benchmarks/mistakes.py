"""Seeded real mistakes: does ``gcode2krl translate`` refuse each or warn, with the line and a remedy?

``python benchmarks/mistakes.py`` runs the cases of ``mistake_cases.py``, ``mistake_cases_hidden.py``
and ``mistake_cases_five_axes.py`` through the command line's own entry, in a temporary folder, then clean
programs that must be translated. What passes in silence is named. The exit code is always 0: figures are
printed, not judged. Cells that contradict themselves stand in ``tests/cell/test_contradictions.py``.
"""

import argparse
import contextlib
import io
import re
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from mistake_cases import CELL_HEAD, CELL_TOOLS, CLEAN, LATER, MISTAKES, PROGRAMS, Clean, Mistake
from mistake_cases_five_axes import FIVE_AXES
from mistake_cases_hidden import FURTHER, REPORTED

from gcode2krl.cli.main import _run

EXAMPLES = Path(__file__).parents[1] / "examples"
MARK = "@"
_FINDING = re.compile(
    r"^(?:(?P<place>.+?): )?(?P<severity>error|warning|note): (?P<message>.*?)"
    r"(?: \[(?P<code>[a-z0-9-]+)\])?(?: -> (?P<remedy>.*))?$"
)


@dataclass(frozen=True)
class Finding:
    """One printed line."""

    severity: str
    code: str
    line: int
    message: str
    remedy: str


@dataclass(frozen=True)
class Outcome:
    """Result of a run of the command line."""

    exit_code: int
    findings: tuple[Finding, ...]
    new_files: tuple[str, ...]
    printed: str


@dataclass(frozen=True)
class Verdict:
    """One mistake, judged."""

    title: str
    exit_code: int
    severity: str
    """The least severity that is right."""
    refused: bool
    """Exit code 1 or 2 with a finding in words, no internal error, and nothing written."""
    warned: bool
    """Written, with a warning that speaks of the mistake, where a warning is enough."""
    code: str
    expected: tuple[int, ...]
    found: int | None
    right_line: bool
    """A finding of that severity speaks of the mistake and names one of the expected lines."""
    remedy: bool
    printed: str

    @property
    def passed(self) -> bool:
        """Tell whether all three are right."""
        return (self.refused or self.warned) and self.right_line and self.remedy


def changed(program: str, change: dict[int, str | None]) -> tuple[str, tuple[int, ...]]:
    """Return the program with the change, and the marked lines of the result."""
    lines: list[str] = []
    for number, line in enumerate(_text(program).splitlines(), start=1):
        new = change.get(number, line)
        if new is not None:
            lines += [MARK + line] if new == MARK else new.split("\n")
    marked = tuple(number for number, line in enumerate(lines, start=1) if line.startswith(MARK))
    return "\n".join(line.removeprefix(MARK) for line in lines) + "\n", marked


def prepare(case: Mistake, folder: Path) -> tuple[list[str], tuple[int, ...]]:
    """Write program and cell of a case; return the arguments and the lines that are right."""
    text, marked = changed(case.program, case.change)
    if case.cut_after:
        text = text[: text.index(case.cut_after) + len(case.cut_after)]
    part, cell = folder / case.name, folder / "cell.toml"
    part.write_bytes(text.encode() if case.data is None else case.data)
    cell.write_text(case.head + case.cell + case.tools, encoding="utf-8")
    lines = (*marked, *case.expected)
    expected = (*((0,) if case.or_whole or not lines else ()), *lines)
    return [str(part), "--cell", str(cell), "-o", str(folder / case.output), *case.options], expected


def prepare_clean(case: Clean, folder: Path) -> list[str]:
    """Write program and cell of a clean case; return the arguments."""
    text, _ = changed(case.program, case.change)
    forms = {
        "crlf": lambda: text.replace("\n", "\r\n"),
        "lower": text.lower,
        "tight": lambda: re.sub(r"^[^(\n]+$", lambda line: line[0].replace(" ", ""), text, flags=re.M),
        "mark": lambda: "\ufeff" + text.rstrip("\n"),
        "": lambda: text,
    }
    part, cell = folder / "part.nc", folder / "cell.toml"
    part.write_bytes(forms[case.form]().encode())
    arguments = [str(part), "-o", str(folder / "out.src")]
    if case.cell is not None:
        cell.write_text(CELL_HEAD + case.cell + CELL_TOOLS, encoding="utf-8")
        arguments += ["--cell", str(cell)]
    return arguments


def run(arguments: list[str], folder: Path) -> Outcome:
    """Run ``gcode2krl translate`` as the command line does, and read what it printed."""
    before = {path.name for path in folder.iterdir()}
    printed = io.StringIO()
    with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(io.StringIO()):
        exit_code = _run(["translate", *arguments])
    files = tuple(sorted({path.name for path in folder.iterdir()} - before))
    text = printed.getvalue().replace(str(folder) + "/", "")
    return Outcome(exit_code, tuple(_findings(text)), files, text)


def judge(case: Mistake, folder: Path) -> Verdict:
    """Run one mistake and compare with what is right."""
    arguments, expected = prepare(case, folder)
    outcome = run(arguments, folder)
    least = ("error",) if case.severity == "error" else ("error", "warning")
    errors = [finding for finding in outcome.findings if finding.severity in least]
    internal = "internal error" in outcome.printed or "Traceback" in outcome.printed
    fitting = [
        error
        for error in errors
        if error.line in expected and re.search(case.about, f"{error.message} {error.code}")
    ]
    best = max(fitting, key=lambda error: bool(error.remedy), default=errors[0] if errors else None)
    return Verdict(
        title=case.title,
        exit_code=outcome.exit_code,
        severity=case.severity,
        refused=outcome.exit_code in (1, 2) and bool(errors) and not internal and not outcome.new_files,
        warned=outcome.exit_code == 0 and case.severity == "warning" and bool(fitting),
        code=best.code if best else "",
        expected=expected,
        found=best.line if best else None,
        right_line=bool(fitting),
        remedy=bool(best and best.remedy),
        printed=outcome.printed,
    )


def judge_clean(case: Clean, folder: Path) -> Outcome:
    """Run one clean program."""
    return run(prepare_clean(case, folder), folder)


def _text(program: str) -> str:
    return PROGRAMS[program] if program in PROGRAMS else (EXAMPLES / program).read_text(encoding="utf-8")


def _findings(printed: str) -> list[Finding]:
    found = []
    for text in printed.splitlines():
        match = _FINDING.match(text)
        if match is None:
            continue
        line = re.search(r":(\d+)$", match["place"] or "")
        number = int(line[1]) if line and not (match["place"] or "").startswith("cell.toml") else 0
        remedy = (match["remedy"] or "").strip()
        found.append(Finding(match["severity"], match["code"] or "-", number, match["message"], remedy))
    return found


def main() -> None:
    """Run everything and print a line for each case, then the counts."""
    parser = argparse.ArgumentParser(description="Seeded mistakes through gcode2krl translate.")
    parser.add_argument("--verbose", action="store_true", help="Everything that was printed, for each case.")
    verbose = parser.parse_args().verbose
    started, verdicts, refused_clean = time.perf_counter(), [], 0
    print(f"{'mistake':<62} {'exit':>4}  {'code':<22} {'expected':<12} {'found':>5}  remedy")
    for mistake in (*MISTAKES, *REPORTED, *FURTHER, *FIVE_AXES):
        with tempfile.TemporaryDirectory() as folder:
            verdict = judge(mistake, Path(folder))
        verdicts.append(verdict)
        expected, line = (
            "/".join(map(str, verdict.expected))[:12],
            "-" if verdict.found is None else verdict.found,
        )
        words = f"{verdict.exit_code:>4}  {verdict.code:<22} {expected:<12} {line:>5}  {verdict.remedy!s:<6}"
        print(f"{verdict.title[:62]:<62} {words} {'PASS' if verdict.passed else 'FAIL'}")
        _show(verdict.printed, verbose, verdict.passed)
    print("\nclean programs")
    for clean in CLEAN:
        with tempfile.TemporaryDirectory() as folder:
            outcome = judge_clean(clean, Path(folder))
        refused_clean += outcome.exit_code != 0
        print(f"{clean.title:<62} exit {outcome.exit_code}")
        _show(outcome.printed, verbose, outcome.exit_code == 0)
    seen = [verdict for verdict in verdicts if verdict.refused or verdict.warned]
    silent = [verdict.title for verdict in verdicts if verdict not in seen]
    print(f"\nnot looked at here: {'; '.join(LATER)}\npass in silence: {'; '.join(silent) or 'none'}")
    for name, count in (
        ("refused", sum(verdict.refused for verdict in verdicts)),
        ("warned of", sum(verdict.warned for verdict in verdicts)),
        ("with right line", sum(verdict.right_line for verdict in seen)),
        ("with remedy", sum(verdict.remedy for verdict in seen)),
        ("all three", sum(verdict.passed for verdict in verdicts)),
    ):
        print(f"{name:<18} {count} of {len(verdicts)}")
    print(f"{'clean refused':<18} {refused_clean} of {len(CLEAN)}")
    print(f"{'time':<18} {time.perf_counter() - started:.1f} s")


def _show(printed: str, verbose: bool, passed: bool) -> None:
    for line in printed.splitlines()[: None if verbose else 0 if passed else 6]:
        print(f"       | {line}")


if __name__ == "__main__":
    main()
