"""What the M-codes of a cell switch, read back from its rendered templates: pairs, and double meanings."""

from collections.abc import Iterator, Mapping
from typing import Any

from gcode2krl.cell.krl_effect import Effect, effect_of
from gcode2krl.cell.template_rules import problem, statements
from gcode2krl.cell.templates import MissingValueError, TemplateError, render
from gcode2krl.errors import Issue, Severity

_OTHER_SPEEDS = (0.0, 1.0, 100.0, 5000.0, 20000.0, 1e6)
"""Spindle speeds in rpm: what a template switches may depend on the speed."""
SAMPLE = {"rpm": 1000.0, "p": 1.0, "q": 1.0, "e": 1.0, "text": "text", "line": 1, "tool": 1, "m": 0}
WORDS = ("p", "q", "e")
"""What a template gets of the words of a block that only a program has."""
_OFF = {"M3": "M5", "M4": "M5", "M7": "M9", "M8": "M9"}
"""Which M-code switches off what another switches on."""
_SPINDLE, _COOLANT = ("M3", "M4"), ("M7", "M8")


def template_issue(key: str, what: str) -> Issue:
    """Return the finding on a template of the cell; ``key`` names it: ``m_code.M8``."""
    text = f"{key} of the cell: {what}"
    return Issue("error", "template", 0, text, f"correct {key} in the cell file", key=key)


def rendered(templates: Mapping[str, str], view: Mapping[str, Any]) -> dict[str, str]:
    """Return key → KRL of the templates, with sample values; what cannot be rendered is left out."""
    texts = {}
    for key, template in templates.items():
        try:
            texts[key] = render(template, {**SAMPLE, **view})
        except TemplateError:
            continue
    return texts


def texts_without_words(templates: Mapping[str, str], view: Mapping[str, Any]) -> dict[str, str]:
    """Return key → KRL of the templates whose outputs do not depend on the words of a block."""
    texts, others = rendered(templates, view), rendered(templates, {**view, **dict.fromkeys(WORDS, 7919.0)})
    return {
        key: text
        for key, text in texts.items()
        if effect_of(text).signals.keys() == effect_of(others.get(key, text)).signals.keys()
    }


