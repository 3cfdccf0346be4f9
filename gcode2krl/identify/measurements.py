"""Compliance measurements: a TOML head about cubes, lasers and load, and a CSV with the readings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from gcode2krl.arrays import Floats, Ints
from gcode2krl.cell import library
from gcode2krl.cell.sections import (
    VIRTUAL_JOINTS,
    Finite,
    NotNegative,
    Place,
    Section,
    SixFloats,
    VirtualJoint,
    VirtualJointName,
)
from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.identify.cubes import DIRECTIONS, POINTS_MM, Layout
from gcode2krl.identify.table_file import FIRST_ROW, MeasuredTable
from gcode2krl.units import RAD_PER_DEG

Point = tuple[Finite, Finite, Finite]
SixPoints = Annotated[tuple[Point, ...], Field(min_length=6, max_length=6)]

ANGLES = tuple(f"q{axis}_deg" for axis in range(1, 7))
FORCE = ("fx_N", "fy_N", "fz_N")
MOMENT = ("mx_Nmm", "my_Nmm", "mz_Nmm")
_LARGEST_MM = 10.0
"""A larger change of a distance is not elastic deformation but another pose, or another unit."""


class Lasers(Section):
    """Six laser triangulation sensors on a stand beside the robot, the same layout for every cube."""

    noise_mm: NotNegative = 0.0
    """1-sigma of one distance; 0: taken from the residuals alone."""
    point_mm: SixPoints = POINTS_MM
    """Where the beams hit, along the axes of the unloaded cube."""
    direction: SixPoints = DIRECTIONS
    """Along the beams, towards the cube."""

    @model_validator(mode="after")
    def _determined(self) -> Self:
        if any(not np.any(beam) for beam in self.direction):
            raise ValueError("direction: a beam of length 0")
        layout = self.layout()
        if (np.einsum("ij,ij->i", layout.normal, layout.point_mm) <= 0).any():
            raise ValueError("a beam comes out of the cube: point_mm and direction belong to opposite faces")
        if not layout.determines_motion():
            raise ValueError(
                "the six beams do not determine a motion: three on one face, two on the next, "
                "one on the third, well apart"
            )
        return self

    def layout(self) -> Layout:
        """Return the beams as arrays."""
        return Layout.of(self.point_mm, self.direction)


class Loading(Section):
    """Where the test load acts and along which axes force and moment are stated."""

    point_flange_mm: Point | None = None
    """In the flange frame; None: the TCP of the cell's mounted tool."""
    along: Literal["root", "flange"] = "root"


class Tracker(Section):
    """The joint angles at which the poses of the cubes were measured."""

    q_deg: SixFloats


class Cube(Place):
    """A measuring cube: the pose of its centre in the robot root, and what it is fixed to."""

    body: Literal["root", VirtualJointName]
    """The body between this virtual joint and the next one."""

    def number(self) -> int:
        """Return how many virtual joints lie below the cube."""
        return 0 if self.body == "root" else VIRTUAL_JOINTS.index(self.body) + 1


class Pair(Section):
    """Two subsequent cubes, in front of and behind a virtual joint."""

    lower: str
    upper: str


class Setup(Section):
    """The head of a measurement."""

    readings: str | None = None
    """CSV beside this file; default: this file's name with the ending csv."""
    note: str = ""
    use: Literal["motion", "rotation"] = "motion"
    """All six coordinates of the relative motion, or its three angles alone."""
    lasers: Lasers = Lasers()
    load: Loading = Loading()
    tracker: Tracker
    cube: dict[str, Cube]
    pair: Annotated[dict[str, Pair], Field(min_length=1)]
    known: dict[VirtualJointName, VirtualJoint] = Field(default_factory=dict)
    """Stiffness known beforehand, to split joints that lie between one pair of cubes."""

    @model_validator(mode="after")
    def _pairs_of_cubes(self) -> Self:
        for name, pair in self.pair.items():
            for which, cube in (("lower", pair.lower), ("upper", pair.upper)):
                if cube not in self.cube:
                    raise ValueError(f"pair.{name}.{which}: found {cube!r}, allowed: {', '.join(self.cube)}")
            if self.cube[pair.lower].number() >= self.cube[pair.upper].number():
                raise ValueError(
                    f"pair.{name}: no virtual joint lies between {pair.lower!r} and {pair.upper!r}"
                )
        return self

    def joints_between(self, name: str) -> tuple[str, ...]:
        """Return the virtual joints between the cubes of a pair, from the root outwards."""
        pair = self.pair[name]
        return VIRTUAL_JOINTS[self.cube[pair.lower].number() : self.cube[pair.upper].number()]


