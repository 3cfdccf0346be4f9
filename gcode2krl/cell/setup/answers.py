"""Answers to the questions: from words or a TOML file, checked, completed by the controller's archive."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gcode2krl.cell import library
from gcode2krl.cell.key_lines import with_lines
from gcode2krl.cell.ranges import all_ranges
from gcode2krl.cell.ranges import general as general_key
from gcode2krl.cell.setup.controller import FRAME_KEYS, ArchivedController
from gcode2krl.cell.setup.questions import (
    FILE,
    GENERAL_QUESTIONS,
    MACHINE_QUESTIONS,
    TOOL_QUESTIONS,
    Answers,
    CellQuestion,
)
from gcode2krl.codes import closest
from gcode2krl.errors import Issue, NotUnderstoodError

MOST_TOOLS = 1000
_SAME_REACH = 0.01
_NAME = re.compile(r"[^\x00-\x1f\x7f\x85\u2028\u2029]{1,80}")
_SUBPROGRAM = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,23}")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_KRL_MEMBER = re.compile(r"(?:\b[A-Z]\d?|\b[A-Z]{2})\s+(?=[-+.\d])", re.I)


def answer_of_words(question: CellQuestion, words: str, controller: ArchivedController) -> Any:
    """Return the answer that a person typed, None if nothing; raises `ValueError` with what is allowed.

    Several numbers may be a KRL frame or axis target as the controller writes it.
    """
    words = words.strip()
    if not words:
        return checked(question, None, controller)
    if question.kind in ("choice", "text", "name"):
        return checked(question, words, controller)
    plain = re.sub(r"[{}:;,]|\bE6(?:AXIS|POS)\b|\bFRAME\b", " ", _KRL_MEMBER.sub(" ", words)).split()
    if not all(map(_NUMBER.fullmatch, plain)):
        raise ValueError(f"found {words[:60]!r}, allowed: {_allowed(question)}")
    numbers = [float(word) for word in plain]
    if question.kind == "numbers":
        return checked(question, numbers, controller)
    if len(numbers) != 1:
        raise ValueError(f"found {words[:60]!r}, allowed: {_allowed(question)}")
    whole = question.kind == "whole" and numbers[0].is_integer()
    return checked(question, int(numbers[0]) if whole else numbers[0], controller)


def checked(question: CellQuestion, value: Any, controller: ArchivedController) -> Any:
    """Return an answer in its type, None if it is empty; raises `ValueError` with what is allowed."""
    if value is None or value == "":
        if question.needed:
            raise ValueError(f"needs an answer: {_allowed(question)}")
        return None
    if question.kind == "choice":
        return _choice(question, value, controller)
    if question.kind in ("text", "name"):
        pattern = _SUBPROGRAM if question.key == "magazine" else _NAME
        if not isinstance(value, str) or not pattern.fullmatch(value):
            raise ValueError(f"found {str(value)[:60]!r}, allowed: {_allowed(question)}")
        return value
    numbers = value if isinstance(value, list) else [value]
    is_number = all(isinstance(one, int | float) and not isinstance(one, bool) for one in numbers)
    is_whole = question.kind != "whole" or all(isinstance(one, int) for one in numbers)
    if not (is_number and is_whole and len(numbers) == question.count) or isinstance(value, list) != (
        question.kind == "numbers"
    ):
        raise ValueError(f"found {str(value)[:60]}, allowed: {_allowed(question)}")
    for number in numbers:
        _refuse_impossible(question, float(number))
    if question.kind == "whole":
        return int(numbers[0])
    return [float(one) for one in numbers] if question.kind == "numbers" else float(numbers[0])


def _choice(question: CellQuestion, value: Any, controller: ArchivedController) -> str:
    known = [name for name, _ in question.choices(controller)] if question.choices else []
    if question.key == "robot" and isinstance(value, str) and value.endswith(".toml"):
        return value
    folded = {_fold(name): name for name in known}
    if not isinstance(value, str) or _fold(value) not in folded:
        if question.key == "robot":
            meant = f"; {library.robot_meant(str(value), known)}"
        else:
            near = closest(str(value), known)
            meant = f"; did you mean {near!r}?" if near else ""
        raise ValueError(f"found {str(value)[:60]!r}, allowed: {', '.join(known)}{meant}")
    return folded[_fold(value)]


def _refuse_impossible(question: CellQuestion, number: float) -> None:
    """Raise `ValueError` where a number is beyond the possible range of its key in the cell."""
    key = general_key(question.cell_key)
    if question.kind == "whole":
        low, high = 0.0 if question.key == "base_number" else 1.0, 99999.0
        if question.cell_key.endswith(("base_data", "tool_data", "analog_output")):
            high = 32.0
        elif question.cell_key.endswith(("_output", "_input")):
            high = 8192.0
    elif key in all_ranges():
        low, high = all_ranges()[key].possible
    else:  # a frame: whatever its members may be
        low, high = -100_000.0, 100_000.0
    if not low <= number <= high:
        raise ValueError(f"found {number:g}, allowed: {low:g} to {high:g}")


def _allowed(question: CellQuestion) -> str:
    if question.kind == "numbers":
        return f"{question.count} numbers, such as {' '.join(f'{one:g}' for one in question.example)}"
    kind = {"number": "a number", "whole": "a whole number"}.get(question.kind, "a name")
    return f"{kind}, such as {question.example}"


def completed(given: Answers, controller: ArchivedController) -> dict[str, Any]:
    """Return answers with what the archive states where they say nothing, of all questions that apply."""
    answers: dict[str, Any] = {"tools": []}
    for question in GENERAL_QUESTIONS:
        if question is MACHINE_QUESTIONS[0]:  # what follows may depend on the tools
            answers["tools"] = [_completed_tool(tool, answers, controller) for tool in given.get("tools", ())]
        _take(question, given, answers, controller)
    return answers


def _completed_tool(given: Answers, general: Answers, controller: ArchivedController) -> dict[str, Any]:
    tool: dict[str, Any] = {"tools_by": general.get("tools_by")}
    for question in TOOL_QUESTIONS:
        _take(question, given, tool, controller)
    return tool


def _take(
    question: CellQuestion, given: Answers, answers: dict[str, Any], controller: ArchivedController
) -> None:
    if not question.when(answers):
        return
    is_answered = question.key in given  # with None by who left it out at the terminal
    value = given[question.key] if is_answered else question.proposal(controller, answers)
    if question.key == "robot" and str(value).endswith(".toml"):
        answers |= {"robot": FILE, "robot_file": value}
    elif value is not None:
        answers[question.key] = value


def read_answers(path: Path, controller: ArchivedController) -> dict[str, Any]:
    """Read answers from a TOML file; raises `NotUnderstoodError` with the line of each that is wrong."""
    text = library.read_text(path)
    data = library.parse_toml(text, str(path))
    issues: list[Issue] = []
    given = _checked_table(GENERAL_QUESTIONS, data, "", controller, issues)
    tools = data.get("tools", [])
    if not isinstance(tools, list) or not all(isinstance(tool, dict) for tool in tools[:MOST_TOOLS]):
        issues.append(_issue("tools", "found no list of tables, allowed: [[tools]]"))
        tools = []
    given["tools"] = [
        _checked_table(TOOL_QUESTIONS, tool, f"tools.{count}.", controller, issues)
        for count, tool in enumerate(tools[:MOST_TOOLS])
    ]
    if not issues:
        issues += unanswered(completed(given, controller))
    if issues:
        raise NotUnderstoodError(with_lines(issues, text), str(path))
    return given


def _checked_table(
    questions: Sequence[CellQuestion],
    data: Mapping[str, Any],
    place: str,
    controller: ArchivedController,
    issues: list[Issue],
) -> dict[str, Any]:
    known = {question.key: question for question in questions}
    answers: dict[str, Any] = {}
    for key, value in data.items():
        if key in known:
            try:
                answers[key] = checked(known[key], value, controller)
            except ValueError as error:
                issues.append(_issue(f"{place}{key}", str(error)))
        elif place or key != "tools":
            near = closest(key, [*known, "tools"])
            meant = f"; did you mean {near}?" if near else ""
            issues.append(_issue(f"{place}{key}"[:80], f"there is no such question{meant}"))
    return answers


def lengths_problem(answers: Answers) -> str | None:
    """Return what is wrong where the lengths do not give the reach of the data sheet; None where they do.

    Makers state the reach of the wrist's centre, some rounded: the library's agree within 0.3 %.
    """
    lengths, reach_mm = answers.get("lengths_mm"), answers.get("reach_mm")
    if not lengths or not reach_mm:
        return None
    a1, a2, _, c2, c3, _ = lengths
    found_mm = a1 + c2 + math.hypot(c3, a2)
    if abs(found_mm - reach_mm) <= _SAME_REACH * reach_mm:
        return None
    return f"the lengths reach {found_mm:.0f} mm (a1 + c2 + hypot(c3, a2)), the data sheet {reach_mm:g} mm"


def unanswered(answers: Answers) -> Iterator[Issue]:
    """Yield an error for each question that needs an answer and has none, or contradicts another."""
    wrong = lengths_problem(answers)
    if wrong is not None:
        yield _issue("lengths_mm", wrong)
    for place, questions, table in _tables(answers):
        for question in questions:
            if question.needed and question.when(table) and table.get(question.key) is None:
                yield _issue(f"{place}{question.key}", f"needs an answer: {question.text}")
    numbers = [tool.get("number") for tool in answers.get("tools", ())]
    if len(set(numbers)) < len(numbers):
        yield _issue("tools", f"two tools have one number: {', '.join(map(str, numbers))}"[:200])
    if answers.get("tool_change") == "none" and len(numbers) > 1:
        yield _issue("tool_change", f"found none, and {len(numbers)} tools: nothing would change them")
    if answers.get("mounted_tool") is not None and answers["mounted_tool"] not in numbers:
        yield _issue("mounted_tool", f"found {answers['mounted_tool']}, which is none of the tools")


def left_out(answers: Answers) -> list[CellQuestion]:
    """Return the questions that apply and have no answer, without those of single tools."""
    return [one for one in GENERAL_QUESTIONS if one.when(answers) and answers.get(one.key) is None]


def _tables(answers: Answers) -> Iterator[tuple[str, Sequence[CellQuestion], Answers]]:
    yield "", GENERAL_QUESTIONS, answers
    for count, tool in enumerate(answers.get("tools", ())):
        yield f"tools.{count}.", TOOL_QUESTIONS, tool


def _issue(key: str, text: str) -> Issue:
    remedy = "`gcode2krl init --questions` prints all questions with examples"
    return Issue("error", "init-answer", 0, f"{key}: {text}", remedy, key=key)


def _fold(name: str) -> str:
    return "".join(name.split()).casefold()


def frame_table(numbers: Sequence[float]) -> dict[str, float]:
    """Return six numbers as a frame of a cell file."""
    return {
        f"{name.lower()}_{'mm' if name in 'XYZ' else 'deg'}": n
        for name, n in zip(FRAME_KEYS, numbers, strict=True)
    }
