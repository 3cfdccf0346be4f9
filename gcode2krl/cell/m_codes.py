"""What the M-codes of a cell do, against what its ``[spindle]`` says of them.

Each template is rendered for slow, middle and full speed and for each tool, and carried out on the model of
`krl_effect`. Where a subprogram is called, or a person acts at a HALT, nothing is said of what they may do.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from gcode2krl.cell.definition import Cell, plain_view
from gcode2krl.cell.krl_effect import Effect, effect_of
from gcode2krl.cell.switching import SAMPLE, texts_without_words
from gcode2krl.cell.template_rules import problem, statements
from gcode2krl.cell.templates import TemplateError, render
from gcode2krl.errors import Issue, Severity

_SHARES = (0.1, 0.3, 0.5, 1.0)
"""Of the largest speed: what is programmed between them behaves alike."""
_UNKNOWN_MAX_RPM = 10_000.0
_UNEVEN = 0.15
"""Relative change of output over speed that a rounding to two decimals does not explain."""
_LEAST_FULL = 0.5
"""Output at ``spindle.max_rpm``, documented as 1; a drive whose full value is twice as fast is usual."""
_LONG_WAIT_S, _ENDLESS_WAIT_S = 120.0, 600.0
"""Spindles start in 1 to 30 s (`ranges.toml`); a longer wait has its seconds as milliseconds."""
_SHORT_WAIT_S = 0.5
"""A stated wait below this is a finding of its own, `spindle-wait`."""
_ENOUGH = 0.99
_RUNS = {"M3": ("run_cw_output", "run_ccw_output"), "M4": ("run_ccw_output", "run_cw_output")}
_COOLANTS = {"M8": ("flood_output", "mist_output"), "M7": ("mist_output", "flood_output")}
_END = ("m_code.M2", "m_code.M30", "program.epilogue")
_MAY_STOP_SPINDLE = ("M3", "M4", "M5", "M2", "M30", "M6", "M19", "M60")
_WORD = re.compile(r"\b[pqe]\b")
"""A word of the block, which names an output: a program says which (`output_words`)."""
_NUMBER_OF_TOOL = re.compile(r"(?i)\btool[ #:_]{0,3}(\d+)\b")


class _Case(NamedTuple):
    """A template with one set of values."""

    rpm: float
    text: str
    effect: Effect


def m_code_issues(cell: Cell) -> Iterator[Issue]:
    """Yield what a template does that its code or ``[spindle]`` contradicts, each with its key."""
    templates = cell.templates()
    if not templates:
        return
    codes = _Codes(cell, templates)
    for key in codes.cases:
        yield from codes.always(key)
    for m_code in _RUNS:
        yield from codes.runs(m_code)
        yield from codes.speed(m_code)
        yield from codes.run_up(m_code)
    yield from codes.directions()
    yield from codes.stop()
    for m_code in _COOLANTS:
        yield from codes.coolant(m_code)
    yield from codes.program_stop()
    yield from codes.intruders()
    yield from codes.tool_changes()


def silent_changes(cell: Cell, tools: Sequence[int]) -> list[int]:
    """Return the tools that ``tool_change`` puts into the spindle without a stop, a call or a wait."""
    changes = tool_effects(cell, tools)
    return [tool for tool in tools if tool in changes and not changes[tool].effect.pauses]


def tool_effects(cell: Cell, tools: Sequence[int]) -> dict[int, _Case]:
    """Return tool → what ``tool_change`` does for it; what cannot be rendered is left out."""
    template = cell.tool_change
    cases = {}
    for tool in tools if template.strip() else ():
        values = {**SAMPLE, **_view(cell, template), "tool": tool}
        if case := _rendered(template, values, cell.program.externals):
            cases[tool] = case
    return cases


def _view(cell: Cell, template: str) -> dict[str, Any]:
    view: dict[str, Any] = {"spindle": cell.spindle.model_dump()}
    if "cell" in template:
        view["cell"] = plain_view(cell)
    return view


def _rendered(template: str, values: Mapping[str, Any], externals: tuple[str, ...]) -> _Case | None:
    """Return a template with its values, None where it is wrong in itself: that is reported elsewhere."""
    try:
        text = render(template, values)
    except TemplateError:
        return None
    if problem(text, externals):
        return None
    return _Case(values["rpm"], text, effect_of(text))


class _Codes:
    """The templates of a cell, rendered at several speeds."""

    def __init__(self, cell: Cell, templates: Mapping[str, str]) -> None:
        self.cell, self.spindle = cell, cell.spindle
        self.taken = frozenset(taken.key for taken in cell.taken_over)
        view = {"spindle": self.spindle.model_dump()}
        if any("cell" in text for text in templates.values()):
            view["cell"] = plain_view(cell)
        most_rpm = self.spindle.max_rpm or _UNKNOWN_MAX_RPM
        self.cases: dict[str, list[_Case]] = {}
        for key, template in templates.items():
            shares = _SHARES if "rpm" in template else _SHARES[-1:]
            cases = (
                _rendered(template, {**SAMPLE, **view, "rpm": share * most_rpm}, cell.program.externals)
                for share in shares
            )
            self.cases[key] = [case for case in cases if case is not None]
        steady = texts_without_words(templates, view) if any(map(_WORD.search, templates.values())) else None
        self.by_words = set() if steady is None else templates.keys() - steady.keys()

    def of(self, m_code: str) -> list[_Case]:
        return self.cases.get(f"m_code.{m_code}", [])

    def out(self, key: str) -> str | None:
        number = getattr(self.spindle, key)
        return None if number is None else f"$OUT[{number}]"

    def severity(self, key: str, spindle_key: str, *, is_doubt: bool = False) -> Severity:
        """Return how bad it is that a template leaves out what ``[spindle]`` names.

        A file that lays a template of its own over the signals of another cell means the template.
        """
        replaced = f"spindle.{spindle_key}" in self.taken and key not in self.taken
        return "warning" if is_doubt or replaced else "error"

    @property
    def speed_output(self) -> str | None:
        number = self.spindle.speed_analog_output
        return None if number is None else f"$ANOUT[{number}]"

    def always(self, key: str) -> Iterator[Issue]:
        """Yield what no template may do: wait for ever, or set an analogue output beyond -1 to 1."""
        for case in self.cases[key]:
            effect = case.effect
            if effect.endless:
                yield _issue("error", key, f"{effect.endless} never ends: the program stands still there")
                return
            if effect.longest_wait_s > _LONG_WAIT_S:
                severity: Severity = "error" if effect.longest_wait_s > _ENDLESS_WAIT_S else "warning"
                text = f"waits {effect.longest_wait_s:g} s: WAIT SEC counts seconds"
                yield _issue(severity, key, text)
                return
            for name, signal in effect.signals.items():
                beyond = [v for v in signal.values if v is not None and abs(v) > 1.0]
                if beyond and name.startswith("$ANOUT"):
                    at = f" at S{case.rpm:g}" if len(self.cases[key]) > 1 else ""
                    yield _issue("error", key, f"sets {name} to {beyond[0]:g}{at}, allowed: -1 to 1")
                    return

    def runs(self, m_code: str) -> Iterator[Issue]:
        """Yield what M3 or M4 switches on that is not its direction, or does not switch on."""
        own_key, other_key = _RUNS[m_code]
        output, other = self.out(own_key), self.out(other_key)
        key, cases = f"m_code.{m_code}", self.of(m_code)
        for case in cases:
            effect = case.effect
            if other is not None and other != output and other in effect.driven():
                both = f"both {output} and {other}" if output in effect.driven() else other
                text = f"switches on {both}: {other} is spindle.{other_key}, the other direction"
                yield _issue("error", key, text)
                return
        for case in cases:
            effect, at = case.effect, f" at S{case.rpm:g}" if len(cases) > 1 else ""
            if effect.calls:
                return
            if output is not None:
                signal = effect.signals.get(output)
                if signal is None or not signal.surely_on:
                    perhaps = signal is not None and signal.driven
                    text = f"does not {'always ' if perhaps else ''}switch on {output}, spindle.{own_key}{at}"
                    is_doubt = bool(effect.stops) or perhaps
                    yield _issue(self.severity(key, own_key, is_doubt=is_doubt), key, text)
                    return
            elif not (any(s.driven for s in effect.signals.values()) or effect.stops or effect.waits_for):
                named = self.speed_output or self.out(other_key)
                text = f"switches nothing on{at}, and nobody else starts the spindle"
                yield _issue("error" if named else "warning", key, text)
                return

    def speed(self, m_code: str) -> Iterator[Issue]:
        """Yield where the speed output does not follow S from 0 to 1."""
        name, key, cases = self.speed_output, f"m_code.{m_code}", self.of(m_code)
        if name is None or not cases or any(case.effect.calls for case in cases):
            return
        signals = [case.effect.signals.get(name) for case in cases]
        if any(signal is None or not signal.sure for signal in signals):
            by_hand = all(case.effect.stops for case in cases)
            severity = self.severity(key, "speed_analog_output", is_doubt=by_hand)
            yield _issue(severity, key, f"does not set {name}, {_SPEED_KEY}")
            return
        levels = [next(iter(s.values)) for s in signals if s is not None and len(s.values) == 1]
        values = [float(level) for level in levels if level is not None]
        if len(values) < len(cases):
            return
        speeds = [case.rpm for case in cases]
        if 0.0 in values:
            text = f"sets {name} to 0 at S{speeds[values.index(0.0)]:g}: the spindle stands still"
            yield _issue("error", key, f"{text}, {_SPEED_KEY}")
        elif len(values) == 1 or any(abs(b) <= abs(a) for a, b in pairwise(values)):
            levels_text = ", ".join(
                f"{value:g} at S{rpm:g}" for value, rpm in zip(values, speeds, strict=True)
            )
            text = f"sets {name} to {levels_text}"
            yield _issue("error", key, f"{text}: it does not grow with S, {_SPEED_KEY}")
        elif max(map(abs, values)) > 1.0:
            return  # found in `always`
        elif m_code == "M3" and values[-1] < 0.0:
            yield _issue("warning", key, f"sets {name} below 0: M3 turns clockwise, {_SPEED_KEY}")
        elif abs(values[0] / speeds[0] / (values[-1] / speeds[-1]) - 1.0) > _UNEVEN:
            text = f"sets {name} to {values[0]:g} at S{speeds[0]:g} and {values[-1]:g} at S{speeds[-1]:g}"
            yield _issue("warning", key, f"{text}: it is not proportional to S, {_SPEED_KEY}")
        elif self.spindle.max_rpm and abs(values[-1]) < _LEAST_FULL:
            text = f"sets {name} to {values[-1]:g} at spindle.max_rpm = {speeds[-1]:g}, where it is 1"
            yield _issue("warning", key, f"{text}, {_SPEED_KEY}")

    def run_up(self, m_code: str) -> Iterator[Issue]:
        """Yield where M3 or M4 does not wait for the speed behind switching on."""
        key, spindle = f"m_code.{m_code}", self.spindle
        output = self.out(_RUNS[m_code][0])
        for case in self.of(m_code)[-1:]:
            effect = case.effect
            driven = [name for name in effect.signals if effect.signals[name].driven]
            name = output if output in driven else next(iter(driven), None)
            if name is None or effect.calls or effect.stops > effect.signals[name].event:
                return
            waited_s, levels = effect.waited_s(name), effect.waited_for(name)
            at_speed = spindle.at_speed_input
            if at_speed is not None and (at_speed, True) not in levels:
                yield self._at_speed(key, effect, name, waited_s)
            elif (
                at_speed is None
                and not levels
                and spindle.start_s >= _SHORT_WAIT_S
                and waited_s < _ENOUGH * spindle.start_s
            ):
                before = effect.wait_s >= _ENOUGH * spindle.start_s
                stated = "start_s" in spindle.model_fields_set and waited_s < 0.5 * spindle.start_s
                text = f"waits {waited_s:g} s behind switching on {name}"
                text += f", and {effect.wait_s:g} s before it" if before else ""
                text += f"; spindle.start_s = {spindle.start_s:g}"
                severity = self.severity(key, "start_s", is_doubt=not (before or stated))
                yield _issue(severity, key, text)
            speed = self.speed_output
            if speed in driven and name != speed and 0.0 == effect.waited_s(speed or "") < waited_s:
                text = f"sets {speed} behind the wait: the speed changes when the cut begins"
                yield _issue("warning", key, f"{text}, {_SPEED_KEY}")

    def _at_speed(self, key: str, effect: Effect, name: str, waited_s: float) -> Issue:
        number = self.spindle.at_speed_input or 0
        signal = f"$IN[{number}], spindle.at_speed_input"
        if (number, False) in effect.waited_for(name):
            return _issue("error", key, f"waits until {signal}, is off: until the spindle is not at speed")
        if (number, True) in effect.levels:
            return _issue(
                "error", key, f"waits for {signal}, before it switches on {name}: it waits for ever"
            )
        text = f"does not wait for {signal}"
        waits = waited_s >= _ENOUGH * self.spindle.start_s or effect.waits_for
        return _issue(self.severity(key, "at_speed_input", is_doubt=waits), key, text)

    def directions(self) -> Iterator[Issue]:
        """Yield M4 that does exactly what M3 does."""
        for cw, ccw in zip(self.of("M3"), self.of("M4"), strict=False):
            alike = statements(cw.text) == statements(ccw.text)
            if alike and cw.effect.signals and not cw.effect.stops:
                yield _issue("error", "m_code.M4", "does what M3 does: the spindle turns clockwise for both")
                return

    def stop(self) -> Iterator[Issue]:
        """Yield what M5 leaves running, and where it does not wait for the standstill."""
        at_speed = self.spindle.at_speed_input
        on, off = self.of("M3"), self.of("M5")
        if not off:
            return
        effect = off[-1].effect
        if effect.calls or effect.stops:
            return
        started = on[-1].effect if on else None
        is_analogue = started is not None and not started.driven() and not started.calls
        if started is not None and is_analogue and self.spindle.run_cw_output is None:
            for name, signal in started.signals.items():
                end = effect.signals.get(name)
                if signal.may_be_on and (end is None or not end.sure or end.may_be_on):
                    yield _issue(
                        "error", "m_code.M5", f"does not set {name} to 0, which alone runs the spindle"
                    )
                    return
        switched = [name for name in effect.signals if effect.signals[name].sure]
        if not switched:
            return
        levels = frozenset().union(*(effect.waited_for(name) for name in switched))
        waited_s = max(effect.waited_s(name) for name in switched)
        if at_speed is not None and (at_speed, True) in levels:
            text = (
                f"waits for $IN[{at_speed}], spindle.at_speed_input, with the spindle off: it waits for ever"
            )
            yield _issue("error", "m_code.M5", text)
        elif not levels and waited_s < _ENOUGH * self.spindle.stop_s:
            text = f"waits {waited_s:g} s behind switching off; spindle.stop_s = {self.spindle.stop_s:g}"
            yield _issue("warning", "m_code.M5", text)

    def coolant(self, m_code: str) -> Iterator[Issue]:
        """Yield M7 and M8 that do not switch on the output that ``[spindle]`` names."""
        own_key, other_key = _COOLANTS[m_code]
        output, other = self.out(own_key), self.out(other_key)
        for case in self.of(m_code):
            effect = case.effect
            signal = effect.signals.get(output or "")
            if output is None or effect.calls or (signal is not None and signal.surely_on):
                continue
            perhaps = signal is not None and signal.driven
            text = f"does not {'always ' if perhaps else ''}switch on {output}, spindle.{own_key}"
            text += f", but {other}, spindle.{other_key}" if other in effect.driven() else ""
            is_doubt = bool(effect.stops) or perhaps
            key = f"m_code.{m_code}"
            yield _issue(self.severity(key, own_key, is_doubt=is_doubt), key, text)
            return

    def program_stop(self) -> Iterator[Issue]:
        """Yield M0 that does not stop."""
        for case in self.of("M0"):
            effect = case.effect
            if not (effect.stops or effect.waits_for or effect.calls):
                severity: Severity = "warning" if effect.may_stop else "error"
                yield _issue(severity, "m_code.M0", "does not stop the program: M0 waits for a person")
                return

    def intruders(self) -> Iterator[Issue]:
        """Yield what else starts or stops the spindle, or leaves something on at the end."""
        spindle = frozenset().union(*(case.effect.driven() for m_code in _RUNS for case in self.of(m_code)))
        coolant = frozenset().union(
            *(case.effect.driven() for m_code in _COOLANTS for case in self.of(m_code))
        )
        for key, cases in self.cases.items():
            if key in self.by_words:
                continue
            m_code = key.removeprefix("m_code.")
            for case in cases[-1:]:
                effect = case.effect
                left_on = effect.on() & (spindle | coolant if key in _END else spindle)
                if left_on and (key in _END or key == "program.prologue"):
                    severity: Severity = "error" if key in _END else "warning"
                    yield _issue(
                        severity, key, f"switches on {_listed(left_on)}, which M3, M7 or M8 switch on"
                    )
                spindle_alone = spindle - coolant
                ends = {name for name in effect.signals if not effect.signals[name].driven}
                if key.startswith("m_code.") and m_code not in _MAY_STOP_SPINDLE and spindle_alone & ends:
                    severity = "warning" if effect.stops else "error"
                    text = f"switches off {_listed(spindle_alone & ends)}: the spindle stops in the cut"
                    yield _issue(severity, key, text)
                name = self.speed_output
                if name in effect.signals and m_code not in _RUNS and effect.signals[name or ""].may_be_on:
                    text = f"sets {name}, the speed of the spindle, {_SPEED_KEY}"
                    yield _issue("error", key, text)

    def tool_changes(self) -> Iterator[Issue]:
        """Yield a change of tools in which nobody changes them, or always to the same one."""
        tools = sorted(self.cell.tool)[:_MOST_TOOLS]
        if len(tools) < 2:
            return
        changes = tool_effects(self.cell, tools)
        silent = [tool for tool in changes if not changes[tool].effect.pauses]
        if silent:
            names = _listed(f"T{tool}" for tool in silent[:6]) + (" and others" if len(silent) > 6 else "")
            text = f"does not stop, wait or call anything for {names}: the tool before stays in the spindle"
            yield _issue("warning", "tool_change", text)
        texts = {tuple(statements(case.text)) for case in changes.values()}
        if len(changes) < 2 or silent:
            return
        for tool, case in changes.items():
            named = [int(number) for number in _NUMBER_OF_TOOL.findall(case.text)]
            if named and tool not in named and set(named) & set(tools):
                yield _issue("warning", "tool_change", f"speaks of tool {named[0]} for T{tool}")
                return
        called = [text for text in next(iter(texts)) if re.search(r"\( ?\d+ ?\)$", text)]
        if len(texts) == 1 and called:
            text = f"does the same for each tool: {called[0].lower()}"
            yield _issue("warning", "tool_change", text)


_MOST_TOOLS = 40
_SPEED_KEY = "spindle.speed_analog_output"


def _listed(names: Any) -> str:
    return ", ".join(sorted(names))


def _issue(severity: Severity, key: str, text: str) -> Issue:
    remedy = f"correct {key} in the cell file, or the key of [spindle] that it contradicts"
    return Issue(severity, "template-effect", 0, f"{key} of the cell {text}", remedy, key=key)
