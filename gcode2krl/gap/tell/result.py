"""What a diagnosis says, as an object and as the JSON of the contract."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gcode2krl.effects import Applied
from gcode2krl.errors import Issue
from gcode2krl.gap.choose.judgement import NAMED

SCHEMA = "gcode2krl/gap/1"


@dataclass(frozen=True)
class Gap:
    """Where reality differs from the prediction, why, and how much is gone with the causes in the model."""

    verdict: str
    """no_gap, explained, partly_explained or unexplained."""
    gap: Mapping[str, Any]
    links: Sequence[Mapping[str, Any]]
    where: Mapping[str, Any]
    causes: Sequence[Mapping[str, Any]]
    unexplained: Mapping[str, Any]
    not_examined: Sequence[Mapping[str, Any]]
    observable: Sequence[Mapping[str, Any]] = ()
    """The smallest size of each effect that these data could have shown."""
    next_run: str | None = None
    named: tuple[Applied, ...] = ()
    """The causes with a probability of at least 0.5, as effects that `predict` takes."""
    issues: tuple[Issue, ...] = field(default=())
    runs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the object of the JSON contract, plain numbers only."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "gap": plain(self.gap),
            "links": plain(self.links),
            "where": plain(self.where),
            "causes": plain(self.causes),
            "unexplained": plain(self.unexplained),
            "not_examined": plain(self.not_examined),
            "observable": plain(self.observable),
            "next_run": self.next_run,
            "runs": list(self.runs),
            "notes": list(self.notes),
            "issues": [
                {
                    "severity": i.severity,
                    "code": i.code,
                    "line": i.line,
                    "message": i.message,
                    "remedy": i.remedy,
                }
                for i in self.issues
            ],
        }

    @property
    def named_causes(self) -> list[Mapping[str, Any]]:
        """Return the causes with a probability of at least 0.5."""
        return [cause for cause in self.causes if cause["probability"] >= NAMED]


def plain(value: Any) -> Any:
    """Return numbers, lists and dicts without numpy types; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
