"""The run kit of a program: `make_kit` writes the folder."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, collect
from gcode2krl.errors import Issue, input_error
from gcode2krl.files import make_folder, refuse_inputs, write_together
from gcode2krl.krl import output_files, write_krl
from gcode2krl.krl.release import released
from gcode2krl.prediction import Prediction
from gcode2krl.runkit.accepted import Accepted, read_program, toolpath_of
from gcode2krl.runkit.checklist import page
from gcode2krl.runkit.trace import run_text, set_up_text
from gcode2krl.tables import Targets

LIFT_MM = 100.0
"""Height above the program at which it is run in air (acceptance, step 5)."""
CHECKLIST, SET_UP, PREDICTION, RUN = "checklist.html", "trace.txt", "prediction", "run_air"
_SUFFIX = "_AIR"


@dataclass(frozen=True)
class RunKit:
    """What `make_kit` wrote."""

    files: tuple[Path, ...]
    air_name: str
    source: str
    """Name of the G-code, whose lines the findings name."""
    time_s: float
    """Predicted motion at 100 % override."""
    issues: tuple[Issue, ...]


def make_kit(
    program: str | Path,
    folder: str | Path,
    cell: Cell,
    *,
    lift_mm: float = LIFT_MM,
    inputs: Sequence[str | Path] = (),
) -> RunKit:
    """Write the run kit of a ``.src`` that was written for a cell.

    The folder (made if missing) gets the program lifted by ``lift_mm`` along Z of ``$BASE``, without spindle,
    coolant and other M-codes; its prediction; a set-up of the controller's trace; a folder for the recording;
    and a check list of one printed page with the values of the program itself.

    Raises
    ------
    RefusedError
        Where the program was made for another cell, or cannot be run that much higher.
    NotUnderstoodError
        Where a file cannot be read or written, or the lift is not positive.
    """
    if not (np.isfinite(lift_mm) and lift_mm > 0.0):
        raise input_error("option-value", f"--lift {lift_mm:g}: not a height in mm", "--lift 100")
    path, place = Path(program), Path(folder)
    accepted = read_program(path, cell)
    air_name = accepted.name[: w.LONGEST_NAME - len(_SUFFIX)] + _SUFFIX
    itself = _predicted(accepted.targets, cell)
    air = _predicted(lifted(accepted.targets, lift_mm), cell)
    released(air.issues, ())
    make_folder(place)
    texts = {
        place / CHECKLIST: page(accepted, itself, cell, air_name, lift_mm),
        place / SET_UP: set_up_text(air_name, air),
        place / RUN / "run.toml": run_text(),
    }
    air_file = place / f"{air_name}{w.SOURCE_SUFFIX}"
    beside = [path.parent / name for name in _names_of(path)]
    refuse_inputs([*texts, *output_files(air_file, None)], [*inputs, *beside])
    written = write_krl(
        air, air_file, cell, pilot="none", options=_options(accepted, lift_mm), inputs=[*inputs, *beside]
    )
    tables = air.save(place / PREDICTION, csv=True, inputs=inputs)
    make_folder(place / RUN)
    write_together({file: text.encode("utf-8") for file, text in texts.items()}, inputs)
    motion = itself.motion
    time_s = float(motion.time_s[-1]) if motion is not None else 0.0
    return RunKit((*written.files, *texts, *tables), air_name, accepted.source, time_s, written.issues)


def lifted(targets: Targets, lift_mm: float) -> Targets:
    """Return the same path ``lift_mm`` higher; HOME stays where it is."""
    position = targets.position_mm + np.outer(~targets.home, [0.0, 0.0, lift_mm])
    return replace(targets, position_mm=position)


def _predicted(targets: Targets, cell: Cell) -> Prediction:
    return collect(Plan.of(toolpath_of(targets, cell), targets, cell).judged(), forces=False)


def _options(accepted: Accepted, lift_mm: float) -> str:
    left_out = "spindle, coolant, other M-codes, pilot and RSI left out"
    return f"IN AIR: {accepted.name} lifted by {lift_mm:g} mm, {left_out}"


def _names_of(path: Path) -> list[str]:
    return [f"{path.stem}{suffix}" for suffix in (w.SOURCE_SUFFIX, w.DATA_SUFFIX, w.SIDECAR_SUFFIX)]
