"""The KRL templates of a cell, rendered in bounded time and space: a cell file may come from a stranger.

A template is Jinja2 without calls, assignments and attributes of Python objects. It sees plain values:
numbers, text, and tables of them, which it cannot change. Any text that it makes is checked by
`template_rules` before it becomes part of a program.
"""

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

import jinja2
from jinja2 import filters, nodes
from jinja2.exceptions import SecurityError
from jinja2.sandbox import ImmutableSandboxedEnvironment

MOST_CHARACTERS = 16_384
"""Longest template; the text that it becomes may be four times as long."""
MOST_OUTPUT = 4 * MOST_CHARACTERS
MOST_ROUNDS = 1000
"""Most rounds of a loop."""
MOST_TEXT = 1000
"""Longest text value of the cell: one expression of a template may repeat it a thousand times."""
_MOST_NUMBER = 1e15
_MOST_DECIMALS = 9
_FILTERS = ("abs", "int", "float", "upper", "lower", "trim", "default", "d", "length")
_ROUNDS = "_rounds"
_TESTS = ("defined", "undefined", "none", "number", "string", "odd", "even", "eq", "ne", "lt", "le", "gt",
          "ge", "in", "==", "!=", "<", "<=", ">", ">=")  # fmt: skip  # word list, kept compact
_NODES = (
    nodes.Template, nodes.Output, nodes.TemplateData, nodes.Name, nodes.Const, nodes.Getattr, nodes.Getitem,
    nodes.If, nodes.CondExpr, nodes.Compare, nodes.Operand, nodes.And, nodes.Or, nodes.Not, nodes.Add,
    nodes.Sub, nodes.Mul, nodes.Div, nodes.FloorDiv, nodes.Mod, nodes.Neg, nodes.Pos, nodes.Filter,
    nodes.Test, nodes.Tuple, nodes.List, nodes.For, nodes.Concat, nodes.Keyword,
)  # fmt: skip  # word list, kept compact
_FORMAT = re.compile(r"%(?:%|[-+ 0#]{0,5}\d{0,2}(?:\.\d{1,2})?[dfgeFGEsxX])|[^%]+")


class TemplateError(Exception):
    """A template cannot be rendered, or must not be."""


class MissingValueError(TemplateError):
    """A template needs a key that the cell does not state; ``key`` names it."""

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__(f"{key} is not stated in the " + ("cell" if "." in key else "block of G-code"))


class _Table(Mapping[str, Any]):
    """A table of the cell as a template sees it: reading by name, and nothing else."""

    __slots__ = ("_values", "name")

    def __init__(self, values: Mapping[Any, Any], name: str) -> None:
        self._values, self.name = {str(key): value for key, value in values.items()}, name

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __str__(self) -> str:
        raise TemplateError(f"{self.name} is a table, not a value")


class _Missing(jinja2.Undefined):
    """A key that the cell does not state: false in a condition, an error wherever a value is needed."""

    def __str__(self) -> str:
        raise MissingValueError(str(self._undefined_name))

    def __iter__(self) -> Iterator[Any]:
        raise MissingValueError(str(self._undefined_name))

    def __len__(self) -> int:
        raise MissingValueError(str(self._undefined_name))

    def __eq__(self, other: object) -> bool:
        raise MissingValueError(str(self._undefined_name))

    __hash__ = jinja2.Undefined.__hash__


class _Environment(ImmutableSandboxedEnvironment):
    """Jinja2 with plain values only."""

    intercepted_binops = frozenset(["+", "-", "*", "/", "//", "%", "**"])

    def getattr(self, obj: Any, attribute: str) -> Any:
        return self._item(obj, attribute)

    def getitem(self, obj: Any, argument: Any) -> Any:
        return self._item(obj, argument)

    def _item(self, obj: Any, key: Any) -> Any:
        if isinstance(obj, _Missing):
            raise MissingValueError(str(obj._undefined_name))
        if isinstance(obj, _Table):
            name = f"{obj.name}.{key}"
            if str(key) not in obj:
                raise TemplateError(f"there is no {name[:80]}")
            value = obj[str(key)]
            if isinstance(value, Mapping):
                return _Table(value, name)
            if value is None:
                return _Missing(name=name, exc=jinja2.UndefinedError)
            return _short(name, value) if isinstance(value, str) else value
        if isinstance(obj, tuple) and isinstance(key, int) and -len(obj) <= key < len(obj):
            return obj[key]
        raise SecurityError(f"a plain value has no {str(key)[:40]!r}")

    def call_binop(self, context: Any, operator: str, left: Any, right: Any) -> Any:
        for side in (left, right):
            if isinstance(side, _Missing):
                raise MissingValueError(str(side._undefined_name))
        if operator == "%" and isinstance(left, str):
            return _formatted(left, right)
        if operator == "+" and isinstance(left, str) and isinstance(right, str):
            return left + right
        if not (_is_number(left) and _is_number(right)):
            raise TemplateError(f"{operator} is for numbers")
        result = super().call_binop(context, operator, left, right)
        if not abs(result) <= _MOST_NUMBER:
            raise TemplateError("a number that is too large")
        return result


