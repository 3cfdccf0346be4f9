"""The path of a run and its residual over time as inline SVG, with the points that a slider goes along."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps

from gcode2krl.arrays import Floats
from gcode2krl.gap.tell.evidence import Evidence, RunEvidence
from gcode2krl.gap.tell.html.pictures import PATH_COLOURS, has_causes, largest_size, views_of
from gcode2krl.gap.tell.residuals import smoothed
from gcode2krl.gap.tell.result import IntervalResult

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

    own = [each for each in intervals if each.run == run.run and each.signal == evidence.signal]
    return Strip(
        before=_polyline(at(run.time_s[rows]), level(before)),
        after=_polyline(at(run.time_s[rows]), level(after)) if has_causes(run) else None,
        noise=(round(level(evidence.noise), 1), round(level(-evidence.noise) - level(evidence.noise), 1)),
        stretches=tuple(
            (round(at(each.t_start_s), 1), round(at(each.t_end_s) - at(each.t_start_s), 1)) for each in own
        ),
        top=top,
        bottom=bottom,
        first_s=max(first, 0.0),
        last_s=last,
    )


def points(run: RunEvidence) -> dict[str, list[Any]]:
    """Return what the slider shows at each of its places: time, line, sizes, and where each view has it."""
    rows = rows_of(run)
    found: dict[str, list[Any]] = {
        "t": [round(float(value), 3) for value in run.time_s[rows]],
        "line": [int(value) for value in run.line[rows]],
        "before": [float(f"{value:.3g}") for value in run.size_before[rows]],
        "after": [float(f"{value:.3g}") for value in run.size_after[rows]],
        "at": [],
    }
    if run.position_mm is not None:
        for first, second in views_of(run):
            place = run.position_mm[rows]
            scale = _stretch(place, (first, second))
            found["at"].append(
                [[round(float(x), 2), round(float(-scale * y), 2)] for x, y in place[:, [first, second]]]
            )
    return found


def scale_colours() -> list[str]:
    """Return the colours of the scale, from no gap to the largest."""
    return [_hex(level) for level in np.linspace(0.0, 1.0, 9)]


def rows_of(run: RunEvidence) -> Any:
    """Return the rows that are drawn, at most 900."""
    return np.arange(0, len(run.time_s), max(1, -(-len(run.time_s) // _MOST_POINTS)))


def _view(place: Floats, colour: Any, axes: tuple[int, int]) -> View:
    scale = _stretch(place, axes)
    flat = np.stack([place[:, axes[0]], -scale * place[:, axes[1]]], axis=1)
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
