"""From a table of another exporter to a run: in memory, or as a folder that later tables follow."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.spatial.transform import Rotation

from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.frames import abc_from_rotation
from gcode2krl.runs.diadem import is_data_set
from gcode2krl.runs.folder import Run, assembled, load_run
from gcode2krl.runs.foreign.guess import ORDERS, Entry, Guess, Predicted, by_layout, guessed, same_columns
from gcode2krl.runs.foreign.names import FACTORS, kind_of
from gcode2krl.runs.foreign.table import LogTable, read_table, table_of
from gcode2krl.runs.head import Clocks, Layout, RunHead, read_head
from gcode2krl.runs.krc_trace import read_krc_trace
from gcode2krl.runs.rsi_log import is_telegrams, read_rsi_log
from gcode2krl.runs.tables import Sheet
from gcode2krl.units import DEG_PER_RAD

_UNITS = {kind: next(iter(units)) for kind, units in FACTORS.items()}
_TABLES = {
    "controller": r"q\d_(cmd|act|load|corr)|[xyzabc]_(cmd|act|corr)|i\d|tau\d|temp\d|ambient",
    "tracker": r"[xyzabc]",
    "force": r"[fm][xyz]",
}
_COSTS = (
    (
        "q1_cmd",
        "commanded joints (path and drives are judged as one, a lag of all axes is taken for a clock)",
    ),
    ("q1_act", "actual joints (drives are not examined)"),
    ("q1_load", "encoders behind the gears (gears are not examined)"),
    ("x", "an instrument at the tip (the arm is not examined)"),
    ("fx", "forces (the cut is not examined)"),
)


def guess_of(source: Any, *, like: Layout | None = None, **answers: Any) -> Guess:
    """Return the guess of a file or a frame; ``answers`` and errors as for `guessed`.

    ``like``: the layout of an earlier run; it answers for a table that has its columns.
    """
    if isinstance(source, (str, Path)):
        source = read_table(source)
    table = source if isinstance(source, LogTable) else table_of(source)
    stated = any(answers.get(key) for key in ("columns", "units", "order", "joints"))
    if like is not None and same_columns(like, table) and not stated:
        return by_layout(table, like, answers.get("prediction"))
    return guessed(table, **answers)


def run_from(
    source: Any,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    order: str = "",
    joints: str = "",
    prediction: Predicted | None = None,
    name: str = "",
) -> Run:
    """Return the run of a log that is no run folder: a file of another exporter, or a frame.

    Parameters
    ----------
    source : a path (CSV, Parquet, MATLAB v5, RSI log, KRC trace), or a frame of polars, pandas or Arrow,
        columns by name, a structured numpy array.
    columns : their name → column of docs/runs.md, with or without its unit (``q1_act_rad``).
    units : their name, or a quantity (time, angle, length, force), → unit.
    order : of the three angles of an orientation: zyx, xyz, xyz-fixed, zyz, rotvec.
    joints : numbers of the axes in the order in which the table counts its joints, ``"321456"``.
    prediction : what the run belongs to; it settles units and orders that names leave open.

    Raises
    ------
    NotUnderstoodError
        A unit, an order or a column that nothing settles (``run-layout``), or a file that is no log.

    Examples
    --------
    >>> from gcode2krl import run_from
    >>> run_from("run-1/controller.csv", units={"angle": "deg"}).controller.q_act_rad.shape[1]
    6
    """
    native = _native(source) if isinstance(source, (str, Path)) else None
    if native is not None:
        return _assembled(name or Path(source).stem, Path(source).parent, RunHead(), {"controller": native})
    guess = guess_of(source, columns=columns, units=units, order=order, joints=joints, prediction=prediction)
    guess.require_certain()
    return run_of(guess, name or (Path(source).stem if isinstance(source, (str, Path)) else "run"))


def run_of(guess: Guess, name: str) -> Run:
    """Return the run of a guess without questions."""
    return _assembled(name, Path(guess.table.source).parent, _head(guess), sheets_of(guess))


def _assembled(name: str, place: Path, head: RunHead, sheets: Mapping[str, Sheet]) -> Run:
    return assembled(name, place, head, sheets, partial=any(_some_joints(sheet) for sheet in sheets.values()))


def _some_joints(sheet: Sheet) -> bool:
    return any(
        0 < sum(f"q{n}_{side}_deg" in sheet.columns for n in range(1, 7)) < 6 for side in ("cmd", "act")
    )


def _native(path: str | Path) -> Sheet | None:
    """Return the sheet of a KRC trace or an RSI log, whose formats fix everything; None of another file."""
    file = Path(path)
    if not is_native(file):
        return None
    return read_krc_trace(file) if is_data_set(file) else read_rsi_log(file)


def _head(guess: Guess) -> RunHead:
    clock_s = round(guess.clock_s, 3)
    clocks = Clocks(controller_s=clock_s, tracker_s=clock_s, force_s=clock_s)
    return RunHead(clocks=clocks, layout=guess.layout())


def sheets_of(guess: Guess) -> dict[str, Sheet]:
    """Return the tables of a guess in the columns of docs/runs.md."""
    columns = {entry.target: guess.values(entry.target) for entry in guess.entries}
    columns |= _orientations(columns, guess)
    time_s = _stamps(columns)
    made: dict[str, Sheet] = {}
    for table, pattern in _TABLES.items():
        chosen = {
            _column(target): values for target, values in columns.items() if re.fullmatch(pattern, target)
        }
        if chosen and time_s is not None:
            there = {"t_s": time_s, **{name: v for name, v in chosen.items() if v is not None}}
            made[table] = Sheet(there, tuple(there), guess.table.first_row, guess.table.source)
    return made


def _stamps(columns: Mapping[str, Floats | None]) -> Floats | None:
    time_s, fraction = columns.get("t"), columns.get("t_fraction")
    if time_s is None:
        return None
    known = np.flatnonzero(np.isfinite(time_s))
    first = time_s[known[0]] if len(known) else 0.0
    passed: Floats = time_s - first
    if fraction is not None and len(known):
        passed = passed + fraction - fraction[known[0]]
    return passed


def _column(target: str) -> str:
    """Return the column of docs/runs.md with its unit."""
    return f"{target}_{_UNITS[kind_of(target)]}"


def _orientations(columns: Mapping[str, Floats | None], guess: Guess) -> dict[str, Floats]:
    """Return A, B, C in degrees of each quaternion, and of each three angles in their order."""
    made: dict[str, Floats] = {}
    for side in ("", "_cmd", "_act"):
        quaternion = [columns.get(f"q{part}{side}") for part in "xyzw"]
        angles = [columns.get(f"{part}{side}") for part in ("rx", "ry", "rz")]
        turned = [columns.get(f"{part}{side}") for part in "abc"]
        if all(part is not None for part in quaternion):
            values = np.stack([part for part in quaternion if part is not None], axis=1)
            made |= _abc(values, side, lambda q: Rotation.from_quat(q))
        elif all(part is not None for part in angles):
            made |= _abc(np.stack([p for p in angles if p is not None], axis=1), side, _turns(guess.order))
        elif all(part is not None for part in turned) and guess.order != "zyx":
            made |= _abc(np.stack([p for p in turned if p is not None], axis=1), side, _turns(guess.order))
    return made


def _turns(order: str) -> Any:
    if order == "rotvec":
        return lambda values: Rotation.from_rotvec(values, degrees=True)
    return lambda values: Rotation.from_euler(ORDERS[order], values, degrees=True)


def _abc(values: Floats, side: str, rotations: Any) -> dict[str, Floats]:
    """Return the columns A, B, C in degrees; NaN where a value is missing or a quaternion is none."""
    good = np.isfinite(values).all(axis=1) & (
        np.linalg.norm(values, axis=1) > 0.0 if values.shape[1] == 4 else True
    )
    abc = np.full((len(values), 3), np.nan)
    if good.any():
        abc[good] = abc_from_rotation(rotations(values[good]).as_matrix()) * DEG_PER_RAD
    return {f"{letter}{side}": abc[:, column] for column, letter in enumerate("abc")}


def absences(sheets: Mapping[str, Sheet]) -> str:
    """Return what the tables do not hold and what each costs, on one line; "" where all is there."""
    there = {name.rpartition("_")[0] for sheet in sheets.values() for name in sheet.columns}
    missing = [what for target, what in _COSTS if target not in there]
    return f"not in the log: {', '.join(missing)}" if missing else ""


def write_run(guess: Guess, folder: Path, prediction: str = "") -> list[Path]:
    """Write a guess without questions as a run folder; return its files.

    Raises `NotUnderstoodError` where the folder holds a run or cannot be written, or it would not load.
    """
    guess.require_certain()
    sheets = sheets_of(guess)
    run_of(guess, folder.name)  # what a run may not be is said before anything is written
    head: dict[str, Any] = {"prediction": prediction} if prediction else {}
    if guess.table.started and not guess.table.started.startswith("1900"):
        head["started"] = datetime.fromisoformat(guess.table.started)
    head["clocks"] = {f"{table}_s": round(guess.clock_s, 3) for table in sheets}
    head["files"] = {table: f"{table}.parquet" for table in sheets}
    head["layout"] = guess.layout().model_dump(exclude_none=True)
    return _written(head, sheets, folder)


def write_native(source: Path, folder: Path, prediction: str = "") -> tuple[list[Path], tuple[Issue, ...]]:
    """Write a KRC trace or an RSI log as a run folder; return its files, and what was found in the log.

    Errors as for `write_run`.
    """
    sheet = _native(source)
    if sheet is None:
        raise input_error("run-layout", "neither a KRC trace nor an RSI log", "", source=str(source))
    _assembled(source.stem, source.parent, RunHead(), {"controller": sheet})
    head: dict[str, Any] = {"prediction": prediction} if prediction else {}
    head["files"] = {"controller": "controller.parquet"}
    return _written(head, {"controller": sheet}, folder), sheet.issues


def is_native(source: Path) -> bool:
    """Tell whether a file is a KRC trace or RSI telegrams, whose formats fix what each column is."""
    try:
        return source.is_file() and (is_data_set(source) or is_telegrams(source))
    except OSError:  # the reader of tables says why
        return False


def _written(head: dict[str, Any], sheets: Mapping[str, Sheet], folder: Path) -> list[Path]:
    import polars as pl

    if (folder / "run.toml").exists():
        words, remedy = "there is a run already", "name another folder, or remove it"
        raise input_error("output-unwritable", words, remedy, source=str(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = []
        for table, sheet in sheets.items():
            file = folder / f"{table}.parquet"
            pl.DataFrame(sheet.columns).write_parquet(file)
            written.append(file)
        (folder / "run.toml").write_text(tomli_w.dumps(head), encoding="utf-8")
    except OSError as error:
        words = f"cannot be written: {error.strerror}"
        raise input_error(
            "output-unwritable", words, "check path, rights and space", source=str(folder)
        ) from None
    return [folder / "run.toml", *written]


def earlier_layout(folder: Path, table: LogTable) -> tuple[Layout, Path] | None:
    """Return the layout of a run beside a folder whose columns are those of a table, and that run."""
    for head, place in _heads_beside(folder):
        if same_columns(head.layout, table):
            return head.layout, place
    return None


def _heads_beside(folder: Path) -> Iterator[tuple[RunHead, Path]]:
    for file in sorted(folder.resolve().parent.glob("*/run.toml")):
        try:
            yield read_head(file)[0], file.parent
        except NotUnderstoodError:  # another's run, which is not asked for
            continue


def run_or_log(place: str | Path, prediction: Predicted | None = None, *, partial: bool = False) -> Run:
    """Return the run of a folder, of a prediction's folder, or of a log whose columns are certain.

    Raises `NotUnderstoodError` as `load_run`; for a log that leaves questions with the command that answers.
    """
    path = Path(place)
    name = path.resolve().stem
    if path.is_dir() and not (path / "run.toml").exists() and (path / "motion.parquet").is_file():
        path = path / "motion.parquet"
    if not path.is_file():
        return load_run(path, partial=partial)
    if is_native(path):
        return run_from(path)
    table = read_table(path)
    earlier = earlier_layout(path.parent / path.stem, table)
    if earlier is not None:
        guess = by_layout(table, earlier[0], prediction)
    else:
        guess = guessed(table, prediction=prediction)
    guess.require_certain(f"gcode2krl runs import {path} -o {path.stem}/")
    run = run_of(guess, name)
    remedy = f"`gcode2krl runs import {path}` shows why, and keeps it"
    notes = [Issue("note", "run-layout", 0, text, remedy) for text in (_taken(guess), *told(guess))]
    # what is missing is said by the links that need it
    return replace(run, issues=(*notes, *(issue for issue in run.issues if issue.code != "trace-missing")))


def _taken(guess: Guess) -> str:
    """Return on one line what the columns were taken for: those of one kind by their first and last."""
    groups: dict[tuple[str, str], list[Entry]] = {}
    for entry in guess.entries:
        groups.setdefault((re.sub(r"\d", "", entry.target), entry.unit), []).append(entry)
    parts = []
    for (_, unit), entries in groups.items():
        ends = entries if len(entries) == 1 else [entries[0], entries[-1]]
        names, targets = (" … ".join(getattr(e, key) for e in ends) for key in ("name", "target"))
        parts.append(f"{names} as {targets}{f' in {unit}' if unit != '1' else ''}")
    return f"{guess.table.how}; {', '.join(parts)}"


def told(guess: Guess) -> list[str]:
    """Return what a guess left out, a line each."""
    left_out = [f"left out: {', '.join(guess.left_out)[:300]}"] if guess.left_out else []
    return [*guess.notes, *left_out]
