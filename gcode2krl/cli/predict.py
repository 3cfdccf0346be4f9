"""``gcode2krl predict part.nc -o prediction/``."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.allowed import as_allowed, with_allowed
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import (
    STANDARD,
    allow_option,
    cell_files,
    common_options,
    effect_files,
    existing,
    files_of_job,
    gcode_options,
    job_option,
    options_of_project,
    read_cell_under_job,
    read_part,
    require_folder,
    require_other,
    require_part,
    simplify_option,
)
from gcode2krl.cli.nominal import FILES, as_dict, compared, comparison_lines, solids, with_comparison
from gcode2krl.errors import Gcode2KrlError, input_error
from gcode2krl.translation.project import Project

if TYPE_CHECKING:
    from gcode2krl.cutting.nominal import Comparison
    from gcode2krl.prediction import Prediction

_MESHES = (".stl", ".ply", ".obj", ".off", ".3mf", ".glb")
_CORNERS = "corners.csv"
_NOMINAL = "part_nominal"


@click.command(
    "predict",
    epilog=examples(
        "gcode2krl predict part.nc -o prediction/ --plot",
        "gcode2krl predict part.nc --cell cell.toml -o out/ --csv --part left.stl",
        "gcode2krl predict part.nc -o out/ --effect backlash:target=A2,gap_deg=0.02",
    ),
)
@click.argument("part")
@click.option("-o", "--output", metavar="FOLDER", help="Folder of the prediction; default: beside the input.")
@common_options
@gcode_options
@simplify_option
@job_option
@allow_option
@click.option(
    "--dt", "dt_s", type=float, metavar="S", help="Sample time; default: the controller's cycle (0.012)."
)
@click.option("--csv", is_flag=True, help="Write the tables as CSV too.")
@click.option("--plot", is_flag=True, help="Draw path, speed, joints, forces and deflection as PNG.")
@click.option("--part", "part_mesh", metavar="OUT.stl", help="Write the machined stock as a mesh.")
@click.option(
    "--nominal", metavar="PART.stl", help="Compare what is left with this part: gouges and rest as solids."
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME:key=value,…",
    help="Add an effect that the nominal model leaves out; may be repeated.",
)
@click.option("--effects", "effect_folders", multiple=True, metavar="FOLDER", help="Folder of your effects.")
@click.option("--no-forces", is_flag=True, help="Leave out material removal, forces and deflection.")
@options_of_project
def command(
    part: str,
    output: str | None,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    tolerance_mm: float | None,
    chord_tolerance_mm: float,
    dialect: str,
    search: tuple[str, ...],
    block_delete: bool,
    simplify_mm: float | None,
    job_path: str | None,
    tools_path: str | None,
    allow: tuple[str, ...],
    dt_s: float | None,
    csv: bool,
    plot: bool,
    part_mesh: str | None,
    nominal: str | None,
    no_forces: bool,
    effects: tuple[str, ...],
    effect_folders: tuple[str, ...],
    project: Project,
) -> int:
    """Predict what the robot will do: path, timing, joints, cutting forces, deflection.

    Findings that would refuse a program are only reported here; those of --allow as the warnings that they
    are to a program.
    """
    from gcode2krl.cli.loads import load_lines
    from gcode2krl.prediction.forecast import load_figures
    from gcode2krl.prediction.limits import cycle_acceleration
    from gcode2krl.translation.quantity import band_words, quantities

    console = Console(quiet, as_json)
    try:
        console.heading.reads(part, nominal)
        require_part(part)
        folder = _folder(part, output)
        inputs = existing(
            part,
            nominal,
            *cell_files(cell_path),
            *files_of_job(job_path, tools_path),
            *effect_files(effect_folders),
        )
        _require_outputs(folder, part_mesh, inputs)
        cell, of_job = read_cell_under_job(cell_path, job_path, tools_path)
        toolpath = read_part(part, cell, console, chord_tolerance_mm, block_delete, dialect, search)
        toolpath = replace(toolpath, issues=(*toolpath.issues, *of_job, *project.issues))
        from gcode2krl.pipeline import add_effects, corner_table, predict_toolpath

        with console.stages() as begin:
            settings = {
                "chord_tolerance_mm": chord_tolerance_mm,
                "block_delete": block_delete,
                "dialect": dialect,
                **({"search": list(search)} if search else {}),
            }
            prediction = predict_toolpath(
                toolpath,
                cell,
                dt_s=dt_s,
                tolerance_mm=tolerance_mm,
                simplify_mm=simplify_mm,
                settings=settings,
                forces=not no_forces,
                begin=begin,
            )
            begin("effects and files")
            prediction = add_effects(prediction, effects, effect_folders)
            comparison = compared(prediction, nominal) if nominal is not None else None
            if comparison is not None and nominal is not None:
                prediction = with_comparison(prediction, comparison, nominal)
            by_name = () if "allow" in project.options else allow
            prediction = with_allowed(prediction, by_name, project.options.get("allow", ()))
            corners = corner_table(prediction)
            files = prediction.save(folder, csv=csv, inputs=inputs)
            files.append(_save_corners(corners, folder, inputs))
            files += _save_solids(comparison, folder, inputs)
            if part_mesh is not None:
                files.append(_save_part(prediction, Path(part_mesh), inputs))
            if plot:
                begin("figures")
                files += _draw(prediction, comparison, folder, inputs)
    except Gcode2KrlError as error:
        return console.refused(error, ["moves", "time_s", "path_mm"], part)
    motion = prediction.motion
    if motion is None:
        raise AssertionError("predict_toolpath always plans a motion")
    forces = prediction.forces
    q_rad = prediction.joints.q_rad if prediction.joints is not None else None
    loads = load_figures(forces, prediction.deflection, q_rad) if forces is not None else None
    known = quantities(loads, float(motion.time_s[-1]), prediction.targets, prediction.cell)
    if as_json:
        return console.record(
            {
                "moves": len(toolpath) - 1,
                "time_s": float(motion.time_s[-1]),
                "path_mm": float(motion.path_mm[-1]),
                "corner_error_mm": float(corners["error_mm"].max(initial=0.0)),
                "max_force_N": loads.force_N if loads is not None else None,
                "max_deflection_mm": loads.deflection_mm if loads is not None else None,
                "quantities": known,
                **({"nominal": as_dict(comparison)} if comparison is not None else {}),
                **project.record,
            },
            as_allowed(prediction),
            files=files,
        )
    console.findings(as_allowed(prediction), part)
    console.say(f"{part} -> {folder}: {', '.join(file.name for file in files)}")
    console.say(f"  {len(motion)} samples, {motion.time_s[-1]:.2f} s, {motion.path_mm[-1] / 1000.0:.3f} m")
    cycle_s = prediction.cell.controller.cycle_s
    top, steepest = motion.speed_mm_s.max(), cycle_acceleration(motion, cycle_s).max()
    console.say(f"  speed up to {top:.1f} mm/s, acceleration up to {steepest:.0f} mm/s2")
    console.say(
        f"  {len(corners['error_mm'])} corners, off by at most {corners['error_mm'].max(initial=0.0):.4f} mm"
    )
    compared_lines = comparison_lines(comparison) if comparison is not None else ()
    bands = (f"  band       {words}" for words in band_words(known))
    for line in (*load_lines(loads, prediction.cell), *bands, *compared_lines):
        console.say(line)
    return 0


def _require_outputs(folder: Path, part_mesh: str | None, inputs: list[Path]) -> None:
    """Raise where an output is an input, has no folder, or its folder has foreign files."""
    from gcode2krl.prediction.folder import RECORD, refuse_foreign
    from gcode2krl.prediction.plots import FIGURES

    refuse_foreign(folder)
    tables = [f"{name}{kind}" for name in ("toolpath", "targets", "motion") for kind in (".parquet", ".csv")]
    names = [*tables, RECORD, _CORNERS, *FILES.values(), *(f"{name}.png" for name in (*FIGURES, _NOMINAL))]
    require_folder(folder, names, inputs)
    if part_mesh is None:
        return
    file = Path(part_mesh)
    if file.suffix.lower() not in _MESHES:
        sentence = f"--part {file.name!r}: allowed endings {', '.join(_MESHES)}"
        raise input_error("option-value", sentence, "name it left.stl", source=part_mesh)
    require_other(file, *inputs)


def _save_part(prediction: "Prediction", file: Path, inputs: list[Path]) -> Path:
    """Write the machined stock as a mesh."""
    from gcode2krl.cutting import remove
    from gcode2krl.cutting.height_field import HeightField
    from gcode2krl.cutting.raw_part import to_mesh
    from gcode2krl.cutting.surface import dexels_to_mesh
    from gcode2krl.files import write_together

    if prediction.motion is None:
        raise AssertionError("predict_toolpath always plans a motion")
    part = remove(prediction.toolpath, prediction.motion, prediction.cell).material
    mesh = to_mesh(part) if isinstance(part, HeightField) else dexels_to_mesh(part)
    content = mesh.export(file_type=file.suffix.lower().removeprefix("."))
    write_together({file: content.encode("utf-8") if isinstance(content, str) else bytes(content)}, inputs)
    return file


def _save_solids(comparison: "Comparison | None", folder: Path, inputs: list[Path]) -> list[Path]:
    """Write gouges and rest as meshes; those of an earlier prediction go."""
    from gcode2krl.files import write_together

    contents = solids(comparison) if comparison is not None else {}
    for name in FILES.values():
        if name not in contents:
            (folder / name).unlink(missing_ok=True)
    files = {folder / name: content for name, content in contents.items()}
    if files:
        write_together(files, inputs)
    return list(files)


def _save_corners(corners: dict[str, Any], folder: Path, inputs: list[Path]) -> Path:
    """Write the table of corners as CSV."""
    import polars as pl

    from gcode2krl.files import write_together

    file = folder / _CORNERS
    write_together({file: pl.DataFrame(corners).write_csv}, inputs)
    return file


def _draw(
    prediction: "Prediction", comparison: "Comparison | None", folder: Path, inputs: list[Path]
) -> list[Path]:
    """Draw every stage that ran, and the part against the nominal one; returns the files."""
    from gcode2krl.figures import against_nominal, figures_of
    from gcode2krl.report.figures import save_figures

    figures = figures_of(prediction)
    if comparison is not None:
        figures[_NOMINAL] = against_nominal(prediction, comparison.above_mm, comparison.at_mm)
    return save_figures(figures, folder, inputs)


def _folder(part: str, output: str | None) -> Path:
    if output == STANDARD or (output is None and part == STANDARD):
        raise input_error("option-value", "a prediction is a folder", "give -o prediction/")
    if output == "":
        raise input_error("option-value", "-o: the name is empty", "give -o prediction/")
    folder = Path(output) if output is not None else Path(part).with_suffix(".prediction")
    if folder.exists() and not folder.is_dir():
        raise input_error("output-unwritable", "this is a file", "name a folder", source=str(folder))
    return folder
