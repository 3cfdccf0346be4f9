"""What changed since the last run: time, force, deflection, what got refused, what is new or gone."""

from collections.abc import Iterable
from dataclasses import dataclass

from gcode2krl.batch import VERDICTS
from gcode2krl.batch.written.part import PartResult, Record, name_of, parts_of

SAME = 1e-4
"""Figures are the same if they differ by less than this share: nobody acts on a hundredth of a percent."""


@dataclass(frozen=True, slots=True)
class Change:
    """A part of both runs."""

    before: PartResult
    after: PartResult

    @property
    def name(self) -> str:
        """The part's name."""
        return self.after.name

    @property
    def time_s(self) -> float | None:
        """How much longer it takes, None where a time is not known."""
        return _more(self.before.time_s, self.after.time_s)

    @property
    def force_N(self) -> float | None:
        """How much the largest force grew."""
        return _more(self.before.force_N, self.after.force_N)

    @property
    def deflection_mm(self) -> float | None:
        """How much the largest deflection grew."""
        return _more(self.before.deflection_mm, self.after.deflection_mm)

    @property
    def is_none(self) -> bool:
        """Whether all figures are the same, or not known both times."""
        pairs = (
            (self.before.time_s, self.after.time_s),
            (self.before.force_N, self.after.force_N),
            (self.before.deflection_mm, self.after.deflection_mm),
        )
        return all(_are_same(before, after) for before, after in pairs)


@dataclass(frozen=True, slots=True)
class Difference:
    """Two runs beside each other; each list by name, ``changed`` with the largest change of time first."""

    new: tuple[PartResult, ...]
    gone: tuple[PartResult, ...]
    refused: tuple[Change, ...]
    """Written before and not any more."""
    mended: tuple[Change, ...]
    """Written now and not before."""
    changed: tuple[Change, ...]
    """Written both times, with other figures."""
    same: int
    """How many parts of both runs have the same verdict and figures."""
    time_before_s: float
    """Sum over the parts that were written both times."""
    time_after_s: float

    @property
    def is_none(self) -> bool:
        """Whether nothing changed."""
        return not (self.new or self.gone or self.refused or self.mended or self.changed)


def difference(records: Iterable[Record], before: Iterable[Record]) -> Difference:
    """Return what changed from the records ``before`` to ``records``."""
    now = {part.name: part for part in parts_of(records)}
    then = {part.name: part for part in parts_of(before)}
    both = [Change(then[name], part) for name, part in now.items() if name in then]
    written = [one for one in both if one.before.is_written and one.after.is_written]
    changed = [one for one in written if not one.is_none]
    refused = [one for one in both if one.before.is_written and not one.after.is_written]
    mended = [one for one in both if one.after.is_written and not one.before.is_written]
    return Difference(
        new=tuple(part for name, part in now.items() if name not in then),
        gone=tuple(part for name, part in then.items() if name not in now),
        refused=tuple(refused),
        mended=tuple(mended),
        changed=tuple(sorted(changed, key=lambda one: (-abs(one.time_s or 0.0), one.name))),
        same=len(both) - len(changed) - len(refused) - len(mended),
        time_before_s=sum(one.before.time_s or 0.0 for one in written),
        time_after_s=sum(one.after.time_s or 0.0 for one in written),
    )


def with_against(records: Iterable[Record], before: Iterable[Record] | None) -> list[Record]:
    """Return the records with what their parts were before under ``against``, null where nobody knows."""
    then = {part.name: part for part in parts_of(before or ())}
    return [{**record, "against": _against(then.get(name_of(record)))} for record in records]


def _against(part: PartResult | None) -> dict[str, object] | None:
    if part is None:
        return None
    return {
        "exit_code": VERDICTS.index(part.verdict),
        "time_s": part.time_s,
        "max_force_N": part.force_N,
        "max_deflection_mm": part.deflection_mm,
    }


def _more(before: float | None, after: float | None) -> float | None:
    if before is None or after is None:
        return None
    return 0.0 if _are_same(before, after) else after - before


def _are_same(before: float | None, after: float | None) -> bool:
    if before is None or after is None:
        return before is after
    return abs(after - before) <= SAME * max(abs(before), abs(after))
