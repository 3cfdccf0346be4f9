"""Whether the causes of an answer are those of the label: exactly, or within the sets that they declare."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

Truth = tuple[str, str | None]
"""Effect and target."""
NAMED = 0.5
ANY_TARGET = frozenset({"tool_number", "swapped_tool"})
"""The plant's target is a way of being wrong, not one of the library's targets."""


def named_of(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the causes of an answer that count as named."""
    return [cause for cause in result["causes"] if cause["probability"] >= NAMED]


def names(cause: dict[str, Any], truth: Truth) -> bool:
    """Tell whether a cause, or one of the members of a group, is this effect at this target."""
    if any(names(member, truth) for member in cause.get("members") or ()):
        return True
    if cause.get("effect") != truth[0]:  # an unknown in a set has none
        return False
    return cause.get("target") == truth[1] or truth[0] in ANY_TARGET


def effects_alike(cause: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the effects of the library that a cause declares indistinguishable from it."""
    return [each for each in cause.get("indistinguishable_from") or () if each.get("kind") != "unknown"]


def declares(cause: dict[str, Any], truth: Truth) -> bool:
    """Tell whether a cause, or one that it declares indistinguishable, is the truth."""
    return any(names(each, truth) for each in (cause, *(cause.get("indistinguishable_from") or ())))


def is_among(cause: dict[str, Any], truths: Iterable[Truth]) -> bool:
    """Tell whether a cause or its declared set holds one of the truths."""
    return any(declares(cause, truth) for truth in truths)


def covers(
    causes: Sequence[dict[str, Any]],
    truths: Sequence[Truth],
    says: Callable[[dict[str, Any], Truth], bool] = names,
) -> bool:
    """Tell whether each truth can be matched with a different cause that says it."""
    if not truths:
        return True
    return any(
        says(cause, truths[0]) and covers([*causes[:i], *causes[i + 1 :]], truths[1:], says)
        for i, cause in enumerate(causes)
    )


def text(name: Truth) -> str:
    """Return effect and target as words."""
    return name[0] if name[1] is None else f"{name[0]} {name[1]}"
