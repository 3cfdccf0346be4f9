"""The table of finding codes holds exactly the codes that the source uses, with their severities."""

import ast
import importlib.util
import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from gcode2krl.codes import all_codes, closest, code_of, follows
from gcode2krl.gcode.findings import all_findings
from gcode2krl.krl.release import NEVER_RELEASED, STRICTER_HERE

ROOT = Path(__file__).resolve().parent.parent
SEVERITIES = ("error", "warning", "note")
KEBAB = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)+")
NOT_CODES = {
    "c-a",
    "c-b",
    "v-bit",
    "shape-type",
    "tip-diameter",
    "post-process",
    "lower-diameter",
    "bull-nose",
    "head-head",
    "table-head",
    "table-table",
    "install-hook",
    "kilograms-force",
    "latin-1",
    "make-test",
    "single-joint",
    "steps-mid",
    "on-tool",
    "pounds-force",
    "steps-post",
    "system-out",
    "utf-16",
    "xyz-fixed",
    "stiffness-map",
    "fanuc-calculator",
    "fanuc-increments",
    "utf-8",
    "utf-8-sig",
    # reasons of the online session's states, which its log explains
    "adds-up",
    "ipoc-cycle",
    "ipoc-jump",
    "ipoc-restart",
    "probe-not-seen",
    "telegrams-lost",
}
"""Words with a hyphen in the source that are not codes of findings; add yours if the test reports it."""


@cache
def _modules() -> dict[Path, ast.Module]:
    return {file: ast.parse(file.read_text("utf-8")) for file in sorted((ROOT / "gcode2krl").rglob("*.py"))}


def _calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            yield name, node


def _code_places(tree: ast.AST) -> dict[str, int]:
    """Return callable → position of its code: `Issue`, `input_error`, and own functions that take one."""
    places = {"Issue": 1, "input_error": 0}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and not node.decorator_list:  # a command is not one
            names = [one.arg for one in node.args.args if one.arg not in ("self", "cls")]
            if "code" in names:
                places[node.name] = names.index("code")
    return places


def _words(node: ast.AST | None) -> Iterator[str]:
    """Yield the texts that a code can be: a literal, or either side of a choice."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _words(node.body)
        yield from _words(node.orelse)


def _argument(call: ast.Call, name: str, place: int) -> ast.AST | None:
    named = next((keyword.value for keyword in call.keywords if keyword.arg == name), None)
    return named if named is not None else call.args[place] if len(call.args) > place else None


def _used() -> dict[str, str]:
    """Return code → file where it is used: at the place of a code, or as any word with hyphens."""
    used = {}
    for file, tree in _modules().items():
        places = _code_places(tree)
        for name, call in _calls(tree):
            if name in places:
                for word in _words(_argument(call, "code", places[name])):
                    used[word] = file.name
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and KEBAB.fullmatch(node.value):
                used[node.value] = file.name
    used |= {finding.code: "findings.toml" for finding in all_findings().values()}
    return {word: file for word, file in used.items() if word not in NOT_CODES}


def _stated_severities() -> Iterator[tuple[str, str, str]]:
    """Yield (code, severity, place) wherever both stand literally in one call."""
    for file, tree in _modules().items():
        for name, call in _calls(tree):
            words = [list(_words(argument)) for argument in call.args]
            for severities, found in pairwise(words):
                if severities and set(severities) <= set(SEVERITIES) and len(found) == 1:
                    yield from ((found[0], severity, f"{file.name}:{call.lineno}") for severity in severities)
            if name == "input_error" and words and words[0]:
                yield from ((code, "error", f"{file.name}:{call.lineno}") for code in words[0])


@pytest.mark.slow
def test_an_entry_read_alone_is_that_of_the_whole_table() -> None:
    assert {name: code_of(name) for name in all_codes()} == all_codes()
    assert code_of("no-such-code") is None


def test_every_code_of_the_source_is_in_the_table() -> None:
    used = _used()
    assert len(used) > 200
    missing = {word: file for word, file in used.items() if word not in all_codes()}
    assert not missing, f"describe these in gcode2krl/codes.toml, or list them in NOT_CODES: {missing}"


def test_every_code_of_the_table_is_in_the_source() -> None:
    package = ROOT / "gcode2krl"
    files = [*package.rglob("*.py"), package / "gcode" / "findings.toml"]
    source = "".join(file.read_text("utf-8") for file in files)
    literals = set(re.findall(r'"([a-z0-9-]+)"', source))
    assert [name for name in all_codes() if name not in literals] == []


def test_severities_are_those_of_the_source() -> None:
    stated = list(_stated_severities())
    assert len({code for code, _, _ in stated}) > 150
    known = all_codes()
    wrong = [
        (code, severity, place)
        for code, severity, place in stated
        if code in known and severity not in known[code].severity.split(", ")
    ]
    assert wrong == []
    for code in STRICTER_HERE:
        assert "error" in known[code].severity


@pytest.mark.parametrize("entry", all_codes().values(), ids=lambda entry: entry.name)
def test_an_entry_is_whole(entry) -> None:
    severities = entry.severity.split(", ")
    assert severities
    assert set(severities) <= set(SEVERITIES)
    assert entry.why.endswith(".")
    assert entry.remedy[-1] in ".…?"
    assert entry.example
    assert entry.allow
    assert "\n" not in entry.why + entry.example + entry.remedy + entry.allow
    if "error" not in severities:
        assert entry.allow.startswith("not needed")
    if entry.name in NEVER_RELEASED:
        assert entry.allow.startswith("never")


def test_causes_are_known_and_no_finding_is_its_own_cause() -> None:
    known = all_codes()
    for entry in known.values():
        assert set(entry.follows) <= set(known), entry.name
        for cause in follows(entry.name):
            assert entry.name not in follows(cause), f"{entry.name} and {cause} cause each other"


def test_a_mistyped_code_is_recognised() -> None:
    assert closest("spindel-off", all_codes()) == "spindle-off"
    assert closest("qqqqqq", all_codes()) == ""
    assert follows("no-such-code") == frozenset()


def test_the_page_of_findings_is_made_from_the_table() -> None:
    spec = importlib.util.spec_from_file_location("make_findings", ROOT / "docs" / "make_findings.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text("utf-8") == module.page(), "run python docs/make_findings.py"
    assert module.page().count("\n| `") == len(all_codes())
