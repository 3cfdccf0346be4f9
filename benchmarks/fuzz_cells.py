"""Cells at random: no traceback, no hang, no memory; each is accepted or refused with a line and a remedy.

``python benchmarks/fuzz_cells.py --count 100000 --seed 1``. Everything runs in this process. A cell that is
accepted is also used: its templates are rendered, and what is missing and doubtful is listed.
"""

import argparse
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import tomli_w
from fuzz_common import MOST_MB, peak_mb

from gcode2krl import load_cell
from gcode2krl.cell import as_toml, cell_from_resolved
from gcode2krl.cli.cell_list import findings, missing_keys, to_confirm
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.krl.provenance import provenance_lines
from gcode2krl.krl.statements import render

SLOW_S = 5.0
VALUES = (
    0, 1, -1, 3, 5.0, 0.12, 200, 1e9, 1e300, -1e-300, 2**63, 10**40, float("inf"), float("nan"), True, False,
    "", "120", "none", "auto", "x\n$BASE=$NULLFRAME", "\x00", "é", "a" * 5000, "KRC4",
    "KR 300 R2500 ultra",
    "../x.toml", "demonstration", [], {}, [1, 2, 3], [[0, 0], [1, 1]],
    {"x_mm": 1.0}, [[[[1]]]], {"a": {"b": {}}},
)  # fmt: skip  # list of odd values, kept compact
TEMPLATES = (
    "", "HALT", "$OUT[1]=TRUE", "$OUT[{{ spindle.run_cw_output }}]=TRUE", "$BASE=$NULLFRAME", "PTP HOME",
    "{{ cell }}",    "{{ cell.m_code.update({}) }}", "{{ 'x' * 3000000000 }}",
    "{% for i in range(999999999) %}x{% endfor %}",
    "{{ '%999999999d' % 1 }}", "{{ " + "(" * 900 + "1" + ")" * 900 + " }}", "{% if %}", "{{", "IF X THEN",
    "GOTO A",
    "{{ cell.tool[1].teeth }}", "{{ 9**9**9 }}", "{{ rpm | round | int }}", "\r\x0b", "{{ self }}", "{{ p }}",
)  # fmt: skip  # list of odd values, kept compact


def main(argv: list[str] | None = None) -> int:
    """Run so many cells; print how many were accepted and refused, the worst time, memory and tracebacks."""
    options = argparse.ArgumentParser(prog="fuzz cells", description=__doc__.split("\n")[0])
    options.add_argument("--count", type=int, default=1000)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args(argv)
    rng = random.Random(chosen.seed)
    whole = {**as_toml(load_cell())}
    for key in ("taken_over", "defaults"):
        whole.pop(key, None)
    outcome: Counter[str] = Counter()
    worst_s, broken = 0.0, []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        for number in range(chosen.count):
            path.write_bytes(text_of(whole, rng))
            started = time.perf_counter()
            try:
                outcome["accepted" if use(path) else "refused"] += 1
            except Exception:
                broken.append((number, traceback.format_exc(limit=-3)))
            spent = time.perf_counter() - started
            worst_s = max(worst_s, spent)
            outcome["slow"] += spent > SLOW_S
    peak = peak_mb()
    print(
        f"cells: {chosen.count}, accepted {outcome['accepted']}, refused {outcome['refused']}, "
        f"worst {worst_s:.2f} s, peak {peak:.0f} MB, tracebacks {len(broken)}"
    )
    for number, text in broken[:5]:
        print(f"cell {number}:\n{text}")
    return int(bool(broken) or outcome["slow"] > 0 or peak > MOST_MB)


