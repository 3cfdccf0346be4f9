"""``gcode2krl identify controller trace.csv``: k, effective CDIS and the law from a recorded trace."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.identified import save_figure, section_in, write_section
from gcode2krl.cli.inputs import (
    common_options,
    dialect_option,
    read_cell,
    read_part,
    require_fit_outputs,
    search_option,
)
from gcode2krl.errors import Gcode2KrlError, NotUnderstoodError
from gcode2krl.units import MS_PER_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from gcode2krl.cell import Cell
    from gcode2krl.identify.controller import CornerFit, Identification, Section
    from gcode2krl.identify.estimate import Estimate
    from gcode2krl.runs import ControllerTrace

_MOST_SHOWN = 20


@click.command(
    "controller",
    epilog=examples(
        "gcode2krl identify controller trace.csv",
        "gcode2krl identify controller trace.csv --plot fit.png --apply cell.toml",
    ),
)
@click.argument("trace")
@click.option(
    "--part", metavar="TEST.nc", help="The program that was run; default: that of `make-test controller`."
)
@dialect_option
@search_option
@common_options
@click.option(
    "--tolerance", "tolerance_mm", type=float, metavar="MM", help="Blend tolerance it was translated with."
)
@click.option("--plot", metavar="FIGURE.png", help="Draw the trace with the fit over it.")
@click.option("--apply", "apply_to", metavar="CELL.toml", help="Write the values into this cell file.")
def command(
    trace: str,
    part: str | None,
    dialect: str,
    search: tuple[str, ...],
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    tolerance_mm: float | None,
    plot: str | None,
    apply_to: str | None,
) -> int:
    """Fit how the controller plans to a recorded trace: k, effective CDIS, the law.

    TRACE is CSV with a header line, or Parquet, with t_s, x_cmd_mm, y_cmd_mm, z_cmd_mm: the commanded
    position in the program's $BASE. The acceleration is taken from the cell.
    """
    console = Console(quiet, as_json)
    try:
        console.heading.reads(trace, part)
        require_fit_outputs(plot, apply_to, cell_path, trace, part)
        result = _identify(trace, part, dialect, search, read_cell(cell_path), tolerance_mm, console)
        files = []
        if plot is not None:
            files.append(_save_figure(result, Path(plot)))
        if apply_to is not None:
            files.append(_apply(result, Path(apply_to), trace, read_cell(cell_path)))
    except Gcode2KrlError as error:
        return console.refused(error, _KEYS, trace)
    if as_json:
        return console.record(_record(result), result.issues, files=files)
    console.findings(result.issues, part or "")
    _say(result, trace, console)
    for file in files:
        console.say(f"  wrote      {file}")
    if apply_to is not None and not _is_own_cdis(result, read_cell(cell_path)):
        console.say("             without cdis_mm: the corners were not programmed with that of the cell")
    return 0


def _identify(
    trace_path: str,
    part: str | None,
    dialect: str,
    search: tuple[str, ...],
    cell: "Cell",
    tolerance_mm: float | None,
    console: Console,
) -> "Identification":
    from gcode2krl.identify.controller import identify_controller
    from gcode2krl.pipeline import set_targets
    from gcode2krl.runs import read_controller_trace

    trace = read_controller_trace(trace_path)
    if part is None:
        return _identify_test(trace, cell, console)
    targets = set_targets(read_part(part, cell, console, 0.01, False, dialect, search), cell, tolerance_mm)
    with console.stage("fitting"):
        return identify_controller(trace, targets, cell)


def _identify_test(trace: "ControllerTrace", cell: "Cell", console: Console) -> "Identification":
    """Fit a trace of the test program: with the lines that turn the tool if it has them, else without."""
    from gcode2krl.identify.controller import identify_controller
    from gcode2krl.pipeline import controller_test_targets

    with console.stage("fitting"):
        try:
            return identify_controller(trace, controller_test_targets(cell), cell)
        except NotUnderstoodError:
            return identify_controller(trace, controller_test_targets(cell, turning=False), cell)


# --- words ----------------------------------------------------------------------------------------------


def _say(result: "Identification", trace: str, console: Console) -> None:
    k, cycle_ms = result.k_s, result.cycle_s * MS_PER_S
    inside = "inside" if k.contains(result.k_whole_s) else "outside"
    taken = "taken" if result.k_best_s == result.k_whole_s else "not taken"
    fitted = sum(section.fitted for section in result.sections)
    console.say(f"{trace}: {len(result.sections)} sections, {fitted} fitted")
    console.say(f"  k          {k.value:.5f} s, 90 % {k.low:.5f} .. {k.high:.5f}")
    cycles = f"{result.k_cycles} cycles of {cycle_ms:g} ms = {result.k_whole_s:.3f} s"
    console.say(f"             {cycles}, {inside}; {taken} as whole cycles")
    if result.cdis_mm is None:
        console.say("  CDIS       not determined")
    else:
        cdis = result.cdis_mm
        console.say(
            f"  CDIS       {cdis.value:.4f} mm, 90 % {cdis.low:.4f} .. {cdis.high:.4f}"
            f" (programmed {result.cdis_programmed_mm:g})"
        )
    console.say(f"  law        {result.law} (2 log-likelihood ratio {result.law_evidence:+.0f})")
    console.say(f"  $ACC.CP    {result.acceleration_mm_s2:g} mm/s2, from the cell")
    if result.turning_rms_mm is not None:
        turning = (("VEL.ORI", result.vel_ori_deg_s, "deg/s"), ("ACC.ORI", result.acc_ori_deg_s2, "deg/s2"))
        for name, value, unit in turning:
            known = "not determined"
            if value:
                known = f"{value.value:.2f} {unit}, 90 % {value.low:.2f} .. {value.high:.2f}"
            console.say(f"  ${name}   {known}")
    console.say(
        f"  residuals  {result.rms_mm:.4f} mm rms, at most {result.max_mm:.4f} mm; "
        f"noise at rest {result.noise_mm:.4f} mm"
    )
    if result.corners:
        console.say("  corners    line  angle  mm/s      d mm             error mm         programmed mm")
    for corner in result.corners[:_MOST_SHOWN]:
        console.say(_corner_line(corner))
    if len(result.corners) > _MOST_SHOWN:
        console.say(f"             … and {len(result.corners) - _MOST_SHOWN} more, see --json")
    from gcode2krl.identify.unsettled import QUESTIONS

    console.say("  not settled by this trace; KRL that would, between two exact stops:")
    for question in QUESTIONS:
        console.say(f"    {question.what}: {'; '.join(question.run)}")
        console.say(f"      assumed: {question.assumed}")


def _corner_line(corner: "CornerFit") -> str:
    d, error = corner.d_mm, corner.error_mm
    programmed = corner.programmed_d_mm * (error.value / d.value)
    return (
        f"            {corner.source_line:5d} {corner.angle_deg:6.1f} {corner.speed_mm_s:5.0f}  "
        f"{d.value:7.4f} +- {d.high - d.value:6.4f} {error.value:7.4f} +- {error.high - error.value:6.4f} "
        f"{programmed:7.4f}"
    )


_KEYS = (
    "k_s",
    "k_interval_s",
    "k_cycles",
    "k_whole_cycles_s",
    "k_whole_cycles_inside",
    "cdis_mm",
    "cdis_interval_mm",
    "cdis_programmed_mm",
    "law",
    "law_evidence",
    "law_of_values",
    "acceleration_mm_s2",
    "vel_ori_deg_s",
    "vel_ori_interval_deg_s",
    "acc_ori_deg_s2",
    "acc_ori_interval_deg_s2",
    "turning_rms_mm",
    "noise_mm",
    "rms_mm",
    "max_mm",
    "sections",
    "corners",
)


def _record(result: "Identification") -> dict[str, Any]:
    values = (
        result.k_s.value,
        _interval(result.k_s),
        result.k_cycles,
        result.k_whole_s,
        result.k_s.contains(result.k_whole_s),
        *_value_and_interval(result.cdis_mm),
        result.cdis_programmed_mm,
        result.law,
        result.law_evidence,
        result.law_fitted,
        result.acceleration_mm_s2,
        *_value_and_interval(result.vel_ori_deg_s),
        *_value_and_interval(result.acc_ori_deg_s2),
        result.turning_rms_mm,
        result.noise_mm,
        result.rms_mm,
        result.max_mm,
        [_section_record(section) for section in result.sections],
        [_corner_record(corner) for corner in result.corners],
    )
    from gcode2krl.identify.unsettled import QUESTIONS

    unsettled = [question._asdict() for question in QUESTIONS]
    return dict(zip(_KEYS, values, strict=True)) | {"unsettled": unsettled}


def _value_and_interval(estimate: "Estimate | None") -> tuple[float | None, list[float] | None]:
    return (None, None) if estimate is None else (estimate.value, _interval(estimate))


def _interval(estimate: "Estimate") -> list[float] | None:
    """Return the 90 % interval, None where it is infinite (JSON has no infinity)."""
    return [estimate.low, estimate.high] if math.isfinite(estimate.high) else None


def _section_record(section: "Section") -> dict[str, Any]:
    return {
        "lines": [section.first_line, section.last_line],
        "moves": section.moves,
        "length_mm": section.length_mm,
        "speed_mm_s": section.speed_mm_s,
        "fitted": section.fitted,
        "start_s": section.start_s,
        "rms_mm": section.rms_mm,
        "max_mm": section.max_mm,
    }


def _corner_record(corner: "CornerFit") -> dict[str, Any]:
    return {
        "line": corner.source_line,
        "angle_deg": corner.angle_deg,
        "speed_mm_s": corner.speed_mm_s,
        "cdis_mm": corner.cdis_mm,
        "programmed_d_mm": corner.programmed_d_mm,
        "d_mm": corner.d_mm.value,
        "d_interval_mm": _interval(corner.d_mm),
        "error_mm": corner.error_mm.value,
        "error_interval_mm": _interval(corner.error_mm),
    }


# --- the cell file --------------------------------------------------------------------------------------


def _apply(result: "Identification", file: Path, trace: str, cell: "Cell") -> Path:
    """Write k, CDIS and law into a cell file.

    CDIS is the value that programs *write*; it goes into the cell only if the corners of the trace were
    programmed with the CDIS of the cell, not with one from ``G64 P``.
    """
    values: dict[str, Any] = {"k_s": round(result.k_best_s, 5)}
    if result.cdis_mm is not None and _is_own_cdis(result, cell):
        values["cdis_mm"] = round(result.cdis_mm.value, 4)
    if result.law != "undecided":
        values["law"] = result.law
    for key, estimate in (("vel_ori_deg_s", result.vel_ori_deg_s), ("acc_ori_deg_s2", result.acc_ori_deg_s2)):
        if estimate is not None:
            values[key] = round(estimate.value, 3)
    values["source"] = (
        f"identified from {Path(trace).name}: k {result.k_s.value:.5f} s, 90 % "
        f"{result.k_s.low:.5f} to {result.k_s.high:.5f}, residuals {result.rms_mm:.4f} mm rms"
    )
    values["sure"] = "checked"
    return write_section(file, "controller", {**section_in(file, "controller"), **values})


def _is_own_cdis(result: "Identification", cell: "Cell") -> bool:
    """Tell whether the corners of the trace were programmed with the cell's CDIS."""
    return result.cdis_programmed_mm == cell.controller.cdis_mm


