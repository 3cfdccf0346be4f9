"""A program read by this reader and by LinuxCNC's ``rs274``: do both accept it, and do both move alike?"""

import io
import math
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import Gcode2KrlError
from gcode2krl.errors import Issue
from gcode2krl.gcode import read_stream
from gcode2krl.tables import Toolpath
from tests.reference.rs274 import make

REFERENCE = Path(__file__).resolve().parent
POSITION_MM, FEED_SHARE, CHORD_MM = 1e-6, 1e-6, 0.01
HEIGHT_SHARE = 1e-9
FEED_MM_S = 1e-6
"""``rs274`` prints nine decimals: of a small feed in inches too few for its share."""
LONGEST_S, ENDLESS = 5.0, "runs without an end"
_PLANES = {"xy": (0, 1, 2), "zx": (2, 0, 1), "yz": (1, 2, 0)}


@dataclass(frozen=True)
class Read:
    """What one of the two makes of a program."""

    moves: list[dict[str, Any]]
    refused: str
    """Why not, '' = accepted."""
    issue: Issue | None = None
    codes: frozenset[str] = frozenset()
    """Findings that do not refuse."""


def by_us(program: bytes) -> tuple[Read, Toolpath | None]:
    """Read a program."""
    try:
        toolpath = read_stream(
            io.BytesIO(program), "part.nc", tools=REFERENCE / "tool.tbl", chord_tolerance_mm=CHORD_MM
        )
    except Gcode2KrlError as error:
        first = next(issue for issue in error.issues if issue.severity == "error")
        return Read([], f"{first.line}: {first.message}", first), None
    return Read([], "", codes=frozenset(issue.code for issue in toolpath.issues)), toolpath


