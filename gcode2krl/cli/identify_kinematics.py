"""``gcode2krl identify kinematics``: frames, zeros, lengths and axes of an arm from measured poses."""

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.identified import gravity_option, save_figure
from gcode2krl.cli.inputs import cell_files, common_options, named_values, read_cell, require_other
from gcode2krl.errors import Gcode2KrlError, input_error

if TYPE_CHECKING:
    from gcode2krl.identify.kinematics import Arm, Geometry, Options, Readings

_GROUPS = "zeros, lengths, axes, wrist, weight, play, gears, drift, air"


@click.command(
    "kinematics",
    epilog=examples(
        "gcode2krl identify kinematics examples/identify/poses.csv --plot poses.png",
        "gcode2krl identify kinematics examples/identify/poses.csv -o geometry.toml",
    ),
)
@click.argument("poses", metavar="POSES")
@common_options
@click.option("--robot", default="", metavar="MODEL", help="The arm, of any maker.  [default: the cell's]")
@click.option(
    "--columns", multiple=True, metavar="NAME=OURS", help="What a column is: q1 … q6, x, y, z, x2 …"
)
@click.option("--unit", multiple=True, metavar="WHAT=UNIT", help="angle=deg|rad, length=mm|m.")
@click.option(
    "--noise-mm",
    type=click.FloatRange(min=0.0),
    default=0.0,
    metavar="MM",
    help="Known 1-sigma of a coordinate.",
)
@click.option("--without", multiple=True, metavar="GROUP", help=f"Leave a group out: {_GROUPS}.")
@click.option(
    "--no-order", is_flag=True, help="The rows are not in the order in which the poses were driven."
)
@click.option("--masses", is_flag=True, help="Take the cell's masses: one stiffness a joint, no weights.")
@gravity_option
@click.option(
    "-o", "--output", metavar="SECTION.toml", help="Write what a cell can hold of it as [[effects]]."
)
@click.option("--plot", metavar="FIGURE.png", help="Draw how far poses are off, before and after.")
def command(
    poses: str,
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    robot: str,
    columns: tuple[str, ...],
    unit: tuple[str, ...],
    noise_mm: float,
    without: tuple[str, ...],
    no_order: bool,
    masses: bool,
    gravity: tuple[float, float, float],
    output: str | None,
    plot: str | None,
) -> int:
    """Fit frames, zeros, lengths, axes, bending and play of an arm to measured poses.

    All are fitted at once, and judged on places left out of the fit. POSES is a table (CSV, Parquet, MATLAB
    v5) of joint angles and the point that an instrument saw: q1 to q6, x, y, z under any usual name;
    optionally a, b, c, further targets x2, y2, z2 …, approach_1 to approach_6 (-1, 0, 1) and t. Base, tool
    and the instrument's frame need not be known.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(poses)
        from gcode2krl.identify.kinematics import identify_kinematics, read_readings

        for given in (output, plot):
            if given is not None:
                require_other(Path(given), poses, *cell_files(cell_path))
        arm, options = _asked(cell_path, robot, noise_mm, without, no_order, masses, gravity)
        readings = read_readings(
            poses, columns=named_values(columns, "--columns"), units=named_values(unit, "--unit")
        )
        with console.stage("fitting"):
            result = identify_kinematics(readings, arm, options)
        files, held = [], ""
        if output is not None:
            held = _section(readings, arm, options, Path(output))
            files.append(Path(output))
        files += [_figure(result, Path(plot))] if plot is not None else []
    except Gcode2KrlError as error:
        return console.refused(error, _KEYS, poses)
    if as_json:
        return console.record(_record(result), result.issues, files=files)
    _say(result, console)
    console.findings(result.issues, poses)
    if held:
        console.say(f"  cell    {held}")
    for file in files:
        console.say(f"  wrote   {file}")
    return 0


def _asked(
    cell_path: str | None,
    robot: str,
    noise_mm: float,
    without: Sequence[str],
    no_order: bool,
    masses: bool,
    gravity: tuple[float, float, float],
) -> "tuple[Arm, Options]":
    from gcode2krl.identify.kinematics import Options, arm_named, arm_of
    from gcode2krl.identify.kinematics.parameters import GROUPS

    fitted = [group for group in GROUPS if group not in ("base", "tool")]
    for group in without:
        if group not in fitted:
            raise input_error("option-value", f"--without {group!r}: no group", f"one of {', '.join(fitted)}")
    if not any(gravity):
        raise input_error(
            "option-value", "gravity: a direction of length 0", "0 0 -1 for a robot on the floor"
        )
    cell = read_cell(cell_path)
    arm = arm_named(robot) if robot else arm_of(cell)
    links = cell.robot.drives.link_mass_kg
    if masses and (links is None or robot):
        raise input_error("option-value", "--masses: the cell states no masses of links", "leave it out")
    lumps = None
    if masses and links is not None:
        lumps = (links[1], links[2] + links[3], links[4] + links[5] + (cell.load.mass_kg or 0.0))
    groups = tuple(group for group in fitted if group not in without)
    return arm, Options(groups, noise_mm, not no_order, gravity, lumps)


# --- words ----------------------------------------------------------------------------------------------


def _say(result: "Geometry", console: Console) -> None:
    import numpy as np

    count, outliers = len(result.row), int(result.is_outlier.sum())
    console.say(
        f"{result.source}: {result.robot}, {count} points; {len(result.told_numbers)} small numbers of the "
        f"arm: {result.rms_before_mm:.3f} -> {result.rms_after_mm:.3f} mm rms at places left out of the fit"
    )
    console.say(f"  noise   {_noise_words(result)}")
    said = f", {outliers} points left out" if outliers else ""
    for name, values in (("before", result.before_mm), ("after", result.after_mm)):
        good = values[~result.is_outlier]
        high = np.quantile(good, 0.95)
        console.say(f"  {name:<7} mean {good.mean():.3f}, 95 % {high:.3f}, most {good.max():.3f} mm{said}")
    if result.curves is not None:
        errors = (60.0 * float(np.abs(curve.error_deg).max()) for curve in result.curves.joints)
        words = ", ".join(f"A{joint} {error:.1f}'" for joint, error in enumerate(errors, 1))
        console.say(
            f"  curves  {result.rms_with_curves_mm:.3f} mm rms at places left out with an error curve of "
            f"each joint over its angle (gear, encoder), up to {words}"
        )
    if result.repeatability_mm is not None:
        console.say(f"  ISO 9283 repeatability RP {result.repeatability_mm:.3f} mm, of poses visited again")
    console.say(f"  {'number':<24} {'value':>10}  {result.level:.0%} interval")
    for part in result.parts:
        if part.is_told and not part.estimate.contains(0.0):
            e = part.estimate
            console.say(f"  {part.name:<24} {e.value:10.4f}  {e.low:9.4f} .. {e.high:9.4f} {part.unit}")
    for words, names in _others(result):
        console.say(
            textwrap.fill(f"{words}: {', '.join(names)}", 118, initial_indent="  ", subsequent_indent="    ")
        )
    console.say(f"  condition number of the told numbers {result.condition:.0f}")
    for first, second, correlation in result.alike[:6]:
        console.say(f"  hardly told apart: {first} and {second} (canonical correlation {correlation:.4f})")


def _others(result: "Geometry") -> Iterator[tuple[str, list[str]]]:
    """Yield the names of numbers that are about 0 or not told, by what they are mistaken for."""
    zero = [part.name for part in result.parts if part.is_told and part.estimate.contains(0.0)]
    if zero:
        yield "0 within their intervals", zero
    untold: dict[tuple[str, ...], list[str]] = {}
    for part in result.parts:
        if not part.is_told:
            untold.setdefault(part.like, []).append(part.name)
    for like, names in untold.items():
        same = f", as {' and '.join(like)} can do the same" if like else ""
        yield f"not told by these poses{same}", names


def _noise_words(result: "Geometry") -> str:
    residual = f"{result.sigma_mm:.4f} mm of a coordinate are left"
    if result.noise_mm is None:
        return (
            f"unknown (not stated, no poses visited again); {residual}: noise, or what the fit does not know"
        )
    more = result.sigma_mm / result.noise_mm
    verdict = (
        "as much as the noise"
        if more < 1.2
        else f"{more:.1f} times the noise: there is more than these numbers"
    )
    return f"{result.noise_mm:.4f} mm of a coordinate ({result.noise_from}); {residual}, {verdict}"


_KEYS = (
    "robot",
    "rms_before_mm",
    "rms_after_mm",
    "rms_within_mm",
    "rms_with_curves_mm",
    "points",
    "outliers",
    "noise_mm",
    "noise_from",
    "sigma_mm",
    "repeatability_mm",
    "level",
    "numbers",
    "condition",
    "alike",
    "frame",
    "curves",
    "rows",
)


def _record(result: "Geometry") -> dict[str, Any]:
    import numpy as np

    from gcode2krl.frames import abc_from_rotation

    numbers = {
        part.name: {
            "group": part.group,
            "unit": part.unit,
            "value": part.estimate.value,
            "interval": [part.estimate.low, part.estimate.high],
            "width": part.width if np.isfinite(part.width) else None,
            "told": part.is_told,
            "like": list(part.like),
        }
        for part in result.parts
    }
    a, b, c = np.degrees(abc_from_rotation(result.alignment.rotation)).tolist()
    x, y, z = result.alignment.place_mm.tolist()
    frame = {
        "root_in_instrument": {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": a, "b_deg": b, "c_deg": c},
        "targets_in_flange_mm": result.alignment.targets_mm.tolist(),
    }
    curves = None
    if result.curves is not None:
        curves = [{name: value.tolist() for name, value in c._asdict().items()} for c in result.curves.joints]
    rows = {
        "line": result.row.tolist(),
        "before_mm": result.before_mm.tolist(),
        "after_mm": result.after_mm.tolist(),
        "outlier": result.is_outlier.tolist(),
        "place": result.place.tolist(),
    }
    good = result.within_mm[~result.is_outlier]
    values = (
        result.robot,
        result.rms_before_mm,
        result.rms_after_mm,
        float(np.sqrt(np.mean(good**2))),
        result.rms_with_curves_mm,
        len(result.row),
        int(result.is_outlier.sum()),
        result.noise_mm,
        result.noise_from,
        result.sigma_mm,
        result.repeatability_mm,
        result.level,
        numbers,
        result.condition,
        [list(pair) for pair in result.alike],
        frame,
        curves,
        rows,
    )
    return dict(zip(_KEYS, values, strict=True))


# --- files ----------------------------------------------------------------------------------------------


def _section(readings: "Readings", arm: "Arm", options: "Options", file: Path) -> str:
    """Write what a cell can hold; return what it brings, in words."""
    import tomli_w

    from gcode2krl.cell import resolve_cell
    from gcode2krl.files import write_together
    from gcode2krl.identify.kinematics.cell_section import section_of

    if not arm.is_kuka:
        words = f"-o: no cell drives a {arm.model}"
        raise input_error("option-value", words, "--json has all numbers", source=readings.source)
    entries, fit = section_of(readings, arm, options)
    resolve_cell({"effects": entries}, source=str(file))
    words = f"{fit.rms_before_mm:.3f} -> {fit.rms_after_mm:.3f} mm rms at places left out"
    head = f"# What a cell can hold of this arm's errors, fitted without the others: {words}.\n"
    write_together({file: (head + tomli_w.dumps({"effects": entries})).encode("utf-8")})
    return f"{len(entries)} effects, fitted without what a cell cannot hold: {words}"


def _figure(result: "Geometry", file: Path) -> Path:
    import numpy as np
    from matplotlib.figure import Figure

    from gcode2krl.report.drawing import BLUE, GREY, VERMILION, look

    with look():
        figure = Figure(figsize=(10.0, 6.4), layout="constrained")
        top, bottom = figure.subplots(2, 1)
        good = ~result.is_outlier
        for values, colour, name in (
            (result.before_mm, GREY, "before"),
            (result.after_mm, BLUE, "after, left out of the fit"),
        ):
            top.plot(result.row[good], values[good], ".", color=colour, markersize=3.0, label=name)
        most = float(result.before_mm[good].max(initial=0.0))
        shown = np.minimum(result.after_mm[~good], 1.2 * most)
        top.plot(result.row[~good], shown, "x", color=VERMILION, markersize=4.0, label="no part of the fit")
        top.set(xlabel="line of the table", ylabel="off by mm", title="poses")
        top.legend(loc="upper right", ncols=3)
        edges = np.linspace(0.0, max(most, 1e-6), 60)
        bottom.hist(result.before_mm[good], edges, color=GREY, alpha=0.6, label="before")
        bottom.hist(result.after_mm[good], edges, color=BLUE, alpha=0.6, label="after, left out of the fit")
        bottom.set(xlabel="off by mm", ylabel="points", title="how many")
        bottom.legend(loc="upper right")
        figure.suptitle(f"{result.robot}: {result.rms_before_mm:.3f} -> {result.rms_after_mm:.3f} mm rms")
        return save_figure(figure, file)
