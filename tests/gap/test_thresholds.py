"""Every threshold of the diagnosis has a kind and a reason, calibrated ones their seeds; the docs agree."""

import ast
import importlib.util
from dataclasses import FrozenInstanceError, dataclass, field
from pathlib import Path

import pytest

from gcode2krl.gap.thresholds import (
    ONCE_SCORED,
    THRESHOLDS,
    CompareThresholds,
    Kind,
    Threshold,
    Thresholds,
    convention,
    listed,
)

ROOT = Path(__file__).parents[2]
ALL = list(listed(THRESHOLDS))
FIRST_SCORED = 30_000
"""Seeds from here on are scored: nothing may be chosen on them (docs/diagnose_check.md)."""


@pytest.mark.parametrize("threshold", ALL, ids=lambda each: f"{each.room}.{each.name}")
def test_a_threshold_has_a_kind_a_reason_and_seeds_where_it_was_calibrated(threshold: Threshold) -> None:
    assert isinstance(threshold.kind, Kind)
    assert len(threshold.reason.split()) >= 3
    assert not threshold.reason.endswith(".")
    if threshold.kind is Kind.CALIBRATED:
        assert threshold.seeds is not None
        unscored = 0 <= threshold.seeds.start < threshold.seeds.stop <= FIRST_SCORED
        assert unscored or threshold.seeds is ONCE_SCORED
    else:
        assert threshold.seeds is None


def test_the_table_is_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(THRESHOLDS.compare, "explained_share", 0.5)  # noqa: B010 (mypy refuses the assignment itself)


def test_another_value_keeps_its_reason() -> None:
    stricter = Thresholds(compare=CompareThresholds(explained_share=0.99))
    (found,) = [each for each in listed(stricter) if each.name == "explained_share"]
    (usual,) = [each for each in ALL if each.name == "explained_share"]
    assert (found.value, found.reason, found.room) == (0.99, usual.reason, "compare")


def test_a_number_without_a_reason_is_no_threshold() -> None:
    @dataclass(frozen=True)
    class Room:
        stated: float = convention(1.0, "a reason of several words")
        bare: float = 2.0

    @dataclass(frozen=True)
    class Rooms:
        room: Room = field(default_factory=Room)

    with pytest.raises(TypeError):
        list(listed(Rooms()))


@pytest.mark.parametrize("place", ["compare/slips.py", "posterior/set_up.py", "answer/[!d]*.py"])
def test_a_room_keeps_no_numbers_beside_the_table(place: str) -> None:
    for file in sorted((ROOT / "gcode2krl" / "gap").glob(place)):
        for node in ast.parse(file.read_text("utf-8")).body:
            # a dict is a table of names, such as the units of force
            if isinstance(node, ast.Assign | ast.AnnAssign) and not isinstance(node.value, ast.Dict | None):
                values = [each for each in ast.walk(node.value) if isinstance(each, ast.Constant)]
                numbers = [each.value for each in values if isinstance(each.value, int | float)]
                assert not numbers, f"{file.name}:{node.lineno} states {numbers}"


def test_the_page_says_what_the_table_says() -> None:
    spec = importlib.util.spec_from_file_location("make_thresholds", ROOT / "docs" / "make_thresholds.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text("utf-8") == module.page(), "run python docs/make_thresholds.py"
