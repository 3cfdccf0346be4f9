"""A measured run: a folder with ``run.toml`` and what was recorded."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar, get_args

from gcode2krl.cell import load_cell
from gcode2krl.errors import Issue, input_error
from gcode2krl.exchange.findings import counted, findings_block
from gcode2krl.exchange.html import block, text_table
from gcode2krl.runs.checks import check_columns, check_table, check_together, quantised
from gcode2krl.runs.diadem import is_data_set
from gcode2krl.runs.head import RunHead, read_head
from gcode2krl.runs.krc_trace import read_krc_trace, recording_of
from gcode2krl.runs.measured import Controller, Force, Measured, Poses, Tracker, build, columns_of, signals_of
from gcode2krl.runs.poses import read_poses
from gcode2krl.runs.rsi_log import is_rsi_log, read_rsi_log
from gcode2krl.runs.scan import Scan, read_scan
from gcode2krl.runs.tables import Sheet, read_sheet

AnyMeasured = TypeVar("AnyMeasured", bound=Measured)
What = Literal["controller", "tracker", "force", "scan", "poses"]
_ENDINGS = {"scan": (".csv", ".parquet", ".ply")}
_RSI_NAMES = ("rsi.log", "rsi.xml", "rsi.txt", "rsi.csv")


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What one run recorded; None where there is no file.

    >>> from gcode2krl import load_run
    >>> run = load_run("run-1")
    >>> run
    Run(run-1: controller ... rows, tracker ... rows...)
    >>> run.tracker.position_mm.shape[1]
    3
    """

    name: str
    folder: Path
    head: RunHead
    controller: Controller | None = None
    tracker: Tracker | None = None
    force: Force | None = None
    scan: Scan | None = None
    issues: tuple[Issue, ...] = ()
    poses: Poses | None = None

    def path(self, key: Literal["cell", "program", "prediction"]) -> Path | None:
        """Return a path that ``run.toml`` names, relative to the run's folder; None where it names none.

        >>> from gcode2krl import load_run
        >>> load_run("run-1").path("prediction")
        """
        value: str | None = getattr(self.head, key)
        return None if value is None else self.folder / value

    def _tables(self) -> dict[str, Measured]:
        named = {
            "controller": self.controller,
            "tracker": self.tracker,
            "force": self.force,
            "poses": self.poses,
        }
        return {name: table for name, table in named.items() if table is not None}

    def __repr__(self) -> str:
        parts = [f"{name} {len(table)} rows" for name, table in self._tables().items()]
        parts += ["scan"] if self.scan is not None else []
        found = counted(self.issues)
        return f"Run({self.name[-60:]}: {', '.join([*(parts or ['no table']), *([found] if found else [])])})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the tables with their signals, and the findings."""
        rows = [
            (
                name,
                len(table),
                f"{table.time_s[0]:.2f} to {table.time_s[-1]:.2f}",
                ", ".join(signals_of(table)),
            )
            for name, table in self._tables().items()
        ]
        head = ("table", "rows", "time (s)", "signals")
        return block(repr(self), text_table(head, rows), findings_block(self.issues))


def load_run(folder: str | Path, *, partial: bool = False) -> Run:
    """Read and check a measured run.

    Parameters
    ----------
    partial : joints may be missing in the commanded and actual angles (a log of some joints only).

    Raises
    ------
    NotUnderstoodError
        Names file, row and column: a file that cannot be read, a missing column, time that does not rise,
        wrong units, swapped columns, tables that do not overlap.

    Examples
    --------
    >>> from gcode2krl import load_run
    >>> load_run("run-1").controller.q_act_rad.shape[1]
    6
    """
    place = Path(folder)
    if not place.is_dir():
        raise input_error(
            "file-unreadable", "is not a folder", "a run is a folder with run.toml", source=str(place)
        )
    head, issues = read_head(place / "run.toml")
    files = {what: _file_of(what, place, head) for what in get_args(What)}

    def controller_sheet(file: Path) -> Sheet:
        if is_data_set(file):
            return read_krc_trace(file, _gear_ratio(place, head))
        return read_rsi_log(file) if is_rsi_log(file) else _sheet(Controller)(file)

    readers = {
        "controller": controller_sheet,
        "tracker": _sheet(Tracker),
        "force": _sheet(Force),
        "poses": read_poses,
    }
    sheets = {what: read(file) for what, read in readers.items() if (file := files[what]) is not None}
    traced = files["controller"] is not None and is_data_set(files["controller"])  # angles of the drives
    scan = read_scan(files["scan"]) if files["scan"] else None
    issues = (*issues, *_paths(place, head), *_not_read(place, files["controller"]))
    name = place.resolve().name
    return assembled(name, place, head, sheets, partial=partial, traced=traced, scan=scan, issues=issues)


