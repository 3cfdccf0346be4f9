"""Made-up arms that are measured in poses: Denavit-Hartenberg with 4x4 matrices, own masses, own air.

It shares no code with gcode2krl. An arm is that of Brandstoetter, Angerer and Hofbaur 2014, written as rows
of theta, d, a, alpha and Hayati's beta; its errors are errors of these.
"""

from dataclasses import dataclass, field

import numpy as np

GRAVITY_m_s2 = 9.81
DEG = np.pi / 180.0
SEVENTEEN = (
    "theta 2", "theta 3", "theta 4", "theta 5", "a 1", "a 2", "a 3", "d 4", "d 3",
    "alpha 1", "alpha 2", "alpha 3", "alpha 4", "alpha 5", "beta 2", "a 4", "d 5",
)  # fmt: skip
FIELDS = ("theta", "d", "a", "alpha", "beta")


@dataclass(frozen=True)
class MadeUp:
    """One arm and the day on which it was measured; angles in rad, lengths in mm."""

    name: str
    lengths_mm: tuple[float, ...]  # a1, a2, b, c1, c2, c3, c4
    signs: tuple[int, ...] = (1, 1, 1, 1, 1, 1)
    offsets_deg: tuple[float, ...] = (0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
    a3_by_a2: float = 0.0  # what the controller's A3 lacks to the angle between the links
    errors: dict = field(default_factory=dict)  # "theta 2" -> rad, "a 1" -> mm
    half_play_rad: tuple[float, ...] = (0.0,) * 6
    eccentric_rad: tuple[float, ...] = (0.0,) * 6
    masses_kg: tuple[float, ...] = (0.0, 0.0, 0.0)  # upper arm, forearm, hand
    stiffness_Nm_rad: tuple[float, ...] = (1e12,) * 6
    tool_mm: tuple[float, ...] = (80.0, -30.0, 120.0)
    place_mm: tuple[float, ...] = (2500.0, 300.0, -400.0)  # of the foot in the instrument's frame
    turn_deg: tuple[float, ...] = (25.0, 1.5, -2.0)  # Rz Ry Rx
    drift_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    drift_time: float = 0.4  # of the whole, in which the drift is nearly over
    air_K_m: float = 0.0
    noise_mm: float = 0.02
    outliers: float = 0.0


def table_of(arm: MadeUp) -> np.ndarray:
    """(6, 5) theta, d, a, alpha, beta with errors."""
    a1, a2, b, c1, c2, c3, c4 = arm.lengths_mm
    quarter = np.pi / 2.0
    rows = np.array(
        [
            [0.0, c1, a1, -quarter, 0.0],
            [-quarter, 0.0, c2, 0.0, 0.0],
            [quarter, b, a2, quarter, 0.0],
            [0.0, c3, 0.0, -quarter, 0.0],
            [0.0, 0.0, 0.0, quarter, 0.0],
            [0.0, c4, 0.0, 0.0, 0.0],
        ]
    )
    for name, error in arm.errors.items():
        kind, row = name.split()
        rows[int(row) - 1, FIELDS.index(kind)] += error
    return rows


def elementary(kind: str, axis: int, value: np.ndarray) -> np.ndarray:
    """(n, 4, 4) of a turn or a shift."""
    made = np.tile(np.eye(4), (len(value), 1, 1))
    if kind == "shift":
        made[:, axis, 3] = value
        return made
    i, j = (axis + 1) % 3, (axis + 2) % 3
    made[:, i, i] = made[:, j, j] = np.cos(value)
    made[:, j, i], made[:, i, j] = np.sin(value), -np.sin(value)
    return made


def frames(rows: np.ndarray, theta: np.ndarray) -> list[np.ndarray]:
    """Frames 0 to 6 (n, 4, 4) of joints theta (n, 6)."""
    one = np.ones(len(theta))
    found = [np.tile(np.eye(4), (len(theta), 1, 1))]
    for joint, (zero, d, a, alpha, beta) in enumerate(rows):
        step = elementary("turn", 2, theta[:, joint] + zero) @ elementary("shift", 2, d * one)
        step = step @ elementary("shift", 0, a * one) @ elementary("turn", 0, alpha * one)
        found.append(found[-1] @ step @ elementary("turn", 1, beta * one))
    return found


def paper_angles(arm: MadeUp, q_rad: np.ndarray) -> np.ndarray:
    """Angles of the paper from those of the controller."""
    own = q_rad.copy()
    own[:, 2] += arm.a3_by_a2 * own[:, 1]
    return own * np.array(arm.signs) - np.array(arm.offsets_deg) * DEG


def controller_angles(arm: MadeUp, paper_rad: np.ndarray) -> np.ndarray:
    """Angles of the controller from those of the paper."""
    own = (paper_rad + np.array(arm.offsets_deg) * DEG) * np.array(arm.signs)
    own[:, 2] -= arm.a3_by_a2 * own[:, 1]
    return own


def sag(arm: MadeUp, placed: list[np.ndarray], tip: np.ndarray) -> np.ndarray:
    """Turn of each joint (n, 6) under the weight of what is behind it, about its own axis."""
    places = [frame[:, :3, 3] for frame in placed]
    masses = (
        ((places[1] + places[2]) / 2.0, arm.masses_kg[0], 1),
        ((places[3] + places[4]) / 2.0, arm.masses_kg[1], 2),
        (tip, arm.masses_kg[2], 5),
    )
    turned = np.zeros((len(tip), 6))
    for joint in range(6):
        axis, origin = placed[joint][:, :3, 2], places[joint]
        for centre, mass, last in masses:
            if joint <= last:
                lever_m = (centre - origin) / 1000.0
                torque = np.cross(lever_m, np.array([0.0, 0.0, -mass * GRAVITY_m_s2]))
                turned[:, joint] += np.sum(torque * axis, axis=1) / arm.stiffness_Nm_rad[joint]
    return turned


def tips(arm: MadeUp, q_rad: np.ndarray, approach: np.ndarray) -> np.ndarray:
    """Tips (n, 3) in the foot's frame, with all errors of the arm; joints and sides of the controller."""
    moved = q_rad + approach * np.array(arm.half_play_rad)
    moved = moved + np.array(arm.eccentric_rad) * np.sin(q_rad + 0.7)
    theta, rows = paper_angles(arm, moved), table_of(arm)
    tool = np.array([*arm.tool_mm, 1.0])
    first = frames(rows, theta)
    theta = theta + sag(arm, first, (first[6] @ tool)[:, :3])
    return (frames(rows, theta)[6] @ tool)[:, :3]


def foot(arm: MadeUp) -> tuple[np.ndarray, np.ndarray]:
    """Place and rotation of the foot in the instrument's frame."""
    turn = np.eye(4)
    for axis, degrees in zip((2, 1, 0), arm.turn_deg, strict=True):
        turn = turn @ elementary("turn", axis, np.array([degrees * DEG]))[0]
    return np.array(arm.place_mm), turn[:3, :3]


@dataclass(frozen=True)
class Measured:
    """A table of poses, with the truth that nobody sees."""

    q_deg: np.ndarray
    approach: np.ndarray
    seen_mm: np.ndarray
    is_wrong: np.ndarray

    def columns(self) -> dict:
        """Names and values, as a person has them."""
        names = {f"q{j + 1}_deg": self.q_deg[:, j] for j in range(6)}
        names |= {f"{a}_mm": self.seen_mm[:, i] for i, a in enumerate("xyz")}
        return names | {f"approach_{j + 1}": self.approach[:, j] for j in range(6)}


def measured(arm: MadeUp, count: int, seed: int, again: int = 0) -> Measured:
    """Poses drawn over the work space, the last ``again`` of them visits of earlier ones."""
    rng = np.random.default_rng(seed)
    low = np.array([-120.0, -40.0, 40.0, -150.0, -100.0, -170.0]) * DEG
    high = np.array([120.0, 60.0, 130.0, 150.0, 100.0, 170.0]) * DEG
    paper = rng.uniform(low, high, (count, 6))
    q = controller_angles(arm, paper)
    q = np.round(q / DEG, 4) * DEG
    approach = rng.choice([-1.0, 1.0], (count, 6))
    if again:
        back = rng.choice(count - again, again, replace=again > count - again)
        q[-again:], approach[-again:] = q[back], approach[back]
    place, rotation = foot(arm)
    seen = tips(arm, q, approach) @ rotation.T + place
    course = np.arange(count) / count
    seen += (1.0 - np.exp(-course / arm.drift_time))[:, None] * np.array(arm.drift_mm)
    ground_m = np.linalg.norm(seen, axis=1) / 1000.0
    seen += (0.5e3 * 0.93e-6 * arm.air_K_m * ground_m**2)[:, None] * rotation[:, 2]
    seen += rng.normal(0.0, arm.noise_mm, seen.shape)
    is_wrong = rng.random(count) < arm.outliers
    far = rng.uniform(0.5, 20.0, count)[:, None] * _directions(rng, count)
    return Measured(q / DEG, approach, seen + far * is_wrong[:, None], is_wrong)


def _directions(rng: np.random.Generator, count: int) -> np.ndarray:
    drawn = rng.normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


KR300 = MadeUp(
    "KR 300 R2500 ultra", (350, 41, 0, 675, 1150, 1000, 240), (-1, 1, 1, -1, 1, -1), (0, -90, 0, 0, 0, 0)
)
MAKERS = (
    KR300,
    MadeUp("KR 6 R900-2", (25, -25, 0, 400, 455, 420, 90), (-1, 1, 1, -1, 1, -1), (0, -90, 0, 0, 0, 0)),
    MadeUp("ABB IRB 120-3/0.6", (0, -70, 0, 290, 270, 302, 72)),
    MadeUp("ABB IRB 2400-10", (100, -135, 0, 615, 705, 755, 85), a3_by_a2=-1.0),
    MadeUp(
        "FANUC M-10iA",
        (150, -200, 0, 450, 600, 640, 100),
        (1, 1, -1, -1, -1, -1),
        (0, 0, -90, 0, 0, 180),
        1.0,
    ),
    MadeUp("Staeubli TX40", (0, 0, 35, 320, 225, 225, 65), offsets_deg=(0,) * 6),
)


def clean(arm: MadeUp, seed: int, reach_mm: float = 2500.0) -> MadeUp:
    """The arm with 17 small errors and nothing else, as a machined and mastered arm of its reach has them."""
    rng = np.random.default_rng(seed)
    size = {"theta": 0.02 * DEG, "alpha": 0.2e-3, "beta": 0.2e-3, "a": 0.2, "d": 0.2}
    share = sum(arm.lengths_mm[3:]) / reach_mm
    errors = {name: size[name.split()[0]] * rng.normal() for name in SEVENTEEN}
    return _but(
        arm,
        errors={n: e * (share if n[0] in "ad" and n.split()[0] in "ad" else 1.0) for n, e in errors.items()},
    )


def truth(arm: MadeUp) -> dict[str, float]:
    """Errors of a clean arm by the names, units and signs of ``identify kinematics``: deg, mm, mrad.

    Its forearm is tilted about a line through the wrist, here about one through the elbow: that moves b.
    """
    e = dict.fromkeys(SEVENTEEN, 0.0) | arm.errors
    return {
        "A2 zero": e["theta 2"] / DEG,
        "A3 zero": e["theta 3"] / DEG,
        "A4 zero": -e["theta 4"] / DEG,
        "A5 zero": e["theta 5"] / DEG,
        "a1": e["a 1"],
        "c2": e["a 2"],
        "a2": e["a 3"],
        "c3": e["d 4"],
        "b": e["d 3"] - arm.lengths_mm[5] * e["alpha 3"],
        "A2 tilt": 1e3 * e["alpha 1"],
        "A3 twist": 1e3 * e["alpha 2"],
        "A3 tilt": -1e3 * e["beta 2"],
        "A4 tilt": -1e3 * e["alpha 3"],
        "A5 tilt": -1e3 * e["alpha 4"],
        "A6 tilt": -1e3 * e["alpha 5"],
        "A5 beside A4": -e["a 4"],
        "A5 across": e["d 5"],
    }


def hard(arm: MadeUp, seed: int) -> MadeUp:
    """The arm with 17 errors, weight, play, eccentric encoders, drift, air and 2 % of outliers."""
    rng = np.random.default_rng(seed)
    reach = sum(arm.lengths_mm[3:]) / 1000.0
    made = clean(arm, seed + 1000)
    masses = np.array([60.0, 40.0, 15.0]) * reach**2 * rng.uniform(0.5, 1.5, 3)
    full_Nm = 9.81 * (masses @ [0.2, 0.6, 1.0]) * reach
    stiffness = full_Nm / (0.3e-3 * rng.uniform(0.5, 1.5, 6))
    return _but(
        made,
        masses_kg=tuple(masses),
        stiffness_Nm_rad=tuple(stiffness),
        half_play_rad=tuple(0.004 * DEG * rng.uniform(0.0, 1.5, 6)),
        eccentric_rad=tuple(0.004 * DEG * rng.uniform(0.0, 1.0, 6)),
        drift_mm=tuple(0.05 * rng.normal(size=3)),
        air_K_m=float(rng.uniform(0.0, 1.5)),
        noise_mm=0.025,
        outliers=0.02,
        tool_mm=tuple(rng.uniform(-150.0, 150.0, 3)),
    )


def _but(arm: MadeUp, **changes) -> MadeUp:
    return MadeUp(**{**arm.__dict__, **changes})


def write_example(file) -> None:
    """The table of examples/identify/poses.csv: a KR 300 with 17 errors, weight, play and some wrong rows."""
    arm = _but(hard(KR300, 4), outliers=0.01, drift_mm=(0.0, 0.0, 0.0))
    table = measured(arm, 300, 5, again=12)
    q = ",".join(f"q{j}_deg" for j in range(1, 7))
    sides = ",".join(f"approach_{j}" for j in range(1, 7))
    lines = [f"{q},x_mm,y_mm,z_mm,{sides}"]
    for joints, seen, side in zip(table.q_deg, table.seen_mm, table.approach, strict=True):
        words = [f"{v:.4f}" for v in joints] + [f"{v:.4f}" for v in seen] + [f"{v:.0f}" for v in side]
        lines.append(",".join(words))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    import sys
    from pathlib import Path

    write_example(Path(sys.argv[1]))
