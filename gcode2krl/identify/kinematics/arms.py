"""The arms whose poses can be read: lengths, signs and zeros of their controllers' joints."""

import difflib
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, library
from gcode2krl.errors import input_error
from gcode2krl.units import RAD_PER_DEG

LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4", "d5")
_KUKA_SIGNS, _KUKA_OFFSETS_DEG = (-1.0, 1.0, 1.0, -1.0, 1.0, -1.0), (0.0, -90.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with ortho-parallel base, and a spherical wrist or one whose A4 is parallel to A2 and A3."""

    model: str
    mm: Floats
    """(8,) a1, a2, b, c1, c2, c3, c4, d5; d5, between A4 and A6 along A5, is 0 with a spherical wrist."""
    signs: Floats
    """(6,) of the controller's joints against those of Brandstötter, Angerer and Hofbaur 2014."""
    offsets_rad: Floats
    """(6,)"""
    a3_by_a2: float = 0.0
    """By this times A2 the angle between the links differs from the controller's A3."""
    source: str = ""
    is_kuka: bool = False
    """A cell can hold it."""

    def kuka_rad(self, q_rad: Floats) -> Floats:
        """Return the joints (n, 6) in KUKA's signs and zero, from those of the arm's own controller."""
        q = q_rad.copy()
        q[:, 2] += self.a3_by_a2 * q[:, 1]
        paper = self.signs * q - self.offsets_rad
        return np.asarray(np.array(_KUKA_SIGNS) * paper + RAD_PER_DEG * np.array(_KUKA_OFFSETS_DEG))


@cache
def _listed() -> dict[str, Arm]:
    """Return model → arm of other makers, from ``arms.toml``."""
    text = files("gcode2krl.identify.kinematics").joinpath("arms.toml").read_text(encoding="utf-8")
    return {
        entry["model"]: Arm(
            model=entry["model"],
            mm=np.array([entry["mm"].get(name, 0.0) for name in LENGTHS], dtype=float),
            signs=np.array(entry["signs"], dtype=float),
            offsets_rad=RAD_PER_DEG * np.array(entry["offsets_deg"], dtype=float),
            a3_by_a2=float(entry["a3_by_a2"]),
            source=entry["source"],
        )
        for entry in tomllib.loads(text)["arm"]
    }


def arm_of(cell: Cell) -> Arm:
    """Return the arm of a cell; raises `RefusedError` where its lengths are not stated."""
    a1, a2, c1, c2, c3, c4 = cell.robot.geometry.array()
    return _kuka(cell.robot.title, np.array([a1, a2, 0.0, c1, c2, c3, c4, 0.0]))


def _kuka(model: str, mm: Floats) -> Arm:
    return Arm(model, mm, np.array(_KUKA_SIGNS), RAD_PER_DEG * np.array(_KUKA_OFFSETS_DEG), is_kuka=True)


def arm_named(model: str) -> Arm:
    """Return an arm by name: of ``arms.toml``, or of the library of KUKA's robots.

    Raises `NotUnderstoodError` for a name that is in neither.
    """
    known = {name.casefold(): arm for name, arm in all_arms().items()}
    if model.casefold() not in known:
        near = difflib.get_close_matches(model.casefold(), known, n=1, cutoff=0.0)[0]
        words = f"--robot {model[:60]!r}: not one of the {len(known)} arms that are known"
        raise input_error("model-unknown", words, f"did you mean {known[near].model!r}?")
    return known[model.casefold()]


def all_arms() -> dict[str, Arm]:
    """Return model → arm of every maker."""
    arms = dict(_listed())
    for model in library.names("robots"):
        geometry = library.read_model("robots", model).get("geometry", {})
        if "a1_mm" in geometry:
            mm = [0.0 if name in ("b", "d5") else float(geometry[f"{name}_mm"]) for name in LENGTHS]
            arms[model] = _kuka(model, np.array(mm))
    return arms
