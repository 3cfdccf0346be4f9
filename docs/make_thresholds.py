"""Write docs/thresholds.md, the table of the diagnosis' thresholds, from ``gcode2krl/gap/thresholds``.

python docs/make_thresholds.py
"""

from pathlib import Path

from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.gap.thresholds.stated import Threshold, listed

PAGE = Path(__file__).with_name("thresholds.md")
_HEAD = """# Thresholds of the diagnosis

Made by `docs/make_thresholds.py` from `gcode2krl/gap/thresholds/`, a file a room of `gcode2krl/gap/`.
Change a number there, with its reason, run the script, and then the check in `docs/diagnose_check.md`.

- **physics**: a law, an instrument, a standard, or the measured accuracy of a model.
- **calibrated**: chosen by what it does on cases of the independent plant, whose seeds are named. No number
  was chosen on seeds from 16000 on.
- **convention**: an agreed limit or a setting of the computation; another of its order would serve as well.

The bounds of normal mismatch are in `gcode2krl/effects/mismatch.py`, an effect's plausible range in its file.

| threshold | value | kind | reason |
| --- | --- | --- | --- |
"""


def page() -> str:
    """Return the page."""
    return _HEAD + "".join(_row(threshold) for threshold in listed(THRESHOLDS))


def _row(threshold: Threshold) -> str:
    kind = threshold.kind.value
    if threshold.seeds is not None:
        kind += f", seeds {threshold.seeds.start}-{threshold.seeds.stop - 1}"
    cells = (f"`{threshold.room}.{threshold.name}`", _text(threshold.value), kind, threshold.reason)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(_text(each) for each in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
