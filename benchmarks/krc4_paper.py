"""Both studies of Bigliardi et al. 2022 on the simulated controller, beside the paper's formulas.

Two lines of 230 mm with 75° between them. First study: CDIS from 20 to 200 mm, three speeds, 4 m/s².
Second study: CDIS 80 mm, three speeds, five accelerations. Everything is measured on Motion: figures at
12 ms as the paper's trace has them, and at 1 ms.

    python benchmarks/krc4_paper.py
"""

import io
import itertools
import tempfile
from pathlib import Path

import numpy as np

from gcode2krl import load_cell, plan_motion
from gcode2krl.gcode import read_stream
from gcode2krl.krc4 import corner, effective_acceleration, jerk

LENGTH_MM, ALPHA = 230.0, np.deg2rad(75.0)
K_S, CYCLE_S, FINE_S = 0.168, 0.012, 0.001
SPEEDS_M_S = (0.2, 0.4, 0.6)
CDIS_MM = (20, 60, 100, 120, 140, 160, 180, 200)
ACCELERATIONS_M_S2 = (2.0, 2.5, 3.0, 3.5, 4.0)
SINE, COSINE = np.sin(ALPHA / 2), np.cos(ALPHA / 2)
POINTS = np.round(LENGTH_MM * np.array([[COSINE, SINE, 0], [0, 0, 0], [COSINE, -SINE, 0]]), 6)


def program(speed_m_s):
    """Return P1-P2-P3 as G-code, blended at P2."""
    words = [" ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZ", p, strict=True)) for p in POINTS]
    feed = f"F{speed_m_s * 60000:g}"
    head = "G21 G90 G54\nT1 M6\nS8000 M3\nG43 H1\nG64\n"
    return head + f"G0 {words[0]}\nG1 {words[1]} {feed}\nG1 {words[2]}\nM30\n"


def simulate(folder, speed_m_s, a_m_s2, cdis_mm):
    """Return Motion at 12 ms and at 1 ms."""
    path = Path(folder) / "cell.toml"
    keys = f"k_s = {K_S}\nacc_cp_m_s2 = {a_m_s2}\ncdis_mm = {float(cdis_mm)}\n"
    path.write_text(f'based_on = "demonstration"\n[controller]\n{keys}advance = "unlimited"\n')
    cell = load_cell(path)
    toolpath = read_stream(io.BytesIO(program(speed_m_s).encode()), "paper.nc", cell)
    return plan_motion(toolpath, cell, dt_s=CYCLE_S), plan_motion(toolpath, cell, dt_s=FINE_S)


