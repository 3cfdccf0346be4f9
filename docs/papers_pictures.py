"""Draw figures of both papers as this project computes them, for ``docs/papers.md``.

python docs/papers_pictures.py            all five into docs/images
python docs/papers_pictures.py haehn_9    one of haehn_4, haehn_9, haehn_13, bigliardi_4, bigliardi_5
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import compliance_paper, krc4_paper  # noqa: E402
from gcode2krl import load_cell, predict  # noqa: E402
from gcode2krl.compliance import displace  # noqa: E402
from gcode2krl.krc4 import corner  # noqa: E402
from gcode2krl.report.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, look  # noqa: E402

COLOURS = (BLUE, GREEN, VERMILION, ORANGE, BLACK)
GROOVE = """G21 G90 G17
T1 M6
S13000 M3
G0 G43 H1 Z20
G0 X-20 Y0
G0 Z2
G1 Z-8.95 F1500
G1 X80
G0 Z20
M5
M30
"""
GROOVE_CELL = 'based_on = "demonstration"\n[stock]\nbox_mm = [[0, -20, -30], [60, 20, 0]]\n'
EVERY = 16
"""An arrow at every so many samples of 12 ms."""


def haehn_4(target: Path) -> None:
    """Draw the correction before and after its projection along a groove (eq. 10), from above and beside."""
    with tempfile.TemporaryDirectory() as folder:
        (part := Path(folder) / "groove.nc").write_text(GROOVE, encoding="ascii")
        (cell := Path(folder) / "cell.toml").write_text(GROOVE_CELL, encoding="utf-8")
        prediction = predict(part, load_cell(cell))
    rows = np.flatnonzero(np.linalg.norm(prediction.forces.force_base_N, axis=1) > 1.0)[::EVERY]
    place = prediction.motion.position_mm
    feed = np.gradient(place, prediction.motion.time_s, axis=0)[rows]
    feed /= np.linalg.norm(feed, axis=1, keepdims=True)
    arrows = (
        ("feed direction v", BLUE, feed),
        ("correction r", GREEN, -prediction.deflection.deflection_base_mm[rows]),
        ("projected correction r_v", VERMILION, prediction.deflection.correction_base_mm[rows]),
    )
    with look():
        figure = Figure(figsize=(10.0, 4.0), layout="constrained")
        FigureCanvasAgg(figure)
        for axes, (up, name) in zip(figure.subplots(2, 1, sharex=True), ((1, "Y"), (2, "Z")), strict=True):
            axes.plot(place[rows, 0], place[rows, up] * 0.0, color=GREY, lw=1.0)
            for words, colour, vector in arrows:
                axes.quiver(
                    place[rows, 0],
                    0.0 * rows,
                    vector[:, 0],
                    vector[:, up],
                    color=colour,
                    angles="xy",
                    scale_units="xy",
                    scale=0.3,
                    width=0.003,
                    label=words,
                )
            axes.set(ylabel=f"{name} beside the path", ylim=(-4.5, 4.5), yticks=[], aspect="equal")
        axes.set_xlabel("X (mm); 1 mm of correction is drawn 3.3 mm long, a feed direction too")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        figure.savefig(target, dpi=130)


def haehn_9(target: Path) -> None:
    """Draw the 60 loaded poses of section 3.1: calculated here, and the means that the paper states."""
    cell = load_cell()
    index, q_rad, force_N = compliance_paper.cases(cell)
    moved_mm, _ = displace(q_rad, force_N, np.zeros_like(force_N), cell)
    size_mm = np.linalg.norm(moved_mm, axis=1)
    with look():
        figure = Figure(figsize=(10.0, 4.2), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for number, words in enumerate(compliance_paper.DIRECTIONS):
            rows = np.flatnonzero(index[:, 0] == number)
            axes.bar(rows + 1, size_mm[rows], color=COLOURS[number], label=f"750 N along {words}")
        axes.axhline(size_mm.mean(), color=BLACK, label=f"mean of these {size_mm.mean():.2f} mm")
        axes.axhline(1.83, color=GREY, ls="--", label="paper, mean measured 1.83 mm")
        axes.axhline(1.72, color=GREY, ls=":", label="paper, mean calculated 1.72 mm")
        for edge in range(5, 60, 5):
            axes.axvline(edge + 0.5, color=GREY, lw=0.4)
        axes.set(xlabel="Pose: 4 positions of 5 orientations, for each direction", ylabel="Displacement (mm)")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        figure.savefig(target, dpi=130)


def haehn_13(target: Path) -> None:
    """Draw the machined test piece of figures 10 to 13 on the twin: the last panel is figure 13."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "gcode2krl", "online", "simulate", "-q", "--plot", folder]
        subprocess.run(command, check=True, cwd=ROOT)
        target.write_bytes((Path(folder) / "deviation.png").read_bytes())


