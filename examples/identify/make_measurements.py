"""Make the example measurements: cubes before lasers under load, and a force sensor in 27 orientations.

Simulated from the physics of Hähn & Weigold 2020 alone, with known stiffness, weight and noise, without any
part of gcode2krl, so that what is identified can be compared with what was put in.

    python examples/identify/make_measurements.py [--out DIR]       # always the same bytes
"""

import argparse
from pathlib import Path

import numpy as np

# --- the robot: 14 frames of eq. 1 (KR 300 R2500 ultra), 10 of them elastic -----------------------------

BODIES = ("root", "A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle")
SIGN = {"A1": -1, "A2": 1, "A3": 1, "A4": -1, "A5": 1, "A6": -1}
FRAMES = {  # alpha in degrees, a and d in mm, theta in degrees at zero
    "A1": (0, 0, 675, 0),
    "A2": (-90, 350, 0, 0),
    "linked_arm": (0, 575, 0, 0),
    "A3": (0, 575, 0, -90),
    "arm": (-90, -41, 500, 0),
    "A4": (0, 0, 500, 0),
    "A5": (90, 0, 0, 0),
    "A6": (-90, 0, 240, 180),
    "sensor": (0, 0, 28, 0),
    "spindle": (0, 0, 28, 0),
}
TABLE_1 = {  # k_C, k_B, k_A in N·mm/rad
    "A1": (1.2e10, 1.2e10, 7.5e9),
    "A2": (6.1e9, 6.1e9, 5.4e9),
    "linked_arm": (1.2e10, 3.8e9, 1.0e10),
    "A3": (6.2e9, 6.2e9, 4.3e9),
    "arm": (6.1e9, 1.3e10, 3.0e9),
    "A4": (3.0e9, 3.0e9, 9.0e8),
    "A5": (2.5e9, 2.5e9, 8.0e8),
    "A6": (6.7e8, 6.7e8, 4.9e8),
    "sensor": (3.3e9, 3.3e9, 5.2e9),
    "spindle": (1.9e8, 6.7e7, 9.1e7),
}


def rx(angle: float) -> np.ndarray:
    """Rotation about x, in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def ry(angle: float) -> np.ndarray:
    """Rotation about y, in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rz(angle: float) -> np.ndarray:
    """Rotation about z, in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def rigid(rotation: np.ndarray, place=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Homogeneous transform (4, 4)."""
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = rotation, place
    return t


def pose_of(x=0.0, y=0.0, z=0.0, a=0.0, b=0.0, c=0.0) -> np.ndarray:
    """A KUKA frame: mm and degrees, Rz(A)·Ry(B)·Rx(C)."""
    a, b, c = np.radians([a, b, c])
    return rigid(rz(a) @ ry(b) @ rx(c), (x, y, z))


def steps(q_deg) -> list[np.ndarray]:
    """From each frame to the next, eq. 1."""
    q = dict(zip(SIGN, q_deg, strict=True))
    result = []
    for name, (alpha, a, d, theta) in FRAMES.items():
        turn = theta + SIGN[name] * q[name] if name in SIGN else theta
        tilt = rigid(rx(np.radians(alpha)))
        result.append(tilt @ rigid(np.eye(3), (a, 0, d)) @ rigid(rz(np.radians(turn))))
    return result


def bodies(q_deg, stiffness=None, point_flange_mm=None, force_N=None, moment_Nmm=None) -> list[np.ndarray]:
    """Pose of the root and of the body behind each virtual joint; with a load eq. 3-8, else undeformed."""
    rigid_poses = [np.eye(4)]
    for step in steps(q_deg):
        rigid_poses.append(rigid_poses[-1] @ step)
    if stiffness is None:
        return rigid_poses
    point_mm = (rigid_poses[BODIES.index("A6")] @ np.append(point_flange_mm, 1.0))[:3]
    poses = [np.eye(4)]
    for number, (name, step) in enumerate(zip(BODIES[1:], steps(q_deg), strict=True), start=1):
        frame = rigid_poses[number]
        torque = np.cross(point_mm - frame[:3, 3], force_N) + moment_Nmm  # eq. 6 along the root's axes
        alpha, beta, gamma = frame[:3, :3].T @ torque / np.array(stiffness[name])  # eq. 5 and 7
        poses.append(poses[-1] @ step @ rigid(rz(gamma) @ ry(beta) @ rx(alpha)))  # eq. 3 and 4
    return poses


