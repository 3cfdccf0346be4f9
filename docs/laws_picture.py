"""Draw the two laws of the motion that ``docs/motion.md`` shows: the rounded corner and the speed step.

python docs/laws_picture.py [-o FILE.png]
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gcode2krl.krc4 import corner, speed_step
from gcode2krl.report.drawing import BLACK, BLUE, GREEN, GREY, VERMILION, look

ROOT = Path(__file__).resolve().parents[1]
ANGLE_DEG, LINE_MM, SPEED_MM_S = 75.0, 230.0, 400.0
"""Angle, lines and speed of the first study of Bigliardi et al. 2022."""
CDIS_MM = (20.0, 60.0, 100.0, 200.0)
K_S = 0.168
STEPS = ((25.0, 2000.0), (400.0, 2000.0))
"""Speed in mm/s and acceleration in mm/s²: milling, where k rules, and the paper, where v/a does."""


def draw(target: Path) -> None:
    """Draw both laws into a file."""
    with look():
        figure = Figure(figsize=(10.0, 4.0), layout="constrained")
        FigureCanvasAgg(figure)
        left, *right = figure.subplots(1, 1 + len(STEPS), width_ratios=[1.3] + [1.0] * len(STEPS))
        _corners(left)
        for axes, step in zip(right, STEPS, strict=True):
            _step(axes, *step)
        figure.savefig(target, dpi=130)


def _corners(axes: Axes) -> None:
    """Draw one corner with several distances."""
    half = np.radians(ANGLE_DEG / 2.0)
    before = LINE_MM * np.array([-np.sin(half), -np.cos(half)])
    after = LINE_MM * np.array([np.sin(half), -np.cos(half)])
    lines = np.array([before, [0.0, 0.0], after])
    axes.plot(*lines.T, color=GREY, linewidth=1.0, label="programmed")
    points = np.column_stack([lines, np.zeros(3)])
    t = np.linspace(0.0, 1.0, 101)[:, None]
    for cdis_mm, colour in zip(CDIS_MM, (BLUE, GREEN, VERMILION, BLACK), strict=True):
        d_mm, error_mm, _, _ = corner(*points[:, None, :], [cdis_mm], [SPEED_MM_S])
        share = d_mm[0] / LINE_MM
        curve = (1.0 - t) ** 2 * share * before + t**2 * share * after
        label = f"CDIS {cdis_mm:.0f}: d = {d_mm[0]:.0f}, e = {error_mm[0]:.1f} mm"
        axes.plot(*curve.T, color=colour, linewidth=1.8, label=label)
    axes.set(title=f"A corner of {ANGLE_DEG:.0f}°, lines of {LINE_MM:.0f} mm", xlabel="mm", ylabel="mm")
    axes.set_aspect("equal")
    axes.legend(loc="lower center")


def _step(axes: Axes, speed_mm_s: float, acceleration_mm_s2: float) -> None:
    """Draw speed, acceleration and jerk of a start, each as a share of its largest value."""
    t_s = np.linspace(-0.02, speed_mm_s / acceleration_mm_s2 + K_S + 0.05, 1200)
    _, *signals = speed_step(t_s, 0.0, speed_mm_s, acceleration_mm_s2, K_S)
    names = (("speed", "mm/s"), ("acceleration", "mm/s²"), ("jerk", "mm/s³"))
    for (name, unit), values, colour in zip(names, signals, (BLUE, GREEN, VERMILION), strict=True):
        largest = float(np.abs(values).max())
        axes.plot(1000.0 * t_s, values / largest, color=colour, label=f"{name}, 1 = {largest:.0f} {unit}")
    axes.set(title=f"0 to {speed_mm_s:.0f} mm/s, a = {acceleration_mm_s2 / 1000:.0f} m/s²", xlabel="ms")
    axes.set_ylim(-1.15, 1.75)
    axes.legend(loc="upper left")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "images" / "motion_laws.png")
    draw(parser.parse_args().output)