def use(path: Path) -> bool:
    """Load a cell and everything that depends on it alone; False where it was refused with a finding."""
    try:
        cell = load_cell(path)
    except Gcode2KrlError as error:
        check(error)
        return False
    list(to_confirm(cell)), missing_keys(cell), findings(cell), provenance_lines(cell, [1], True, True)
    record = as_toml(cell)
    cell_from_resolved(record, "again")
    for key in cell.templates():
        try:
            render(cell, key, rpm=1000.0, m=3, p=None, text="x", line=1, tool=1)
        except Gcode2KrlError as error:
            check(error)
    for number in [0, *cell.tool]:
        for matrix in (cell.base_matrix, cell.home_q_rad, lambda number=number: cell.tool_matrix(number)):
            try:
                matrix()
            except Gcode2KrlError as error:
                check(error)
    return True


def check(error: Gcode2KrlError) -> None:
    """Raise where a finding is not one line with a code and a remedy."""
    for issue in error.issues:
        if not (issue.code and issue.message and issue.remedy) or len(issue.text()) > 2000:
            raise AssertionError(f"no finding for a person: {issue!r:.300}")
        if "\n" in issue.text() or "Traceback" in issue.text():
            raise AssertionError(f"more than one line: {issue!r:.300}")


def text_of(whole: dict, rng: random.Random) -> bytes:
    """Return the bytes of a cell file: the demonstration's keys, some left out, changed or damaged."""
    data = {key: value for key, value in whole.items() if rng.random() < 0.8}
    data = dict(rng.sample(list(data.items()), len(data)))
    if "tool" in data:
        numbers = rng.sample(list(data["tool"]), rng.randint(0, min(3, len(data["tool"]))))
        data["tool"] = {number: data["tool"][number] for number in numbers}
    if rng.random() < 0.5:
        data["based_on"] = rng.choice(
            ["demonstration", "cell.toml", "kr300_demonstration", "nowhere.toml", "x"]
        )
    data = changed(data, rng, rng.choice([0.0, 0.0, 0.01, 0.05]))
    if rng.random() < 0.3 and isinstance(data.get("m_code"), dict):
        data["m_code"] = {
            **data["m_code"],
            rng.choice(["M3", "M5", "M8", "M9", "M30"]): rng.choice(TEMPLATES),
        }
    if rng.random() < 0.1:
        data[rng.choice(["tool", "frames", "robot", "load", "spindle", "m_code", "x"])] = rng.choice(VALUES)
    try:
        text = tomli_w.dumps(data).encode("utf-8", "replace")
    except (TypeError, ValueError, AttributeError):
        text = b"[frames]\n"
    return damaged(text, rng) if rng.random() < 0.3 else text


def changed(value: object, rng: random.Random, share: float) -> object:
    """Return a value with some of its contents replaced, renamed or left out."""
    if isinstance(value, dict):
        found = {}
        for key, inner in value.items():
            drawn = rng.random()
            if drawn < share / 4:
                continue
            name = rng.choice(["x", "01", "a.b", "", "é", "MODEL"]) if drawn < share / 2 else key
            found[name] = rng.choice(VALUES) if share / 2 <= drawn < share else changed(inner, rng, share)
        return found
    if isinstance(value, list):
        return [changed(inner, rng, share) for inner in value]
    return rng.choice(VALUES) if rng.random() < share / 4 else value


def damaged(text: bytes, rng: random.Random) -> bytes:
    """Return the text with bytes removed, doubled or replaced, or hostile text before or after it."""
    at, length = rng.randrange(len(text) + 1), rng.randrange(1, 50)
    kind = rng.randrange(6)
    if kind == 0:
        return text[:at] + text[at + length :]
    if kind == 1:
        return text[:at] + text[at : at + length] * 2 + text[at + length :]
    if kind == 2:
        return text[:at] + rng.randbytes(rng.randrange(1, 4)) + text[at + 1 :]
    if kind == 3:
        return text[:at]
    hostile = rng.choice(
        [b"[" * 100_000, b"a." * 50_000 + b"a=1\n", b"\x00", b"a=" + b"[" * 500, b"\xff\xfe", b"=" * 99]
    )
    return hostile + text if kind == 4 else text + b"\n" + hostile


if __name__ == "__main__":
    sys.exit(main())