def bigliardi_4(target: Path) -> None:
    """Draw the corner with all eight CDIS, and its error and acceleration beside eq. 3 and 6."""
    with look():
        figure = Figure(figsize=(12.0, 4.6), layout="constrained")
        FigureCanvasAgg(figure)
        paths, error, speeds = figure.subplots(1, 3)
        paths.plot(*krc4_paper.POINTS[:, 1::-1].T, color=GREY, lw=1.0)
        every = np.linspace(15.0, 200.0, 200)
        p1, p2, p3 = krc4_paper.POINTS[:, None, :]
        with tempfile.TemporaryDirectory() as folder:
            for number, speed in enumerate(krc4_paper.SPEEDS_M_S):
                found = []
                for cdis_mm in krc4_paper.CDIS_MM:
                    motion, fine = krc4_paper.simulate(folder, speed, 4.0, cdis_mm)
                    found.append(krc4_paper.measure_corner(motion))
                    if not number:
                        rows = fine.corner
                        place = fine.position_mm[rows]
                        paths.plot(place[:, 1], place[:, 0], lw=6.0 - 0.025 * cdis_mm, label=f"{cdis_mm}")
                _, error_mm, a_p, _ = np.array(found).T
                rule = corner(p1, p2, p3, every, 1000.0 * speed)
                words = {"color": COLOURS[number], "label": f"{speed:g} m/s"}
                error.plot(krc4_paper.CDIS_MM, error_mm, "o", mfc="none", ms=4 + 3 * number, **words)
                speeds.plot(krc4_paper.CDIS_MM, a_p / 1000.0, "o", mfc="none", **words)
                speeds.plot(every, rule[2] / 1000.0, color=COLOURS[number], lw=0.9)
            error.plot(every, rule[1], color=GREY, lw=0.9, label="eq. 3, CDIS at most half a line")
        paths.set(title="Path by CDIS in mm", xlabel="Y (mm)", ylabel="X (mm)", aspect="equal")
        error.set(title="Corner error d", xlabel="CDIS (mm)", ylabel="mm")
        speeds.set(title="a_P: from positions at 12 ms (o), eq. 6 (-)", xlabel="CDIS (mm)", ylabel="m/s²")
        for axes in (paths, error, speeds):
            axes.legend(fontsize=7)
        figure.savefig(target, dpi=130)


def bigliardi_5(target: Path) -> None:
    """Draw speed, acceleration and jerk along the path in the fifteen cases of the second study."""
    columns = (("speed_mm_s", "Speed (m/s)"), ("acceleration_mm_s2", "Acceleration (m/s²)"))
    columns += (("jerk_mm_s3", "Jerk (m/s³)"),)
    with look():
        figure = Figure(figsize=(12.0, 8.0), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(3, 3, sharex="col", sharey="row")
        with tempfile.TemporaryDirectory() as folder:
            for across, speed in enumerate(krc4_paper.SPEEDS_M_S):
                for number, a_m_s2 in enumerate(krc4_paper.ACCELERATIONS_M_S2):
                    _, fine = krc4_paper.simulate(folder, speed, a_m_s2, 80)
                    for down, (column, words) in enumerate(columns):
                        axes = panels[down, across]
                        signal = getattr(fine, column) / 1000.0
                        axes.plot(
                            fine.time_s, signal, color=COLOURS[number], lw=1.0, label=f"{a_m_s2:g} m/s²"
                        )
                        if not across:
                            axes.set_ylabel(words)
                panels[0, across].set_title(f"{'abc'[across]}) {speed:g} m/s", loc="left")
                panels[2, across].set_xlabel("Time (s)")
        panels[0, 0].legend(fontsize=7)
        figure.savefig(target, dpi=130)


DRAWN = {each.__name__: each for each in (haehn_4, haehn_9, haehn_13, bigliardi_4, bigliardi_5)}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="those to draw; all by default")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "images")
    options = parser.parse_args()
    for name in options.names or DRAWN:
        DRAWN[name](options.output / f"{name}.png")
