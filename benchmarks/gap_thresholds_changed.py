"""The diagnosis with one threshold changed; as a program, the answers of stored cases under such a setting.

The thresholds are frozen and read when the rooms of the diagnosis are loaded. So the table is replaced after
it has been loaded and before anything that reads it: `gcode2krl.gap.thresholds` is imported under a stand-in
for its parent package, whose own ``__init__`` would load the rest.
"""

import importlib
import json
import sys
import time
import types
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FACTORS = (0.5, 2.0)
GAP = "gcode2krl.gap"


@dataclass(frozen=True)
class Setting:
    """A threshold, and what its value is multiplied by; no name: nothing is changed."""

    room: str = ""
    name: str = ""
    factor: float = 1.0

    def __str__(self) -> str:
        return f"{self.room}.{self.name}x{self.factor:g}" if self.name else "base"

    @staticmethod
    def applies(value: Any, factor: float) -> bool:
        """Tell whether a value is a number, or numbers, that this factor changes."""
        return _is_number(value) and _times(value, factor) != value


BASE = Setting()


def _is_number(value: Any) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(_is_number(each) for each in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def _times(value: Any, factor: float) -> Any:
    """Return a number times a factor; counts stay counts, of one at least."""
    if isinstance(value, tuple):
        return tuple(_times(each, factor) for each in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def thresholds() -> list[Any]:
    """Return all thresholds as they are stated."""
    from gcode2krl.gap.thresholds import THRESHOLDS
    from gcode2krl.gap.thresholds.stated import listed

    return list(listed(THRESHOLDS))


def change(setting: Setting) -> None:
    """Change a threshold for the rest of this process.

    Raises RuntimeError where the diagnosis has been loaded already.
    """
    if GAP in sys.modules:
        raise RuntimeError("the diagnosis was loaded before its thresholds were changed")
    parent = types.ModuleType(GAP)
    parent.__path__ = [str(ROOT / "gcode2krl" / "gap")]
    sys.modules[GAP] = parent
    module = importlib.import_module(f"{GAP}.thresholds")
    del sys.modules[GAP]
    if setting.name:
        room = getattr(module.THRESHOLDS, setting.room)
        changed = replace(room, **{setting.name: _times(getattr(room, setting.name), setting.factor)})
        module.THRESHOLDS = replace(module.THRESHOLDS, **{setting.room: changed})
    importlib.import_module(GAP).thresholds = module


def respond() -> int:
    """Read a setting and cases as JSON, write the answers as JSON."""
    task = json.load(sys.stdin)
    change(Setting(*task["setting"]))
    sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]
    from gap_blind_run import answer

    answers: dict[str, dict[str, Any]] = {}
    for name, (folder, without) in task["cases"].items():
        own = time.process_time()
        try:
            answers[name] = {"result": answer(Path(folder), without), "error": None}
        except Exception as error:  # a threshold may break the diagnosis; that is shown as no answer
            answers[name] = {"result": None, "error": repr(error)}
        answers[name]["cpu_s"] = time.process_time() - own
    json.dump(answers, sys.stdout)
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    raise SystemExit(respond())
