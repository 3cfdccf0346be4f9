"""A prediction: the tables of a part and its cell, saved as a folder and loaded again."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.exchange import ColumnFrame, Findings, Table
from gcode2krl.exchange.findings import counted, findings_block
from gcode2krl.exchange.html import beside, block, path_picture, text_table
from gcode2krl.exchange.views import view
from gcode2krl.files import Content, make_folder, refuse_inputs, write_together
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.prediction.forecast import LoadFigures, load_figures
from gcode2krl.prediction.plots import Plots
from gcode2krl.result import cell_of, record_of, sha256_of
from gcode2krl.tables import Clearance, Deflection, Forces, Joints, Motion, Targets, Toolpath, lengths
from gcode2krl.units import MM_PER_M, NMM_PER_NM

# All stages side by side: a row a time sample.


def joined_samples(
    toolpath: Toolpath,
    motion: Motion | None,
    joints: Joints | None,
    forces: Forces | None,
    deflection: Deflection | None,
    added: Mapping[str, Floats],
    clearance: Clearance | None = None,
) -> ColumnFrame:
    """Return the samples of a motion with what every stage says of them; see `Prediction.samples`."""
    if motion is None:
        raise input_error("prediction-empty", "the prediction has no motion", "predict the part again")
    row = np.clip(motion.move, 0, len(toolpath) - 1)
    rapid = toolpath.rapid[row] | toolpath.machine[row]
    of_motion = motion.columns()
    columns: dict[str, NDArray[Any]] = {
        "time_s": of_motion.pop("time_s"),
        "source_line": toolpath.source_line[row],
        "tool": of_motion.pop("tool"),
        "move": of_motion.pop("move"),
        "kind": _kinds(toolpath)[row],
        "pass": pass_numbers(rapid, motion.tool),
    }
    if forces is not None:
        columns["cutting"] = np.asarray(np.isfinite(forces.phi_rad).any(axis=1))
    columns |= of_motion
    columns["feed_mm_s"] = toolpath.feed_mm_s[row]
    if joints is not None:
        columns |= joints.columns()
    if clearance is not None:
        link, obstacle = clearance.names()
        columns["clearance_mm"] = clearance.clearance_mm
        columns |= {"clearance_link": link, "clearance_obstacle": obstacle}
    if forces is not None:
        of_forces = forces.columns()
        del of_forces["tool"]  # that of the motion
        columns |= {"force_N": lengths(forces.force_base_N), **of_forces}
    if deflection is not None:
        columns |= {"deflection_mm": lengths(deflection.deflection_base_mm), **deflection.columns()}
    return ColumnFrame({**columns, **added}, "samples")


def pass_numbers(rapid: Bools, tool: Ints32) -> Ints32:
    """Return (m,) the number, from 1, of the run of feed samples of one tool; 0 on rapids."""
    begins = ~rapid
    begins[1:] &= rapid[:-1] | (tool[1:] != tool[:-1])
    return np.where(rapid, 0, np.cumsum(begins)).astype(np.int32)


def _kinds(toolpath: Toolpath) -> NDArray[np.str_]:
    """Return (n,) what each row of the tool path is."""
    kinds = [toolpath.machine, toolpath.rapid, toolpath.arc >= 0]
    return np.select(kinds, ["machine", "rapid", "arc"], "line")


# A prediction on one line, and as a notebook shows it.

_MOST_LETTERS = 60
"""Of a program's name on one line."""
_SERIOUS = ("error", "warning")


