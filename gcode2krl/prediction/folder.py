"""A prediction as a folder: what is written, what is read again, and which folders are left alone.

The folder holds ``prediction.toml`` (inputs, hashes, versions, settings, the cell as resolved, findings and
events) and a Parquet file a table: ``toolpath``, ``targets``, and ``motion`` with Motion, Joints, Forces and
Deflection side by side. The Arrow schema of a file states the unit of each column.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, asdict, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gcode2krl.cell import Cell, as_toml, cell_from_resolved
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.exchange.disk_names import counted_pattern, names_of_parts
from gcode2krl.exchange.frame import ColumnFrame
from gcode2krl.files import Content
from gcode2krl.prediction.record import REMEDY, SCHEMA, PredictionRecord, events_of, read_record
from gcode2krl.prediction.tables import PARQUET_TYPES, check_numbers, check_references, read_table
from gcode2krl.tables import (
    Clearance,
    Deflection,
    Event,
    Forces,
    Joints,
    Motion,
    Restart,
    Simplified,
    Table,
    Targets,
    Toolpath,
)

RECORD = "prediction.toml"
UNFINISHED = f'schema = "{SCHEMA}"\nunfinished = true\n'.encode("ascii")
_OURS = re.compile(rb'^schema = "gcode2krl/prediction/\d+"', re.MULTILINE)
_MOST_OF_RECORD = 4096
_IGNORED = re.compile(r"\.DS_Store|Thumbs\.db|desktop\.ini|\..+\.(?:part|old)")
"""Files that do not make a folder foreign: those of desktops, and leftovers of a killed run."""
_ADDED = re.compile(r"q[1-6]_(act|load)_rad|(force|moment)_meas_[xyz]_(N|Nmm)|part_shift_[xyz]_mm")
AnyTable = TypeVar("AnyTable", bound=Table)


def table_files(place: Path, tables: Mapping[str, ColumnFrame], csv: bool) -> dict[Path, Content]:
    """Return the files of tables by name and what writes them; with ``csv`` as CSV too."""
    from gcode2krl.exchange.arrow import write_parquet

    files: dict[Path, Content] = {}
    for name, columns in tables.items():
        frame = columns.to_polars()
        files[place / f"{name}.parquet"] = partial(write_parquet, frame)
        if csv:
            files[place / f"{name}.csv"] = frame.write_csv
    return files


def record_bytes(
    inputs: Mapping[str, Any],
    issues: tuple[Issue, ...],
    toolpath: Toolpath,
    targets: Targets,
    cell: Cell,
    bands: Mapping[str, float],
    head: Mapping[str, Any],
    clearance: Clearance | None = None,
) -> bytes:
    """Return ``prediction.toml``: ``bands`` of the tables that have one, ``head`` as of `head_of`."""
    import tomli_w

    record: dict[str, Any] = {
        "schema": SCHEMA,
        "result": head,
        "inputs": inputs,
        "issues": [_issue_record(issue) for issue in issues],
        "toolpath_events": [_event_record(event) for event in toolpath.events],
        "targets_events": [_event_record(event) for event in targets.events],
        "cell": as_toml(cell),
    }
    if toolpath.restart is not None:
        record["restart"] = _restart_record(toolpath.restart)
    if targets.simplified is not None:
        record["simplified"] = asdict(targets.simplified)
    if targets.correction_mm:
        record["correction_mm"] = targets.correction_mm
    if clearance is not None:
        record["clearance"] = {"links": list(clearance.links), "obstacles": list(clearance.obstacles)}
    record |= {f"{name}_relative_band": band for name, band in bands.items()}
    return tomli_w.dumps(record).encode("utf-8", "replace")


def read_folder(place: Path) -> dict[str, Any]:
    """Return the fields of a prediction by name; raises `NotUnderstoodError` naming what it cannot read."""
    record = read_record(place / RECORD)
    cell = _cell_of(record, place / RECORD)
    names = ["toolpath", "targets", *(["motion"] if (place / "motion.parquet").exists() else [])]
    frames = {name: read_table(place / f"{name}.parquet", _kind_of(name)) for name in names}
    try:
        inputs = record.inputs.model_dump(exclude_unset=True)
        return {"cell": cell, "inputs": inputs, **_parts(record, frames, cell)}
    except (KeyError, ValueError) as error:
        words = f"not the tables of a prediction: {str(error)[:200]}"
        raise input_error("prediction-columns", words, REMEDY, source=str(place)) from None


def _cell_of(record: PredictionRecord, file: Path) -> Cell:
    """Return the cell of a prediction; an error names the first thing that is wrong with it."""
    try:
        return cell_from_resolved(record.cell, source=str(file))
    except NotUnderstoodError as error:
        first, *others = error.issues
        more = f" (and {len(others)} more)" if others else ""
        message = f"cell: {first.message}{more}"
        raise NotUnderstoodError(Issue("error", first.code, 0, message, REMEDY), str(file)) from None


def _parts(record: PredictionRecord, frames: dict[str, Any], cell: Cell) -> dict[str, Any]:
    """Return the tables of a prediction; raises `KeyError` or `ValueError` where they do not fit."""
    source, motion_frame = record.inputs.program, frames.get("motion")
    restart = None if record.restart is None else Restart(**record.restart.model_dump())
    paths, poses = len(frames["toolpath"]), len(frames["targets"])
    toolpath = _table(
        Toolpath,
        frames["toolpath"],
        source=source,
        events=events_of(record.toolpath_events, paths, "toolpath"),
        restart=restart,
    )
    targets = _table(
        Targets,
        frames["targets"],
        source=source,
        issues=record.findings(),
        events=events_of(record.targets_events, poses, "targets"),
        restart=restart,
        simplified=None if record.simplified is None else Simplified(**record.simplified.model_dump()),
        correction_mm=record.correction_mm,
    )
    parts: dict[str, Any] = {"toolpath": toolpath, "targets": targets}
    if motion_frame is not None:
        parts["motion"] = _table(Motion, motion_frame)
        bands = {"forces": record.forces_relative_band, "deflection": record.deflection_relative_band}
        for name, kind, mark in _BESIDE:
            if mark in motion_frame.columns:
                more: dict[str, Any] = {"relative_band": bands[name]} if name in bands else {}
                if name == "clearance":
                    more = record.clearance.model_dump()
                parts[name] = _table(kind, motion_frame, **more)
        parts["added"] = {
            name: motion_frame[name].to_numpy() for name in motion_frame.columns if _ADDED.fullmatch(name)
        }
    for table in parts.values():
        if isinstance(table, Table):
            check_numbers(table)
    tables = (parts.get("motion"), parts.get("forces"))
    check_references(toolpath, targets, *tables, set(cell.tool), parts.get("clearance"))
    return parts


_BESIDE: tuple[tuple[str, type[Table], str], ...] = (
    ("joints", Joints, "q1_rad"),
    ("clearance", Clearance, "clearance_mm"),
    ("forces", Forces, "force_base_x_N"),
    ("deflection", Deflection, "deflection_base_x_mm"),
)
"""Tables saved beside Motion, each with a column that no other table has."""
_TABLES: dict[str, tuple[type[Table], ...]] = {
    "toolpath": (Toolpath,),
    "targets": (Targets,),
    "motion": (Motion, *(kind for _, kind, _ in _BESIDE)),
}


def _kind_of(file: str) -> Callable[[str], str | None]:
    """Return the function from column name to Parquet type in a file; None for a column that is not ours."""
    specs = [spec for kind in _TABLES[file] for spec in fields(kind) if "tail" in spec.metadata]
    fixed: dict[str, str] = {}
    counted = [_ADDED] if file == "motion" else []
    for spec in specs:
        tail = spec.metadata["tail"]
        if tail == (None,):
            counted.append(counted_pattern(spec.name))
        else:
            names = names_of_parts(spec, tail[0] if tail else 0)
            fixed |= dict.fromkeys(names, PARQUET_TYPES[spec.metadata["dtype"].kind])

    def kind_of(name: str) -> str | None:
        if any(pattern.fullmatch(name) for pattern in counted):
            return PARQUET_TYPES["f"]
        return fixed.get(name)

    return kind_of


def refuse_foreign(folder: Path) -> None:
    """Raise where a folder exists, is not empty, and holds no prediction of ours."""
    if not folder.is_dir():
        return
    record = folder / RECORD
    if record.is_file() and _OURS.search(record.read_bytes()[:_MOST_OF_RECORD]):
        return
    others = sorted(file.name for file in folder.iterdir() if not _IGNORED.fullmatch(file.name))
    if others:
        what = "and no prediction" if RECORD not in others else "which is not a prediction"
        named = RECORD if RECORD in others else others[0]
        sentence = f"the folder is not empty: it holds {named}, {what}"
        raise input_error("output-foreign", sentence, "name a new folder", source=str(folder))


def _counted(name: str, columns: list[str]) -> list[str]:
    pattern = counted_pattern(name)
    return [column for column in columns if pattern.fullmatch(column)]


def _table(kind: type[AnyTable], frame: Any, **more: Any) -> AnyTable:
    columns: dict[str, Any] = {}
    for spec in fields(kind):
        if "tail" not in spec.metadata:
            continue
        tail = spec.metadata["tail"]
        width = tail[0] if tail else 0
        names = names_of_parts(spec, len(_counted(spec.name, frame.columns)) if width is None else width)
        absent = [name for name in names if name not in frame.columns]
        if absent and spec.default is not MISSING:
            continue
        if absent:
            raise ValueError(f"column {absent[0]} is missing")
        parts = [frame[name].to_numpy() for name in names]
        columns[spec.name] = np.stack(parts, axis=1) if tail else parts[0]
    return kind(**columns, **more)


def _issue_record(issue: Issue) -> dict[str, Any]:
    names = ("severity", "code", "line", "message", "remedy", *(("file", "file_line") if issue.file else ()))
    return {name: getattr(issue, name) for name in names}


def _restart_record(restart: Restart) -> dict[str, Any]:
    return {name: getattr(restart, name) for name in ("line", "begins_line", "way_rows")}


def _event_record(event: Event) -> dict[str, Any]:
    return {"row": event.row, "kind": event.kind, "values": event.values}