# --- cubes and lasers -----------------------------------------------------------------------------------

TRACKED_DEG = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
LOAD_POINT_MM = (0.0, 0.0, 106.0)
"""Centre of the cube on the sensor, where the cable pulls."""
CUBES = {  # body; x, y, z in mm and A, B, C in degrees in the root at TRACKED_DEG
    "pedestal": ("root", (250, -450, 300, 0, 0, 0)),
    "carousel": ("A1", (150, -420, 720, 15, 0, 0)),
    "link_low": ("A2", (350, -260, 850, 0, 4, 0)),
    "link_high": ("linked_arm", (355, -260, 1640, 0, -3, 2)),
    "arm_rear": ("A3", (460, -270, 1900, 5, 0, 0)),
    "arm_front": ("arm", (1120, -170, 1800, 0, 0, -10)),
    "wrist": ("A4", (1330, -190, 1784, 0, 0, 0)),
    "hand": ("A5", (1440, -150, 1784, 0, 8, 0)),
    "flange": ("sensor", (1696, 0, 1784, 0, 0, 0)),
}
PAIRS = {
    "A1": ("pedestal", "carousel"),
    "A2": ("carousel", "link_low"),
    "link": ("link_low", "link_high"),
    "A3": ("link_high", "arm_rear"),
    "arm": ("arm_rear", "arm_front"),
    "A4": ("arm_front", "wrist"),
    "A5": ("wrist", "hand"),
    "A6": ("hand", "flange"),
}
POSES_DEG = (
    (0, -90, 90, 0, 0, 0),
    (30, -70, 100, 40, 60, -30),
    (-40, -110, 70, -60, -50, 90),
    (15, -60, 110, 90, 80, 45),
)
LOADS = (  # force in N and moment in N·mm along the root's axes
    ((2000, 0, 0), (0, 0, 0)),
    ((0, 2000, 0), (0, 0, 0)),
    ((0, 0, -2000), (0, 0, 0)),
    ((0, 0, 0), (400e3, 0, 0)),
    ((0, 0, 0), (0, 400e3, 0)),
    ((0, 0, 0), (0, 0, 400e3)),
)
LASER_NOISE_MM = 0.005
"""1-sigma of one sample."""
SAMPLES = 16
"""Samples that are averaged to a distance."""
MEAN_NOISE_MM = LASER_NOISE_MM / SAMPLES**0.5
STANDOFF_MM = 60.0
BEAMS = (  # where a beam hits the unloaded cube, and its direction, along the cube's axes
    ((-40, -40, 50), (0, 0, -1)),
    ((40, -40, 50), (0, 0, -1)),
    ((0, 40, 50), (0, 0, -1)),
    ((-40, 50, 0), (0, -1, 0)),
    ((40, 50, 0), (0, -1, 0)),
    ((50, 0, 0), (-1, 0, 0)),
)


