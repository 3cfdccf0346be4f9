"""What KRL of a template does: outputs, waits, stops and calls, whichever way its conditions lead.

A small interpreter of the statements that `template_rules` allows. Both branches of a condition are carried
out and joined, a loop zero times or once; a subprogram does what nobody knows. Whatever judges a template
asks this model.
"""

import ast
import operator
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

from gcode2krl import krl_words as w
from gcode2krl.cell.template_rules import PULSE_FORM, calls, statements

Value = bool | float | None
"""Of an output: None where it is not a literal, as in ``$OUT[1]=$IN[3]``."""
Level = tuple[int, bool]
"""An input and the state that it must have."""

_MOST_STATEMENTS, _DEEPEST = 1000, 40
"""Beyond them a text is taken for a subprogram: a cell file may come from a stranger."""
_SET = re.compile(r"(\$(?:AN)?OUT ?\[ ?\d+ ?\]|[A-Z_][A-Z0-9_]*(?:\[\d+\])?) ?=(?!=) ?(.+)$")
_TOKEN = re.compile(r" *(\$IN ?\[ ?\d+ ?\]|==|<>|[()]|[A-Z]+\b|[^ ()=<>]+|.)")
_NUMBERS = re.compile(r"[\d.E+\-*/() ]+")
_COMPARED = re.compile(r"([\d.]+) ?(==|<>|<=|>=|<|>) ?([\d.]+)$")
_COMPARE = {
    "==": operator.eq,
    "<>": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}


@dataclass(frozen=True)
class OutputSignal:
    """A signal after the text: ``$OUT[3]``, ``$ANOUT[1]``, or the integrator's name for one."""

    values: frozenset[Value]
    sure: bool
    """It is set on every way through the text."""
    pulsed: bool = False
    clock_s: float = 0.0
    """When it was set, counted in the seconds that the text surely waits."""
    event: int = 0

    @property
    def may_be_on(self) -> bool:
        """True where it is on, or may be."""
        return any(value is None or bool(value) for value in self.values)

    @property
    def driven(self) -> bool:
        """True where it is on or pulsed, or may be."""
        return self.pulsed or self.may_be_on

    @property
    def surely_on(self) -> bool:
        """True where it is on or pulsed on every way."""
        return self.sure and (self.pulsed or all(value not in (None, False, 0.0) for value in self.values))


@dataclass(frozen=True)
class Effect:
    """What a text does from its first statement to its last."""

    signals: Mapping[str, OutputSignal]
    wait_s: float
    """What it surely waits by ``WAIT SEC``."""
    longest_wait_s: float
    levels: Mapping[Level, int]
    """The inputs that it surely waits for, with the event at which it does."""
    waits_for: bool
    """It waits for a condition on every way."""
    stops: int
    """Event of the last HALT that stands on every way, 0 without."""
    may_stop: bool
    calls: tuple[str, ...]
    endless: str
    """A statement that never lets the program go on, empty without."""
    _clock_s: float = 0.0

    @property
    def pauses(self) -> bool:
        """True where a person or something else has the time to act: it stops, waits or calls."""
        return bool(self.stops or self.waits_for or self.calls) or self.wait_s > 0.0

    def waited_s(self, name: str) -> float:
        """Return the seconds that are surely waited behind the setting of a signal."""
        return self._clock_s - self.signals[name].clock_s

    def waited_for(self, name: str) -> frozenset[Level]:
        """Return the inputs that are surely waited for behind the setting of a signal."""
        event = self.signals[name].event
        return frozenset(level for level, at in self.levels.items() if at > event)

    def on(self) -> frozenset[str]:
        """Return the digital signals that are on, or may be."""
        return frozenset(name for name in self.digital() if self.signals[name].may_be_on)

    def off(self) -> frozenset[str]:
        """Return the digital signals that are off, whatever the conditions."""
        return frozenset(
            name for name in self.digital() if self.signals[name].sure and not self.signals[name].may_be_on
        )

    def driven(self) -> frozenset[str]:
        """Return the digital signals that are on or pulsed, or may be."""
        return frozenset(name for name in self.digital() if self.signals[name].driven)

    def digital(self) -> Iterator[str]:
        """Yield the names of the digital signals."""
        return (name for name in self.signals if not name.startswith("$ANOUT"))


