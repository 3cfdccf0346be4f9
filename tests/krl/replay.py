"""An independent replay of a KRL program: text by regular expressions, poses by scipy, joints by OPW.

It shares nothing with the package: what it finds is what a controller with this robot would do.
`read_program` is the one reader of every replay here: of joints (`replay_joints`), and of times and triggers
(`brute_replay`, `pilot_replay`). Three readers of KRL know nothing of each other: the package's own, by which
`verify` refuses (`gcode2krl/krl/read.py` and its scanner), this one, and the grammar that is executed
(`language`, `execution`).
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import py_opw_kinematics as opw
from scipy.spatial.transform import RigidTransform, Rotation

FrameData = Mapping[int, RigidTransform]

_NUMBER = r"[-+]?\d+(?:\.\d+)?"
_DEF = re.compile(r"(?:GLOBAL\s+)?DEF\s+(\w+)\s*\(", re.I)
_MOTION = re.compile(r"(PTP|LIN)\s*\{([^{}]*)\}\s*(C_DIS)?", re.I)
_SETTING = re.compile(rf"\$(VEL\.CP|ACC\.CP|APO\.CDIS)\s*=\s*({_NUMBER})", re.I)
_FRAME = re.compile(r"\$(BASE|TOOL)\s*=\s*\{([^{}]*)\}", re.I)
_NUMBERED = re.compile(r"BAS\s*\(\s*#(BASE|TOOL)\s*,\s*(\d+)\s*\)", re.I)
_CALL = re.compile(r"(\w+)\s*\(\s*\)", re.I)
_TRIGGER = re.compile(
    r"TRIGGER WHEN DISTANCE=0 DELAY=(\d+) DO (?:([$\w]+(?:\[\d+\])?)=(-?\d+)|(\w+)\(([^()]*)\) PRIO=-1)"
)
_COMPONENT = re.compile(rf"([XYZABCST]|A[1-6])\s+({_NUMBER})", re.I)


@dataclass(frozen=True)
class Motion:
    """One motion as the controller meets it, with all that is in force."""

    kind: str
    values: Mapping[str, float]
    blend: bool
    line: int
    speed_m_s: float
    acceleration_m_s2: float
    cdis_mm: float
    base: RigidTransform | None
    tool: RigidTransform | None
    before: tuple[str, ...] = field(repr=False)
    """Statements since the motion before; settings of speed and CDIS, frames and calls left out."""

    @property
    def joints_deg(self) -> np.ndarray | None:
        """A1 to A6 where the target is given as joints."""
        if "A1" not in self.values:
            return None
        return np.array([self.values[f"A{k}"] for k in range(1, 7)])

    @property
    def triggers(self) -> list[tuple[float, str, list[float]]]:
        """(delay in s, variable or subprogram, numbers) of the triggers that stand before it."""
        found = [_TRIGGER.fullmatch(text) for text in self.before if text.startswith("TRIGGER")]
        assert all(found), self.before
        numbers = [[float(word) for word in (one[3] or one[5]).split(",")] for one in found]
        return [(int(one[1]) / 1000.0, one[2] or one[4], of) for one, of in zip(found, numbers, strict=True)]

    @property
    def pose(self) -> RigidTransform:
        """The tool frame in ``$BASE``."""
        return frame(self.values)

    @property
    def flange(self) -> RigidTransform:
        """The flange in the robot root, ``$BASE``·pose·``$TOOL``⁻¹."""
        assert self.base is not None
        assert self.tool is not None, f"line {self.line}: no $BASE or $TOOL yet"
        return self.base * self.pose * self.tool.inv()


@dataclass(frozen=True)
class Program:
    """The motions in the order of execution, and what stands behind the last."""

    motions: tuple[Motion, ...]
    after: tuple[str, ...]


def frame(values: Mapping[str, float]) -> RigidTransform:
    """Return a KUKA frame: X, Y, Z in mm and A, B, C in degrees, Rz(A)·Ry(B)·Rx(C)."""
    rotation = Rotation.from_euler("ZYX", [values["A"], values["B"], values["C"]], degrees=True)
    return RigidTransform.from_components([values["X"], values["Y"], values["Z"]], rotation)


def components(text: str) -> dict[str, float]:
    """Return the components of ``X 1.0,Y 2.0,…``."""
    found = _COMPONENT.findall(text)
    assert len(found) == len(text.split(",")), text
    return {key.upper(): float(value) for key, value in found}


def read_program(
    path: Path, base_data: FrameData | None = None, tool_data: FrameData | None = None
) -> Program:
    """Read a ``.src`` and the ``.src`` files beside it; frames by number come from the controller's data."""
    blocks: dict[str, list[tuple[int, str]]] = {}
    for file in [path, *sorted(set(path.parent.glob("*.src")) - {path})]:
        for name, lines in _blocks(file.read_text("ascii")):
            blocks.setdefault(name, lines)
    main = next(iter(blocks))
    state: dict[str, Any] = dict.fromkeys(("VEL.CP", "ACC.CP", "APO.CDIS"), math.nan)
    state |= {"BASE": None, "TOOL": None}
    data = {"BASE": base_data or {}, "TOOL": tool_data or {}}
    motions: list[Motion] = []
    since: list[str] = []
    for number, text in _executed(blocks, main):
        if found := _MOTION.fullmatch(text):
            values, blend = components(found[2]), found[3] is not None
            motions.append(Motion(found[1].upper(), values, blend, number, *state.values(), tuple(since)))
            since.clear()
        elif found := _SETTING.fullmatch(text):
            state[found[1].upper()] = float(found[2])
        elif found := _FRAME.fullmatch(text):
            state[found[1].upper()] = frame(components(found[2]))
        elif found := _NUMBERED.fullmatch(text):
            state[found[1].upper()] = data[found[1].upper()][int(found[2])]
        else:
            since.append(text)
    return Program(tuple(motions), tuple(since))


