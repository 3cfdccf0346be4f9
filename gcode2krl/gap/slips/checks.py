"""The checks that runs have of their own: another unit, swapped axes, another program."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gcode2krl.effects import Effect
from gcode2krl.errors import Issue
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.slip import Slip, final_slip
from gcode2krl.runs import check_against

_EFFECT_OF = {"run-unit": "unit", "run-axes": "unit", "run-program": "other_program"}
"""Code of a finding that ends the comparison -> effect."""


def checked(pairs: Sequence[Pair]) -> list[Issue]:
    """Return what the checks say against the runs; a log alone has nothing to be checked against."""
    return [
        issue
        for pair in pairs
        if not pair.from_log
        for issue in check_against(
            pair.run, pair.inputs.time_s, pair.inputs.position_mm, pair.inputs.q_cmd_rad
        )
    ]


@dataclass(frozen=True)
class CheckTest:
    """A run that does not belong to its prediction, by its checks. Nothing is compared beyond it."""

    issues: tuple[Issue, ...]
    effects = tuple(dict.fromkeys(_EFFECT_OF.values()))

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the first error after which nothing can be compared, as a slip."""
        for issue in self.issues:
            effect = library.get(_EFFECT_OF.get(issue.code, ""))
            if issue.severity == "error" and effect is not None:
                file = issue.message.split(".")[0].split(":")[0]
                target = file if file in effect.targets(pairs[0].inputs.cell) else None
                return [final_slip(effect, target, issue.message, pairs)]
        return []