def laser_distances(unloaded: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """Distances (6,) from lasers that stand in the room to the faces of a cube that has moved."""
    result = []
    for hit, beam in BEAMS:
        hit, beam = np.array(hit, float), np.array(beam, float)
        laser = (unloaded @ np.append(hit - STANDOFF_MM * beam, 1.0))[:3]
        along = unloaded[:3, :3] @ beam
        sides = np.eye(3)[np.abs(beam) < 0.5] * 10.0  # three points of the face span its plane
        corner, first, second = (
            (loaded @ np.append(hit + shift, 1.0))[:3] for shift in (np.zeros(3), sides[0], sides[1])
        )
        normal = np.cross(first - corner, second - corner)
        result.append(normal @ (corner - laser) / (normal @ along))
    return np.array(result)


def cube_rows(
    pairs,
    cubes,
    poses_deg,
    loads,
    *,
    stiffness=TABLE_1,
    noise_mm=MEAN_NOISE_MM,
    rng=None,
    point_mm=LOAD_POINT_MM,
    along="root",
    tracked_deg=TRACKED_DEG,
) -> list[list]:
    """Readings: pair, q, force, moment, then lower unloaded, lower loaded, upper unloaded, upper loaded."""
    tracked = bodies(tracked_deg)
    on_body = {
        name: (BODIES.index(body), np.linalg.inv(tracked[BODIES.index(body)]) @ pose_of(*pose))
        for name, (body, pose) in cubes.items()
    }
    rows = []
    for q_deg in poses_deg:
        still = bodies(q_deg)
        turn = still[BODIES.index("A6")][:3, :3] if along == "flange" else np.eye(3)
        for force, moment in loads:
            bent = bodies(q_deg, stiffness, point_mm, turn @ force, turn @ moment)
            for pair, names in pairs.items():
                readings = []
                for name in names:
                    body, place = on_body[name]
                    for state in (still, bent):
                        readings.append(laser_distances(still[body] @ place, state[body] @ place))
                rows.append([pair, *q_deg, *force, *moment, *np.concatenate(readings)])
    if rng is not None:
        for row in rows:
            row[13:] = np.array(row[13:]) + rng.normal(0.0, noise_mm, 24)
    return rows


CUBE_HEADER = [
    "pair",
    *(f"q{axis}_deg" for axis in range(1, 7)),
    "fx_N",
    "fy_N",
    "fz_N",
    "mx_Nmm",
    "my_Nmm",
    "mz_Nmm",
    *(
        f"{cube}_{state}_{laser}_mm"
        for cube in ("lower", "upper")
        for state in ("unloaded", "loaded")
        for laser in range(1, 7)
    ),
]


def cube_csv(rows: list[list]) -> str:
    """Readings as CSV, distances to 0.1 µm."""
    lines = [",".join(CUBE_HEADER)]
    for row in rows:
        lines.append(",".join([row[0], *(f"{x:g}" for x in row[1:13]), *(f"{x:.4f}" for x in row[13:])]))
    return "\n".join(lines) + "\n"


def cube_head(
    pairs,
    cubes,
    *,
    tracked_deg=TRACKED_DEG,
    point_mm=LOAD_POINT_MM,
    along="root",
    noise_mm=MEAN_NOISE_MM,
    known=None,
    note="",
    extra="",
) -> str:
    """The head of a measurement."""
    point, angles = (", ".join(f"{x:g}" for x in values) for values in (point_mm, tracked_deg))
    lines = [f'note = "{note}"', *([extra] if extra else [])]
    lines += ["", "[lasers]", f"noise_mm = {noise_mm:g}"]
    lines += ["", "[load]", f"point_flange_mm = [{point}]", f'along = "{along}"']
    lines += ["", "[tracker]", f"q_deg = [{angles}]"]
    for name, (body, pose) in cubes.items():
        keys = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
        lines += ["", f"[cube.{name}]", f'body = "{body}"']
        lines += [f"{key} = {value:g}" for key, value in zip(keys, pose, strict=True) if value]
    for name, (lower, upper) in pairs.items():
        lines += ["", f"[pair.{name}]", f'lower = "{lower}"', f'upper = "{upper}"']
    for name, values in (known or {}).items():
        lines += ["", f"[known.{name}]"]
        lines += [f"{key} = {value:g}" for key, value in zip(("k_c", "k_b", "k_a"), values, strict=True)]
    return "\n".join(lines) + "\n"


# The holder on a bench: its lower face clamped, cubes on the clamp and at the spindle nose.
BENCH_CUBES = {
    "clamp": ("sensor", (-150, 0, 28, 0, 0, 0)),
    "nose": ("spindle", (150, 0, 250, 0, 0, 0)),
}
BENCH_PAIRS = {"holder": ("clamp", "nose")}
BENCH_POINT_MM = (250.0, 0.0, 250.0)


def bench_cubes() -> dict:
    """The poses above are in the flange frame; at zero angles the flange stands somewhere in the root."""
    flange = bodies((0,) * 6)[BODIES.index("A6")]
    cubes = {}
    for name, (body, pose) in BENCH_CUBES.items():
        place = flange @ pose_of(*pose)
        b = -np.arcsin(place[2, 0])
        a, c = np.arctan2(place[1, 0], place[0, 0]), np.arctan2(place[2, 1], place[2, 2])
        if abs(np.cos(b)) < 1e-9:
            a, c = np.arctan2(-place[0, 1], place[1, 1]), 0.0
        cubes[name] = (body, (*np.round(place[:3, 3], 6), *np.round(np.degrees([a, b, c]), 6)))
    return cubes


BENCH_LOADS = tuple(
    (tuple(float(s * 500 * (i == axis)) for i in range(3)), (0.0, 0.0, 0.0))
    for axis in range(3)
    for s in (1, -1)
)


# --- the force sensor -----------------------------------------------------------------------------------

WEIGHT_N = 412.0
CENTRE_MM = np.array([62.0, -4.5, 118.0])
FORCE_OFFSET_N = np.array([12.4, -31.8, 7.9])
MOMENT_OFFSET_NMM = np.array([-2150.0, 840.0, 3320.0])
FORCE_NOISE_N = 0.5
MOMENT_NOISE_NMM = 60.0
HOSE_POINT_MM = np.array([-120.0, 0.0, 180.0])
"""Where the hose pack is fixed to the end effector, from the sensor along its axes."""
HOSE_HANGS_MM = np.array([-500.0, 150.0, 600.0])
"""Where it hangs, from the sensor along the axes of the root."""
HOSE_SLACK_MM, HOSE_N_MM = 450.0, 0.03


def orientations() -> list[tuple[float, float, float]]:
    """27 orientations of the sensor in the root, A, B, C in degrees."""
    return [(a, b, c) for a in (-60.0, 10.0, 75.0) for b in (35.0, 90.0, 140.0) for c in (-70.0, 0.0, 55.0)]


def hose(rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pull of a hose pack on the end effector, along the sensor's axes: a soft spring with a slack length."""
    way = rotation.T @ HOSE_HANGS_MM - HOSE_POINT_MM
    length = np.linalg.norm(way)
    pull = HOSE_N_MM * max(length - HOSE_SLACK_MM, 0.0) * way / length
    return pull, np.cross(HOSE_POINT_MM, pull)


def sensor_reading(rotation: np.ndarray, with_hose: bool) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment that the sensor shows: its offset and the load on its tool side."""
    weight = rotation.T @ np.array([0.0, 0.0, -WEIGHT_N])
    force, moment = FORCE_OFFSET_N + weight, MOMENT_OFFSET_NMM + np.cross(CENTRE_MM, weight)
    if with_hose:
        pull, turn = hose(rotation)
        force, moment = force + pull, moment + turn
    return force, moment


def pose_rows(abc_deg, rng, with_hose=True, force_noise_N=FORCE_NOISE_N, moment_noise_Nmm=MOMENT_NOISE_NMM):
    """Readings: A, B, C, force, moment."""
    rows = []
    for a, b, c in abc_deg:
        force, moment = sensor_reading(pose_of(0, 0, 0, a, b, c)[:3, :3], with_hose)
        force = force + rng.normal(0.0, force_noise_N, 3)
        moment = moment + rng.normal(0.0, moment_noise_Nmm, 3)
        rows.append([a, b, c, *force, *moment])
    return rows


def pose_csv(rows) -> str:
    """Readings of the sensor as CSV."""
    lines = ["a_deg,b_deg,c_deg,fx_N,fy_N,fz_N,mx_Nmm,my_Nmm,mz_Nmm"]
    for row in rows:
        angles, force, moment = row[:3], row[3:6], row[6:]
        values = [f"{x:g}" for x in angles] + [f"{x:.2f}" for x in force] + [f"{x:.0f}" for x in moment]
        lines.append(",".join(values))
    return "\n".join(lines) + "\n"


# --- the files ------------------------------------------------------------------------------------------


def files(seed: int = 2020) -> dict[str, str]:
    """All example files by name."""
    rng = np.random.default_rng(seed)
    made = "simulated: table 1 of Haehn & Weigold 2020, laser noise 5 um, 16 samples a distance"
    robot = cube_rows(PAIRS, CUBES, POSES_DEG, LOADS, rng=rng)
    bench = bench_cubes()
    holder = cube_rows(
        BENCH_PAIRS,
        bench,
        ((0,) * 6,) * 2,
        BENCH_LOADS,
        rng=rng,
        point_mm=BENCH_POINT_MM,
        along="flange",
        tracked_deg=(0,) * 6,
    )
    return {
        "robot.toml": cube_head(PAIRS, CUBES, known={"sensor": TABLE_1["sensor"]}, note=made),
        "robot.csv": cube_csv(robot),
        "holder.toml": cube_head(
            BENCH_PAIRS, bench, tracked_deg=(0,) * 6, point_mm=BENCH_POINT_MM, along="flange", note=made
        ),
        "holder.csv": cube_csv(holder),
        "orientations.csv": pose_csv(pose_rows(orientations(), rng)),
    }


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    folder = parser.parse_args().out
    for name, text in files().items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
        print(folder / name)


if __name__ == "__main__":
    main()
