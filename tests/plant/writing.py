"""Run folders and labels as files."""

import json
from pathlib import Path

import numpy as np
import polars as pl


def write_table(path: Path, table: dict, parquet: bool) -> None:
    """A table as CSV or Parquet, by the same column names."""
    frame = pl.DataFrame(table)
    if parquet:
        frame.write_parquet(path.with_suffix(".parquet"))
    else:
        frame.write_csv(path.with_suffix(".csv"), null_value="NaN")


def _value(v) -> str:
    if isinstance(v, str):
        return json.dumps(v)
    return repr(round(float(v), 9))


def run_toml(keys: dict, sections: dict) -> str:
    """A small TOML file: strings and numbers, then sections."""
    lines = [f"{k} = {_value(v)}" for k, v in keys.items()]
    for name, entries in sections.items():
        lines += ["", f"[{name}]", *(f"{k} = {_value(v)}" for k, v in entries.items())]
    return "\n".join(lines) + "\n"


def write_text(path: Path, text: str) -> None:
    """UTF-8 with plain line ends everywhere."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


def write_label(path: Path, label: dict) -> None:
    """The truth of a case, as JSON."""
    write_text(path, json.dumps(label, indent=1, default=_plain) + "\n")


def _plain(v):
    if isinstance(v, np.ndarray):
        return v.tolist()
    if isinstance(v, np.generic):
        return v.item()
    raise TypeError(f"{type(v).__name__} has no place in a label")