def rendered_widely(templates: Mapping[str, str], view: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return key → KRL at several spindle speeds, with and without the optional words of a block."""
    texts: dict[str, list[str]] = {}
    others: list[dict[str, Any]] = [
        {},
        {"p": None, "q": None, "e": None},
        {"text": ""},
        {"line": 0},
        {"line": 10**6},
    ]
    others += [{"rpm": rpm} for rpm in _OTHER_SPEEDS]
    for other in others:
        named = {  # what does not name the word says the same again
            key: text for key, text in templates.items() if not other or any(word in text for word in other)
        }
        for key, text in rendered(named, {**view, **other}).items():
            texts.setdefault(key, []).append(text)
    return texts


def template_issues(
    templates: Mapping[str, str], view: Mapping[str, Any], externals: tuple[str, ...]
) -> Iterator[Issue]:
    """Yield what is wrong with each template, rendered with sample values."""
    for key, template in templates.items():
        try:
            what = problem(render(template, {**SAMPLE, **view}), externals)
        except MissingValueError:
            continue  # missing, not wrong: reported where the program needs it
        except TemplateError as error:
            what = str(error)
        if what:
            yield template_issue(key, what)


def pair_issues(templates: Mapping[str, str], view: Mapping[str, Any]) -> Iterator[Issue]:
    """Yield the outputs that one M-code switches on and its partner does not switch off.

    It is a warning where the partner calls a subprogram, whose effect is not read. For an output that is
    switched under a condition the worse case counts.
    """
    texts = rendered_widely(templates, view) if any(f"m_code.{on}" in templates for on in _OFF) else {}
    for on, off in _OFF.items():
        on_key, off_key = f"m_code.{on}", f"m_code.{off}"
        if on_key not in templates:
            continue
        if off_key not in templates:
            yield _pair(off_key, f"{on_key} without {off_key}: nothing switches off what {on} switches on")
        elif off_key in texts and not all(map(statements, texts[off_key])):
            yield _pair(off_key, f"{off_key} is empty: nothing switches off what {on} switches on")
        elif on_key in texts and off_key in texts:
            ends = [effect_of(text) for text in texts[off_key]]
            switched_on = frozenset().union(*(effect_of(text).on() for text in texts[on_key]))
            left_on = switched_on - frozenset.intersection(*(end.off() for end in ends))
            if left_on:
                names, called = ", ".join(sorted(left_on)), ends[0].calls
                text = f"{on_key} switches on {names}, which {off_key} does not switch off"
                if called:
                    text += f", unless {called[0]} does"
                yield _pair(off_key, text, "warning" if called else "error")


def meaning_issues(
    texts: Mapping[str, str], named: Mapping[str, int | None], inputs: Mapping[str, int | None]
) -> Iterator[Issue]:
    """Yield outputs and inputs with two meanings, one finding for each of them.

    ``named`` holds the outputs that keys of the cell name, ``inputs`` the inputs.
    """
    seen: set[str] = set()
    for issue in _meanings(texts, named, inputs):
        signal = issue.message.split()[0]
        if signal not in seen:
            seen.add(signal)
            yield issue


def _meanings(
    texts: Mapping[str, str], named: Mapping[str, int | None], inputs: Mapping[str, int | None]
) -> Iterator[Issue]:
    yield from _same_number(named, "$OUT", _may_share)
    yield from _same_number(inputs, "$IN", lambda a, b: False)
    yield from _of_spindle_or_coolant(texts)
    yield from _of_online(texts, named)


def _of_spindle_or_coolant(texts: Mapping[str, str]) -> Iterator[Issue]:
    """Yield the signals of spindle or coolant that something else switches on as well."""
    on = {key: effect_of(text).driven() for key, text in texts.items()}
    spindle = _union(on, _SPINDLE)
    coolant = _union(on, _COOLANT)
    for signal in sorted(spindle | coolant):
        others = [
            key
            for key, signals in on.items()
            if signal in signals
            and (key == "tool_change" or (key.startswith("m_code.") and not _is_of(key, _SPINDLE, _COOLANT)))
        ]
        if signal in spindle and signal in coolant:
            yield _two_meanings(signal, "the spindle (m_code.M3, M4)", "the coolant (m_code.M7, M8)")
        elif others and (signal in spindle or "tool_change" in others):
            what = "the spindle (m_code.M3, M4)" if signal in spindle else "the coolant (m_code.M7, M8)"
            yield _two_meanings(signal, what, others[0])


def _of_online(texts: Mapping[str, str], named: Mapping[str, int | None]) -> Iterator[Issue]:
    """Yield the outputs of the online compensation that a template switches."""
    for key, number in named.items():
        if number is None or not key.startswith("online."):
            continue
        signal = f"$OUT[{number}]"
        for user, text in texts.items():
            if signal in effect_of(text).signals:
                yield _two_meanings(signal, key, user)


def signals_text(texts: Mapping[str, str], key: str) -> str:
    """Return what a template switches as a person reads it: ``$OUT[1] on, $OUT[2] off``."""
    text = texts.get(key, "")
    effect = effect_of(text)
    words = [_signal_text(effect, name) for name in effect.digital()]
    words += [line for line in statements(text) if line.startswith("$ANOUT")]
    words += [f"calls {name}" for name in effect.calls]
    return ", ".join(words)


def _signal_text(effect: Effect, name: str) -> str:
    signal = effect.signals[name]
    if signal.pulsed:
        return f"{name} pulsed"
    is_certain = signal.sure and len(signal.values) == 1 and None not in signal.values
    return f"{name} {'on' if signal.may_be_on else 'off'}{'' if is_certain else ' (perhaps)'}"


def _is_of(key: str, *groups: tuple[str, ...]) -> bool:
    return any(key.removeprefix("m_code.") in group for group in groups)


def _union(on: Mapping[str, frozenset[str]], codes: tuple[str, ...]) -> frozenset[str]:
    return frozenset().union(*(on.get(f"m_code.{code}", frozenset()) for code in codes))


def _may_share(first: str, second: str) -> bool:
    """Flood and mist may share one valve; any other shared signal is a mistake."""
    return {first, second} == {"spindle.flood_output", "spindle.mist_output"}


def _same_number(named: Mapping[str, int | None], what: str, may_share: Any) -> Iterator[Issue]:
    users: dict[int, str] = {}
    for key, number in named.items():
        if number is None:
            continue
        first = users.setdefault(number, key)
        if first != key and not may_share(first, key):
            yield _two_meanings(f"{what}[{number}]", first, key)


def _pair(key: str, text: str, severity: Severity = "error") -> Issue:
    remedy = f"give {key} in the cell file, so that it switches all of them off"
    return Issue(severity, "cell-pair", 0, text, remedy, key=key)


def _two_meanings(signal: str, first: str, second: str) -> Issue:
    text = f"{signal} has two meanings: {first}, and {second}"
    key = second.partition(" ")[0]  # "guard_inputs (door closed)": the list
    return Issue("error", "signal-twice", 0, text, f"give {second} a signal of its own", key=key)
