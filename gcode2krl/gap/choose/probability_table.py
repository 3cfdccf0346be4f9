"""The file of calibrated probabilities, `thresholds/probabilities.json`, as it stands."""

import json
from functools import cache
from pathlib import Path
from typing import Any

TABLE = Path(__file__).parents[1] / "thresholds" / "probabilities.json"
"""Written by ``benchmarks/gap_calibrate.py``."""


@cache
def stated_table() -> dict[str, Any]:
    """Return the table of the package."""
    table: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


@cache
def declared_nats() -> float:
    """Return by how much an effect may be worse than a cause and still belong to its declared set, in nats.

    The conformal quantile: of cases of the plant with whole effects left out, 95 % of the truths were nearer
    (Vovk, Gammerman & Shafer 2005); at least what the data cannot tell by convention, `alike_chi2`.
    """
    return float(stated_table()["alike_nats"])
