"""The plant's world as plain numbers: robot, frames, stiffness, controller, tool, material, stock.

The figures are those of the demonstration cell (sources in README.md); nothing is read from the package.
"""

from dataclasses import dataclass, field, replace

import numpy as np

DEGREE = np.pi / 180.0
GRAVITY_m_s2 = 9.80665
JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")
LENGTHS = ("a1", "a2", "c1", "c2", "c3", "c4")
VIRTUAL = ("A1", "A2", "linked_arm", "A3", "arm", "A4", "A5", "A6", "sensor", "spindle")
JOINT_ROW = (0, 1, 3, 5, 6, 7)  # rows of VIRTUAL that belong to A1 ... A6
COEFFICIENTS = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
GEAR_RATIO = np.array([256.857142857, 267.428571429, 252.333333333, 221.0, 239.619047619, 154.323134328])


def euler(a_deg: float, b_deg: float, c_deg: float) -> np.ndarray:
    """Rotation Rz(A)·Ry(B)·Rx(C), the controller's A, B, C."""
    a, b, c = np.radians([a_deg, b_deg, c_deg])
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


@dataclass(frozen=True)
class Frame:
    """A place: origin in mm and axes as columns."""

    origin_mm: np.ndarray
    axes: np.ndarray

    @classmethod
    def of(cls, x=0.0, y=0.0, z=0.0, a=0.0, b=0.0, c=0.0) -> "Frame":
        """From the controller's six numbers, mm and degrees."""
        return cls(np.array([x, y, z], float), euler(a, b, c))


def _stiffness() -> np.ndarray:
    """Stiffness about x, y, z of each virtual joint, N·mm/rad (table 1 of Hähn & Weigold 2020)."""
    return np.array(
        [
            [1.2e10, 1.2e10, 7.5e9],
            [6.1e9, 6.1e9, 5.4e9],
            [1.2e10, 3.8e9, 1.0e10],
            [6.2e9, 6.2e9, 4.3e9],
            [6.1e9, 1.3e10, 3.0e9],
            [3.0e9, 3.0e9, 9.0e8],
            [2.5e9, 2.5e9, 8.0e8],
            [6.7e8, 6.7e8, 4.9e8],
            [3.3e9, 3.3e9, 5.2e9],
            [1.9e8, 6.7e7, 9.1e7],
        ]
    )


@dataclass(frozen=True)
class Cutter:
    """A flat end mill and what one revolution of it costs, N/mm² and N/mm."""

    diameter_mm: float = 16.0
    teeth: int = 3
    flute_mm: float = 40.0
    spindle_rad_s: float = 13000.0 * 2.0 * np.pi / 60.0
    coefficients: np.ndarray = field(default_factory=lambda: np.array([796.1, 168.8, 222.0, 27.7, 30.8, 1.4]))
    runout_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    chip_exponent: float = 0.0  # chip load h·(h/h0)^-m: 0 is the linear law
    edge_of_shares: np.ndarray = field(default_factory=lambda: np.ones(3))

    @property
    def tooth_s(self) -> float:
        """From one tooth to the next."""
        return 2.0 * np.pi / (self.teeth * self.spindle_rad_s)


@dataclass(frozen=True)
class World:
    """Everything a run depends on that is a number; effects replace entries of it."""

    lengths_mm: np.ndarray = field(
        default_factory=lambda: np.array([350.0, 41.0, 675.0, 1150.0, 1000.0, 240.0])
    )
    base: Frame = field(default_factory=lambda: Frame.of(1500.0, 0.0, 800.0))
    tool: Frame = field(default_factory=lambda: Frame.of(250.0, 0.0, 250.0, 0.0, -90.0, 0.0))
    stiffness_Nmm_rad: np.ndarray = field(default_factory=_stiffness)
    cutter: Cutter = field(default_factory=Cutter)
    stock_mm: np.ndarray = field(default_factory=lambda: np.array([[0.0, -70.0, -30.0], [160.0, 70.0, 0.0]]))
    stock_turn_deg: float = 0.0
    k_s: float = 0.168
    acceleration_mm_s2: float = 2000.0
    ramp: str = "averages"
    corner: str = "parabola"
    lag_s: np.ndarray = field(default_factory=lambda: np.zeros(6))

    def but(self, **changes) -> "World":
        """This world with some entries replaced."""
        return replace(self, **changes)

    def cutting(self, **changes) -> "World":
        """This world with some entries of the cutter replaced."""
        return replace(self, cutter=replace(self.cutter, **changes))


CDIS_mm = 0.5
RAPID_mm_s = 200.0

CELL_TOML = """\
name = "plant, demonstration cell"
based_on = "demonstration"

[robot]
model = "KR 300 R2500 ultra"

[controller]
cdis_mm = 0.5

[stock]
box_mm = [[0.0, -70.0, -30.0], [160.0, 70.0, 0.0]]

[clearance]
z_mm = 100.0
"""
