"""The modules of a package and what each imports of it, read from the source; nothing is imported.

An import is a pair of modules, however many names it takes. It happens at import (in the body of the
module), in a function (when that is called), or for types alone (under ``if TYPE_CHECKING``).
"""

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

When = Literal["import", "function", "types"]
Graph = Mapping[str, set[str]]
TIMES: tuple[When, ...] = ("import", "function", "types")
"""The earliest first."""


@dataclass(frozen=True)
class Module:
    """One source file."""

    name: str
    """Dotted, of a package that of its folder."""
    path: Path
    text: str
    tree: ast.Module

    @property
    def is_package(self) -> bool:
        """Tell whether this is the ``__init__`` of a folder."""
        return self.path.name == "__init__.py"


@dataclass(frozen=True)
class Import:
    """One module that imports another of the same package."""

    importer: str
    imported: str
    when: When


def modules_of(package: Path) -> dict[str, Module]:
    """Return all modules below a package's folder, by name. Raises ValueError where there is no package."""
    if not (package / "__init__.py").exists():
        raise ValueError(f"{package} is no package: it has no __init__.py")
    modules = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = file.read_text(encoding="utf-8")
        modules[name] = Module(name, file, text, ast.parse(text, str(file)))
    return modules


def imports_of(modules: Mapping[str, Module]) -> list[Import]:
    """Return every import between the modules once, as the earliest of the times when it happens."""
    found: dict[tuple[str, str], When] = {}
    for module in modules.values():
        for imported, when in _imported(module, modules):
            pair = (module.name, imported)
            if imported != module.name:
                found[pair] = min(when, found.get(pair, when), key=TIMES.index)
    return [Import(*pair, when) for pair, when in sorted(found.items())]


def _imported(module: Module, modules: Mapping[str, Module]) -> Iterator[tuple[str, When]]:
    for node, when in _walk(module.tree, "import"):
        for name in _names(node, module):
            target = _longest(name, modules)
            if target is not None:
                yield target, when


def _walk(node: ast.AST, when: When) -> Iterator[tuple[ast.AST, When]]:
    """Yield every node below one, and when it is run."""
    for child in ast.iter_child_nodes(node):
        inner = _when(node, child, when)
        yield child, inner
        yield from _walk(child, inner)


def _when(node: ast.AST, child: ast.AST, when: When) -> When:
    """Return when a child is run that stands in a node that is run at this time."""
    if isinstance(node, ast.If) and child in node.body and _is_type_checking(node.test):
        return "types"
    in_body = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and child in node.body
    return "function" if in_body or isinstance(node, ast.Lambda) else when


def _is_type_checking(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else getattr(test, "id", "")
    return name == "TYPE_CHECKING"


def _names(node: ast.AST, module: Module) -> Iterator[str]:
    """Yield the dotted names that a statement may mean as modules, ``package.name`` for each name taken."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = _base(node, module)
        yield from (f"{base}.{alias.name}" if base else alias.name for alias in node.names)
    elif isinstance(node, ast.Call) and _is_import_module(node.func) and node.args:
        first = node.args[0]
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            yield first.value


def _base(node: ast.ImportFrom, module: Module) -> str:
    """Return the absolute name behind ``from``; one dot is the module's own package."""
    if not node.level:
        return node.module or ""
    parts = module.name.split(".")
    up = node.level - 1 if module.is_package else node.level
    return ".".join([*parts[: len(parts) - up], *([node.module] if node.module else [])])


def _is_import_module(function: ast.expr) -> bool:
    return getattr(function, "attr", getattr(function, "id", "")) == "import_module"


def _longest(name: str, modules: Mapping[str, Module]) -> str | None:
    """Return the module that a dotted name begins with: a module's own name stands in its place."""
    while name and name not in modules:
        name = name.rpartition(".")[0]
    return name or None


# rooms, cycles, floors --------------------------------------------------------------------------------------


def room_of(name: str, root: str) -> str | None:
    """Return the first word behind a root that a module stands in; the root's own is ``__init__``."""
    if name == root:
        return "__init__"
    return name[len(root) + 1 :].partition(".")[0] if name.startswith(f"{root}.") else None


def graph_of(pairs: Iterable[tuple[str, str]], nodes: Iterable[str] = ()) -> dict[str, set[str]]:
    """Return who imports whom, as sets; each node is a key."""
    graph: dict[str, set[str]] = defaultdict(set, {node: set() for node in nodes})
    for importer, imported in pairs:
        graph[importer].add(imported)
        graph[imported] |= set()
    return dict(graph)


def components(graph: Graph) -> list[list[str]]:
    """Return the strongly connected components, each after those that it reaches (Tarjan 1972)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        number[node] = low[node] = len(number)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in number:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], number[other])
        if low[node] == number[node]:
            at = stack.index(node)
            found.append(sorted(stack[at:]))
            del stack[at:]

    for node in sorted(graph):
        if node not in number:
            visit(node)
    return found


def cycles(graph: Graph) -> list[list[str]]:
    """Return the sets of nodes that reach each other."""
    return [component for component in components(graph) if len(component) > 1]


def loops(graph: Graph, knot: list[str]) -> list[list[str]]:
    """Return the simple cycles within one set of `cycles`, each from its first name on.

    Their number grows quickly with the size of a knot; this is meant for small ones.
    """
    found: list[list[str]] = []

    def follow(path: list[str]) -> None:
        for other in sorted(graph[path[-1]] & set(knot)):
            if other == path[0]:
                found.append(path)
            elif other > path[0] and other not in path:
                follow([*path, other])

    for start in sorted(knot):
        follow([start])
    return found


def floors(graph: Graph) -> dict[str, int]:
    """Return the floor of each node: 0 imports nothing, others stand one above the highest they import.

    Nodes of one cycle share a floor.
    """
    floor: dict[str, int] = {}
    for component in components(graph):
        below = {other for node in component for other in graph[node]} - set(component)
        height = 1 + max((floor[other] for other in below), default=-1)
        floor |= dict.fromkeys(component, height)
    return floor