@lru_cache(maxsize=512)
def effect_of(text: str) -> Effect:
    """Return what rendered KRL does; a text that is too long or too deep does what nobody knows."""
    lines = statements(text)
    called = tuple(calls(text))
    run = _Run(lines[:_MOST_STATEMENTS])
    end = run.block(_State(), frozenset(), 0) or run.last
    if len(lines) > _MOST_STATEMENTS or run.too_deep:
        called += ("a long text",)
    return Effect(
        signals=end.signals,
        wait_s=end.clock_s,
        longest_wait_s=run.longest_wait_s,
        levels=end.levels,
        waits_for=end.waits_for,
        stops=end.stops,
        may_stop=run.may_stop,
        calls=called,
        endless=run.endless,
        _clock_s=end.clock_s,
    )


@dataclass
class _State:
    signals: dict[str, OutputSignal] = field(default_factory=dict)
    clock_s: float = 0.0
    event: int = 1
    levels: dict[Level, int] = field(default_factory=dict)
    waits_for: bool = False
    stops: int = 0

    def copy(self) -> "_State":
        return replace(self, signals=dict(self.signals), levels=dict(self.levels))


def _joined(a: _State | None, b: _State | None) -> _State | None:
    """Return what is known where one of two ways was gone; None is a way that does not lead on."""
    if a is None or b is None:
        return a or b
    clock_s = min(a.clock_s, b.clock_s)
    signals = {}
    for name in {**a.signals, **b.signals}:
        both = [(state, state.signals[name]) for state in (a, b) if name in state.signals]
        signals[name] = OutputSignal(
            values=frozenset().union(*(signal.values for _, signal in both)),
            sure=len(both) == 2 and all(signal.sure for _, signal in both),
            pulsed=any(signal.pulsed for _, signal in both),
            clock_s=clock_s - min(state.clock_s - signal.clock_s for state, signal in both),
            event=max(signal.event for _, signal in both),
        )
    return _State(
        signals,
        clock_s,
        max(a.event, b.event),
        {level: min(at, b.levels[level]) for level, at in a.levels.items() if level in b.levels},
        a.waits_for and b.waits_for,
        min(a.stops, b.stops),
    )