class Beside:
    """``rs274`` in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        binary = shutil.which("rs274")
        assert binary is not None
        self.interpreter = make.Interpreter(Path(binary), folder)
        self.environment = {**os.environ, "HOME": str(folder)}

    def read(self, program: bytes) -> Read:
        """Return the moves of ``rs274``, or why it refuses: its words, and the block that it shows."""
        folder = self.interpreter.folder
        (folder / "program.nc").write_bytes(program)
        (folder / "rs274.var").write_text("", encoding="ascii")
        options = "-g -n 2 -t tool.tbl -v rs274.var program.nc"
        command = [str(self.interpreter.binary), *options.split()]
        try:
            done = subprocess.run(
                command,
                cwd=folder,
                env=self.environment,
                capture_output=True,
                timeout=LONGEST_S,
                close_fds=False,
            )
        except subprocess.TimeoutExpired:
            return Read([], ENDLESS)
        said = done.stderr.decode("latin-1").splitlines()
        messages = [line for line in said if line != "executing"]
        if done.returncode:
            return Read([], " | ".join(messages[:2]) or f"exit code {done.returncode}")
        canon = make.Canon()
        for line in done.stdout.decode("latin-1").splitlines():
            match = make.CALL.match(line)
            if not match:
                return Read([], f"printed {line}")
            if match[2] == "PROGRAM_END":
                break
            canon.take(match[2], re.split(r",\s*|\s+", match[3]))
        return Read(canon.moves, "")


def difference(toolpath: Toolpath, moves: list[dict[str, Any]]) -> str:
    """Return in what a Toolpath differs from the moves of ``rs274``, '' if in nothing."""
    arc = toolpath.arc[1:]
    ends = np.ones(len(arc), dtype=bool)
    ends[:-1] = (arc[:-1] < 0) | (arc[:-1] != arc[1:])
    rows = np.flatnonzero(ends) + 1
    before = 0
    for k, (row, move) in enumerate(zip(rows.tolist(), moves, strict=False)):
        kind = "arc" if toolpath.arc[row] >= 0 else "rapid" if toolpath.rapid[row] else "feed"
        where = f"move {k + 1} (line {toolpath.source_line[row]})"
        if kind != move["kind"]:
            return f"{where}: {kind} here, {move['kind']} there"
        off_mm = float(np.abs(toolpath.position_mm[row] - move["end"]).max())
        if not off_mm <= POSITION_MM:
            return f"{where}: {toolpath.position_mm[row].round(6).tolist()} here, {move['end']} there"
        if "feed_mm_s" in move and move["feed_mm_s"] > 0:
            feed, wanted = float(toolpath.feed_mm_s[row]), move["feed_mm_s"]
            if abs(feed - wanted) > (FEED_SHARE + _spiral(move)) * wanted + FEED_MM_S:
                return f"{where}: feed {feed:.9g} mm/s here, {wanted:.9g} there"
        if kind == "arc":
            said = _arc_difference(
                np.vstack((move["start"], toolpath.position_mm[before + 1 : row + 1])), move
            )
            if said:
                return f"{where}: {said}"
        if abs(float(toolpath.dwell_s[row]) - move["dwell_s"]) > 1e-9:
            return f"{where}: {toolpath.dwell_s[row]} s of dwell here, {move['dwell_s']} there"
        before = row
    if len(rows) != len(moves):
        return f"{len(rows)} moves here, {len(moves)} there"
    return ""


def is_known(toolpath: Toolpath, moves: list[dict[str, Any]]) -> bool:
    """Tell whether X and Y are known at the first move that ends elsewhere."""
    arc = toolpath.arc[1:]
    rows = np.flatnonzero(np.append((arc[:-1] < 0) | (arc[:-1] != arc[1:]), True)) + 1
    for row, move in zip(rows.tolist(), moves, strict=False):
        if not float(np.abs(toolpath.position_mm[row] - move["end"]).max()) <= POSITION_MM:
            return bool(toolpath.known[row, :2].all())
    return True


def _spiral(move: dict[str, Any]) -> float:
    """Return the share by which the radii of an arc differ: under G93 its length goes by one, or by both."""
    if move["kind"] != "arc":
        return 0.0
    first, second, _ = _PLANES[move["plane"]]
    x, y = move["centre"]
    end = _unrotated(np.array([move["end"]]), move)[0]
    radii = [
        math.hypot(point[first] - x, point[second] - y)
        for point in (_unrotated(np.array([move["start"]]), move)[0], end)
    ]
    return abs(radii[0] - radii[1]) / max(*radii, 1e-9)


def _unrotated(points: np.ndarray, move: dict[str, Any]) -> np.ndarray:
    """Return points in the frame of a work offset that is rotated."""
    if "about" not in move:
        return points
    x, y, degrees = move["about"]
    angle = math.radians(degrees)
    back = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return np.column_stack(((points[:, :2] - [x, y]) @ back + [x, y], points[:, 2]))


def _arc_difference(points: np.ndarray, move: dict[str, Any]) -> str:
    """Return in what chords differ from an arc: their radii, their direction, their turns, their error."""
    points = _unrotated(points, move)
    first, second, along = _PLANES[move["plane"]]
    radial = points[:, [first, second]] - move["centre"]
    radius = np.hypot(*radial.T)
    sign = math.copysign(1.0, move["rotation"])
    turned = np.mod(sign * np.diff(np.arctan2(radial[:, 1], radial[:, 0])), math.tau)
    closed = math.hypot(*(radial[-1] - radial[0])) < POSITION_MM
    once = math.tau if closed else math.fmod(math.fsum(turned), math.tau)
    turns = (math.fsum(turned) - once) / math.tau + 1.0
    chord_mm = float((radius.max() * (1.0 - np.cos(turned / 2.0))).max())
    low, high = sorted((radius[0], radius[-1]))
    if radius.min() < low - POSITION_MM or radius.max() > high + POSITION_MM:
        return f"radius {radius.min():.6f} to {radius.max():.6f}, the arc's {low:.6f} to {high:.6f}"
    if chord_mm > CHORD_MM + POSITION_MM:
        return f"a chord is {chord_mm:.6f} mm off"
    if abs(turns - abs(move["rotation"])) > 1e-3:
        return f"{turns:.3f} turns here, {abs(move['rotation'])} there"
    share = np.concatenate(([0.0], np.cumsum(turned) / turned.sum()))
    height = points[:, along]
    rise = height[-1] - height[0]
    if np.abs(height - (height[0] + share * rise)).max() > POSITION_MM + HEIGHT_SHARE * abs(rise):
        return "the height does not follow the turn"
    return ""
