"""How many faults that a script plants in the package and in the core do the tests notice?

    python benchmarks/planted_faults.py --count 200                      # all over the package and the core
    python benchmarks/planted_faults.py --count 20 --area gcode2krl/krl  # of one area
    python benchmarks/planted_faults.py --count 20 --area native/gcode --tests tests/gcode

A fault is one small change: an operator, a constant, a sign, an index, a branch never taken. It is drawn
with a seed and planted in a copy of the tree. Then the tests run that import the module, the nearest
first, and the golden programs, or those that ``--tests`` names; the first that fails, or hangs, has
noticed it. The suite must pass without a fault. Some faults change nothing that can be seen, so that no
suite notices all: what counts is the same seed before and after a change of the tests.

``--covered`` asks the whole suite at less cost: it names what a run of the suite has written with
``pytest --cov=gcode2krl --cov-context=test`` (pytest-cov). Of a fault in a Python function those tests run
that execute its line, since no other can notice it; of one elsewhere in a module those that run a function
of it.
"""

import argparse
import ast
import importlib.util
import io
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
OTHER = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
}
OF_WORDS = {"and": "or", "or": "and", "&&": "||", "||": "&&", "min": "max", "max": "min", "True": "False"}
C_TOKEN = re.compile(r"[A-Za-z_]\w*|\d[\w.]*|&&|\|\||[<>=!]=|[-+*/<>](?![-+=<>])|\S")
C_APART = re.compile(
    r'/\*.*?\*/|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'|^[ \t]*#.*?$|->|\+\+|--|<<|>>', re.DOTALL | re.MULTILINE
)
LONGEST_S = 7200.0
HANGS_S = 150.0
"""A test of the README's suite that takes so long hangs: the longest takes some 20 s."""


class Fault(NamedTuple):
    """A change of a file: the text from ``start`` to ``stop`` becomes ``new``."""

    file: Path
    kind: str
    start: int
    stop: int
    new: str

    def planted(self, text: str) -> str:
        return text[: self.start] + self.new + text[self.stop :]

    def __str__(self) -> str:
        text = (ROOT / self.file).read_text(encoding="utf-8")
        line = text.count("\n", 0, self.start) + 1
        change = f"{text[self.start : self.stop][:40]!r} -> {self.new[:40]!r}"
        return f"{self.file.as_posix()}:{line} {self.kind}: {change}"


def faults_of(file: Path) -> list[Fault]:
    """Return every fault that can be planted in a file."""
    text = (ROOT / file).read_text(encoding="utf-8")
    found = _in_python(text) if file.suffix == ".py" else _in_c(text)
    return [Fault(file, *each) for each in found]


def _of_token(token: str) -> tuple[str, str] | None:
    """Return kind and replacement of a token, None for what stays."""
    if token in OTHER:
        return "operator", OTHER[token]
    if token in OF_WORDS:
        return "operator", OF_WORDS[token]
    if re.fullmatch(r"\d+", token):
        return "constant", str(int(token) + 1)
    if re.fullmatch(r"\d+\.\d*(e-?\d+)?|\d+e-?\d+", token):
        return "constant", repr(float(token) * 1.25 if float(token) else 1.0)
    return None


def _in_python(text: str) -> Iterator[tuple[str, int, int, str]]:
    begins = [0]
    for line in text.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))
    tree = ast.parse(text)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    quiet = {line for node in imports for line in range(node.lineno, node.end_lineno + 1)}
    plain = text.encode("utf-8").isascii()

    def place(line: int, column: int) -> int:
        if not plain:  # columns of a tree count bytes
            column = len(text[begins[line - 1] : begins[line]].encode("utf-8")[:column].decode("utf-8"))
        return begins[line - 1] + column

    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        change = (
            _of_token(token.string) if token.type in (tokenize.OP, tokenize.NUMBER, tokenize.NAME) else None
        )
        if change and token.start[0] not in quiet:
            start = begins[token.start[0] - 1] + token.start[1]
            yield change[0], start, start + len(token.string), change[1]
    for node in ast.walk(tree):
        if isinstance(node, ast.If | ast.IfExp) and not isinstance(node.test, ast.Constant):
            test = node.test
            yield (
                "branch",
                place(test.lineno, test.col_offset),
                place(test.end_lineno, test.end_col_offset),
                "False",
            )
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            start = place(node.lineno, node.col_offset)
            yield "sign", start, start + (1 if isinstance(node.op, ast.USub) else 3), ""
        elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice) and node.slice.lower:
            start = place(node.slice.lower.lineno, node.slice.lower.col_offset)
            yield "index", start, start, "1 + "


