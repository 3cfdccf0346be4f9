"""Write docs/thresholds.md, the table of the diagnosis' thresholds, from ``gcode2krl/gap/thresholds``.

python docs/make_thresholds.py
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gcode2krl.gap.posterior.calibrated import FAMILY_TERMS, TERMS, Scale, Terms
from gcode2krl.gap.thresholds import THRESHOLDS, Threshold, listed, stated_table

PAGE = Path(__file__).with_name("thresholds.md")
_HEAD = """# Thresholds of the diagnosis

Made by `docs/make_thresholds.py` from `gcode2krl/gap/thresholds.py`, a class a room.
Change a number there, with its reason, run the script, and then the check in `docs/diagnose_check.md`.

- **physics**: a law, an instrument, a standard, or the measured accuracy of a model.
- **calibrated**: chosen by what it does on cases of the independent plant, whose seeds are named. Seeds
  from 30000 on are scored; 290000-553999 were, their figures are told, and they were looked at since: no
  figure of today is from them.
- **convention**: an agreed limit or a setting of the computation; another of its order would serve as well.

The bounds of normal mismatch are in `gcode2krl/effects/mismatch.py`, an effect's plausible range in its file.

| threshold | value | kind | reason |
| --- | --- | --- | --- |
"""


_PROBABILITIES = """
## Probabilities

P = 1 / (1 + exp(-b - Σ w·u)) of the goodness u of each test, 0 at the worst and 1 at the best value here and
beyond (`gcode2krl/gap/posterior/calibrated.py`; of two numbers the better one counts; of *unknown* the
formula gives 1 - P). Weights and b are made by `benchmarks/blind/calibrate.py` from {cases}.
Sets that cannot be told apart reach to {alike_nats:g} nats. A gap for which no effect was accepted is outside
the library with P = {unknown_without_cause:g}.

"""


def page() -> str:
    """Return the page."""
    return (
        _HEAD + "".join(_row(threshold) for threshold in listed(THRESHOLDS)) + _probabilities(stated_table())
    )


def _probabilities(table: Mapping[str, Any]) -> str:
    """Return the section on probabilities: terms, their weights, and the scores with effects left out."""
    made, heads = table["provenance"], table["heads"]
    kinds = ", ".join(f"{count} {kind}" for kind, count in made["kinds"].items())
    seeds = ", ".join(made["seeds"])
    text = _PROBABILITIES.format(cases=f"{made['cases']} cases ({kinds}; seeds {seeds})", **table)
    text += _weights(TERMS, [name for name in heads if name != "dependence"], heads) + "\n"
    text += _weights(FAMILY_TERMS, ["dependence"], heads)
    text += "\nEach effect left out of the cases in turn:\n\n"
    text += "| probability of | causes | ECE | Brier | log score | right of those with p >= 0.9 |\n"
    text += "| --- | --- | --- | --- | --- | --- |\n"
    for name, each in made["left_out_scores"].items():
        sure = f"{each['sure_right']} of {each['sure']}"
        cells = (name, each["rows"], each["ece"], each["brier"], each["log"], sure)
        text += f"| {' | '.join(map(str, cells))} |\n"
    return text


def _weights(terms: Terms, names: list[str], heads: Mapping[str, Any]) -> str:
    """Return the table of the weights of some probabilities."""
    rows = [
        ["test", "numbers: worst to best", *(f"w of {name}" for name in names)],
        ["---"] * (2 + len(names)),
    ]
    for term, scales in terms.items():
        numbers = ", ".join(f"`{name}` {_scale(scale)}" for name, scale in scales.items())
        rows.append([term, numbers, *(f"{heads[name]['weights'][term]:.3g}" for name in names)])
    rows.append(["b", "", *(f"{heads[name]['bias']:.3g}" for name in names)])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _scale(scale: Scale) -> str:
    return f"{scale.worst:g} to {scale.best:g} ({scale.by.replace('_', ' of ')})"


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
