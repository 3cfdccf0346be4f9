"""``results.jsonl``: a record a line, sorted by part."""

import contextlib
import json
import math
from collections.abc import Iterable
from typing import Any

from gcode2krl.batch.written.part import Record, name_of


def results_jsonl(records: Iterable[Record]) -> bytes:
    """Return the lines: plain ASCII, keys in alphabetical order, null for what is not a finite number.

    Of several records of one part the last counts.
    """
    last = {name_of(record): record for record in records}
    return b"".join(_line(last[name]) for name in sorted(last))


def _line(record: Record) -> bytes:
    text = json.dumps(_finite(record), sort_keys=True, allow_nan=False)
    return text.encode("ascii") + b"\n"


def records_of(content: bytes) -> list[Record]:
    """Return the records of a ``results.jsonl``; a line that is no object is left out."""
    records: list[Record] = []
    for line in content.splitlines():
        with contextlib.suppress(ValueError):
            record = json.loads(line)
            if isinstance(record, dict):
                records.append(record)
    return records


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, list | tuple) else value
