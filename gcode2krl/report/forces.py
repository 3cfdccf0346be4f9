"""Cutting force, depth and width of cut and engagement over time as a matplotlib figure."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from gcode2krl.arrays import Floats
from gcode2krl.report.columns import TimeColumns
from gcode2krl.report.drawing import BLACK, BLUE, GREY, ORANGE, PALE, look, need_samples, thin, title
from gcode2krl.report.enlarged import Trace, enlarge_places, number_places
from gcode2krl.report.loads import (
    AXES,
    draw_components,
    draw_confidence,
    finish,
    is_hatch,
)
from gcode2krl.report.signals import Clock, name_largest, panel
from gcode2krl.report.span import span_of
from gcode2krl.report.worst_places import worst_rows
from gcode2krl.tables import Forces, Motion, Toolpath
from gcode2krl.units import DEG_PER_RAD

_GREENS = LinearSegmentedColormap.from_list("engaged", ["white", "#7FCFB9"])


def force_figure(toolpath: Toolpath, motion: Motion, forces: Forces) -> Figure:
    """Draw force, depth and width of cut and engagement over time, with the G-code lines along the top.

    The engagement is drawn as the share of samples whose tooth cuts at an angle. Where lines would fill the
    picture, each quantity is a band in a panel of its own, and the largest forces are enlarged below.
    """
    need_samples(motion)
    clock = Clock.of(toolpath, motion)
    size_N = np.linalg.norm(forces.force_base_N, axis=1)
    with look():
        if is_hatch(clock.columns, forces.force_base_N, forces.peak_N, forces.a_p_mm, forces.a_e_mm):
            figure, panels = _of_bands(clock, forces, size_N)
        else:
            figure, panels = _of_lines(clock, forces, size_N)
        finish(figure, panels, clock, title("Cutting force and engagement", toolpath))
    return figure


def engaged_share(columns: TimeColumns, phi_rad: Floats) -> Floats:
    """Return (180, c) the share of each column's samples that cut at each degree from the feed normal.

    ``phi_rad`` (m, 2k) are the entry and exit angles of the arcs, NaN padded.
    """
    count = len(columns.edge_s) - 1
    column = np.repeat(columns.held, np.diff(columns.start, append=columns.rows))
    begins = np.zeros((count, 181))
    for pair in range(phi_rad.shape[1] // 2):
        entry, leave = (phi_rad[:, 2 * pair + end] * DEG_PER_RAD for end in (0, 1))
        cuts = np.isfinite(entry) & np.isfinite(leave)
        for angle, sign in ((np.floor(entry[cuts] + 1e-9), 1.0), (np.ceil(leave[cuts] - 1e-9), -1.0)):
            bins = column[cuts] * 181 + np.clip(angle, 0, 180).astype(np.int64)
            begins += sign * np.bincount(bins, minlength=count * 181).reshape(count, 181)
    samples = np.zeros(count)
    samples[columns.held] = np.diff(columns.start, append=columns.rows)
    share = np.cumsum(begins, axis=1)[:, :180] / np.maximum(samples, 1.0)[:, None]
    shares: Floats = np.clip(share, 0.0, 1.0).T
    return shares


def _of_lines(clock: Clock, forces: Forces, size_N: Floats) -> tuple[Figure, list[Axes]]:
    """Draw all components in one panel, depth and width in another."""
    figure = Figure(figsize=(11.0, 8.5), layout="constrained")
    panels = list(figure.subplots(3, 1, sharex=True, height_ratios=(1.6, 1.0, 1.0)))
    first, cut, arcs = panels
    draw_confidence(first, clock.time_s, size_N, forces.relative_band)
    first.plot(*thin(clock.time_s, forces.peak_N), color=PALE, lw=0.8, label="peak of a revolution")
    first.plot(*thin(clock.time_s, size_N), color=BLACK, lw=1.2, label="mean of a revolution")
    for axis, (colour, name) in enumerate(AXES):
        values = forces.force_base_N[:, axis]
        first.plot(*thin(clock.time_s, values), color=colour, lw=0.8, label=f"{name} in $BASE")
    first.set_ylabel("Force on the tool (N)")
    whole = span_of(clock.columns, size_N, float(size_N.max(initial=0.0)))
    name_largest(first, clock, size_N, whole, "N")
    cut.plot(*thin(clock.time_s, forces.a_p_mm), color=BLUE, lw=1.0, label="depth $a_p$")
    cut.plot(*thin(clock.time_s, forces.a_e_mm), color=ORANGE, lw=1.0, label="width $a_e$")
    cut.set_ylabel("Cut (mm)")
    _draw_arcs(arcs, clock, forces.phi_rad)
    return figure, panels


def _of_bands(clock: Clock, forces: Forces, size_N: Floats) -> tuple[Figure, list[Axes]]:
    """Draw each quantity as a band in its own panel, and the three largest forces sample by sample."""
    figure = Figure(figsize=(11.0, 13.0), layout="constrained")
    heights = (1.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.9, 1.7)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    first = figure.add_subplot(grid[0])
    panels = [first, *(figure.add_subplot(grid[row], sharex=first) for row in range(1, 7))]
    _, peak_N = clock.columns.extremes(forces.peak_N)
    panel(first, clock, size_N, "N", BLACK, "mean of a revolution", size_N.max(initial=0.0))
    time_s, label = clock.columns.middle_s, "highest peak of a revolution"
    first.plot(time_s, peak_N, color=GREY, lw=0.6, drawstyle="steps-mid", label=label)
    first.set_ylim(0.0, 1.05 * max(float(np.nanmax(peak_N)), first.get_ylim()[1] / 1.05))
    first.set_ylabel("Force on the tool (N)")
    words = f"90 % of the coefficients: ± {forces.relative_band:.0%} (not drawn)"
    first.set_title(words, loc="left", fontsize=8)
    draw_components(panels[1:4], clock, forces.force_base_N, "N")
    for axes, values, colour, name in (
        (panels[4], forces.a_p_mm, BLUE, "depth $a_p$"),
        (panels[5], forces.a_e_mm, ORANGE, "width $a_e$"),
    ):
        panel(axes, clock, values, "mm", colour, name)
        axes.set_ylabel(f"{name} (mm)")
    _draw_arcs(panels[6], clock, forces.phi_rad)
    rows = worst_rows(clock.time_s, size_N)
    number_places(first, clock, size_N, rows, span_of(clock.columns, size_N, size_N.max(initial=0.0)))
    components = zip(AXES, forces.force_base_N.T, strict=True)
    traces = (
        Trace(size_N, BLACK, "mean of a revolution"),
        Trace(forces.peak_N, PALE, "peak of a revolution"),
        *(Trace(values, colour, name) for (colour, name), values in components),
    )
    enlarge_places(figure, grid[7], clock, rows, traces, "N")
    return figure, panels


def _draw_arcs(axes: Axes, clock: Clock, phi_rad: Floats) -> None:
    """Draw at which angles teeth cut."""
    edge_s = clock.columns.edge_s
    axes.imshow(
        engaged_share(clock.columns, phi_rad),
        origin="lower",
        extent=(edge_s[0], edge_s[-1], 0.0, 180.0),
        aspect="auto",
        interpolation="nearest",
        cmap=_GREENS,
        vmin=0.0,
        vmax=1.0,
    )
    words = "engaged at this angle, white: never, green: all samples"
    axes.set_title(words, loc="left", fontsize=8, color=GREY)
    axes.set_ylabel("Angle from the\nfeed normal (°)")
    axes.set_ylim(0.0, 180.0)
    axes.set_yticks([0, 90, 180])
