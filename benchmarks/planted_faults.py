"""How many faults that a script plants in the package and in the core do the tests notice?

    python benchmarks/planted_faults.py --count 200                      # all over the package and the core
    python benchmarks/planted_faults.py --count 20 --area gcode2krl/krl  # of one area
    python benchmarks/planted_faults.py --count 20 --area native/gcode --tests tests/gcode

A fault is one small change: an operator, a constant, a sign, an index, a branch never taken. It is drawn
with a seed and planted in a copy of the tree. Then the tests run that import the module, the nearest
first, and the golden programs, or those that ``--tests`` names; the first that fails, or hangs, has
noticed it. The suite must pass without a fault. Some faults change nothing that can be seen, so that no
suite notices all: what counts is the same seed before and after a change of the tests.
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
LONGEST_S = 900.0


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


def notices(copy: Path, fault: Fault, tests: list[str], *, slow: bool) -> bool:
    """Tell whether the tests fail with a fault planted in the copy."""
    target = copy / fault.file
    sound = target.read_text(encoding="utf-8")
    target.write_text(fault.planted(sound), encoding="utf-8", newline="\n")
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "GCODE2KRL_CORE": "plain",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", *tests]
    try:
        if fault.file.suffix == ".c" and not _build(copy):
            return True
        command += ["-m", "slow or not slow"] if slow else []
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=LONGEST_S)
        return done.returncode not in (0, 5)  # 5: no test was chosen
    except subprocess.TimeoutExpired:
        return True
    finally:
        target.write_text(sound, encoding="utf-8", newline="\n")


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
    parser.add_argument("--slow", action="store_true", help="the slow tests too")
    chosen = parser.parse_args(argv)
    faults = drawn(chosen.area or ["gcode2krl", "native"], chosen.count, chosen.seed)
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
            seen = notices(copy, fault, chosen.tests or tests_of(fault.file), slow=chosen.slow)
            built = built and fault.file.suffix == ".py"
            noticed += seen
            print("noticed" if seen else "MISSED ", fault, flush=True)
        print(f"{noticed} of {len(faults)} faults noticed, {time.monotonic() - began_s:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