def assembled(
    name: str,
    place: Path,
    head: RunHead,
    sheets: Mapping[str, Sheet],
    *,
    partial: bool = False,
    traced: bool = False,
    scan: Scan | None = None,
    issues: Iterable[Issue] = (),
) -> Run:
    """Return the run of sheets by the names of its tables, checked; errors as for `load_run`.

    ``traced``: joints may be missing in the controller's table.
    """
    controller = _table(Controller, sheets.get("controller"), head, partial or traced)
    tracker = _table(Tracker, sheets.get("tracker"), head, partial)
    force = _table(Force, sheets.get("force"), head, partial)
    poses = _table(Poses, sheets.get("poses"), head, partial)
    check_together(controller, tracker, force)
    check_columns(controller, tracker, head)
    tables = (controller, tracker, force, poses)
    table_issues = [issue for table in (*tables, scan) if table for issue in table.issues]
    table_issues += [issue for table in tables if table for issue in quantised(table, head)]
    return Run(name, place, head, controller, tracker, force, scan, (*issues, *table_issues), poses)


def _sheet(kind: type[Measured]) -> Callable[[Path], Sheet]:
    return lambda file: read_sheet(file, columns_of(kind))


def _table(kind: type[AnyMeasured], sheet: Sheet | None, head: RunHead, partial: bool) -> AnyMeasured | None:
    if sheet is None:
        return None
    clock_s = getattr(head.clocks, f"{kind.__name__.lower()}_s", 0.0)
    table = build(kind, sheet, partial=partial, clock_s=clock_s)
    check_table(table, head)
    return table


def _file_of(what: What, place: Path, head: RunHead) -> Path | None:
    """Return the file of a table: the one that ``[files]`` names, else the usual one, else None."""
    named: str | None = getattr(head.files, what)
    if named is not None:
        if not _exists(place / named):
            words = f"files.{what}: no file {named[:80]!r} there"
            raise input_error("file-unreadable", words, source=str(place / "run.toml"))
        return place / named
    usual = [place / f"{what}{ending}" for ending in _ENDINGS.get(what, (".csv", ".parquet"))]
    files = [file for file in usual if file.is_file()]
    if not files and what == "controller":
        files = _controller_logs(place)
    if len(files) > 1:
        names = ", ".join(file.name for file in files)
        remedy = f"keep one, or name it: [files] {what} = {files[0].name!r}"
        raise input_error("run-files", f"{what}: several files: {names}", remedy, source=str(place))
    return files[0] if files else None


def _exists(path: Path, is_file: bool = True) -> bool:
    """Tell whether a path leads to a file (or anything); an invalid name leads nowhere."""
    try:
        return path.is_file() if is_file else path.exists()
    except (OSError, ValueError):
        return False


def _controller_logs(place: Path) -> list[Path]:
    """Return one file of each KRC trace in a folder, and the RSI logs."""
    traces: dict[str, Path] = {}
    for file in sorted(place.glob("*.dat")):
        if is_data_set(file):
            traces.setdefault(recording_of(file), file)
    return [*traces.values(), *(place / name for name in _RSI_NAMES if (place / name).is_file())]


def _not_read(place: Path, controller: Path | None) -> list[Issue]:
    """Return a note for each controller log beside the table that was read."""
    return [
        Issue("note", "run-files", 0, f"{file.name}: not read, {controller.name} is")
        for file in _controller_logs(place)
        if controller is not None and file != controller and recording_of(file) != recording_of(controller)
    ]


def _gear_ratio(place: Path, head: RunHead) -> tuple[float, ...] | None:
    """Return the gear ratios of the cell that ``run.toml`` names."""
    if head.cell is None or not _exists(place / head.cell):
        return None
    return load_cell(place / head.cell).robot.drives.gear_ratio


def _paths(place: Path, head: RunHead) -> list[Issue]:
    """Return a warning for each path of ``run.toml`` that leads nowhere."""
    named = {key: getattr(head, key) for key in ("cell", "program", "prediction")}
    return [
        Issue(
            "warning",
            "run-path",
            0,
            f"run.toml: {key}: nothing at {value[:80]!r}",
            "relative to the run's folder",
        )
        for key, value in named.items()
        if value is not None and not _exists(place / value, is_file=False)
    ]
