"""The questions of ``gcode2krl init`` at a terminal, with arrow keys, and as a file to be filled in."""

from collections.abc import Mapping, Sequence
from typing import Any

from gcode2krl.cell.setup.answers import answer_of_words, lengths_problem
from gcode2krl.cell.setup.controller import ArchivedController
from gcode2krl.cell.setup.questions import (
    MACHINE_QUESTIONS,
    PLACE_QUESTIONS,
    REFERENCE_QUESTIONS,
    TOOL_QUESTIONS,
    CellQuestion,
)

BACK = "<"
"""Typed instead of an answer: the question before."""


class Stopped(Exception):  # noqa: N818 - it is no error
    """The dialogue was ended before its last question."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self.answers = answers


def ask(controller: ArchivedController, draft: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Ask all questions that apply; what a draft or the archive states is proposed, and Enter accepts it.

    Raises `Stopped` with the answers so far at Ctrl-C.
    """
    import questionary

    draft = draft or {}
    questionary.print(
        f"Enter accepts what is shown or leaves a question out; {BACK} goes back; Ctrl-C keeps the answers."
    )
    answers: dict[str, Any] = {"tools": []}
    drafted: list[Mapping[str, Any]] = list(draft.get("tools", ()))
    stage, backwards = 0, False
    try:
        while stage < len(answers["tools"]) + 3:
            tools = answers["tools"]
            at = stage - 2  # of the tools, which stand between the place and the machine
            if stage < 2 or at == len(tools) > 0:
                questions = (PLACE_QUESTIONS, REFERENCE_QUESTIONS, MACHINE_QUESTIONS)[min(stage, 2)]
                done = _ask_each(questions, answers, controller, draft, backwards=backwards)
            else:
                if at == len(tools):
                    tools.append({"tools_by": answers.get("tools_by")})
                others = {tool.get("number") for tool in tools if tool is not tools[at]}
                questionary.print(f"\nTool {at + 1}")
                known = drafted[at] if at < len(drafted) else {}
                done = _ask_each(TOOL_QUESTIONS, tools[at], controller, known, others, backwards=backwards)
                is_last = at == len(tools) - 1
                if done and is_last and questionary.confirm("Another tool?", default=False).unsafe_ask():
                    tools.append({"tools_by": answers.get("tools_by")})
            stage, backwards = (stage + 1, False) if done else (max(stage - 1, 0), stage > 0)
    except KeyboardInterrupt:
        raise Stopped(answers) from None
    return answers


def _ask_each(
    questions: Sequence[CellQuestion],
    answers: dict[str, Any],
    controller: ArchivedController,
    draft: Mapping[str, Any],
    taken: set[Any] | None = None,
    *,
    backwards: bool = False,
) -> bool:
    """Ask questions in their order, or from the last one on; False where it is gone back beyond the first."""
    asked = [one for one in questions if is_asked(one, answers, controller)]
    at = len(asked) - 1 if backwards else 0
    while 0 <= at < len(asked):
        question = asked[at]
        answer = _ask_one(question, answers, controller, draft, taken or set())
        if answer == BACK:
            at -= 1
            continue
        answers[question.key] = answer
        asked = [one for one in questions if is_asked(one, answers, controller)]
        at = asked.index(question) + 1
    return at >= 0 and (bool(asked) or not backwards)


def is_asked(question: CellQuestion, answers: dict[str, Any], controller: ArchivedController) -> bool:
    """Tell whether a question applies; one about the archive does if that has something to choose from."""
    listed = question.choices(controller) if question.of_archive and question.choices else [None]
    return question.when(answers) and bool(listed)


def _ask_one(
    question: CellQuestion,
    answers: dict[str, Any],
    controller: ArchivedController,
    draft: Mapping[str, Any],
    taken: set[Any],
) -> Any:
    import questionary

    proposal = answers.get(question.key, draft.get(question.key, question.proposal(controller, answers)))
    listed = question.choices(controller) if question.choices else []
    questionary.print(f"\n  where: {question.where}", style="fg:ansibrightblack")
    if question.picture:
        questionary.print(question.picture)
    if question.kind == "choice":
        listed = [*listed, (BACK, "the question before")]
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
        if words.strip() == BACK:
            return True
        try:
            answer = answer_of_words(question, words, controller)
        except ValueError as error:
            return str(error)
        if question.key in ("reach_mm", "lengths_mm"):
            wrong = lengths_problem({**answers, question.key: answer})
            if wrong is not None:
                return f"{wrong}; {BACK} goes back"
        return "this tool is there already" if question.key == "number" and answer in taken else True

    instruction = None if proposal is not None else f"(such as {shown(question.example)}) "
    words = questionary.text(
        question.text, default=shown(proposal), validate=problem, instruction=instruction
    ).unsafe_ask()
    return BACK if words.strip() == BACK else answer_of_words(question, words, controller)


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
        lines += [f"#{line}" for line in question.picture.strip("\n").splitlines()]
        choices = question.choices(nobody) if question.choices else []
        if choices:
            lines.append("#   one of " + ", ".join(value for value, _ in choices))
        example = f'"{question.example}"' if isinstance(question.example, str) else str(question.example)
        lines.append(f"# {question.key} = {example}")
    return "\n".join(lines) + "\n"