def render(template: str, values: Mapping[str, Any]) -> str:
    """Return a template as text, with ``values`` (numbers, text, tables of them).

    Raises `MissingValueError` where a needed key is None, `TemplateError` for any other mistake.
    """
    if "{" not in template and "\r" not in template and len(template) <= MOST_CHARACTERS:
        return template.strip("\n")  # as Jinja2 has it: half of a cell's templates are a word such as HALT
    try:
        compiled = _compiled(template)
        used = {key: _plain(key, value) for key, value in values.items()}
        text = ""
        for piece in compiled.generate(used):
            text += piece
            if len(text) > MOST_OUTPUT:
                raise TemplateError(f"becomes more than {MOST_OUTPUT // 1024} KiB")
    except TemplateError:
        raise
    except jinja2.UndefinedError as error:
        raise _undefined(error) from None
    except Exception as error:  # a template is a user's program: whatever it raises is a finding
        raise TemplateError(_brief(str(error) or type(error).__name__)) from None
    return text.strip("\n")


def uses_cell(template: str) -> bool:
    """Tell whether a template may look at the whole cell."""
    return "cell" in template


def _undefined(error: jinja2.UndefinedError) -> TemplateError:
    text = str(error)
    missing = re.match(r"'((?:cell|spindle)\.[\w.]+)' is undefined", text)
    return MissingValueError(missing.group(1)) if missing else TemplateError(_brief(text))


def _brief(text: str) -> str:
    return " ".join(text.split())[:160]


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        return _Table(value, name)
    if value is None:
        return _Missing(name=name)
    if isinstance(value, str):
        return _short(name, value)
    if isinstance(value, int | float):
        return value
    raise TemplateError(f"{name} is not a plain value")


def _short(name: str, value: str) -> str:
    if len(value) > MOST_TEXT:
        raise TemplateError(f"{name[:80]} is longer than {MOST_TEXT} characters")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _formatted(pattern: str, values: Any) -> str:
    """Return ``pattern % values``; widths of three digits and more would fill the memory."""
    if "".join(match[0] for match in _FORMAT.finditer(pattern)) != pattern:
        raise TemplateError(f"format {pattern[:20]!r} is not one of %d, %.3f, %g, %s")
    given = values if isinstance(values, tuple) else (values,)
    if not all(isinstance(value, str | int | float) for value in given):
        raise TemplateError("only numbers and text can be formatted")
    return pattern % given


def _rounds(values: Any) -> Any:
    """Return the values that a loop runs over, if they are few enough; every loop calls this."""
    if isinstance(values, range | tuple | list | str | _Table) and len(values) > MOST_ROUNDS:
        raise TemplateError(f"a loop of more than {MOST_ROUNDS} rounds")
    return values


def _round(value: Any, precision: Any = 0, method: Any = "common") -> Any:
    """Round as Jinja2 does, with few decimals: Jinja2 itself would compute 10 to any power."""
    if not (isinstance(precision, int) and abs(precision) <= _MOST_DECIMALS):
        raise TemplateError(f"round: allowed -{_MOST_DECIMALS} to {_MOST_DECIMALS} decimals")
    return filters.do_round(value, precision, method)


@lru_cache(maxsize=256)
def _compiled(text: str) -> jinja2.Template:
    if len(text) > MOST_CHARACTERS:
        raise TemplateError(f"is longer than {MOST_CHARACTERS} characters")
    environment = _environment()
    tree = environment.parse(text)
    _refuse_more(tree, 0)
    for loop in list(tree.find_all(nodes.For)):
        loop.iter = nodes.Filter(loop.iter, _ROUNDS, [], [], None, None)
    return environment.from_string(tree)


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    environment = _Environment(
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
        optimized=False,
        finalize=_final,
    )
    environment.globals = {"range": range}
    environment.filters = {name: environment.filters[name] for name in _FILTERS}
    environment.filters |= {"decimals": _decimals, "round": _round, _ROUNDS: _rounds}
    environment.tests = {name: environment.tests[name] for name in _TESTS}
    environment.tests["none"] = lambda value: value is None or isinstance(value, _Missing)
    return environment


def _final(value: Any) -> Any:
    """Refuse what a person cannot have meant to write into a program."""
    if isinstance(value, _Missing):
        raise MissingValueError(str(value._undefined_name))
    if isinstance(value, jinja2.Undefined):
        return value
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise TemplateError(f"{type(value).__name__.strip('_').lower()} is not a text or number")
    if isinstance(value, float) and not abs(value) <= _MOST_NUMBER:
        raise TemplateError("a number that is too large")
    return value


def _decimals(value: float, count: int) -> str:
    if not 0 <= count <= _MOST_DECIMALS:
        raise TemplateError(f"decimals: allowed 0 to {_MOST_DECIMALS}")
    return f"{float(value):.{int(count)}f}"


def _refuse_more(node: nodes.Node, depth: int, loops: int = 0) -> None:
    """Raise where a template uses a part of Jinja2 that is not allowed here; walks the syntax tree."""
    if depth > 100:
        raise TemplateError("nested too deeply")
    if isinstance(node, nodes.Call):
        named = isinstance(node.node, nodes.Name) and node.node.name == "range"
        if not named or node.dyn_args is not None or node.dyn_kwargs is not None or node.kwargs:
            raise TemplateError("calls are not allowed in templates")
    elif not isinstance(node, _NODES):
        raise TemplateError(f"{type(node).__name__.lower()} is not allowed in templates")
    if isinstance(node, nodes.For):
        loops += 1
        if loops > 1 or node.recursive:
            raise TemplateError("a loop in a loop is not allowed in templates")
    for child in node.iter_child_nodes():
        _refuse_more(child, depth + 1, loops)
