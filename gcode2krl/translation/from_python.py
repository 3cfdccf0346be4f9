"""All stages on a part in one call, as the command `predict` runs them, for Python programs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.cell import Cell
from gcode2krl.gcode import CHORD_TOLERANCE_MM, DEFAULT_DIALECT, read_gcode
from gcode2krl.pipeline import add_effects, predict_toolpath
from gcode2krl.prediction import Prediction
from gcode2krl.translation.inputs import read_cell, under_job
from gcode2krl.translation.project import Project, project_of

if TYPE_CHECKING:
    from gcode2krl.effects import Applied

_OF_PROJECT: dict[str, Any] = {"cell_path": None, "job_path": None, "tools_path": None, "no_forces": False}
"""Options that a project states and that have no argument of their name."""


def predict(
    part: str | Path,
    cell: Cell | None = None,
    *,
    dt_s: float | None = None,
    tolerance_mm: float | None = None,
    simplify_mm: float | None = None,
    chord_tolerance_mm: float = CHORD_TOLERANCE_MM,
    block_delete: bool = False,
    dialect: str = DEFAULT_DIALECT,
    search: Sequence[str | Path] = (),
    forces: bool = True,
    effects: "Sequence[str | Applied]" = (),
    effect_folders: Sequence[str | Path] = (),
    project: bool = False,
) -> Prediction:
    """Run every stage on a part: G-code, targets, motion, joints, forces, deflection.

    ``dt_s`` is the sample time, by default the controller's cycle; ``simplify_mm`` merges feed moves, see
    `set_targets`; ``search`` are folders with subprograms. ``forces`` False leaves out material removal and
    what depends on it. A stage that cannot run (no material, unknown stiffness) leaves None and a note.
    ``effects`` such as ``backlash:target=A2,gap_deg=0.02`` are added to those of the cell;
    ``effect_folders`` are folders with the user's own effects. Raises `NotUnderstoodError` where the G-code,
    the cell or an option is wrong; what a program must not do is in the prediction's ``issues``.

    A library does not read files that nobody named, so the nearest ``gcode2krl.toml`` at or above the part's
    folder counts only with ``project=True``. Then what it states and the call does not (cell, job with its
    tools and stock, options) holds as on the command line, and a note says what that is.

    The worst second of every tool:

    >>> from gcode2krl import load_cell, predict
    >>> samples = predict("part.nc", load_cell("cell.toml")).samples().to_pandas()
    >>> samples["second"] = samples["time_s"].astype(int)
    >>> worst = samples.groupby(["tool", "second"])["force_N"].max().groupby("tool").idxmax()
    >>> list(worst.index)
    [1]

    With an effect that the nominal model leaves out, its columns stand beside the nominal ones:

    >>> loose = predict("part.nc", effects=["backlash:target=A2,gap_deg=0.02"])
    >>> sorted(loose.added)[:2]
    ['force_meas_x_N', 'force_meas_y_N']
    """
    options: dict[str, Any] = {
        "dt_s": dt_s,
        "tolerance_mm": tolerance_mm,
        "simplify_mm": simplify_mm,
        "chord_tolerance_mm": chord_tolerance_mm,
        "block_delete": block_delete,
        "dialect": dialect,
        "search": search,
        "effects": effects,
        "effect_folders": effect_folders,
    }
    taken = _taken(part, cell, forces, options) if project else Project()
    options |= _OF_PROJECT | {"no_forces": not forces} | dict(taken.options)
    bare = cell if cell is not None else read_cell(options["cell_path"])
    under, of_job = under_job(bare, options["job_path"], options["tools_path"])
    reading = {name: options[name] for name in ("chord_tolerance_mm", "block_delete", "dialect")}
    toolpath = read_gcode(part, under, search=options["search"], **reading)
    if options["search"]:
        reading["search"] = [str(folder) for folder in options["search"]]
    prediction = predict_toolpath(
        replace(toolpath, issues=(*toolpath.issues, *of_job, *taken.issues)),
        under,
        **{name: options[name] for name in ("dt_s", "tolerance_mm", "simplify_mm")},
        settings=reading,
        forces=not options["no_forces"],
    )
    return add_effects(prediction, options["effects"], options["effect_folders"])


def _taken(part: str | Path, cell: Cell | None, forces: bool, options: dict[str, Any]) -> Project:
    """Return what the project of a part states and the call does not."""
    usual: dict[str, Any] = {"chord_tolerance_mm": CHORD_TOLERANCE_MM, "dialect": DEFAULT_DIALECT}
    stated = {name for name, value in options.items() if value and value != usual.get(name)}
    stated |= ({"cell_path"} if cell is not None else set()) | (set() if forces else {"no_forces"})
    return project_of(part).without(stated, {*options, *_OF_PROJECT})
