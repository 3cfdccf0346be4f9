"""A prediction: the tables of a part and its cell, saved as a folder and loaded again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.exchange import Columns, Findings, Table
from gcode2krl.exchange.views import view
from gcode2krl.files import make_folder, refuse_inputs, write_together
from gcode2krl.prediction.folder import (
    RECORD,
    UNFINISHED,
    read_folder,
    record_bytes,
    refuse_foreign,
    table_files,
)
from gcode2krl.prediction.head import hashed, head_of
from gcode2krl.prediction.looks import Figures, figures_html, figures_words
from gcode2krl.prediction.plots import Plots
from gcode2krl.prediction.samples import joined_samples
from gcode2krl.tables import Clearance, Deflection, Forces, Joints, Motion, Targets, Toolpath

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
    """Why a stage did not run."""
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

    def samples(self) -> Columns:
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
        return cls(**read_folder(Path(folder)))

    def _tables_on_disk(self) -> dict[str, Columns]:
        """Return the tables as they are saved: Motion with what stands beside it."""
        tables = {"toolpath": self.toolpath.columns(), "targets": self.targets.columns()}
        if self.motion is not None:
            beside: list[Table] = [
                table
                for table in (self.joints, self.clearance, self.forces, self.deflection)
                if table is not None
            ]
            tables["motion"] = self.motion.columns()
            for table in beside:
                tables["motion"] |= table.columns()
            tables["motion"] |= self.added
        return {name: Columns(columns) for name, columns in tables.items()}

    def _record_bytes(self, hashes: Mapping[str, str]) -> bytes:
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
