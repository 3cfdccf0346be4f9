"""What a notebook shows: facts, findings, columns, and the path as a small picture; all text is escaped."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats

_CELL = 'style="text-align:left;padding:1px 12px 1px 0;vertical-align:top"'
_MOST_COLUMNS = 60
_WIDTH, _HEIGHT = 260.0, 180.0
_MOST_POINTS = 1200
"""Of the path in a picture: with two numbers of five letters each it stays below 15 kB."""
_BLUE, _GREY, _ORANGE = "#0072B2", "#999999", "#E69F00"


def block(title: str, *parts: str) -> str:
    """Return parts, which are HTML, under a title, which is text."""
    return f"<div><strong>{escape(title)}</strong>{''.join(parts)}</div>"


def text_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table of texts and numbers; without a head, rows alone."""
    top = "".join(f"<th {_CELL}>{escape(each)}</th>" for each in head)
    body = "".join(
        "<tr>" + "".join(f"<td {_CELL}>{escape(str(value))}</td>" for value in row) + "</tr>" for row in rows
    )
    return f"<table>{f'<tr>{top}</tr>' if top else ''}{body}</table>"


def paragraph(text: str) -> str:
    """Return a text as a paragraph."""
    return f"<p>{escape(text)}</p>"


def beside(*parts: str) -> str:
    """Return parts, which are HTML, side by side."""
    cells = "".join(f"<div>{part}</div>" for part in parts if part)
    return f'<div style="display:flex;gap:24px;flex-wrap:wrap">{cells}</div>'


def column_table(title: str, columns: Mapping[str, NDArray[Any]], units: Mapping[str, str]) -> str:
    """Return each column with its unit, lowest and highest value."""
    rows = [(name, units.get(name, ""), *_range(values)) for name, values in columns.items()]
    more = [paragraph(f"… and {len(rows) - _MOST_COLUMNS} more columns")] if len(rows) > _MOST_COLUMNS else []
    return block(title, text_table(("column", "unit", "lowest", "highest"), rows[:_MOST_COLUMNS]), *more)


def _range(values: NDArray[Any]) -> tuple[str, str]:
    if values.dtype.kind not in "fiub":
        return "", ""
    present = values[np.isfinite(values)]
    if not len(present):
        return "-", "-"
    low, high = present.min().item(), present.max().item()
    return (f"{low:.6g}", f"{high:.6g}") if values.dtype.kind == "f" else (str(low), str(high))


def path_picture(position_mm: Floats, feed: NDArray[np.bool_] | None = None) -> str:
    """Return the path (n, 3) from above as an SVG of a few kB, rapid moves in grey; empty without a path.

    ``feed`` (n,) tells which rows are reached at feed.
    """
    points = np.asarray(position_mm)[:, :2]
    is_feed = np.ones(len(points), np.bool_) if feed is None else feed
    good = np.isfinite(points).all(axis=1)
    points, is_feed = points[good], is_feed[good]
    if len(points) < 2:
        return ""
    step = -(-len(points) // _MOST_POINTS)
    rows = np.unique(np.append(np.arange(0, len(points), step), len(points) - 1))
    low = points.min(axis=0)
    scale = min(_WIDTH, _HEIGHT) / max(float(np.ptp(points, axis=0).max()), 1e-9)
    x, y = ((points[rows] - low) * scale).T
    height = float(np.ptp(points[:, 1])) * scale
    drawn = "".join(
        f'<path d="{_path_data(x, height - y, is_feed[rows] == at_feed)}" fill="none" stroke="{colour}"/>'
        for at_feed, colour in ((False, _GREY), (True, _BLUE))
    )
    box = f"-4 -4 {float(np.ptp(points[:, 0])) * scale + 8:.0f} {height + 8:.0f}"
    return _svg(box, drawn)


def line_picture(time_s: Floats, lines: Sequence[Floats]) -> str:
    """Return values (n,) over time as an SVG of a few kB, the first line pale, without missing values."""
    values = np.stack(lines)
    rows = np.flatnonzero(np.isfinite(values).all(axis=0) & np.isfinite(time_s))
    rows = rows[:: max(-(-len(rows) // (_MOST_POINTS // 2)), 1)]
    if len(rows) < 2:
        return ""
    x = (time_s[rows] - time_s[rows[0]]) * _WIDTH / max(float(time_s[rows[-1]] - time_s[rows[0]]), 1e-9)
    low, high = float(values[:, rows].min()), float(values[:, rows].max())
    drawn = ""
    for line, colour in zip(values, (_ORANGE, _BLUE), strict=False):
        y = (high - line[rows]) * _HEIGHT / max(high - low, 1e-300)
        data = _path_data(x, y, np.ones(len(rows), np.bool_))
        drawn += f'<path d="{data}" fill="none" stroke="{colour}"/>'
    return _svg(f"-4 -4 {_WIDTH + 8:.0f} {_HEIGHT + 8:.0f}", drawn)


def _svg(box: str, drawn: str) -> str:
    size = f'width="{_WIDTH:.0f}" height="{_HEIGHT:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" {size}>{drawn}</svg>'


def _path_data(x: Floats, y: Floats, drawn: NDArray[np.bool_]) -> str:
    """Return the lines to the points that are drawn, each from the point before it."""
    words: list[str] = []
    at = -1
    for row in np.flatnonzero(drawn[1:]) + 1:
        if at != row - 1:
            words.append(f"M{x[row - 1]:.1f} {y[row - 1]:.1f}")
        words.append(f"L{x[row]:.1f} {y[row]:.1f}")
        at = int(row)
    return "".join(words)