def measure_corner(motion):
    """Return effective CDIS, corner error, a_P and the lowest speed, from the positions in the corner."""
    rows = np.flatnonzero(motion.corner)[1:-1]
    time = motion.time_s[rows] - motion.time_s[rows].mean()
    place = motion.position_mm[rows] - POINTS[1]
    fits = [np.polynomial.Polynomial.fit(time, place[:, k], 2) for k in range(3)]
    height = fits[0]  # X runs along the bisector
    apex = height.deriv().roots()[0].real
    acceleration = np.array([fit.deriv(2)(0.0) for fit in fits])
    direction = POINTS[1] - POINTS[0]
    direction = direction / np.linalg.norm(direction)
    first = rows[: len(rows) // 2]  # from C1 on the distance to the line grows with the square of time
    off = motion.position_mm[first] - POINTS[1]
    off = np.linalg.norm(off - np.outer(off @ direction, direction), axis=1)
    leaves_s = np.polyfit(np.sqrt(off), motion.time_s[first] - motion.time_s[rows].mean(), 1)[1]
    at = np.array([fit(leaves_s) for fit in fits])
    speed = np.linalg.norm([fit.deriv()(apex) for fit in fits])
    return np.linalg.norm(at), abs(height(apex)), np.linalg.norm(acceleration), speed


def lines_only(motion, column):
    """Return a column where the tool is on a line, two samples away from the corner."""
    near = np.convolve(motion.corner, np.ones(5), "same") > 0
    return getattr(motion, column)[~near]


def differenced(motion, order):
    """Return the largest derivative of path_mm on the lines, by differences as from a trace."""
    values = np.diff(motion.path_mm[:-1], order) / (motion.time_s[1] - motion.time_s[0]) ** order
    near = np.convolve(motion.corner, np.ones(2 * order + 5), "same") > 0
    return np.abs(values[~near[: len(values)]]).max()


def per_cent(value, wanted):
    return 100 * (value / wanted - 1)


def first_study(folder):
    print("First study: 4 m/s², CDIS and speed; formula / measured on the motion")
    print(
        "  v m/s  CDIS mm   effective CDIS mm    corner error mm      a_P m/s²          v reached    lowest v"
    )
    worst = np.zeros(3)
    for v, cdis in itertools.product(SPEEDS_M_S, CDIS_MM):
        d, error, a_p, _ = (
            float(column[0])
            for column in corner(*(p[None, :] for p in POINTS), float(cdis), np.array([1000 * v]))
        )
        _, fine = simulate(folder, v, 4.0, cdis)
        measured = measure_corner(fine)
        print(
            f"  {v:5.1f}  {cdis:7d}   {d:8.3f} {measured[0]:8.3f}   {error:8.4f} {measured[1]:8.4f}"
            f"   {a_p / 1000:8.4f} {measured[2] / 1000:8.4f}   {fine.speed_mm_s.max() / 1000:9.5f}"
            f"   {measured[3] / 1000:9.5f}"
        )
        worst = np.maximum(worst, np.abs(per_cent(np.array(measured[:3]), np.array([d, error, a_p]))))
    print(
        f"  largest difference: CDIS {worst[0]:.2g} %, error {worst[1]:.2g} %, a_P {worst[2]:.2g} %; "
        f"v·sin(alpha/2) = {', '.join(f'{v * SINE:.5f}' for v in SPEEDS_M_S)} m/s\n"
    )


def second_study(folder):
    print("Second study: CDIS 80 mm; the law v/max(v/a, k), a/k beside columns of Motion and differences")
    print("                 acceleration on the lines, m/s²        jerk on the lines, m/s³")
    print(
        "  v m/s  a m/s²    law    12 ms   1 ms   diff 12     law    12 ms   1 ms   diff 12"
        "   a_P    formula  v reached  lowest v  v·sin"
    )
    worst = np.zeros(3)
    for v, a in itertools.product(SPEEDS_M_S, ACCELERATIONS_M_S2):
        trace, fine = simulate(folder, v, a, 80)
        law = (
            np.array([effective_acceleration(1000 * v, 1000 * a, K_S), jerk(1000 * a, K_S)], dtype=float)
            / 1000
        )
        _, _, a_p, lowest = np.array(measure_corner(fine)) / 1000
        names = ("acceleration_mm_s2", "jerk_mm_s3")
        at_12, at_1 = ([lines_only(motion, name).max() / 1000 for name in names] for motion in (trace, fine))
        diff = [differenced(trace, order) / 1000 for order in (2, 3)]
        wanted = v**2 * COSINE / 0.080
        print(
            f"  {v:5.1f}  {a:5.1f}   {law[0]:6.4f} {at_12[0]:6.4f} {at_1[0]:6.4f}  {diff[0]:6.4f}"
            f"   {law[1]:7.3f} {at_12[1]:7.3f} {at_1[1]:7.3f} {diff[1]:7.3f}"
            f"   {a_p:6.4f} {wanted:6.4f}   {fine.speed_mm_s.max() / 1000:8.5f}"
            f"  {lowest:8.5f} {v * SINE:8.5f}"
        )
        differences = per_cent(np.array([*at_1, a_p]), np.array([*law, wanted]))
        worst = np.maximum(worst, np.abs(differences))
    print(
        f"  largest difference at 1 ms: acceleration {worst[0]:.2g} %, jerk {worst[1]:.2g} %,"
        f" a_P {worst[2]:.2g} %"
    )
    print("  the paper prints a_P 0.39, 1.58, 3.55 m/s²; eq. 6 gives 0.3967, 1.5867, 3.5701 m/s²")


def main():
    with tempfile.TemporaryDirectory() as folder:
        first_study(folder)
        second_study(folder)


if __name__ == "__main__":
    main()