@dataclass(frozen=True)
class Figures:
    """The figures of a prediction; None where a stage did not run."""

    name: str
    moves: int
    time_s: float | None
    path_mm: float | None
    loads: LoadFigures | None
    issues: tuple[Issue, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by the names of a record."""
        return {
            "moves": self.moves,
            "time_s": self.time_s,
            "path_mm": self.path_mm,
            "max_force_N": self.loads.force_N if self.loads is not None else None,
            "max_deflection_mm": self.loads.deflection_mm if self.loads is not None else None,
        }

    @classmethod
    def of(
        cls,
        toolpath: Toolpath,
        motion: Motion | None,
        forces: Forces | None,
        deflection: Deflection | None,
        issues: tuple[Issue, ...],
    ) -> "Figures":
        """Return the figures of tables."""
        timed = motion if motion is not None and len(motion) else None
        return cls(
            name=re.split(r"[\\/]", toolpath.source)[-1][-_MOST_LETTERS:] or "program",
            moves=max(len(toolpath) - 1, 0),
            time_s=None if timed is None else float(timed.time_s[-1]),
            path_mm=None if timed is None else float(timed.path_mm[-1]),
            loads=None if forces is None else load_figures(forces, deflection),
            issues=issues,
        )


def figures_words(figures: Figures) -> str:
    """Return ``part.nc: 436 moves, 78.3 s, 895 N, 2.47 mm, 2 warnings``."""
    words = [f"{figures.moves} moves"]
    if figures.time_s is not None:
        words.append(f"{figures.time_s:.1f} s")
    if figures.loads is not None:
        words.append(f"{figures.loads.force_N:.0f} N")
        if figures.loads.deflection_mm is not None:
            words.append(f"{figures.loads.deflection_mm:.3g} mm")
    serious = counted(figures.issues, _SERIOUS) or counted(figures.issues)
    return f"{figures.name}: {', '.join([*words, *([serious] if serious else [])])}"


def figures_html(title: str, figures: Figures, toolpath: Toolpath, cell_name: str) -> str:
    """Return figures, findings and the path from above as HTML."""
    rows: list[tuple[str, str]] = [("program", figures.name), ("cell", cell_name or "without a name")]
    rows.append(("moves", str(figures.moves)))
    if figures.time_s is not None and figures.path_mm is not None:
        rows.append(("time", f"{figures.time_s:.1f} s of motion"))
        rows.append(("path", f"{figures.path_mm / MM_PER_M:.3f} m"))
    rows += _loads(figures.loads)
    shown = toolpath.is_position()
    picture = path_picture(toolpath.position_mm[shown], ~toolpath.rapid[shown])
    return block(title, beside(text_table((), rows), picture), findings_block(figures.issues))


def _loads(loads: LoadFigures | None) -> list[tuple[str, str]]:
    if loads is None:
        return [("force", "not known")]
    rows = [
        ("force", f"up to {loads.force_N:.0f} N +- {loads.force_band:.0%} (90 %)"),
        ("torque", f"up to {loads.torque_Nmm / NMM_PER_NM:.2f} Nm"),
        ("cut", f"{loads.in_cut:.0%} of the time, a_p up to {loads.a_p_mm:.2f} mm"),
    ]
    if loads.deflection_mm is None:
        return [*rows, ("deflection", "not known")]
    return [
        *rows,
        ("deflection", f"up to {loads.deflection_mm:.3g} mm +- {loads.deflection_band:.0%} (90 %)"),
    ]


# The record of a prediction, as the table ``[result]`` of ``prediction.toml`` (docs/record.md).

CHORD_MM = 0.01
"""Default of ``--chord-tolerance``; a test compares it with `gcode.CHORD_TOLERANCE_MM`."""
_NOT_OPTIONS = frozenset({"program", "program_sha256", "program_size_bytes", "version"})


def head_of(
    inputs: Mapping[str, Any],
    issues: tuple[Issue, ...],
    cell: Cell,
    figures: Mapping[str, Any],
    files: Mapping[str, str],
) -> dict[str, Any]:
    """Return the record without its findings, which stand beside it; TOML has no null, so it is left out.

    ``files`` are name → SHA-256 of the tables.
    """
    record = record_of(
        "predict",
        figures,
        issues,
        input=_input(inputs),
        cell=cell_of(cell, None),
        options=_options(inputs, cell),
        files=files,
    )
    del record["issues"]
    record["cell"] = {key: value for key, value in record["cell"].items() if value is not None}
    return {key: value for key, value in record.items() if value is not None}


def _options(inputs: Mapping[str, Any], cell: Cell) -> dict[str, Any]:
    """Return the settings that differ from their defaults."""
    defaults = {
        "dt_s": cell.controller.cycle_s,
        "chord_tolerance_mm": CHORD_MM,
        "block_delete": False,
        "dialect": DIALECT_NAMES[0],
    }
    return {
        key: value for key, value in inputs.items() if key not in _NOT_OPTIONS and value != defaults.get(key)
    }


def hashed(files: Mapping[Path, Content], hashes: dict[str, str]) -> dict[Path, Content]:
    """Return files that leave the SHA-256 of what is written in ``hashes``, by their names."""
    return {
        file: partial(_write_hashed, write, file.name, hashes) if callable(write) else write
        for file, write in files.items()
    }


def _write_hashed(write: Callable[[Path], object], name: str, hashes: dict[str, str], place: Path) -> None:
    write(place)
    hashes[name] = sha256_of(place)


def _input(inputs: Mapping[str, Any]) -> dict[str, Any] | None:
    keys = {"file": "program", "sha256": "program_sha256", "size_bytes": "program_size_bytes"}
    known = {name: inputs[key] for name, key in keys.items() if key in inputs}
    return known if len(known) == len(keys) else None


if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Prediction:
    """What is known of a part in a cell; None where a stage did not run.

    Each stage is a table of numpy columns that polars, pandas and Arrow take as it is.

    >>> from gcode2krl import predict
    >>> prediction = predict("part.nc")
    >>> prediction
    Prediction(part.nc: ... moves, ... s, ... N, ... mm, ... notes)
    >>> round(float(prediction.motion.time_s[-1]))
    12
    >>> round(float(prediction.motion.to_pandas()["speed_mm_s"].max()))
    200
    """

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
    """Why a stage did not run, or what an effect did not know."""
    added: dict[str, Floats] = field(default_factory=dict)
    """Columns (m,) beside Motion that effects bring: ``q1_act_rad`` …, ``q1_load_rad`` …,
    ``force_meas_x_N`` …."""
    clearance: Clearance | None = None
    """How near anything comes; None where the cell describes nothing that may be hit."""

    @property
    def issues(self) -> tuple[Issue, ...]:
        """All findings, of the targets (which carry those of the G-code) and of every later stage.

        >>> from gcode2krl import predict
        >>> [issue.severity for issue in predict("part.nc").issues if issue.severity == "error"]
        []
        """
        later = (self.motion, self.forces, self.deflection)
        stage_issues = (issue for table in later if table is not None for issue in table.issues)
        return (*self.targets.issues, *stage_issues, *self.skipped)

    @property
    def findings(self) -> Findings:
        """The `issues` as a table: ``severity``, ``code``, ``line``, ``message``, ``remedy``.

        >>> from gcode2krl import predict
        >>> predict("part.nc").findings.to_polars().columns
        ['severity', 'code', 'line', 'message', 'remedy']
        """
        return Findings(self.issues)

    @property
    def has_forces(self) -> bool:
        """True where forces are known.

        >>> from gcode2krl import predict
        >>> predict("part.nc", forces=False).has_forces
        False
        """
        return self.forces is not None

    @property
    def plot(self) -> Plots:
        """The figures that ``predict --plot`` draws, as Matplotlib figures: ``plot.force()`` ….

        >>> from gcode2krl import predict
        >>> predict("part.nc").plot.kinematics().savefig("kinematics.png")
        """
        return Plots(partial(_drawn, self))

    def samples(self) -> ColumnFrame:
        """Return all stages in one table, a row a time sample.

        ``source_line`` is the line of the G-code; ``kind`` of the move ``rapid``, ``line``, ``arc`` or
        ``machine``; ``pass`` counts the runs of feed moves of one tool from 1, 0 on rapids; ``cutting`` is
        where the tool is in material. ``force_N`` and ``deflection_mm`` are lengths of the vectors beside
        them; ``clearance_link`` and ``clearance_obstacle`` are names. Lengths are mm,
        times s, angles rad, forces N, torques N·mm: each name ends in its unit.
        Columns of a stage that did not run are left out. Raises `NotUnderstoodError` without a motion.

        The largest force of each line:

        >>> import polars as pl
        >>> from gcode2krl import predict
        >>> samples = predict("part.nc").samples().to_polars()
        >>> worst = samples.group_by("source_line").agg(pl.col("force_N").max())
        >>> worst.columns
        ['source_line', 'force_N']
        """
        return joined_samples(
            self.toolpath, self.motion, self.joints, self.forces, self.deflection, self.added, self.clearance
        )

    def save(self, folder: str | Path, csv: bool = False, inputs: Iterable[str | Path] = ()) -> list[Path]:
        """Write the folder (made if missing); with ``csv`` the tables as CSV too. Returns the files.

        The folder must be empty or hold a prediction. While it is being written its record says that it
        is unfinished, so that what a killed run leaves is never read as complete. ``inputs`` are never
        overwritten.

        >>> from gcode2krl import predict
        >>> [file.name for file in predict("part.nc").save("saved")]
        ['toolpath.parquet', 'targets.parquet', 'motion.parquet', 'prediction.toml']
        """
        from gcode2krl.prediction.folder import RECORD, UNFINISHED, refuse_foreign, table_files

        place = Path(folder)
        refuse_foreign(place)
        make_folder(place)
        hashes: dict[str, str] = {}
        files, record = hashed(table_files(place, self._tables_on_disk(), csv), hashes), place / RECORD
        files[record] = lambda file: file.write_bytes(self._record_bytes(hashes))  # after the tables
        refuse_inputs(files, inputs)
        before = record.read_bytes() if record.is_file() else None
        write_together({record: UNFINISHED})
        try:
            write_together(files)
        except BaseException as error:
            if isinstance(error, NotUnderstoodError) and error.issues[0].code == "output-changed":
                raise  # the record is that of another process by now
            if before is None:
                record.unlink(missing_ok=True)
            else:
                write_together({record: before})
            raise
        return list(files)

    @classmethod
    def load(cls, folder: str | Path) -> "Prediction":
        """Read a folder that `save` wrote; raises `NotUnderstoodError` naming the file it cannot read.

        >>> from gcode2krl import Prediction
        >>> Prediction.load("prediction").motion
        Motion(... samples, ... s)
        """
        from gcode2krl.prediction.folder import read_folder

        return cls(**read_folder(Path(folder)))

    def _tables_on_disk(self) -> dict[str, ColumnFrame]:
        """Return the tables as they are saved: Motion with what stands beside it."""
        tables = {"toolpath": self.toolpath.columns(), "targets": self.targets.columns()}
        if self.motion is not None:
            columns_of: list[Table] = [
                table
                for table in (self.joints, self.clearance, self.forces, self.deflection)
                if table is not None
            ]
            tables["motion"] = self.motion.columns()
            for table in columns_of:
                tables["motion"] |= table.columns()
            tables["motion"] |= self.added
        return {name: ColumnFrame(columns) for name, columns in tables.items()}

    def _record_bytes(self, hashes: Mapping[str, str]) -> bytes:
        from gcode2krl.prediction.folder import record_bytes

        head = head_of(self.inputs, self.issues, self.cell, self._figures().as_dict(), hashes)
        return record_bytes(
            self.inputs,
            self.issues,
            self.toolpath,
            self.targets,
            self.cell,
            self._bands(),
            head,
            self.clearance,
        )

    def _bands(self) -> dict[str, float]:
        named = (("forces", self.forces), ("deflection", self.deflection))
        return {name: table.relative_band for name, table in named if table is not None}

    def _figures(self) -> Figures:
        return Figures.of(self.toolpath, self.motion, self.forces, self.deflection, self.issues)

    def __repr__(self) -> str:
        return f"Prediction({figures_words(self._figures())})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: figures, findings and the path from above."""
        return figures_html(repr(self), self._figures(), self.toolpath, self.cell.name)


def _drawn(prediction: Prediction, name: str) -> "Figure":
    figure: Figure = view("prediction figure")(prediction, name)
    return figure