def _in_c(text: str) -> Iterator[tuple[str, int, int, str]]:
    code = C_APART.sub(lambda apart: " " * len(apart[0]), text)
    inside = code.find("{")
    for token in C_TOKEN.finditer(code, max(inside, 0)):
        change = _of_token(token[0])
        if token[0] == "*" and not code[token.end()].isspace():
            change = None  # a pointer
        if change:
            number = change[1] + ("LL" if token[0].endswith("L") else "")
            yield change[0], token.start(), token.end(), number
    for test in re.finditer(r"\bif \(", code):
        yield "branch", test.end(), test.end(), "0 && "


def drawn(areas: list[str], count: int, seed: int) -> list[Fault]:
    """Return faults of the files below the areas."""
    files = [
        path.relative_to(ROOT)
        for area in areas
        for path in sorted([ROOT / area] if (ROOT / area).is_file() else (ROOT / area).rglob("*"))
        if path.suffix in (".py", ".c") and path.name not in ("build.py", "constants.py")
    ]
    chosen = random.Random(seed)
    every = [fault for file in files for fault in faults_of(file)]
    return chosen.sample(every, min(count, len(every)))


def tests_of(file: Path) -> list[str]:
    """Return the test files that import a module, behind them those of its area and the golden programs."""
    area = file.parts[1].removesuffix(".py")
    near = sorted((ROOT / "tests" / area).rglob("test_*.py")) or sorted(
        (ROOT / "tests").glob(f"test_*{area}*.py")
    )
    module = ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    package, _, name = module.rpartition(".")
    asks = re.compile(rf"from {re.escape(package)} import [^\n]*\b{name}\b|{re.escape(module)}\b")
    every = sorted((ROOT / "tests").rglob("test_*.py"))
    direct = (
        [path for path in every if asks.search(path.read_text(encoding="utf-8"))]
        if file.suffix == ".py"
        else []
    )
    golden = sorted((ROOT / "tests" / "golden").glob("test_*.py"))
    chosen = dict.fromkeys([*direct, *near, *golden] if direct or near else every)
    return [path.relative_to(ROOT).as_posix() for path in chosen]


class Covered:
    """The tests that execute each line of the package, as a run under coverage has written them."""

    def __init__(self, file: Path) -> None:
        from coverage import CoverageData

        self.data = CoverageData(basename=str(file))
        self.data.read()
        self.names = {
            str(Path(name).relative_to(_package_above(name))): name for name in self.data.measured_files()
        }

    def tests_of(self, fault: Fault) -> list[str]:
        """Return the tests that can notice a fault, the nearest first; of C those of its area."""
        name = self.names.get(str(fault.file))
        if name is None:
            return tests_of(fault.file)
        text = (ROOT / fault.file).read_text(encoding="utf-8")
        line = text.count("\n", 0, fault.start) + 1
        inside = [
            range(node.body[0].lineno, node.end_lineno + 1)
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.FunctionDef)
        ]
        lines = {line} if any(line in body for body in inside) else {at for body in inside for at in body}
        by_line = self.data.contexts_by_lineno(name)
        tests = {context.rpartition("|")[0] for at in lines & set(by_line) for context in by_line[at]} - {""}
        order = {file: place for place, file in enumerate(tests_of(fault.file))}
        golden = [file for file in order if file.startswith("tests/golden/")]
        nearest = sorted(tests, key=lambda test: (order.get(test.partition("::")[0], len(order)), test))
        return list(dict.fromkeys([*nearest, *golden]))


