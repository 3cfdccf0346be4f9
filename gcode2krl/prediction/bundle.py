"""A prediction: the tables of a part and its cell, saved as a folder and loaded again.

The folder holds ``prediction.toml`` (inputs, hashes, versions, settings, the cell as resolved, findings and
events) and a Parquet file a table: ``toolpath``, ``targets``, and ``motion`` with Motion and Joints side by
side. Vector columns are split: ``position_x_mm`` …, ``rotation_x`` …, ``q1_rad`` ….
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import MISSING, Field, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, as_toml, cell_from_resolved
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files import Content, make_folder, refuse_inputs, write_together
from gcode2krl.prediction.record import REMEDY, SCHEMA, PredictionRecord, events_of, read_record
from gcode2krl.prediction.tables import PARQUET_TYPES, check_numbers, check_references, read_table
from gcode2krl.tables import (
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
_UNFINISHED = f'schema = "{SCHEMA}"\nunfinished = true\n'.encode("ascii")
_OURS = re.compile(rb'^schema = "gcode2krl/prediction/\d+"', re.MULTILINE)
_MOST_OF_RECORD = 4096
_IGNORED = re.compile(r"\.DS_Store|Thumbs\.db|desktop\.ini|\..+\.(?:part|old)")
"""Files that do not make a folder foreign: those of desktops, and leftovers of a killed run."""
_UNITS = ("_mm_s3", "_mm_s2", "_mm_s", "_mm", "_rad_s", "_rad", "_Nmm", "_N")
_ADDED = re.compile(r"q[1-6]_(act|load)_rad|(force|moment)_meas_[xyz]_(N|Nmm)|part_shift_[xyz]_mm")
_AXES = {3: "xyz", 4: "xyzw"}
AnyTable = TypeVar("AnyTable", bound=Table)


@dataclass(frozen=True)
class Prediction:
    """What is known of a part in a cell; None where a stage did not run."""

    toolpath: Toolpath
    targets: Targets
    cell: Cell
    motion: Motion | None = None
    joints: Joints | None = None
    inputs: dict[str, Any] = field(default_factory=dict)
    """Program, its SHA-256, version and settings."""
    forces: Forces | None = None
    deflection: Deflection | None = None
    skipped: tuple[Issue, ...] = ()
    """Why a stage did not run."""
    added: dict[str, Floats] = field(default_factory=dict)
    """Columns (m,) beside Motion that effects bring: ``q1_act_rad`` …, ``q1_load_rad`` …,
    ``force_meas_x_N`` …."""

    @property
    def issues(self) -> tuple[Issue, ...]:
        """All findings, of the targets (which carry those of the G-code) and of every later stage."""
        later = (self.motion, self.forces, self.deflection)
        stage_issues = (issue for table in later if table is not None for issue in table.issues)
        return (*self.targets.issues, *stage_issues, *self.skipped)

    @property
    def has_forces(self) -> bool:
        """True where forces are known."""
        return self.forces is not None

    def save(self, folder: str | Path, csv: bool = False, inputs: Iterable[str | Path] = ()) -> list[Path]:
        """Write the folder (made if missing); with ``csv`` the tables as CSV too. Returns the files.

        The folder must be empty or hold a prediction. While it is being written its record says that it
        is unfinished, so that what a killed run leaves is never read as complete. ``inputs`` are never
        overwritten.
        """
        place = Path(folder)
        refuse_foreign(place)
        make_folder(place)
        files, record = self._files(place, csv), place / RECORD
        refuse_inputs(files, inputs)
        before = record.read_bytes() if record.is_file() else None
        write_together({record: _UNFINISHED})
        try:
            write_together(files)
        except BaseException:
            if before is None:
                record.unlink(missing_ok=True)
            else:
                write_together({record: before})
            raise
        return list(files)

    def _files(self, place: Path, csv: bool) -> dict[Path, Content]:
        """Return the files and what writes them, the record last."""
        import polars as pl
        import tomli_w

        tables: dict[str, dict[str, Any]] = {
            "toolpath": dict(_columns(self.toolpath)),
            "targets": dict(_columns(self.targets)),
        }
        if self.motion is not None:
            tables["motion"] = dict(_columns(self.motion))
            for beside in (self.joints, self.forces, self.deflection):
                if beside is not None:
                    tables["motion"] |= dict(_columns(beside))
            tables["motion"] |= self.added
        files: dict[Path, Content] = {}
        for name, columns in tables.items():
            frame = pl.DataFrame(columns)
            files[place / f"{name}.parquet"] = frame.write_parquet
            if csv:
                files[place / f"{name}.csv"] = frame.write_csv
        record: dict[str, Any] = {
            "schema": SCHEMA,
            "inputs": self.inputs,
            "issues": [_issue_record(issue) for issue in self.issues],
            "toolpath_events": [_event_record(event) for event in self.toolpath.events],
            "targets_events": [_event_record(event) for event in self.targets.events],
            "cell": as_toml(self.cell),
        }
        if self.toolpath.restart is not None:
            record["restart"] = _restart_record(self.toolpath.restart)
        if self.targets.simplified is not None:
            record["simplified"] = asdict(self.targets.simplified)
        if self.targets.correction_mm:
            record["correction_mm"] = self.targets.correction_mm
        for name, table in (("forces", self.forces), ("deflection", self.deflection)):
            if table is not None:
                record[f"{name}_relative_band"] = table.relative_band
        return {**files, place / RECORD: tomli_w.dumps(record).encode("utf-8", "replace")}

    @classmethod
    def load(cls, folder: str | Path) -> "Prediction":
        """Read a folder that `save` wrote; raises `NotUnderstoodError` naming the file it cannot read."""
        place = Path(folder)
        record = read_record(place / "prediction.toml")
        cell = _cell_of(record, place / "prediction.toml")
        names = ["toolpath", "targets", *(["motion"] if (place / "motion.parquet").exists() else [])]
        frames = {name: read_table(place / f"{name}.parquet", _kind_of(name)) for name in names}
        try:
            return cls(
                cell=cell, inputs=record.inputs.model_dump(exclude_unset=True), **_parts(record, frames, cell)
            )
        except (KeyError, ValueError) as error:
            words = f"not the tables of a prediction: {str(error)[:200]}"
            raise input_error("prediction-columns", words, REMEDY, source=str(place)) from None


def _cell_of(record: PredictionRecord, file: Path) -> Cell:
    """Return the cell of a prediction; an error names the first thing that is wrong with it."""
    try:
        return cell_from_resolved(record.cell, source=str(file))
    except NotUnderstoodError as error:
        first, *rest = error.issues
        more = f" (and {len(rest)} more)" if rest else ""
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
                band = {"relative_band": bands[name]} if name in bands else {}
                parts[name] = _table(kind, motion_frame, **band)
        parts["added"] = {
            name: motion_frame[name].to_numpy() for name in motion_frame.columns if _ADDED.fullmatch(name)
        }
    for table in parts.values():
        if isinstance(table, Table):
            check_numbers(table)
    check_references(toolpath, targets, parts.get("motion"), parts.get("forces"), set(cell.tool))
    return parts


_BESIDE: tuple[tuple[str, type[Table], str], ...] = (
    ("joints", Joints, "q1_rad"),
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
            counted.append(_counted_pattern(spec.name))
        else:
            names = _names_on_disk(spec, tail[0] if tail else 0)
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


def column_names(name: str, width: int) -> list[str]:
    """Return the names on disk of a column of the given width (0 = a plain column)."""
    if width == 0:
        return [name]
    unit = next((unit for unit in _UNITS if name.endswith(unit)), "")
    stem = name[: len(name) - len(unit)] if unit else name
    if width in _AXES:
        return [f"{stem}_{axis}{unit}" for axis in _AXES[width]]
    return [f"{stem}{number}{unit}" for number in range(1, width + 1)]


def _names_on_disk(spec: Field[Any], width: int) -> list[str]:
    """Return a column's names; one whose width the data decide is counted from 0: ``phi_0_rad`` …."""
    if spec.metadata["tail"] != (None,):
        return column_names(spec.name, width)
    stem, unit = spec.name.rsplit("_", 1)
    return [f"{stem}_{number}_{unit}" for number in range(width)]


