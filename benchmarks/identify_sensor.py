"""Does `gcode2krl identify sensor` recover weight, centre and offsets, and are its intervals right?

Simulated by the script of ``examples/identify``, which shares no code with the package: 27 orientations with
noise of 0.5 N and 60 N·mm, without a hose pack for the coverage, with one for what the ten terms leave over.

    python benchmarks/identify_sensor.py [--draws 200] [--seed 2020]
"""

import argparse
import math
import sys
from importlib import import_module
from pathlib import Path

import numpy as np

from gcode2krl.compliance.sensor import Calibration, compensate
from gcode2krl.frames import quaternion_from_rotation
from gcode2krl.identify.sensor import identify_sensor
from gcode2krl.identify.sensor_poses import SensorPoses

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "identify"))
make = import_module("make_measurements")

TRUTH = np.array([make.WEIGHT_N, *make.CENTRE_MM, *make.FORCE_OFFSET_N, *make.MOMENT_OFFSET_NMM])
NAMES = ("weight N", *(f"{name} {axis}" for name in ("centre mm", "force N", "moment Nmm") for axis in "xyz"))
LEVELS = (0.90, 0.95)
SETS = {
    "27 orientations": make.orientations(),
    "6 orientations": [(0, 0, 180), (0, 0, 45), (0, 0, 90), (0, 90, 0), (0, 45, 0), (0, 0, 0)],
    "3 orientations": [(0, 0, 180), (0, -30, 45), (0, 20, -90)],
}


def poses_of(abc_deg, rng, **more) -> SensorPoses:
    values = np.array(make.pose_rows(abc_deg, rng, **more))
    rotation = np.array([make.pose_of(0, 0, 0, *abc)[:3, :3] for abc in values[:, :3]])
    return SensorPoses(quaternion_from_rotation(rotation), values[:, 3:6], values[:, 6:9])


def coverage(name: str, draws: int, rng: np.random.Generator) -> None:
    hits = {level: [] for level in LEVELS}
    values, half = [], []
    for _ in range(draws):
        poses = poses_of(SETS[name], rng, with_hose=False)
        for level in LEVELS:
            found = identify_sensor(poses, level=level)
            estimates = (found.weight_N, *found.centre_mm, *found.force_offset_N, *found.moment_offset_Nmm)
            hits[level].append([e.contains(true) for e, true in zip(estimates, TRUTH, strict=True)])
            if level == LEVELS[0]:
                values.append([e.value for e in estimates])
                half.append([e.high - e.value for e in estimates])
    print(f"{name}, {draws} draws")
    for level in LEVELS:
        by_draw = np.mean(hits[level], axis=1)
        spread = 2 * by_draw.std() / math.sqrt(draws)
        print(
            f"  {level:.0%} intervals cover {by_draw.mean():6.2%} +- {spread:.2%} of {10 * draws} true values"
        )
    for at, what in enumerate(NAMES):
        error = np.array(values)[:, at] - TRUTH[at]
        print(
            f"    {what:<12} {TRUTH[at]:9.2f}   mean error {error.mean():+8.3f}, rms {error.std():8.3f}, "
            f"90 % half-width {np.median(half, axis=0)[at]:8.3f}"
        )


def hose(rng: np.random.Generator) -> None:
    """Residuals at other orientations, with and without the ten terms."""
    found = identify_sensor(poses_of(make.orientations(), rng))
    between = [(a, b, c) for a in (-45, -15, 30, 60) for b in (50, 75, 115) for c in (-50, -20, 15, 45)]
    new = poses_of(between, rng, force_noise_N=0.0, moment_noise_Nmm=0.0)
    none = Calibration.model_fields["force_terms_N"].default
    plain = found.calibration.model_copy(update={"force_terms_N": none, "moment_terms_Nmm": none})
    print(f"with a hose pack: left over at {len(between)} other orientations between the 27, rms")
    for words, calibration in (("weight and offset alone", plain), ("with ten terms", found.calibration)):
        force, moment = compensate(new.force_N, new.moment_Nmm, new.rotation, calibration)
        print(f"    {words:<24} {np.sqrt(np.mean(force**2)):6.2f} N  {np.sqrt(np.mean(moment**2)):7.0f} Nmm")
    print(
        f"    said by the fit          {found.force_left_out_N:6.2f} N  {found.moment_left_out_Nmm:7.0f} Nmm"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=2020)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    for name in SETS:
        coverage(name, arguments.draws, rng)
    hose(rng)


if __name__ == "__main__":
    main()
