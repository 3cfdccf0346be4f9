"""The questions of ``gcode2krl init`` at a terminal, with arrow keys, and as a file to be filled in."""

from collections.abc import Sequence
from typing import Any

from gcode2krl.cell.setup.answers import answer_of_words
from gcode2krl.cell.setup.controller import ArchivedController
from gcode2krl.cell.setup.questions import (
    MACHINE_QUESTIONS,
    PLACE_QUESTIONS,
    REFERENCE_QUESTIONS,
    TOOL_QUESTIONS,
    CellQuestion,
)


def ask(controller: ArchivedController) -> dict[str, Any]:
    """Ask all questions that apply; what the archive states is proposed, and Enter accepts it."""
    import questionary

    questionary.print("Enter accepts what is shown or leaves a question out; Ctrl-C ends without a file.")
    answers: dict[str, Any] = {"tools": []}
    _ask_each(PLACE_QUESTIONS, answers, controller)
    _ask_each(REFERENCE_QUESTIONS, answers, controller)
    while True:
        tool: dict[str, Any] = {"tools_by": answers.get("tools_by")}
        numbers = {one["number"] for one in answers["tools"]}
        questionary.print(f"\nTool {len(answers['tools']) + 1}")
        _ask_each(TOOL_QUESTIONS, tool, controller, taken=numbers)
        answers["tools"].append(tool)
        if not questionary.confirm("Another tool?", default=False).unsafe_ask():
            break
    _ask_each(MACHINE_QUESTIONS, answers, controller)
    return answers


def _ask_each(
    questions: Sequence[CellQuestion],
    answers: dict[str, Any],
    controller: ArchivedController,
    taken: set[Any] | None = None,
) -> None:
    for question in questions:
        if is_asked(question, answers, controller):
            answers[question.key] = _ask_one(question, answers, controller, taken or set())


def is_asked(question: CellQuestion, answers: dict[str, Any], controller: ArchivedController) -> bool:
    """Tell whether a question applies; one about the archive does if that has something to choose from."""
    listed = question.choices(controller) if question.of_archive and question.choices else [None]
    return question.when(answers) and bool(listed)


def _ask_one(
    question: CellQuestion, answers: dict[str, Any], controller: ArchivedController, taken: set[Any]
) -> Any:
    import questionary

    proposal = question.proposal(controller, answers)
    listed = question.choices(controller) if question.choices else []
    questionary.print(f"\n  where: {question.where}", style="fg:ansibrightblack")
    if question.kind == "choice":
        choices = [questionary.Choice(f"{value}  {words}".rstrip(), value) for value, words in listed]
        return questionary.select(
            question.text,
            choices=choices,
            default=proposal if proposal in [value for value, _ in listed] else None,
            use_search_filter=len(listed) > 9,
            use_jk_keys=False,
        ).unsafe_ask()
    for _, words in listed:
        questionary.print(f"    {words}")

    def problem(words: str) -> bool | str:
        try:
            answer = answer_of_words(question, words, controller)
        except ValueError as error:
            return str(error)
        return "this tool is there already" if question.key == "number" and answer in taken else True

    instruction = None if proposal is not None else f"(such as {shown(question.example)}) "
    words = questionary.text(
        question.text, default=shown(proposal), validate=problem, instruction=instruction
    ).unsafe_ask()
    return answer_of_words(question, words, controller)


def shown(value: Any) -> str:
    """Return a value as a person types it; empty for None."""
    if isinstance(value, list):
        return " ".join(map(shown, value))
    if isinstance(value, float):
        return f"{value:.9g}"
    return "" if value is None else str(value)


def questions_text() -> str:
    """Return all questions as a TOML file of answers, each with an example in a comment."""
    head = (
        "# Answers for `gcode2krl init --answers FILE`: remove the # in front of what you answer.\n"
        "# What the controller's archive states (--controller) need not be answered here.\n"
    )
    general = (*PLACE_QUESTIONS, *REFERENCE_QUESTIONS, *MACHINE_QUESTIONS)
    tools = "\n# Each tool is a table.\n# [[tools]]\n"
    return head + _questions(general) + tools + _questions(TOOL_QUESTIONS)


def _questions(questions: Sequence[CellQuestion]) -> str:
    nobody = ArchivedController(source="")
    lines = []
    for question in questions:
        lines.append(f"\n# {question.text}\n#   where: {question.where}")
        choices = question.choices(nobody) if question.choices else []
        if choices:
            lines.append("#   one of " + ", ".join(value for value, _ in choices))
        example = f'"{question.example}"' if isinstance(question.example, str) else str(question.example)
        lines.append(f"# {question.key} = {example}")
    return "\n".join(lines) + "\n"