def _counted_pattern(name: str) -> re.Pattern[str]:
    stem, unit = name.rsplit("_", 1)
    return re.compile(rf"{stem}_\d{{1,3}}_{unit}")


def _counted(name: str, columns: list[str]) -> list[str]:
    pattern = _counted_pattern(name)
    return [column for column in columns if pattern.fullmatch(column)]


def _columns(table: Table) -> Iterator[tuple[str, Any]]:
    for spec in fields(table):
        if "tail" not in spec.metadata:
            continue
        values = getattr(table, spec.name)
        names = _names_on_disk(spec, values.shape[1] if values.ndim == 2 else 0)
        for number, name in enumerate(names):
            yield name, np.ascontiguousarray(values[:, number] if values.ndim == 2 else values)


def _table(kind: type[AnyTable], frame: Any, **more: Any) -> AnyTable:
    columns: dict[str, Any] = {}
    for spec in fields(kind):
        if "tail" not in spec.metadata:
            continue
        tail = spec.metadata["tail"]
        width = tail[0] if tail else 0
        names = _names_on_disk(spec, len(_counted(spec.name, frame.columns)) if width is None else width)
        absent = [name for name in names if name not in frame.columns]
        if absent and spec.default is not MISSING:
            continue
        if absent:
            raise ValueError(f"column {absent[0]} is missing")
        parts = [frame[name].to_numpy() for name in names]
        columns[spec.name] = np.stack(parts, axis=1) if tail else parts[0]
    return kind(**columns, **more)


def _issue_record(issue: Issue) -> dict[str, Any]:
    return {name: getattr(issue, name) for name in ("severity", "code", "line", "message", "remedy")}


def _restart_record(restart: Restart) -> dict[str, Any]:
    return {name: getattr(restart, name) for name in ("line", "begins_line", "way_rows")}


def _event_record(event: Event) -> dict[str, Any]:
    return {"row": event.row, "kind": event.kind, "values": event.values}