class _Run:
    """The statements of a text, carried out from the first to the last."""

    def __init__(self, lines: list[str]) -> None:
        self.lines, self.at = lines, 0
        self.exits: list[list[_State]] = []
        self.longest_wait_s, self.may_stop, self.endless, self.too_deep = 0.0, False, "", False
        self.last = _State()

    def block(self, state: _State | None, ends: frozenset[str], depth: int) -> _State | None:
        """Carry out statements up to one that begins with a word of ``ends``, which is left."""
        while self.at < len(self.lines):
            line = self.lines[self.at]
            word = _first(line)
            if word in ends:
                break
            self.at += 1
            if word in _OPENED and depth < _DEEPEST:
                state = getattr(self, f"_{word.lower()}")(state, line, depth + 1)
            elif word in _OPENED:
                self.too_deep = True
            elif state is not None:
                state = self._statement(state, word, line)
        return state

    def _if(self, state: _State | None, line: str, depth: int) -> _State | None:
        chosen = _condition(line[2:].removesuffix("THEN")).constant
        then = self.block(_copied(state), frozenset(("ELSE", "ENDIF")), depth)
        other = state
        if self._next() == "ELSE":
            self.at += 1
            other = self.block(_copied(state), frozenset(("ENDIF",)), depth)
        self.at += 1
        if chosen is not None:
            return then if chosen else other
        return _joined(then, other)

    def _switch(self, state: _State | None, line: str, depth: int) -> _State | None:
        self.block(None, frozenset(("CASE", "DEFAULT", "ENDSWITCH")), depth)
        ways: list[_State | None] = []
        complete = False
        while self._next() in ("CASE", "DEFAULT"):
            complete = complete or self._next() == "DEFAULT"
            self.at += 1
            ways.append(self.block(_copied(state), frozenset(("CASE", "DEFAULT", "ENDSWITCH")), depth))
        self.at += 1
        end = ways[0] if complete and ways else state
        for way in ways:
            end = _joined(end, way)
        return end

    def _loop(self, state: _State | None, line: str, depth: int) -> _State | None:
        self.exits.append([])
        end = self.block(_copied(state), frozenset(("ENDLOOP",)), depth)
        self.at += 1
        after: _State | None = None
        for way in self.exits.pop():
            after = _joined(after, way)
        if after is None and end is not None:
            self.endless = self.endless or "LOOP without EXIT"
            self.last = end
        return after

    def _while(self, state: _State | None, line: str, depth: int) -> _State | None:
        chosen = _condition(line[5:]).constant
        body = self.block(_copied(state), frozenset(("ENDWHILE",)), depth)
        self.at += 1
        if chosen and state is not None:
            self.endless, self.last = self.endless or line, body or state
            return None
        return state if chosen is False else _joined(state, body)

    def _for(self, state: _State | None, line: str, depth: int) -> _State | None:
        body = self.block(_copied(state), frozenset(("ENDFOR",)), depth)
        self.at += 1
        return _joined(state, body)

    def _repeat(self, state: _State | None, line: str, depth: int) -> _State | None:
        body = self.block(_copied(state), frozenset(("UNTIL",)), depth)
        condition = self.lines[self.at][5:] if self.at < len(self.lines) else ""
        self.at += 1
        if _condition(condition).constant is False and body is not None:
            self.endless, self.last = self.endless or "REPEAT … UNTIL FALSE", body
            return None
        return body

    def _next(self) -> str:
        return _first(self.lines[self.at]) if self.at < len(self.lines) else ""

    def _statement(self, state: _State, word: str, line: str) -> _State | None:
        state.event += 1
        if word == w.EXIT:
            if self.exits:
                self.exits[-1].append(state)
            return None
        if word == w.HALT:
            state.stops, self.may_stop = state.event, True
        elif word == w.WAIT:
            return self._wait(state, line)
        elif pulse := PULSE_FORM.match(line):
            self._set(state, pulse[1], OutputSignal(frozenset((pulse[2] != "TRUE",)), sure=True, pulsed=True))
        elif assigned := _SET.match(line):
            value = _value(assigned[2])
            if assigned[1].startswith("$") or isinstance(value, bool):
                self._set(state, assigned[1], OutputSignal(frozenset((value,)), sure=True))
        return state

    def _set(self, state: _State, name: str, signal: OutputSignal) -> None:
        before = state.signals.get(name.replace(" ", ""))
        state.signals[name.replace(" ", "")] = replace(
            signal,
            clock_s=state.clock_s,
            event=state.event,
            pulsed=signal.pulsed or (before is not None and before.pulsed),
        )

    def _wait(self, state: _State, line: str) -> _State | None:
        kind, _, what = line[4:].strip().partition(" ")
        if kind == "SEC":
            seconds = _value(what)
            wait_s = float(seconds) if isinstance(seconds, int | float) else 0.0
            state.clock_s += max(wait_s, 0.0)
            self.longest_wait_s = max(self.longest_wait_s, wait_s)
            return state
        condition = _condition(line[4:].strip().removeprefix("FOR"))
        if condition.constant is False:
            self.endless, self.last = self.endless or line, state
        if condition.constant is None:
            state.waits_for = True
            state.levels |= dict.fromkeys(condition.if_true, state.event)
        return state


_OPENED = frozenset(("IF", "SWITCH", "LOOP", "WHILE", "FOR", "REPEAT"))


def _copied(state: _State | None) -> _State | None:
    return None if state is None else state.copy()


def _first(statement: str) -> str:
    match = re.match(r"[A-Z]+", statement)
    return match[0] if match else ""


