"""Pictures and the page of an answer: one figure a run, and ``--html gap.html``, one file without network.

A figure shows the residual over time, where on the path it is, and against the input it depends on; the page
has the path as inline SVG, with the points that a slider goes along. Needs no display; importing this module
loads matplotlib, so it is imported only where a picture is asked for.
"""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error
from gcode2krl.files import make_folder, write_together
from gcode2krl.gap.answer.evidence import Evidence, RunEvidence, smoothed
from gcode2krl.gap.answer.result import CauseResult, Gap, IntervalResult
from gcode2krl.gap.answer.words import (
    alike,
    depends,
    describe,
    happened,
    headline,
    kind,
    left_lines,
    named,
    next_run,
    number,
    stretch,
    where_words,
    worst,
)
from gcode2krl.gap.compare.interpolation import usual_step_s
from gcode2krl.report.drawing import BLUE, GREY, PALE, SKY, VERMILION, line_ticks, look, thin
from gcode2krl.report.figures import shown_in_notebooks
from gcode2krl.report.page.one_file import base_css
from gcode2krl.version import __version__

DPI = 110
PATH_COLOURS = "viridis"
_MOST_SEGMENTS = 3000
_MOST_DOTS = 4000
_LINES_ON_AXIS = 10
_FLAT_MM = 0.5
SIGNALS = {
    "tcp": "tool tip",
    "force": "force",
    "joint_actual": "servo (actual minus commanded joints)",
    "joint_load": "gears (joints behind minus before)",
    "joint_commanded": "commanded joints",
}


def write_pictures(gap: Gap, folder: Path, inputs: Iterable[str | Path] = ()) -> list[Path]:
    """Write ``gap_<run>.png`` of each run into a folder, all or none; return the files.

    None where nothing was compared. Raises `NotUnderstoodError` where the folder cannot be written.
    """
    evidence = gap.evidence
    if evidence is None:
        return []
    make_folder(folder)
    figures = {folder / f"gap_{_file_name(run.run)}.png": run_figure(gap, run) for run in evidence.runs}
    write_together({file: picture_bytes(figure) for file, figure in figures.items()}, inputs)
    return list(figures)


def figure_of_run(gap: Gap, run: str | None) -> Figure:
    """Draw a run by its name, None = the first; raises `NotUnderstoodError` where there is none to draw."""
    runs = {} if gap.evidence is None else {each.run: each for each in gap.evidence.runs}
    if not runs or (run is not None and run not in runs):
        sentence = f"there is no run {run!r} to draw" if runs else "nothing was compared: nothing to draw"
        raise input_error("no-runs", sentence, f"the runs are {', '.join(runs)}" if runs else "")
    return shown_in_notebooks(run_figure(gap, runs[run] if run is not None else next(iter(runs.values()))))


def run_figure(gap: Gap, run: RunEvidence) -> Figure:
    """Draw one run: the residual over time, the path coloured by it, and its dependence if one is known."""
    evidence = gap.evidence
    if evidence is None:
        raise ValueError("nothing was compared, so there is nothing to draw")
    signal = SIGNALS.get(evidence.signal, evidence.signal)
    title = f"{run.run}: measured minus predicted, {signal}"
    with look():
        if run.position_mm is None and run.against is None:
            figure = Figure(figsize=(11.0, 3.8), layout="constrained")
            draw_time(figure.add_subplot(), evidence, run, gap.where.intervals)
            figure.suptitle(title)
            return figure
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1.0, 0.45), width_ratios=(1.15, 1.0))
        draw_time(figure.add_subplot(grid[0, :]), evidence, run, gap.where.intervals)
        views = views_of(run)
        for number, view in enumerate(views):
            rows = slice(number + 1, number + 2) if len(views) > 1 else slice(1, 3)
            draw_path(figure.add_subplot(grid[rows, 0]), evidence, run, view)
        draw_dependence(figure.add_subplot(grid[1:, 1]), evidence, run)
        figure.suptitle(title)
    return figure


