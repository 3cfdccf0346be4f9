"""Two outputs side by side: which files are alike to the byte, how far the others are, and what both took."""

import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gap_identity_run import RECORDS

ANSWERS = ("verdict", "effect", "target", "link", "notes", "signal", "joints", "run", "issues")
"""Keys of a diagnosis that say something in words; a difference in one of them is another answer."""
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass
class Difference:
    """How two files with one name differ."""

    name: str
    largest: float = 0.0
    """Largest relative difference of two numbers at one place."""
    largest_at: str = ""
    places: Counter[str] = field(default_factory=Counter)
    """Where something other than the size of a number differs; list positions left out."""
    order_only: bool = False
    """The same values under the same keys in another order, or spelt in another way."""

    @property
    def answers(self) -> list[str]:
        """Return the places where the answer itself differs."""
        return [place for place in self.places if any(word in place.split(".") for word in ANSWERS)]

    def line(self) -> str:
        """Return the difference as one line."""
        if self.order_only:
            return f"{self.name}: only order or spelling"
        size = f"largest relative difference {self.largest:.2g} at {self.largest_at}" if self.largest else ""
        answers = ("another answer: " + ", ".join(self.answers)) if self.answers else ""
        others = [place for place in self.places if place not in self.answers]
        rest = f"{len(others)} other places: {', '.join(others[:4])}" if others else ""
        return f"{self.name}: " + "; ".join(each for each in (size, answers, rest) if each)


def compare(out_a: Path, out_b: Path, part: bool = False) -> int:
    """Print what differs between two outputs, or in the part that B has; returns 1 where anything does.

    Raises ValueError where one of them holds no files.
    """
    files_a, files_b = _files(out_a), _files(out_b)
    for out, files in ((out_a, files_a), (out_b, files_b)):
        if not files:
            raise ValueError(f"{out} holds no output")
    if part:
        there = {_case(name) for name in files_b}
        files_a = {name for name in files_a if _case(name) in there}
    both = sorted(files_a & files_b)
    found = [d for name in both if (d := difference(name, out_a / name, out_b / name)) is not None]
    alone = [(out_a, files_a - files_b), (out_b, files_b - files_a)]
    print(f"{len(both) - len(found)} of {len(files_a | files_b)} files are identical")
    for each in found:
        print(f"  {each.line()}")
    for out, names in alone:
        for name in sorted(names):
            print(f"  {name}: only in {out}")
    if found:
        largest = max(each.largest for each in found)
        others = sum(bool(each.answers) for each in found)
        print(f"largest relative difference of any number {largest:.2g}; {others} files with another answer")
    _print_took(out_a, out_b, both)
    return int(bool(found) or files_a != files_b)


def _files(out: Path) -> set[str]:
    names = {file.relative_to(out).as_posix() for file in out.rglob("*") if file.is_file()}
    return {name for name in names if not name.startswith(f"{RECORDS}/")}


def _case(name: str) -> str:
    """Return the case or call that a file belongs to."""
    return name.partition("/")[0].partition(".")[0]


def difference(name: str, file_a: Path, file_b: Path) -> Difference | None:
    """Return how two files differ; None where their bytes are the same."""
    a, b = file_a.read_bytes(), file_b.read_bytes()
    if a == b:
        return None
    found = Difference(name)
    try:
        text_a, text_b = a.decode("utf-8"), b.decode("utf-8")
    except UnicodeDecodeError:
        found.places["bytes"] += 1
        return found
    try:
        values_a, values_b = json.loads(text_a), json.loads(text_b)
    except json.JSONDecodeError:
        _compare_lines(found, text_a.splitlines(), text_b.splitlines())
    else:
        _compare_values(found, values_a, values_b, "")
    found.order_only = not found.largest and not found.places
    return found


def _compare_values(found: Difference, a: Any, b: Any, place: str) -> None:
    """Walk two JSON values at once; list positions are left out of the places."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(key for key in b if key not in a)]:
            where = f"{place}.{key}" if place else key
            if key in a and key in b:
                _compare_values(found, a[key], b[key], where)
            else:
                found.places[where] += 1
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            found.places[place] += 1
        for one, other in zip(a, b, strict=False):
            _compare_values(found, one, other, place)
    elif _is_number(a) and _is_number(b):
        _compare_numbers(found, float(a), float(b), place)
    elif a != b or type(a) is not type(b):
        found.places[place] += 1


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _compare_numbers(found: Difference, a: float, b: float, place: str) -> None:
    if a == b:
        return
    relative = abs(a - b) / max(abs(a), abs(b))
    if not relative <= found.largest:
        found.largest, found.largest_at = relative, place


def _compare_lines(found: Difference, a: list[str], b: list[str]) -> None:
    """Compare the numbers of lines that are alike but for them; other lines are places of their own."""
    if len(a) != len(b):
        found.places[f"{len(a)} and {len(b)} lines"] += 1
    for number, (one, other) in enumerate(zip(a, b, strict=False), 1):
        if one == other:
            continue
        if NUMBER.sub("#", one) != NUMBER.sub("#", other):
            found.places[f"line {number}"] += 1
            continue
        for x, y in zip(NUMBER.findall(one), NUMBER.findall(other), strict=True):
            _compare_numbers(found, float(x), float(y), f"line {number}")


# time and memory --------------------------------------------------------------------------------------------


def _print_took(out_a: Path, out_b: Path, names: list[str]) -> None:
    """Print processor time and memory of the cases that both have a record of."""
    pairs = list(_records(out_a, out_b, names))
    if not pairs:
        return
    for key, unit in (("cpu_s", "s"), ("wall_s", "s")):
        a, b = (math.fsum(pair[side][key] for pair in pairs) for side in (0, 1))
        print(f"{key}: {a:.1f} and {b:.1f} {unit} for {len(pairs)} cases, ratio {b / a:.3f}")
    a, b = (max(pair[side]["peak_MB"] for pair in pairs) for side in (0, 1))
    print(f"peak_MB: {a:.0f} and {b:.0f} MB at most, ratio {b / a:.3f}")


def _records(out_a: Path, out_b: Path, names: list[str]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    for name in names:
        files = [out / RECORDS / f"{Path(name).stem}.json" for out in (out_a, out_b)]
        if Path(name).suffix != ".toml" and all(file.exists() for file in files):
            a, b = (json.loads(file.read_text(encoding="utf-8")) for file in files)
            yield a, b