def _package_above(name: str) -> Path:
    """Return the folder that holds the package in which a measured file lies."""
    return next(folder.parent for folder in reversed(Path(name).parents) if folder.name == "gcode2krl")


def notices(copy: Path, fault: Fault, tests: list[str], *, slow: bool) -> bool:
    """Tell whether the tests fail with a fault planted in the copy, and pass without it."""
    target = copy / fault.file
    sound = target.read_text(encoding="utf-8")
    try:
        target.write_text(fault.planted(sound), encoding="utf-8", newline="\n")
        if fault.file.suffix == ".c":
            return not _build(copy) or _failed(copy, tests, slow) is not None
        while (failed := _failed(copy, tests, slow)) and "::" in failed:
            target.write_text(sound, encoding="utf-8", newline="\n")
            if _failed(copy, [failed], slow) is None:
                break
            tests = [
                test for test in tests if test not in (failed, failed.partition("::")[0])
            ]  # not for the fault
            target.write_text(fault.planted(sound), encoding="utf-8", newline="\n")
        return failed is not None
    except subprocess.TimeoutExpired:
        return True
    finally:
        target.write_text(sound, encoding="utf-8", newline="\n")


def _failed(copy: Path, tests: list[str], slow: bool) -> str | None:
    """Run tests until one fails; return its name, "" where none could be collected, None where all pass."""
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "GCODE2KRL_CORE": "plain",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    (copy / "asked.txt").write_text("\n".join(tests), encoding="utf-8")  # too many for a command line
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", "@asked.txt"]
    command += (
        ["-m", "slow or not slow"] if slow else ["--timeout", str(HANGS_S), "--timeout-method", "thread"]
    )
    done = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=LONGEST_S
    )
    if done.returncode in (0, 5):  # 5: no test was chosen
        return None
    if done.returncode == 4 and any(
        "::" in test for test in tests
    ):  # a module that fails has no test by name
        return _failed(copy, list(dict.fromkeys(test.partition("::")[0] for test in tests)), slow)
    name = re.search(r"^(?:FAILED|ERROR) (\S+::.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return name[1] if name else ""


def _build(copy: Path) -> bool:
    """Compile the plain core of the copy; tell whether it compiles."""
    spec = importlib.util.spec_from_file_location("native_build", copy / "native" / "build.py")
    build: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    build._variants = lambda machine, **_: [("core", ("-O1",))]
    try:
        build.build()
    except SystemExit:
        return False
    return True


def main(argv: list[str] | None = None) -> int:
    """Plant the faults one after the other and print which are noticed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--area", action="append", help="folder or file; default: gcode2krl and native")
    parser.add_argument(
        "--tests", nargs="+", help="test files or folders instead of those that import the module"
    )
    parser.add_argument("--covered", type=Path, help="a .coverage file of the suite: the tests by line")
    parser.add_argument("--begin", type=int, default=0, help="leave out the first faults that are drawn")
    parser.add_argument("--slow", action="store_true", help="the slow tests too")
    chosen = parser.parse_args(argv)
    faults = drawn(chosen.area or ["gcode2krl", "native"], chosen.count, chosen.seed)[chosen.begin :]
    covered = Covered(chosen.covered) if chosen.covered else None
    noticed = 0
    with tempfile.TemporaryDirectory(prefix="faults_") as folder:
        copy = Path(folder) / "tree"
        shutil.copytree(
            ROOT, copy, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache", ".hypothesis")
        )
        if any(fault.file.suffix == ".c" for fault in faults) and not _build(
            copy
        ):  # else every fault in the core would count as noticed
            raise SystemExit("planted_faults: the core does not compile as it is")
        began_s, built = time.monotonic(), True
        for fault in faults:
            if not built and fault.file.suffix == ".py":
                built = _build(copy)
            tests = chosen.tests or (covered.tests_of(fault) if covered else tests_of(fault.file))
            seen = notices(copy, fault, tests, slow=chosen.slow)
            built = built and fault.file.suffix == ".py"
            noticed += seen
            print("noticed" if seen else "MISSED ", fault, flush=True)
        print(f"{noticed} of {len(faults)} faults noticed, {time.monotonic() - began_s:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
