"""A person at the terminal: the keys that give answers to the questions of ``gcode2krl init``."""

from gcode2krl.cell.setup.answers import completed
from gcode2krl.cell.setup.controller import ArchivedController
from gcode2krl.cell.setup.questions import (
    MACHINE_QUESTIONS,
    PLACE_QUESTIONS,
    REFERENCE_QUESTIONS,
    TOOL_QUESTIONS,
)
from gcode2krl.cli.init_dialogue import is_asked, shown

DOWN, ENTER, CLEAR = "\x1b[B", "\r", "\x15"


def keys(given, controller=None):
    """Return the keys, question by question, that answer as ``given`` does."""
    controller = controller or ArchivedController(source="")
    answers = completed(given, controller)
    typed = [_typed(question, answers, controller) for question in (*PLACE_QUESTIONS, *REFERENCE_QUESTIONS)]
    for count, tool in enumerate(answers["tools"]):
        typed += [_typed(question, tool, controller) for question in TOOL_QUESTIONS]
        typed.append("n" if count == len(answers["tools"]) - 1 else "y")
    typed += [_typed(question, answers, controller) for question in MACHINE_QUESTIONS]
    return [words for words in typed if words is not None]


def _typed(question, answers, controller):
    if not is_asked(question, answers, controller):
        return None
    proposal, answer = question.proposal(controller, answers), answers.get(question.key)
    if question.kind == "choice":
        values = [value for value, _ in question.choices(controller)]
        start = values.index(proposal) if proposal in values else 0
        return DOWN * ((values.index(answer) - start) % len(values)) + ENTER
    return ENTER if answer == proposal else CLEAR + shown(answer) + ENTER
