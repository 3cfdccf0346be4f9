"""CIRC and SPLINE beside LIN: bytes, motions and predicted time of the same programs, and their reading back.

``python benchmarks/curves_out.py`` makes random programs of arcs and of short moves along smooth curves,
writes each as LIN, with ``[controller] circ = true`` and with ``spline = true``, and prints the sums. The
time is that of the chords in all three, but for the stops at the ends of SPLINE blocks: the controller's own
law for CIRC and SPLINE is not known.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from gcode2krl import read_gcode, set_targets, verify_krl, write_krl
from gcode2krl.krc4 import build_chain, plan
from tests.cells import over_demonstration
from tests.krl.test_arcs import END, HEAD, random_arcs
from tests.krl.test_splines import random_curve

FORMS: dict[str, dict[str, Any]] = {"LIN": {}, "CIRC": {"circ": True}, "SPLINE": {"spline": True}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--programs", type=int, default=50)
    options = parser.parse_args()
    print(f"{options.programs} programs of arcs, {options.programs} of short moves along curves")
    print(f"  {'':<12}{'form':<8}{'kB':>8}{'motions':>9}{'predicted s':>13}{'read back off by':>18}")
    for kind in ("arcs", "curves"):
        for form in ("LIN", "CIRC" if kind == "arcs" else "SPLINE"):
            size_kB, motions, time_s, off_mm = written(kind, form, options.programs)
            print(f"  {kind:<12}{form:<8}{size_kB:8.1f}{motions:9}{time_s:13.1f}{off_mm:15.4f} mm")


def written(kind: str, form: str, count: int) -> tuple[float, int, float, float]:
    """Return kB and motions of all programs, their predicted time, and the largest deviation read back."""
    cell = over_demonstration({"controller": FORMS[form], "clearance": {"z_mm": 250.0}})
    sums, worst = np.zeros(3), 0.0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(count):
            rng = np.random.default_rng(seed)
            part = Path(folder) / "part.nc"
            part.write_text(HEAD + (random_arcs(rng)[0] if kind == "arcs" else random_curve(rng)) + END)
            toolpath = read_gcode(part, cell)
            targets = set_targets(toolpath, cell)
            program = write_krl(targets, Path(folder) / "CURVES.src", cell, toolpath=toolpath)
            report = verify_krl(program.files[0], toolpath, cell)
            if not report.ok:
                sys.exit(f"{kind} {seed} as {form}: {report.issues[0].message}")
            text = program.texts["CURVES.src"]
            lines = text.count(b"\nLIN ") + text.count(b"\nCIRC ") + text.count(b"\nSPL ")
            sums += (len(text) / 1e3, lines, plan(build_chain(targets, cell), cell).total_s)
            worst = max(worst, report.max_deviation_mm)
    return float(sums[0]), int(sums[1]), float(sums[2]), worst


if __name__ == "__main__":
    main()
