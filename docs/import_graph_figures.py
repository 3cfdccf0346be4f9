"""Figures of source files: lines, functions, constants, and how many ways lead through a function."""

import ast
import re
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import StringIO

CONSTANT = re.compile(r"_{0,2}[A-Z][A-Z0-9_]*(?:_[A-Za-z0-9]+)*")
"""Capitals, with a unit behind an underline (``LONGEST_mm``)."""
ARRAYS = ("Floats", "Ints", "Bools")
_LAYOUT = (tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
_NO_CODE = (tokenize.COMMENT, *_LAYOUT)
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Complex:
    """A function and the ways through it."""

    name: str
    line: int
    complexity: int


@dataclass(frozen=True)
class Figures:
    """Counts of one file, or of several."""

    files: int = 0
    lines: int = 0
    code_lines: int = 0
    """Without blank lines, comments and docstrings."""
    functions: int = 0
    """Methods and inner functions too."""
    classes: int = 0
    constants: int = 0
    """Names in capitals that a module's body assigns."""
    fmt_skips: int = 0
    module_named: int = 0
    """Functions with the name of their module."""
    array_names: int = 0
    """Definitions of `Floats`, `Ints` or `Bools`."""

    def __add__(self, other: "Figures") -> "Figures":
        return Figures(**{name: value + getattr(other, name) for name, value in vars(self).items()})


def figures(text: str, tree: ast.Module, module_name: str) -> Figures:
    """Return the counts of one file."""
    nodes = list(ast.walk(tree))
    plain = module_name.rpartition(".")[2]
    assigned = list(_assigned(tree))
    return Figures(
        files=1,
        lines=len(text.splitlines()),
        code_lines=len(_code_lines(text) - _docstring_lines(nodes)),
        functions=sum(isinstance(node, Function) for node in nodes),
        classes=sum(isinstance(node, ast.ClassDef) for node in nodes),
        constants=sum(CONSTANT.fullmatch(name) is not None and len(name) > 1 for name, _ in assigned),
        fmt_skips=text.count("# fmt: skip"),
        module_named=sum(isinstance(node, Function) and node.name == plain for node in tree.body),
        array_names=sum(name in ARRAYS and "NDArray" in ast.unparse(value) for name, value in assigned),
    )


def _assigned(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield the plain names that the body of a module assigns, with their values."""
    for node in tree.body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from ((name.id, node.value) for name in names if isinstance(name, ast.Name))
        elif isinstance(node, ast.AnnAssign) and node.value is not None and isinstance(node.target, ast.Name):
            yield node.target.id, node.value


def _code_lines(text: str) -> set[int]:
    """Return the numbers of lines that hold more than a comment."""
    found: set[int] = set()
    for token in tokenize.generate_tokens(StringIO(text).readline):
        if token.type not in _NO_CODE:
            found.update(range(token.start[0], token.end[0] + 1))
    return found


def _docstring_lines(nodes: Iterable[ast.AST]) -> set[int]:
    """Return the numbers of lines of strings that stand alone: docstrings, and those below an attribute."""
    found: set[int] = set()
    for node in nodes:
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def complexities(tree: ast.Module) -> list[Complex]:
    """Return the functions of a module and of its classes; an inner function counts in the one around it."""
    return list(_functions(tree, ""))


def _functions(node: ast.AST, prefix: str) -> Iterator[Complex]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function):
            yield Complex(prefix + child.name, child.lineno, complexity(child))
        elif isinstance(child, ast.ClassDef):
            yield from _functions(child, f"{prefix}{child.name}.")
        else:
            yield from _functions(child, prefix)


def complexity(function: ast.AST) -> int:
    """Return the cyclomatic number (McCabe 1976), boolean operators and comprehensions counted as branches.

    One way, and one more for each condition that may turn aside: ``if``, ``elif``, ternary, loop, its
    ``else``, ``except``, ``case``, ``assert``, ``and``/``or``, a comprehension and each of its ``if``. An
    inner function adds its own. This is the count of the tool radon.
    """
    return 1 + sum(_branches(node) for node in ast.walk(function) if node is not function)


def _branches(node: ast.AST) -> int:
    match node:
        case ast.If() | ast.IfExp() | ast.Assert() | ast.FunctionDef() | ast.AsyncFunctionDef():
            return 1
        case ast.For() | ast.AsyncFor() | ast.While():
            return 1 + bool(node.orelse)
        case ast.Try() | ast.TryStar():
            return len(node.handlers) + bool(node.orelse)
        case ast.BoolOp():
            return len(node.values) - 1
        case ast.comprehension():
            return 1 + len(node.ifs)
        case ast.Match():
            return len(node.cases) - any(_is_default(case) for case in node.cases)
    return 0


def _is_default(case: ast.match_case) -> bool:
    return isinstance(case.pattern, ast.MatchAs) and case.pattern.pattern is None and case.guard is None