def _value(text: str) -> Value:
    """Return TRUE, FALSE or a number; None where the value is not literal."""
    text = text.strip()
    if _NUMBERS.fullmatch(text) and len(text) < 200:
        try:
            return _number(ast.parse(text.replace(" ", ""), mode="eval").body)
        except (SyntaxError, ValueError, ZeroDivisionError, RecursionError, MemoryError):
            return None
    return _condition(text).constant


def _number(node: ast.expr) -> float:
    """Return a number; as in KRL, an INT divided by an INT is cut off to an INT."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
            return -_number(operand) if isinstance(node.op, ast.USub) else _number(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as op, right=right):
            a, b = _number(left), _number(right)
            if isinstance(op, ast.Div):
                return int(a / b) if isinstance(a, int) and isinstance(b, int) else a / b
            return a + b if isinstance(op, ast.Add) else a - b if isinstance(op, ast.Sub) else a * b
    raise ValueError("not a number")


@dataclass(frozen=True)
class _Condition:
    """What is certain of the inputs where a condition is true, and where it is false."""

    if_true: frozenset[Level] = frozenset()
    if_false: frozenset[Level] = frozenset()
    constant: bool | None = None

    def negated(self) -> "_Condition":
        return _Condition(self.if_false, self.if_true, None if self.constant is None else not self.constant)


_UNKNOWN = _Condition()


def _condition(text: str) -> _Condition:
    compared = _COMPARED.match(text.strip().strip("()"))
    if compared:
        try:
            a, b = float(compared[1]), float(compared[3])
        except ValueError:
            return _UNKNOWN
        return _Condition(constant=bool(_COMPARE[compared[2]](a, b)))
    tokens = [match[1] for match in _TOKEN.finditer(text.strip())]
    if len(tokens) > 200:
        return _UNKNOWN
    try:
        condition, end = _either(tokens, 0)
    except RecursionError:
        return _UNKNOWN
    return condition if end == len(tokens) else _UNKNOWN


def _either(tokens: list[str], at: int) -> tuple[_Condition, int]:
    condition, at = _both(tokens, at)
    while at < len(tokens) and tokens[at] in ("OR", "EXOR"):
        word = tokens[at]
        other, at = _both(tokens, at + 1)
        condition = _UNKNOWN if word == "EXOR" else _and(condition.negated(), other.negated()).negated()
    return condition, at


def _both(tokens: list[str], at: int) -> tuple[_Condition, int]:
    condition, at = _compared(tokens, at)
    while at < len(tokens) and tokens[at] == "AND":
        other, at = _compared(tokens, at + 1)
        condition = _and(condition, other)
    return condition, at


def _and(a: _Condition, b: _Condition) -> _Condition:
    known = (a.constant, b.constant)
    constant = False if False in known else True if known == (True, True) else None
    return _Condition(a.if_true | b.if_true, a.if_false & b.if_false, constant)


def _compared(tokens: list[str], at: int) -> tuple[_Condition, int]:
    condition, at = _atom(tokens, at)
    while at < len(tokens) and tokens[at] in ("==", "<>"):
        same = tokens[at] == "=="
        other, at = _atom(tokens, at + 1)
        if other.constant is None:
            condition, other = other, condition
        if other.constant is None:
            condition = _UNKNOWN
        elif other.constant != same:
            condition = condition.negated()
    return condition, at


def _atom(tokens: list[str], at: int) -> tuple[_Condition, int]:
    token = tokens[at] if at < len(tokens) else ""
    if token == "NOT":
        condition, at = _atom(tokens, at + 1)
        return condition.negated(), at
    if token == "(":
        condition, at = _either(tokens, at + 1)
        return condition, at + (at < len(tokens) and tokens[at] == ")")
    if token in ("TRUE", "FALSE"):
        return _Condition(constant=token == "TRUE"), at + 1
    if token.startswith("$IN"):
        number = int(re.sub(r"\D", "", token))
        return _Condition(frozenset(((number, True),)), frozenset(((number, False),))), at + 1
    return _UNKNOWN, at + (at < len(tokens))
