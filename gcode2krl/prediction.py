"""A prediction: the tables of a part and its cell, saved as a folder and loaded again.

The folder holds ``prediction.toml`` (inputs, hashes, versions, settings, the cell as resolved, findings and
events) and a Parquet file a table: ``toolpath``, ``targets``, and ``motion`` with Motion and Joints side by
side. Vector columns are split: ``position_x_mm`` …, ``rotation_x`` …, ``q1_rad`` ….
"""

import re
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gcode2krl.cell import Cell, as_toml, cell_from_resolved
from gcode2krl.errors import Issue, input_error
from gcode2krl.files import Content, make_folder, refuse_inputs, write_together
from gcode2krl.tables import Deflection, Event, Forces, Joints, Motion, Table, Targets, Toolpath

SCHEMA = "gcode2krl/prediction/1"
RECORD = "prediction.toml"
_UNFINISHED = f'schema = "{SCHEMA}"\nunfinished = true\n'.encode("ascii")
_OURS = re.compile(rb'^schema = "gcode2krl/prediction/\d+"', re.MULTILINE)
_MOST_OF_RECORD = 4096
_IGNORED = re.compile(r"\.DS_Store|Thumbs\.db|desktop\.ini|\..+\.(?:part|old)")
"""Files that make no folder somebody's: those of desktops, and leftovers of a killed run."""
_UNITS = ("_mm_s3", "_mm_s2", "_mm_s", "_mm", "_rad_s", "_rad", "_Nmm", "_N")
_ADDED = re.compile(r"q[1-6]_(act|load)_rad|(force|moment)_meas_[xyz]_(N|Nmm)")
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
    added: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """Columns (m,) beside Motion that effects bring: ``q1_act_rad`` …, ``q1_load_rad`` …,
    ``force_meas_x_N`` …."""

    @property
    def issues(self) -> tuple[Issue, ...]:
        """All findings, of the targets (which carry those of the G-code) and of every later stage."""
        later = (self.motion, self.forces, self.deflection)
        found = (issue for table in later if table is not None for issue in table.issues)
        return (*self.targets.issues, *found, *self.skipped)

    def save(self, folder: str | Path, csv: bool = False, inputs: Iterable[str | Path] = ()) -> list[Path]:
        """Write the folder (made if missing); with ``csv`` the tables as CSV too. Returns the files.

        The folder must be empty or hold a prediction. While it is written it says that it is unfinished, so
        that what a killed run leaves is not read as a whole. ``inputs`` are never overwritten.
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
        for name, table in (("forces", self.forces), ("deflection", self.deflection)):
            if table is not None:
                record[f"{name}_relative_band"] = table.relative_band
        return {**files, place / RECORD: tomli_w.dumps(record).encode("utf-8", "replace")}

    @classmethod
    def load(cls, folder: str | Path) -> "Prediction":
        """Read a folder that `save` wrote; raises `NotUnderstoodError` naming the file it cannot read."""
        import polars as pl

        place = Path(folder)
        record = _read_record(place / "prediction.toml")
        found: dict[str, Any] = {}
        for name in ("toolpath", "targets", "motion"):
            file = place / f"{name}.parquet"
            if not file.exists() and name == "motion":
                continue
            try:
                found[name] = pl.read_parquet(file)
            except (OSError, pl.exceptions.PolarsError) as error:
                raise input_error("file-unreadable", f"cannot read: {error}", source=str(file)) from None
        issues = tuple(Issue(**issue) for issue in record["issues"])
        source = str(record["inputs"].get("program", ""))
        try:
            toolpath = _table(
                Toolpath, found["toolpath"], events=_events(record["toolpath_events"]), source=source
            )
            targets = _table(
                Targets,
                found["targets"],
                events=_events(record["targets_events"]),
                source=source,
                issues=issues,
            )
            motion = _table(Motion, found["motion"]) if "motion" in found else None
            beside = found.get("motion", ())
            joints = _table(Joints, beside) if "q1_rad" in beside else None
            forces = (
                _table(Forces, beside, relative_band=record.get("forces_relative_band", 0.0))
                if "force_base_x_N" in beside
                else None
            )
            deflection = (
                _table(Deflection, beside, relative_band=record.get("deflection_relative_band", 0.0))
                if "deflection_base_x_mm" in beside
                else None
            )
        except (KeyError, ValueError, pl.exceptions.PolarsError) as error:
            raise input_error(
                "prediction-columns", f"not the tables of a prediction: {error}", source=str(place)
            ) from None
        cell = cell_from_resolved(record["cell"], source=str(place / "prediction.toml"))
        added = {
            name: beside[name].to_numpy() for name in getattr(beside, "columns", ()) if _ADDED.fullmatch(name)
        }
        return cls(toolpath, targets, cell, motion, joints, record["inputs"], forces, deflection, (), added)


def refuse_foreign(folder: Path) -> None:
    """Raise where a folder exists, is not empty, and holds no prediction of ours."""
    if not folder.is_dir():
        return
    record = folder / RECORD
    if record.is_file() and _OURS.search(record.read_bytes()[:_MOST_OF_RECORD]):
        return
    others = sorted(file.name for file in folder.iterdir() if not _IGNORED.fullmatch(file.name))
    if others:
        what = "and no prediction of ours" if RECORD not in others else "which is no prediction of ours"
        named = RECORD if RECORD in others else others[0]
        sentence = f"the folder is not empty: it holds {named}, {what}"
        raise input_error("output-foreign", sentence, "name a new folder", source=str(folder))


def _read_record(file: Path) -> dict[str, Any]:
    try:
        record = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise input_error("not-toml", str(error), source=str(file)) from None
    if record.get("unfinished"):
        sentence = "the prediction was not written to its end"
        raise input_error("prediction-unfinished", sentence, "predict again", source=str(file))
    if record.get("schema") != SCHEMA:
        found = record.get("schema")
        raise input_error(
            "prediction-schema", f"schema: found {found!r}, allowed: {SCHEMA}", source=str(file)
        )
    return record


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


def _counted(name: str, columns: list[str]) -> list[str]:
    stem, unit = name.rsplit("_", 1)
    return [column for column in columns if re.fullmatch(rf"{stem}_\d+_{unit}", column)]


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
        parts = [frame[name].to_numpy() for name in names]
        columns[spec.name] = np.stack(parts, axis=1) if tail else parts[0]
    return kind(**columns, **more)


def _issue_record(issue: Issue) -> dict[str, Any]:
    return {name: getattr(issue, name) for name in ("severity", "code", "line", "message", "remedy")}


def _event_record(event: Event) -> dict[str, Any]:
    return {"row": event.row, "kind": event.kind, "values": event.values}


def _events(records: list[dict[str, Any]]) -> tuple[Event, ...]:
    return tuple(Event(record["row"], record["kind"], record["values"]) for record in records)