# --- the figure -----------------------------------------------------------------------------------------


def _save_figure(result: "Identification", file: Path) -> Path:
    from gcode2krl.report.drawing import look

    with look():
        return save_figure(figure(result), file)


def figure(result: "Identification") -> "Figure":
    """Return the trace with the fit over it: speed of a short and a long line, the sharpest corner."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(10.0, 6.8), layout="constrained")
    places = drawing.subplots(2, 2)
    fitted = [section for section in result.sections if section.fitted]
    straight = [section for section in fitted if section.moves == 1] or fitted
    fastest = max(section.speed_mm_s for section in straight)
    fast = sorted((s for s in straight if s.speed_mm_s == fastest), key=lambda section: section.length_mm)
    _draw_speed(places[0, 0], fast[len(fast) // 2 if len(fast) < 4 else 2], "a short fast line")
    _draw_speed(places[0, 1], fast[-1], "a long fast line")
    _draw_corner(places[1, 0], result)
    _draw_residuals(places[1, 1], result)
    drawing.suptitle(
        f"k = {result.k_s.value:.5f} s ({result.k_cycles} cycles), law: {result.law}, "
        f"residuals {result.rms_mm:.4f} mm rms"
    )
    return drawing


def _draw_speed(axes: "Axes", section: "Section", title: str) -> None:
    from gcode2krl.report.drawing import BLUE, VERMILION

    time = section.time_s - section.start_s
    step = np.diff(time)
    middle = 0.5 * (time[1:] + time[:-1])
    along = section.model_mm[-1] - section.model_mm[0]
    along = along / max(float(np.linalg.norm(along)), 1e-12)
    for points, style, colour, label in (
        (section.model_mm, "-", VERMILION, "fitted law, between samples"),
        (section.position_mm, ".", BLUE, "trace, between samples"),
    ):
        speed = np.diff(points, axis=0) @ along / step
        axes.plot(middle, speed, style, color=colour, label=label)
    axes.set(xlabel="time from the start in s", ylabel="speed along the line in mm/s")
    words = f"{title}: {section.length_mm:g} mm at {section.speed_mm_s:g} mm/s, line {section.first_line}"
    axes.set_title(words)
    axes.legend(loc="lower center")


def _draw_corner(axes: "Axes", result: "Identification") -> None:
    from gcode2krl.report.drawing import BLUE, VERMILION

    bent = [section for section in result.sections if section.fitted and section.corner_deg < 179.0]
    if not bent:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no approximated corner", ha="center", transform=axes.transAxes)
        return
    section = min(bent, key=lambda section: (abs(section.corner_deg - 90.0), section.speed_mm_s))
    spread = np.argsort(np.ptp(section.model_mm, axis=0))[::-1][:2]
    first, second = sorted(spread.tolist())
    axes.plot(
        section.model_mm[:, first], section.model_mm[:, second], "-", color=VERMILION, label="fitted law"
    )
    axes.plot(section.position_mm[:, first], section.position_mm[:, second], ".", color=BLUE, label="trace")
    corner = next(c for c in result.corners if section.first_line <= c.source_line <= section.last_line)
    near = np.linalg.norm(section.model_mm - _apex_of(section), axis=1) < 1.5 * corner.d_mm.value
    shown = section.model_mm[near]
    margin = 0.1 * corner.d_mm.value
    axes.set_xlim(shown[:, first].min() - margin, shown[:, first].max() + margin)
    axes.set_ylim(shown[:, second].min() - margin, shown[:, second].max() + margin)
    axes.set_aspect("equal")
    axes.set(xlabel=f"{'xyz'[first]} in mm", ylabel=f"{'xyz'[second]} in mm")
    axes.set_title(
        f"corner of {corner.angle_deg:.0f}° at {corner.speed_mm_s:g} mm/s: d = {corner.d_mm.value:.3f} mm, "
        f"error {corner.error_mm.value:.3f} mm"
    )
    axes.legend()


def _apex_of(section: "Section") -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Return the point of the path that lies furthest from the line between its ends."""
    start, end = section.model_mm[0], section.model_mm[-1]
    way = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
    away = section.model_mm - start
    off = np.linalg.norm(away - np.outer(away @ way, way), axis=1)
    return np.asarray(section.model_mm[int(np.argmax(off))])


def _draw_residuals(axes: "Axes", result: "Identification") -> None:
    from gcode2krl.report.drawing import BLUE, GREY, ORANGE

    number = np.arange(1, len(result.sections) + 1)
    rms = np.array([section.rms_mm for section in result.sections])
    fitted = np.array([section.fitted for section in result.sections])
    axes.bar(number[fitted], rms[fitted], color=BLUE, label="fitted")
    if not fitted.all():
        axes.bar(number[~fitted], rms[~fitted], color=ORANGE, label="judged only")
    axes.axhline(result.noise_mm, color=GREY, linestyle="--", label="noise at rest")
    axes.set(xlabel="section", ylabel="residual in mm rms", title="how well the law holds")
    axes.set_ylim(0.0, 1.35 * max(float(rms.max()), result.noise_mm, 1e-9))
    axes.legend(loc="upper left", ncols=3)