def _blocks(text: str) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    name, lines = "", []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if '"' not in line and not line.startswith("WAIT"):  # behind a wait stands whose it is
            line = line.split(";")[0].strip()
        if not line or line[0] in "&;":
            continue
        if found := _DEF.match(line):
            name, lines = found[1].upper(), []
        elif line.upper() == "END":
            yield name, lines
        else:
            lines.append((number, line))


def _executed(blocks: Mapping[str, list[tuple[int, str]]], name: str) -> Iterator[tuple[int, str]]:
    for number, text in blocks[name]:
        call = _CALL.fullmatch(text)
        if call and call[1].upper() in blocks:
            yield from _executed(blocks, call[1].upper())
        elif not re.match(r"(DECL|EXT)\b", text, re.I):
            yield number, text


def opw_solver(lengths_mm, *, degrees: bool) -> opw.Robot:
    """Return the independent solver of an arm (a1, a2, c1, c2, c3, c4) with the controller's signs."""
    model = opw.KinematicModel(
        **dict(zip(("a1", "a2", "c1", "c2", "c3", "c4"), map(float, lengths_mm), strict=True)),
        b=0.0,
        offsets=(0.0, -90.0 if degrees else -math.pi / 2, 0.0, 0.0, 0.0, 0.0),
        flip_axes=(True, False, False, True, False, True),
    )
    return opw.Robot(model, degrees=degrees)


class Kr300:
    """The KR 300 R2500 ultra by an OPW solver; angles in degrees with the controller's signs and zero."""

    limits_deg = np.array([[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-122.5, 122.5], [-350, 350]])
    wrist_mm = 240.0
    elbow_deg = -math.degrees(math.atan2(41.0, 1000.0))
    """A3 of the stretched arm."""

    def __init__(self) -> None:
        self.solver = opw_solver((350, 41, 675, 1150, 1000, 240), degrees=True)

    def forward(self, joints_deg: np.ndarray) -> RigidTransform:
        """Return the flange in the robot root."""
        return self.solver.forward(tuple(joints_deg))

    def status(self, joints_deg: np.ndarray) -> int:
        """Return KUKA's S: bit 0 wrist behind axis 1, bit 1 elbow bent downwards, bit 2 A5 negative."""
        flange = self.forward(joints_deg)
        x, y, _ = flange.translation - self.wrist_mm * flange.rotation.as_matrix()[:, 2]
        a1 = math.radians(joints_deg[0])
        behind = x * math.cos(a1) - y * math.sin(a1) < 0
        return behind + 2 * (joints_deg[2] >= self.elbow_deg) + 4 * (joints_deg[4] < 0)

    def by_status(self, flange: RigidTransform, status: int, turn: int) -> np.ndarray:
        """Return the joints that S and T name, as PTP does."""
        found = []
        for solution in self.solver.inverse(flange):
            joints = np.array(solution)
            if self.status(joints) == status:
                negative = np.array([turn >> k & 1 for k in range(6)], dtype=bool)
                joints[np.abs(joints) < 1e-4] = 0.0
                joints = np.where(negative & (joints >= 0), joints - 360.0, joints)
                found.append(np.where(~negative & (joints < 0), joints + 360.0, joints))
        assert len(found) == 1, f"S {status}, T {turn}: {len(found)} solutions"
        return found[0]

    def nearest(self, flange: RigidTransform, before_deg: np.ndarray) -> np.ndarray:
        """Return the joints nearest to those before, as LIN does."""
        solutions = np.array(self.solver.inverse(flange))
        assert len(solutions), "out of reach"
        solutions += 360.0 * np.round((before_deg - solutions) / 360.0)
        return solutions[np.argmin(np.abs(solutions - before_deg).max(axis=1))]


def replay_joints(program: Program, robot: Kr300, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of motions that were solved and their joints (rows, 6) in degrees.

    All PTP and every so many LIN, with the LIN before each PTP.
    """
    rows, joints = [], []
    last = len(program.motions) - 1
    for row, motion in enumerate(program.motions):
        if motion.kind == "LIN" and row % every and row < last and program.motions[row + 1].kind == "LIN":
            continue
        if motion.joints_deg is not None:
            angles = motion.joints_deg
        elif motion.kind == "PTP":
            angles = robot.by_status(motion.flange, int(motion.values["S"]), int(motion.values["T"]))
        else:
            angles = robot.nearest(motion.flange, joints[-1])
        rows.append(row)
        joints.append(angles)
    return np.array(rows), np.array(joints)
