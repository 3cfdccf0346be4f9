"""The simulated measurements of ``examples/identify``, without a detour through files."""

import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np

from gcode2krl.frames import quaternion_from_rotation
from gcode2krl.identify.measurements import Measurements, Setup
from gcode2krl.identify.sensor_poses import SensorPoses

FOLDER = Path(__file__).parents[2] / "examples" / "identify"
sys.path.insert(0, str(FOLDER))
make = import_module("make_measurements")
sys.path.remove(str(FOLDER))

SENSOR = {"sensor": make.TABLE_1["sensor"]}


def setup_of(pairs=None, cubes=None, *, noise_mm=0.0, known=SENSOR, **head):
    """The head as the example has it, by default without a stated noise."""
    text = make.cube_head(pairs or make.PAIRS, cubes or make.CUBES, noise_mm=noise_mm, known=known, **head)
    return Setup.model_validate(tomllib.loads(text))


def clean_rows(pairs=None, poses_deg=make.POSES_DEG, loads=make.LOADS, cubes=None, **more):
    """Rows without noise."""
    return make.cube_rows(pairs or make.PAIRS, cubes or make.CUBES, poses_deg, loads, **more)


def measurements(rows, setup=None, *, rng=None, noise_mm=make.MEAN_NOISE_MM):
    """Rows as the reader would return them, with noise where a generator is given."""
    values = np.array([row[1:] for row in rows], dtype=float)
    readings = values[:, 12:].reshape(-1, 4, 6)
    if rng is not None:
        readings = readings + rng.normal(0.0, noise_mm, readings.shape)
    return Measurements(
        setup=setup or setup_of(),
        row=np.arange(len(rows)) + 2,
        pair=np.array([row[0] for row in rows]),
        q_rad=np.radians(values[:, :6]),
        force_N=values[:, 6:9],
        moment_Nmm=values[:, 9:12],
        lower_mm=readings[:, 1] - readings[:, 0],
        upper_mm=readings[:, 3] - readings[:, 2],
        source="robot.csv",
    )


def sensor_poses(rows):
    """Rows of A, B, C, force and moment as the reader would return them."""
    values = np.array(rows, dtype=float)
    rotation = np.array([make.pose_of(0, 0, 0, *abc)[:3, :3] for abc in values[:, :3]])
    return SensorPoses(quaternion_from_rotation(rotation), values[:, 3:6], values[:, 6:9], "poses.csv")
