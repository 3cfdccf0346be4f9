"""What a template of the cell may say in KRL: switch, wait, halt and call what ``externals`` declares.

It may not move, jump, or change what the motions depend on (frames, load, speeds, approximation, advance).
The list is of what is allowed: an unknown statement is refused.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache

from gcode2krl import krl_words as w

_SWITCHED = frozenset(["OUT", "ANOUT", "FLAG", "CYCFLAG", "TIMER", "TIMER_STOP", "TIMER_FLAG"])
"""System variables that a template may set; all others belong to the planner or to safety."""
_PLANNER_DATA = re.compile(
    r"(BASE_|TOOL_|LOAD_|MACHINE_|IPO_|BAS_|DEF_|PDAT|FDAT|LDAT|XHOME|HOME|XP|GK_|POS_ACT|AXIS_ACT|P\d)"
)
"""Names of ``$CONFIG.DAT``, of inline forms and of this program's own variables."""
_CLOSE = {close: begin for begin, close in w.BLOCKS.items()}
_ASSIGNED = re.compile(r"(\$?)([A-Z_][A-Z0-9_]*)((?:\.[A-Z0-9_]+|\[[^\]=]*\])*) ?=(?!=)")
_CALL = re.compile(r"([A-Z_][A-Z0-9_]*) ?\(")
PULSE_FORM = re.compile(r"PULSE ?\( ?(\$OUT\[ ?\d+ ?\]) ?, ?(TRUE|FALSE) ?,[^()]*\)$")
_INTERRUPT = re.compile(
    r"(?:GLOBAL )?INTERRUPT (?:DECL (\d+) WHEN .+ DO ([A-Z_][A-Z0-9_]*) ?\(.*\)"
    r"|(?:ON|OFF|DISABLE|ENABLE) (\d+))$"
)
_OF_CONTROLLER = re.compile(
    r"(BAS|IR_STOPM|SPS|GK_.*|RSI_.*|SETVAR|CWRITE|SYNCCMD|[A-Z]*_KRLMSG|[A-Z]*_KRLDLG)"
)
"""Subprograms of the controller that move, set frames, or belong to the program itself."""
_WORDS_INSIDE = [*w.MOTIONS, *w.JUMPS, w.DO, w.TRIGGER, w.BAS, *w.APPROXIMATIONS]
_INSIDE = re.compile(rf"(?<![$.#\w])(?:{'|'.join(_WORDS_INSIDE)})(?!\w)")
"""Words that move or jump; a controller may read on after a complete statement."""
_ALONE = frozenset(
    ["ENDIF", "ENDWHILE", "ENDFOR", "LOOP", "ENDLOOP", "REPEAT", "ENDSWITCH", "ELSE", "DEFAULT"]
)
_COUNTS = re.compile(r"FOR (?!\$)([A-Z_][A-Z0-9_]*) ?= ?[^=]+ TO ")
_HIGHEST_OUTPUT = 8192
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]")


def statements(text: str) -> list[str]:
    """Return the statements of KRL text: upper case, single spaces, without comments and blank lines."""
    statement_lines = (_statement(line) for line in text.split("\n"))
    return [line for line in statement_lines if line]


def problem(text: str, externals: Iterable[str] = ()) -> str:
    """Return what is not allowed in rendered KRL, empty if all is."""
    if not text.isascii():
        return "a character that is not ASCII"
    if _CONTROL.search(text.replace("\t", " ")):
        return "a control character"
    callable_names = {name.split("(")[0].strip().upper() for name in externals}
    for statement in statements(text):
        wrong = _wrong(statement, callable_names)
        if wrong:
            return f"{statement[:50]!r} {wrong}"
    return _interrupts_left_on(text) or _unbalanced(text)


def external_problem(external: str) -> str:
    """Return why a subprogram may not be declared for templates, empty where it may."""
    name = external.split("(")[0].strip().upper()
    is_reserved = name in w.MOTIONS | w.JUMPS | _CONDITIONS | _FUNCTIONS | {
        "DO",
        w.TRIGGER,
        w.HALT,
        w.WAIT,
        w.INTERRUPT,
    }
    if is_reserved or _OF_CONTROLLER.fullmatch(name):
        return f"{name} belongs to the controller or to KRL: a template may not call it"
    return ""


def calls(text: str) -> list[str]:
    """Return the subprograms that KRL text calls: what they switch cannot be read."""
    return [name for statement in statements(text) for name in _called(statement) if name not in _FUNCTIONS]


@lru_cache(maxsize=4096)
def _statement(line: str) -> str:
    # the templates of a cell are rendered dozens of times, mostly to the same lines
    bare = re.sub(r'^((?:[^";]|"[^"]*")*);.*$', r"\1", line)
    return re.sub(r"\s+", " ", bare).strip().upper()


def _first(statement: str) -> str:
    match = re.match(r"\$?[A-Z_][A-Z0-9_]*", statement)
    return match[0] if match else ""


def _wrong(statement: str, callable_names: set[str]) -> str:
    """Return why a statement is not allowed, empty where it is."""
    word = _first(statement)
    if word in w.MOTIONS:
        return "moves the robot"
    if word in w.JUMPS or re.match(r"[A-Z_][A-Z0-9_]* ?:", statement):
        return "leaves the order of the program"
    bare = re.sub(r'"[^"]*"', '""', statement)
    inside = _INSIDE.search(bare if word not in (w.INTERRUPT, w.GLOBAL) else bare.partition(" DO ")[0])
    if inside:
        return f"has {inside[0]} in it, which moves the robot or leaves the order of the program"
    outputs = re.findall(r"\$OUT\[ ?(\d+) ?\]", bare)
    if not all(1 <= int(number[:6]) <= _HIGHEST_OUTPUT for number in outputs):
        return f"names an output that no controller has: 1 to {_HIGHEST_OUTPUT}"
    if word in (w.INTERRUPT, w.GLOBAL):
        return _wrong_interrupt(statement, callable_names)
    for name in _called(statement):
        if name not in callable_names and name not in _FUNCTIONS:
            return f"calls {name}, which program.externals does not declare"
    if _assignments(statement) > 1:
        return "assigns twice in a line"
    return _wrong_form(word, statement, callable_names)