def picture_bytes(figure: Figure) -> bytes:
    """Return a figure as a PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    return buffer.getvalue()


def draw_time(
    axes: Axes, evidence: Evidence, run: RunEvidence, intervals: Sequence[IntervalResult] = ()
) -> None:
    """Draw the residual over time, before and after, with the noise, the stretches and the G-code lines.

    The lines are means over 0.1 s; the dots behind them are the readings.
    """
    time_s = run.time_s
    shaded = "larger than the noise"
    for interval in intervals:
        if interval.run == run.run and interval.signal == evidence.signal:
            axes.axvspan(interval.t_start_s, interval.t_end_s, color=PALE, alpha=0.35, lw=0, label=shaded)
            shaded = "_"
    axes.axhspan(-evidence.noise, evidence.noise, color=SKY, alpha=0.35, lw=0, label="noise, ±1 σ")
    for values, colour, label in ((run.before, VERMILION, "before"), (run.after, BLUE, "with the causes")):
        if label != "before" and not has_causes(run):
            continue
        rows = _some(len(time_s), _MOST_DOTS)
        axes.plot(time_s[rows], values[rows], ".", ms=1.2, color=colour, alpha=0.25)
        axes.plot(*thin(*_with_gaps(time_s, smoothed(time_s, values))), color=colour, lw=1.2, label=label)
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"{evidence.component} ({evidence.unit})")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=4)
    _add_lines(axes, run)


def draw_path(axes: Axes, evidence: Evidence, run: RunEvidence, view: tuple[int, int]) -> None:
    """Draw the path along two axes of ``$BASE``, coloured by the size of the gap; words without a path."""
    if run.position_mm is None:
        _say(axes, "no path: the robot is not known")
        return
    first, second = view
    rows = _some(len(run.time_s), _MOST_SEGMENTS)
    points = run.position_mm[rows][:, [first, second]]
    segments = np.stack([points[:-1], points[1:]], axis=1)
    order = np.argsort(run.size_before[rows][1:], kind="stable")  # the worst on top
    lines = LineCollection(list(segments[order]), cmap=PATH_COLOURS, lw=2.2, capstyle="round")
    lines.set_array(run.size_before[rows][1:][order])
    lines.set_clim(0.0, largest_size(evidence))
    axes.add_collection(lines)
    axes.autoscale()
    axes.set_xlabel(f"{'XYZ'[first]} (mm)")
    axes.set_ylabel(f"{'XYZ'[second]} (mm)")
    axes.margins(0.05, 0.12)
    worst = int(np.argmax(run.size_before))
    axes.plot(*run.position_mm[worst, [first, second]], "o", ms=11, mfc="none", mec=VERMILION, mew=1.4)
    if second == 1:
        axes.set_aspect("equal", adjustable="datalim")
        axes.figure.colorbar(lines, ax=axes, label=f"gap ({evidence.size_unit})", shrink=0.9)
    title = "from above; circle: largest" if second == 1 else "from the side, Z not to scale"
    axes.set_title(title, loc="left")


def draw_dependence(axes: Axes, evidence: Evidence, run: RunEvidence) -> None:
    """Draw the residual against the input that the gap depends on, before and after."""
    if run.against is None:
        _say(axes, "no input is known that the gap depends on")
        return
    x, values = run.against.values, smoothed(run.time_s, run.before)
    rows = _some(len(x), _MOST_DOTS)
    axes.axhspan(-evidence.noise, evidence.noise, color=SKY, alpha=0.35, lw=0)
    if run.against.across_runs:
        _draw_others(axes, evidence, run)
    direction = run.against.direction
    if direction is None:
        axes.plot(x[rows], values[rows], ".", ms=2.0, color=VERMILION, label="before")
    else:
        for sign, marker, label in (
            (1.0, "^", "before, joint moving up"),
            (-1.0, "v", "before, moving down"),
        ):
            moving = rows[direction[rows] == sign]
            colour = VERMILION if sign > 0 else GREY
            axes.plot(x[moving], values[moving], marker, ms=2.2, mew=0, color=colour, label=label)
    if has_causes(run):
        after = smoothed(run.time_s, run.after)
        axes.plot(x[rows], after[rows], ".", ms=1.6, color=BLUE, alpha=0.6, label="with the causes")
    axes.set_xlabel(run.against.name)
    axes.set_ylabel(f"{evidence.component} ({evidence.unit})")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=2, markerscale=2.5)


def _draw_others(axes: Axes, evidence: Evidence, run: RunEvidence) -> None:
    """Draw what the other runs show of an input that hardly changes within one."""
    label = "other runs, before"
    for other in evidence.runs:
        if other is not run and other.against is not None:
            rows = _some(len(other.time_s), _MOST_DOTS // 4)
            values = smoothed(other.time_s, other.before)
            axes.plot(other.against.values[rows], values[rows], ".", ms=1.6, color=PALE, label=label)
            label = "_"


def has_causes(run: RunEvidence) -> bool:
    """Tell whether named causes change the residual."""
    return bool(np.any(run.before != run.after))


def views_of(run: RunEvidence) -> list[tuple[int, int]]:
    """Return the axes of the views: from above and, where the tip goes up and down, from the side."""
    if run.position_mm is None:
        return [(0, 1)]
    span = np.ptp(run.position_mm, axis=0)
    side = (0 if span[0] >= span[1] else 1, 2)
    return [(0, 1), side] if span[2] > _FLAT_MM else [(0, 1)]


def largest_size(evidence: Evidence) -> float:
    """Return the size that the end of the colour scale stands for, the same in all runs."""
    sizes = np.concatenate([run.size_before for run in evidence.runs])
    return max(float(np.percentile(sizes, 99.0)), 1e-12)


def _add_lines(axes: Axes, run: RunEvidence) -> None:
    """Add G-code lines along the top."""
    if not np.any(run.line > 0):
        return
    times, labels = line_ticks(run.time_s, run.line.astype(np.int32), _LINES_ON_AXIS)
    top = axes.secondary_xaxis("top")
    top.set_xticks(times, labels)
    top.set_xlabel("G-code line")


def _with_gaps(time_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return time and values with a missing one in each gap, so that no line is drawn across it."""
    step_s = usual_step_s(time_s) if len(time_s) > 1 else 1.0
    gaps = np.flatnonzero(np.diff(time_s) > 5.0 * step_s) + 1
    return np.insert(time_s, gaps, time_s[gaps - 1] + step_s), np.insert(values, gaps, np.nan)


