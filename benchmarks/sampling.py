"""By how much forces at common times differ between coarse and fine sampling of the motion.

``python benchmarks/sampling.py [PROGRAM.nc ...]``: the demonstration cell, samples 12, 4 and 2 ms apart.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import cut
from gcode2krl.gcode import read_gcode
from gcode2krl.pipeline import plan_motion

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
COARSE_S, FINE_S = 0.012, (0.004, 0.002)


def forces_N(program: Path, dt_s: float) -> np.ndarray:
    """Return the force (m, 3) at samples so far apart."""
    cell = resolve_cell({"based_on": "demonstration"})
    toolpath = read_gcode(program, cell)
    forces: np.ndarray = cut(toolpath, plan_motion(toolpath, cell, dt_s), cell).force_base_N
    return forces


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each program and step."""
    named = sys.argv[1:] if arguments is None else arguments
    for program in map(Path, named or [EXAMPLES / "test_piece.nc", EXAMPLES / "cam_style.nc"]):
        coarse_N = forces_N(program, COARSE_S)
        for dt_s in FINE_S:
            fine_N = forces_N(program, dt_s)[:: round(COARSE_S / dt_s)]
            stamps = min(len(coarse_N), len(fine_N))
            apart_N = np.linalg.norm(fine_N[:stamps] - coarse_N[:stamps], axis=1)
            rms_N = float(np.sqrt(np.mean(apart_N**2)))
            steps = f"{COARSE_S * 1e3:.0f} and {dt_s * 1e3:.0f} ms"
            print(f"{program.name}: {steps}: {apart_N.max():.1f} N at most, {rms_N:.2f} N RMS")
    return 0


if __name__ == "__main__":
    sys.exit(main())