def _wrong_form(word: str, statement: str, callable_names: set[str]) -> str:
    """Return why a statement that moves nothing and calls nothing unknown has not the form of its word."""
    if word in _FORMS:
        return _FORMS[word](statement)
    if word in _ALONE and statement != word:
        return f"has more than {word}"
    if word in _CONDITIONS:
        return "assigns in a condition" if _assignments(statement) else ""
    if word in (w.HALT, w.CONTINUE, w.EXIT) and statement == word:
        return ""
    assigned = _ASSIGNED.match(statement)
    if assigned:
        return _wrong_assignment(assigned)
    if _CALL.match(statement) and statement.endswith(")") and word in callable_names:
        return "assigns in a call" if _assignments(statement) else ""
    return "is not a statement that templates may use"


def _wrong_pulse(statement: str) -> str:
    return "" if PULSE_FORM.match(statement) else "does not pulse an output given by its number"


def _wrong_for(statement: str) -> str:
    counts = _COUNTS.match(statement)
    return "" if counts and not _PLANNER_DATA.match(counts[1]) else "counts in a variable of the controller"


def _wrong_wait(statement: str) -> str:
    waits = re.match(r"WAIT (SEC|FOR)\b", statement) and not _assignments(statement)
    return "" if waits else "is not WAIT SEC or WAIT FOR"


_FORMS: dict[str, Callable[[str], str]] = {w.PULSE: _wrong_pulse, w.FOR: _wrong_for, w.WAIT: _wrong_wait}
_CONDITIONS = frozenset([*w.BLOCKS, *_CLOSE, *w.BRANCHES])
_FUNCTIONS = frozenset(["ABS", "SIN", "COS", "SQRT", "ROUND", "STRFIND", "STRLEN", w.PULSE, "AND",
                        "OR", "NOT", "EXOR", "IF", "WHILE", "UNTIL", "FOR", "CASE", "SWITCH", "SEC", "B_AND",
                        "B_OR", "B_NOT", "TO"])  # fmt: skip  # word list
"""Names that may stand before a bracket without being a subprogram."""


def _called(statement: str) -> Iterator[str]:
    bare = re.sub(r'"[^"]*"', '""', statement)
    return (match[1] for match in re.finditer(r"(?<![$\w.])([A-Z_][A-Z0-9_]*) ?\(", bare))


def _assignments(statement: str) -> int:
    return len(re.findall(r"(?<![<>=])=(?!=)", re.sub(r'"[^"]*"', "", statement)))


def _wrong_assignment(assigned: re.Match[str]) -> str:
    system, name = assigned[1] == "$", assigned[2]
    if system and name not in _SWITCHED:
        return f"changes ${name}, on which the motions may depend"
    if system and name == "OUT" and not re.fullmatch(r"\[ ?\d+ ?\]", assigned[3]):
        return "switches an output whose number is not a literal: it cannot be read back"
    if not system and _PLANNER_DATA.match(name):
        return f"changes {name}, which the controller or the program uses"
    return ""


def _wrong_interrupt(statement: str, callable_names: set[str]) -> str:
    match = _INTERRUPT.match(statement)
    number = int(match[1] or match[3]) if match else 0
    if match is None or number in (w.RSI_INTERRUPT, w.STOP_INTERRUPT):
        return f"touches an interrupt of the program ({w.STOP_INTERRUPT}, {w.RSI_INTERRUPT}, or all of them)"
    if match[1] and match[2] not in callable_names:
        return f"calls {match[2]}, which program.externals does not declare"
    return ""


def _interrupts_left_on(text: str) -> str:
    """Return why an interrupt may not stay on: nothing is set again behind a subprogram that it calls."""
    is_on: dict[str, bool] = {}
    for statement in statements(text):
        match = re.match(r"INTERRUPT (ON|ENABLE|OFF|DISABLE) (\d+)$", statement)
        if match:
            is_on[match[2]] = match[1] in ("ON", "ENABLE")
    number = next((number for number, on in is_on.items() if on), "")
    if not number:
        return ""
    return (
        f"leaves interrupt {number} on: its subprogram could change what the motions depend on "
        f"between any two of them; switch it off in the same template"
    )


def _unbalanced(text: str) -> str:
    """Return which block the text opens and does not close, or the other way round."""
    open_blocks: list[str] = []
    for statement in statements(text):
        word = _first(statement)
        if word in w.BLOCKS:
            open_blocks.append(word)
        elif word in _CLOSE:
            if not open_blocks or open_blocks.pop() != _CLOSE[word]:
                return f"{word} without {_CLOSE[word]}"
        elif word in w.BRANCHES and not open_blocks:
            return f"{word} outside of a block"
        elif word == w.EXIT and "LOOP" not in open_blocks:
            return "EXIT outside of a LOOP leaves the program"
    if open_blocks:
        return f"{open_blocks[-1]} without {w.BLOCKS[open_blocks[-1]]}"
    folds = [line.strip().upper() for line in text.split("\n")]
    opened = sum(line.startswith(w.FOLD) for line in folds)
    if opened != sum(line.startswith(w.ENDFOLD) for line in folds):
        return ";FOLD and ;ENDFOLD do not match"
    return ""