def _some(count: int, most: int) -> Any:
    """Return at most so many row numbers, evenly spread."""
    return np.arange(0, count, max(1, -(-count // most)))


def _say(axes: Axes, words: str) -> None:
    axes.set_axis_off()
    axes.text(0.5, 0.5, words, ha="center", va="center", color=GREY, transform=axes.transAxes)


def _file_name(run: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in run)


_COLOURS = 24
_MOST_POINTS = 900
_STRIP = (1000.0, 200.0)
_MARGIN = 0.06
_TITLES = {1: "from above", 2: "from the side"}


@dataclass(frozen=True)
class View:
    """The path along two axes: lines of one colour each, in millimetres with y downwards."""

    title: str
    box: str
    """``viewBox`` of the SVG."""
    radius: float
    lines: tuple[tuple[str, str], ...]
    """Colour and path data."""


@dataclass(frozen=True)
class Strip:
    """The residual over time in a box of 1000 by 200, and what its edges mean."""

    before: str
    after: str | None
    noise: tuple[float, float]
    """Top and height of the band."""
    stretches: tuple[tuple[float, float], ...]
    """First and width."""
    top: float
    bottom: float
    first_s: float
    last_s: float


def views(evidence: Evidence, run: RunEvidence) -> list[View]:
    """Return the path from above and from the side, coloured by the size of the gap; none without a path."""
    if run.position_mm is None:
        return []
    rows = rows_of(run)
    colour = _colours(run.size_before[rows], largest_size(evidence))
    return [_view(run.position_mm[rows], colour, axes) for axes in views_of(run)]


def strip(evidence: Evidence, run: RunEvidence, intervals: Sequence[IntervalResult]) -> Strip:
    """Return the residual over time; only the stretches of the run itself are taken of the intervals."""
    rows = rows_of(run)
    first, last = float(run.time_s[0]), float(run.time_s[-1])
    before = smoothed(run.time_s, run.before)[rows]
    after = smoothed(run.time_s, run.after)[rows]
    top = max(float(before.max()), float(after.max()), evidence.noise)
    bottom = min(float(before.min()), float(after.min()), -evidence.noise)
    width, height = _STRIP

    def at(time_s: Any) -> Any:
        return width * (time_s - first) / max(last - first, 1e-9)

    def level(value: Any) -> Any:
        return height * (top - value) / max(top - bottom, 1e-300)

    of_run = [each for each in intervals if each.run == run.run and each.signal == evidence.signal]
    return Strip(
        before=_polyline(at(run.time_s[rows]), level(before)),
        after=_polyline(at(run.time_s[rows]), level(after)) if has_causes(run) else None,
        noise=(round(level(evidence.noise), 1), round(level(-evidence.noise) - level(evidence.noise), 1)),
        stretches=tuple(
            (round(at(interval.t_start_s), 1), round(at(interval.t_end_s) - at(interval.t_start_s), 1))
            for interval in of_run
        ),
        top=top,
        bottom=bottom,
        first_s=max(first, 0.0),
        last_s=last,
    )


def points(run: RunEvidence) -> dict[str, list[Any]]:
    """Return what the slider shows at each of its places: time, line, sizes, and where each view has it."""
    rows = rows_of(run)
    at = []
    if run.position_mm is not None:
        flat = (_flat(run.position_mm[rows], axes) for axes in views_of(run))
        at = [[[round(float(x), 2), round(float(y), 2)] for x, y in place] for place in flat]
    return {
        "t": [round(float(value), 3) for value in run.time_s[rows]],
        "line": run.line[rows].tolist(),
        "before": [float(f"{value:.3g}") for value in run.size_before[rows]],
        "after": [float(f"{value:.3g}") for value in run.size_after[rows]],
        "at": at,
    }


def _flat(place: Floats, axes: tuple[int, int]) -> Floats:
    """Return places (n, 3) along two axes (n, 2), y downwards."""
    return np.stack([place[:, axes[0]], -_stretch(place, axes) * place[:, axes[1]]], axis=1)


def scale_colours() -> list[str]:
    """Return the colours of the scale, from no gap to the largest."""
    return [_hex(level) for level in np.linspace(0.0, 1.0, 9)]


def rows_of(run: RunEvidence) -> Any:
    """Return the rows that are drawn, at most 900."""
    return _some(len(run.time_s), _MOST_POINTS)


def _view(place: Floats, colour: Any, axes: tuple[int, int]) -> View:
    scale, flat = _stretch(place, axes), _flat(place, axes)
    low, span = flat.min(axis=0), np.ptp(flat, axis=0)
    margin = _MARGIN * max(float(span.max()), 1e-6)
    low, span = low - margin, span + 2.0 * margin
    box = " ".join(f"{value:.2f}" for value in (*low, *span))
    title = _TITLES[axes[1]] + (f", Z drawn {scale:g} times as high" if scale > 1.0 else "")
    lines = tuple((_hex(level / (_COLOURS - 1)), data) for level, data in _pieces(flat, colour))
    return View(title, box, round(0.014 * float(span.max()), 2), lines)


def _stretch(place: Floats, axes: tuple[int, int]) -> float:
    """Return how many times as high a flat side view is drawn, a whole number; 1 from above."""
    if axes[1] != 2:
        return 1.0
    span = np.ptp(place[:, list(axes)], axis=0)
    return float(max(1, round(0.2 * span[0] / max(span[1], 1e-6))))


def _pieces(flat: Floats, colour: Any) -> list[tuple[int, str]]:
    """Return colour and path data of the runs of points of one colour, the worst last."""
    edges = np.flatnonzero(np.diff(colour)) + 1
    starts, ends = np.append(0, edges), np.append(edges, len(colour) - 1)
    pieces = [
        (int(colour[start]), _polyline(*flat[start : end + 1].T))
        for start, end in zip(starts, ends, strict=True)
        if end > start
    ]
    return sorted(pieces, key=lambda piece: piece[0])


def _polyline(x: Floats, y: Floats) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _colours(sizes: Floats, largest: float) -> Any:
    levels = np.clip(sizes / largest, 0.0, 1.0) * (_COLOURS - 1)
    return levels.round().astype(int)


def _hex(level: float) -> str:
    red, green, blue, _ = colormaps[PATH_COLOURS](level)
    return "#" + "".join(f"{round(255 * value):02x}" for value in (red, green, blue))


_VERDICTS = {
    "no_gap": "no gap",
    "explained": "explained",
    "partly_explained": "partly explained",
    "unexplained": "not explained",
}


def write_page(gap: Gap, file: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Write the page; raises `NotUnderstoodError` where the file cannot be written or is an input."""
    write_together({file: page(gap).encode("utf-8")}, inputs)


def page(gap: Gap) -> str:
    """Return the page: the first sentence, where, why, what remains and the next run."""
    evidence = gap.evidence
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            gap=gap,
            sentence=headline(gap),
            verdict=_VERDICTS[gap.verdict],
            stretches=gap.where.intervals[: worst(gap.where.intervals)[0]],
            where_words=where_words(gap.where.intervals) if gap.where.intervals else None,
            runs=[] if evidence is None else [_run(gap, evidence, run) for run in evidence.runs],
            evidence=evidence,
            colours=scale_colours(),
            largest=0.0 if evidence is None else largest_size(evidence),
            causes=[_cause(cause) for cause in gap.causes],
            events=[happened(each) for each in gap.events],
            left=list(left_lines(gap)),
            courses=[(depends(each), each.course) for each in gap.unexplained.depends_on if each.course],
            next_run=[] if gap.next_run is None else next_run(gap.next_run),
            version=__version__,
            base_css=base_css(),
        )
    )


def _run(gap: Gap, evidence: Evidence, run: RunEvidence) -> dict[str, Any]:
    """Return one run as the page shows it, its picture as PNG in base 64."""
    return {
        "name": run.run,
        "views": views(evidence, run),
        "strip": strip(evidence, run, gap.where.intervals),
        "points": points(run),
        "picture": b64encode(picture_bytes(run_figure(gap, run))).decode("ascii"),
    }


def _cause(cause: CauseResult) -> dict[str, Any]:
    """Return a cause with its words."""
    return {
        "words": describe(cause),
        "said": cause.words,
        "is_named": cause.is_named,
        "probability": cause.probability,
        "shrink": cause.shrink,
        "kind": kind(cause),
        "alike": alike(cause.indistinguishable_from),
        "rivals": [
            (named(rival.effect, rival.target), rival.probability)
            for rival in cause.rivals or ()
            if rival.probability >= 0.01
        ],
    }


def _environment() -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("gcode2krl.gap.answer", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"number": number, "percent": lambda value: f"{value:.0%}", "stretch": stretch}
    return made