@dataclass(frozen=True)
class Measurements:
    """Readings of pairs of cubes; a row is one pair, unloaded and loaded."""

    setup: Setup
    row: Ints
    """(n,) line in the file."""
    pair: NDArray[np.str_]
    """(n,) name of the pair."""
    q_rad: Floats
    """(n, 6)"""
    force_N: Floats
    """(n, 3) loaded minus unloaded, along the stated axes."""
    moment_Nmm: Floats
    """(n, 3) in addition to that of the force, about the point where it acts."""
    lower_mm: Floats
    """(n, 6) distances, loaded minus unloaded, to the lower cube."""
    upper_mm: Floats
    """(n, 6) to the upper cube."""
    source: str


def read_measurements(path: str | Path) -> Measurements:
    """Read a compliance measurement: the TOML head, or the CSV whose head lies beside it.

    Raises
    ------
    NotUnderstoodError
        Names file, key, row and column: a value that is missing, not a number, of an unknown pair, or too
        large a motion.
    """
    file = Path(path)
    head = file.with_suffix(".toml") if file.suffix.lower() == ".csv" else file
    setup = _read_setup(head)
    if file != head:
        readings = file
    else:
        readings = head.parent / setup.readings if setup.readings else head.with_suffix(".csv")
    return _read_rows(setup, readings)


def _read_setup(head: Path) -> Setup:
    data = library.read_toml(head)
    try:
        return Setup.model_validate(data)
    except ValidationError as error:
        raise NotUnderstoodError(
            [_issue(dict(detail)) for detail in error.errors(include_url=False)], str(head)
        ) from None


def _issue(detail: dict[str, Any]) -> Issue:
    """Turn a finding of pydantic into a line that names the key, what was found and what is allowed."""
    key = ".".join(str(step) for step in detail["loc"]) or "pair"
    message = str(detail["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    texts = {
        "missing": f"{key}: missing",
        "extra_forbidden": f"{key}: there is no such key",
        "value_error": message if detail["loc"] == () else f"{key}: {message}",
    }
    text = texts.get(detail["type"], f"{key}: found {detail['input']!r:.60}, allowed: {message}")
    return Issue("error", "measurement-key", 0, text, "docs/identification.md lists the keys")


def _read_rows(setup: Setup, file: Path) -> Measurements:
    table = MeasuredTable(file)
    columns = {
        (cube, state): tuple(f"{cube}_{state}_{laser}_mm" for laser in range(1, 7))
        for cube in ("lower", "upper")
        for state in ("unloaded", "loaded")
    }
    table.require(["pair", *ANGLES, *FORCE, *MOMENT, *(name for names in columns.values() for name in names)])
    pair = table.texts("pair")
    for index, name in enumerate(pair):
        if name not in setup.pair:
            raise input_error(
                "table-pair",
                f"row {index + FIRST_ROW}, column pair: found {name!r}, allowed: {', '.join(setup.pair)}",
                f"add [pair.{name or 'NAME'}] to the head or correct the name",
                line=index + FIRST_ROW,
                source=str(file),
            )
    change = {}
    for cube in ("lower", "upper"):
        change[cube] = table.numbers(columns[cube, "loaded"]) - table.numbers(columns[cube, "unloaded"])
        _check_change(change[cube], columns[cube, "loaded"], file)
    return Measurements(
        setup=setup,
        row=np.arange(len(table)) + FIRST_ROW,
        pair=np.array(pair),
        q_rad=table.numbers(ANGLES) * RAD_PER_DEG,
        force_N=table.numbers(FORCE),
        moment_Nmm=table.numbers(MOMENT),
        lower_mm=change["lower"],
        upper_mm=change["upper"],
        source=str(file),
    )


def _check_change(change_mm: Floats, names: tuple[str, ...], file: Path) -> None:
    far = np.argwhere(np.abs(change_mm) > _LARGEST_MM)
    if not len(far):
        return
    index, laser = (int(number) for number in far[0])
    raise input_error(
        "table-change",
        f"row {index + FIRST_ROW}, column {names[laser]}: {change_mm[index, laser]:+.4g} mm from unloaded to "
        f"loaded, allowed: up to {_LARGEST_MM:g} mm",
        "distances are in mm; both readings at the same joint angles and with the stand at the same place",
        line=index + FIRST_ROW,
        source=str(file),
    )
