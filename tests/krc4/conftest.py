"""Cells and small programs for the controller's time law and its corners."""

import io
import itertools

import pytest

from gcode2krl import load_cell, plan_motion
from gcode2krl.gcode import read_stream

HEAD = "G21 G90 G54\nT1 M6\nS8000 M3\nG43 H1\n"
K_S = 0.168


def toml_value(value):
    return f'"{value}"' if isinstance(value, str) else repr(value)


def move_word(point):
    """Return X, Y and Z of a point, as G-code."""
    return " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZ", point, strict=True))


def polyline(points, speeds, mode="G64"):
    """Return a program: a rapid to the first point, then a feed move to each other one."""
    text = HEAD + mode + "\nG0 " + move_word(points[0]) + "\n"
    for point, speed in zip(points[1:], speeds, strict=True):
        text += f"G1 {move_word(point)} F{60 * speed:.14g}\n"
    return text + "M30\n"


def straight(lengths, speeds, mode="G64", start_mm=None):
    """Return a program along Y: feed moves of these lengths, centred in front of the robot."""
    start = -sum(lengths) / 2 if start_mm is None else start_mm
    places = list(itertools.accumulate(lengths, initial=start))
    return polyline([(0, y, 0) for y in places], speeds, mode)


@pytest.fixture(scope="session")
def make_cell(tmp_path_factory):
    """Return a cell with the given keys of [controller]; look-ahead is off unless asked for."""
    known = {}

    def make(**controller):
        controller = {"advance": "unlimited", "k_s": K_S, **controller}
        key = tuple(sorted(controller.items()))
        if key not in known:
            path = tmp_path_factory.mktemp("cell") / "cell.toml"
            rows = [f"{name} = {toml_value(value)}" for name, value in controller.items()]
            path.write_text("based_on = 'demonstration'\n[controller]\n" + "\n".join(rows) + "\n")
            known[key] = load_cell(path)
        return known[key]

    return make


@pytest.fixture(scope="session")
def read():
    def read_text(text, cell):
        return read_stream(io.BytesIO(text.encode()), "part.nc", cell)

    return read_text


@pytest.fixture(scope="session")
def run_program(make_cell, read):
    """Return the Motion of a program text in a cell with these keys of [controller]."""

    def run(text, dt_s=0.012, **controller):
        cell = make_cell(**controller)
        return plan_motion(read(text, cell), cell, dt_s=dt_s)

    return run
