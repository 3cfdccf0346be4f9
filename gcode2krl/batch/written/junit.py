"""``junit.xml``: a suite a folder, a case a part, as CI servers read it.

A part that was understood and refused is a failure, one that was not understood an error; the text of either
is what the command line prints. Warnings stand in ``system-out``. The format has no one standard; this is
what Jenkins, GitLab and GitHub's actions have in common.
"""

from collections.abc import Iterable
from xml.etree import ElementTree

from gcode2krl.batch import VERDICTS
from gcode2krl.batch.written.part import FileIssue, PartResult, Record, lines_of, parts_of
from gcode2krl.batch.written.words import demonstration, one_line, printable

_MOST_MESSAGE = 500


def junit_xml(records: Iterable[Record]) -> bytes:
    """Return the file."""
    parts = parts_of(records)
    root = ElementTree.Element("testsuites", {"name": "gcode2krl", **_totals(parts)})
    folders = sorted({part.folder for part in parts})
    for folder in folders:
        in_folder = [part for part in parts if part.folder == folder]
        suite = ElementTree.SubElement(root, "testsuite", {"name": printable(folder), **_totals(in_folder)})
        if warning := demonstration(in_folder):
            properties = ElementTree.SubElement(suite, "properties")
            ElementTree.SubElement(properties, "property", name="cell", value=warning)
        suite.extend(_case(part) for part in in_folder)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _totals(parts: list[PartResult]) -> dict[str, str]:
    verdicts = [part.verdict for part in parts]
    return {
        "tests": str(len(parts)),
        "failures": str(verdicts.count(VERDICTS[1])),
        "errors": str(verdicts.count(VERDICTS[2])),
        "skipped": "0",
        "time": _seconds(sum(part.seconds or 0.0 for part in parts)),
    }


def _case(part: PartResult) -> ElementTree.Element:
    case = ElementTree.Element(
        "testcase",
        classname=printable(part.folder),
        name=printable(part.file),
        file=printable(part.source),
        time=_seconds(part.seconds or 0.0),
    )
    if not part.is_written:
        case.append(_refusal(part))
    others = part.of_severity("error", "warning") if part.is_written else _beside_errors(part)
    if others:
        ElementTree.SubElement(case, "system-out").text = _text(lines_of(others, part.source))
    return case


def _beside_errors(part: PartResult) -> tuple[FileIssue, ...]:
    """Return the warnings of a part that was not written, unless they are the reason."""
    return part.of_severity("warning") if part.count("error") else ()


def _refusal(part: PartResult) -> ElementTree.Element:
    """Return the failure or the error, with all that kept the part from being written."""
    reasons = part.reasons()
    first = reasons[0].issue if reasons else None
    refusal = ElementTree.Element(
        "failure" if part.verdict == VERDICTS[1] else "error",
        message=one_line(first.text(), _MOST_MESSAGE) if first is not None else part.verdict,
        type=printable(first.code) if first is not None else part.verdict,
    )
    refusal.text = _text(lines_of(reasons, part.source))
    return refusal


def _text(lines: Iterable[str]) -> str:
    return "\n" + "".join(f"{printable(line)}\n" for line in lines)


def _seconds(seconds: float) -> str:
    return f"{seconds:.3f}"
