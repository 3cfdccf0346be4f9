"""Stiffness of A1 to A6 from pulls on a bar at the flange: known weight or spring balance, and a dial gauge.

Model: a force F at a point of the flange, pulled along u, moves the point along the dial's direction n by

    d = sum_j (n·J_j)·(J_j·F)·c_j

with J_j the velocity of the point when A_j turns (mm/rad) and c_j the compliance of A_j about its own axis:
linear in c, so weighted least squares. Links and bearings bend too; as far as they do it in the direction of
an axis they are in its c, as in Dumas et al. 2011, else they are left out.

Noise of a reading d: two readings of the dial, each with its resolution and `DIAL_SIGMA_MM`, and the
balance's share of d, independent from pull to pull. Where the residuals are improbable for that noise, the
intervals are widened by them. No prior is used: what the pulls do not determine is said, not filled in.
Assumptions: the arm stands still, poses are those of the display, the force acts on the undeformed arm.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import missing
from gcode2krl.compliance.estimate import estimated
from gcode2krl.errors import Issue, input_error
from gcode2krl.identify.estimate import LEVEL, Estimate, chance_above, inverse, student
from gcode2krl.identify.table_file import FIRST_ROW, MeasuredTable
from gcode2krl.robot.kinematics import flange_pose
from gcode2krl.robot.standing import limits_rad
from gcode2krl.robot.velocity_kinematics import jacobian
from gcode2krl.units import DEG_PER_RAD, GRAVITY_M_S2, RAD_PER_DEG

AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
DIRECTIONS = {
    sign + name: direction * unit
    for name, unit in zip("xyz", np.eye(3), strict=True)
    for sign, direction in (("+", 1.0), ("-", -1.0))
}
"""Along the axes of the robot root."""
PULLS = ("-z", "+x", "+y")
"""The pulls at each pose."""
DIAL_RESOLUTION_MM = 0.01
DIAL_SIGMA_MM = 0.005
"""Of one reading, beside the rounding."""
BALANCE = 0.01
"""1-sigma of a spring balance as a fraction of its reading."""
MOST_FORCE_N = 1000.0
_SHARE_OF_PAYLOAD = 0.5
_SHARE_OF_REACH = 0.1
"""How far the bar reaches from axis 6: without it no pull turns A6."""
_LOW_MM, _HIGH_MM = 300.0, 1900.0
"""Heights above the robot's foot at which a person can read a dial."""
_AWAY_RAD = 10.0 * RAD_PER_DEG
"""From the joint limits."""
_FREE_MM = 50.0
_TRIED = 400
_IMPROBABLE = 1e-2
_WIDEST = 0.5
"""A compliance whose half interval is a larger fraction of it is not determined."""
_STRAY_SIGMA = 5.0
_COLUMNS = tuple(f"a{n}_deg" for n in range(1, 7)), ("point_x_mm", "point_y_mm", "point_z_mm")

Gap = Callable[[Floats], Floats]
"""Angles (n, 6) in rad to the least distance (n,) in mm from anything."""


@dataclass(frozen=True)
class Pulls:
    """Pulls as planned or as done, a row each."""

    q_rad: Floats
    """(m, 6)."""
    point_mm: Floats
    """(m, 3) where the force acts and the dial touches, in the flange frame."""
    force_N: Floats
    """(m, 3) along the robot root."""
    dial: Floats
    """(m, 3) unit vectors along the robot root, positive as the dial counts."""
    moved_mm: Floats
    """(m,) loaded less unloaded reading; NaN where not done."""
    source: str


@dataclass(frozen=True)
class PullFit:
    """What the pulls say of A1 to A6."""

    k_Nmm_rad: tuple[Estimate | None, ...]
    """(6,) with their intervals; None where not determined."""
    band: float
    """Largest half interval of the displacement at a pull, relative."""
    residual_sigma: Floats
    """(m,)."""
    level: float
    issues: tuple[Issue, ...]
    source: str

    def errors(self) -> list[Issue]:
        """Return one finding for each axis that is not determined."""
        return [issue for issue in self.issues if issue.severity == "error"]


def propose(cell: Cell, gap: Gap | None, count: int, force_N: float | None, point_mm: Floats | None) -> Pulls:
    """Return pulls at ``count`` poses that determine the six stiffnesses best: D-optimal among free ones.

    ``gap`` tells how far poses are from a collision, None where the cell describes nothing. The expected
    stiffness is that of the arm's class.

    Raises
    ------
    RefusedError
        If the cell lacks lengths, limits, payload or reach.
    NotUnderstoodError
        If too few poses are free.
    """
    payload = cell.robot.payload
    if payload.mass_kg is None or payload.reach_mm is None:
        raise missing("robot.payload.mass_kg" if payload.mass_kg is None else "robot.payload.reach_mm")
    if cell.robot.limits.q_deg is None:
        raise missing("robot.limits.q_deg")
    if force_N is None:
        force_N = min(MOST_FORCE_N, _SHARE_OF_PAYLOAD * payload.mass_kg * GRAVITY_M_S2)
        force_N = max(10.0 * round(force_N / 10.0), 5.0)
    if point_mm is None:
        point_mm = np.array([max(10.0 * round(_SHARE_OF_REACH * payload.reach_mm / 10.0), 50.0), 0.0, 0.0])
    poses = _free_poses(cell, gap, point_mm)
    if len(poses) < count:
        raise input_error(
            "not-determined",
            f"{len(poses)} of {_TRIED} poses are within the limits, free and at a height of "
            f"{_LOW_MM:g} to {_HIGH_MM:g} mm; {count} are needed",
            "fewer with --poses, or check [[obstacle]], [table] and the limits of the cell",
            source=cell.name,
        )
    compliance = 1.0 / _expected(payload.mass_kg, payload.reach_mm)
    rows = len(PULLS)
    every = _pulls(np.repeat(poses, rows, axis=0), point_mm, force_N, PULLS * len(poses), cell.name)
    slopes = _slopes(every, cell) * compliance
    slopes /= _sigma(slopes.sum(axis=1), BALANCE)[:, None]
    chosen = _most_telling(slopes.reshape(len(poses), rows, 6), count)
    chosen = chosen[np.argsort(poses[chosen, 0])]
    return _pulls(np.repeat(poses[chosen], rows, axis=0), point_mm, force_N, PULLS * count, cell.name)


def form(pulls: Pulls) -> str:
    """Return the CSV form of planned pulls, the two readings of the dial empty."""
    names = {tuple(direction): name for name, direction in DIRECTIONS.items()}
    head = ("pose", *_COLUMNS[0], *_COLUMNS[1], "pull", "dial", "force_N", "unloaded_mm", "loaded_mm")
    lines = [",".join(head)]
    pose = 0
    for row, q_deg in enumerate(pulls.q_rad * DEG_PER_RAD):
        pose += row == 0 or bool((pulls.q_rad[row] != pulls.q_rad[row - 1]).any())
        size = float(np.linalg.norm(pulls.force_N[row]))
        words = [str(pose), *(f"{angle:.2f}" for angle in q_deg), *(f"{x:g}" for x in pulls.point_mm[row])]
        words += [names[tuple(pulls.force_N[row] / size)], names[tuple(pulls.dial[row])], f"{size:g}", "", ""]
        lines.append(",".join(words))
    return "\n".join(lines) + "\n"


def read_form(file: str | Path) -> Pulls:
    """Read a filled-in form; raises `NotUnderstoodError` with row and column of what is missing or wrong."""
    table = MeasuredTable(file)
    table.require((*_COLUMNS[0], *_COLUMNS[1], "pull", "dial", "unloaded_mm", "loaded_mm"))
    if not any(table.texts("loaded_mm")):
        raise input_error(
            "table-number",
            "no reading yet: the columns unloaded_mm and loaded_mm are empty",
            "fill them in, delete the rows that were not measured, and give the same command again",
            source=str(file),
        )
    size_N = (
        table.numbers(["mass_kg"]) * GRAVITY_M_S2 if table.has(["mass_kg"]) else table.numbers(["force_N"])
    )
    unloaded, loaded = table.numbers(["unloaded_mm", "loaded_mm"]).T
    return Pulls(
        q_rad=table.numbers(_COLUMNS[0]) * RAD_PER_DEG,
        point_mm=table.numbers(_COLUMNS[1]),
        force_N=_directions(table, "pull") * size_N,
        dial=_directions(table, "dial"),
        moved_mm=loaded - unloaded,
        source=str(file),
    )


def fit(pulls: Pulls, cell: Cell, balance: float = BALANCE, level: float = LEVEL) -> PullFit:
    """Fit the stiffness of A1 to A6 in N·mm/rad.

    Parameters
    ----------
    pulls : as done.
    cell : its robot's lengths.
    balance : 1-sigma of the force, relative; 0 for a weighed mass.
    level : probability of the intervals.
    """
    slopes, moved = _slopes(pulls, cell), pulls.moved_mm
    model = moved
    for _ in range(4):  # the balance's share of the noise goes with what was really moved
        weight = 1.0 / _sigma(model, balance)
        compliance, covariance = _solved(slopes * weight[:, None], moved * weight)
        model = slopes @ compliance
    residual = (moved - model) / _sigma(model, balance)
    freedom = len(moved) - 6
    squares = float(residual @ residual)
    quantile = student(level, 10**6)
    issues = _stray(residual)
    if freedom > 0 and chance_above(squares, freedom) < _IMPROBABLE:
        quantile = student(level, freedom) * math.sqrt(squares / freedom)
        issues.append(_misfit(math.sqrt(squares / freedom)))
    half = quantile * np.sqrt(np.diag(covariance))
    stiffness = tuple(_estimate(float(c), float(h)) for c, h in zip(compliance, half, strict=True))
    for axis, estimate in zip(AXES, stiffness, strict=True):
        if estimate is None:
            issues.append(_not_determined(axis))
    spread = quantile * np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    band = float((spread / np.maximum(np.abs(model), 1e-12)).max(initial=0.0))
    return PullFit(stiffness, band, residual, level, tuple(issues), pulls.source)


# --- the linear model -------------------------------------------------------------------------------------


def _slopes(pulls: Pulls, cell: Cell) -> Floats:
    """Return what each compliance adds to each reading (m, 6): (n·J)(J·F) in mm·N·mm/rad²."""
    geometry = cell.robot.geometry.array()
    slopes = np.empty((len(pulls.q_rad), 6))
    for row, (q, point) in enumerate(zip(pulls.q_rad, pulls.point_mm, strict=True)):
        turns = jacobian(q[None, :], geometry, point)[0, :3]
        slopes[row] = (pulls.dial[row] @ turns) * (pulls.force_N[row] @ turns)
    return slopes


def _sigma(moved_mm: Floats, balance: float) -> Floats:
    """Return the 1-sigma (m,) of readings in mm."""
    of_dial = 2.0 * (DIAL_SIGMA_MM**2 + DIAL_RESOLUTION_MM**2 / 12.0)
    sigma: Floats = np.sqrt(of_dial + (balance * moved_mm) ** 2)
    return sigma


def _solved(slopes: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the solution (6,) and its covariance (6, 6) for noise 1; infinite for a column of zeros."""
    scale = np.linalg.norm(slopes, axis=0)
    used = scale > 1e-9 * scale.max(initial=1e-300)
    solution, covariance = np.zeros(6), np.diag(np.full(6, math.inf))
    scaled = slopes[:, used] / scale[used]
    normal = np.linalg.pinv(scaled.T @ scaled)
    solution[used] = normal @ (scaled.T @ values) / scale[used]
    covariance[np.ix_(used, used)] = normal / np.outer(scale[used], scale[used])
    return solution, covariance


def _estimate(compliance: float, half: float) -> Estimate | None:
    is_determined = math.isfinite(half) and compliance > 0.0 and half <= _WIDEST * compliance
    return inverse(compliance, half) if is_determined else None


# --- findings ---------------------------------------------------------------------------------------------


def _not_determined(axis: str) -> Issue:
    remedy = (
        "more pulls, a larger force, or a longer bar: `gcode2krl identify stiffness --pulls` proposes both"
    )
    return Issue("error", "not-determined", 0, f"k_a of {axis}: the pulls do not determine it", remedy)


def _misfit(factor: float) -> Issue:
    sentence = (
        f"the readings scatter {factor:.1f} times as much as dial and balance do; intervals are widened"
    )
    remedy = "look at the rows named; tighten the dial's stand, take the slack out before reading"
    return Issue("warning", "model-misfit", 0, sentence, remedy)


def _stray(residual: Floats) -> list[Issue]:
    """Name the readings that stand out, unless a quarter of all do."""
    typical = max(1.0, float(np.median(np.abs(residual))) / 0.6745)
    stray = np.flatnonzero(np.abs(residual) > _STRAY_SIGMA * typical)
    if len(stray) > 0.25 * len(residual):
        return []
    return [
        Issue(
            "warning",
            "stray-reading",
            int(row) + FIRST_ROW,
            f"this reading is off by {abs(residual[row]):.0f} sigma",
            "a dial that was touched, a wrong direction or force?",
        )
        for row in stray
    ]


# --- where to pull ----------------------------------------------------------------------------------------


def _free_poses(cell: Cell, gap: Gap | None, point_mm: Floats) -> Floats:
    """Return poses (n, 6) in rad within the limits, at a height for a person, and free of collisions."""
    limits = limits_rad(cell) + np.array([[_AWAY_RAD], [-_AWAY_RAD]]).T
    low, high = np.maximum(limits[:, 0], -math.pi), np.minimum(limits[:, 1], math.pi)
    drawn = np.random.default_rng(0).uniform(low, high, (8 * _TRIED, 6))
    drawn = np.round(drawn * DEG_PER_RAD) * RAD_PER_DEG
    position, rotation = flange_pose(drawn, cell.robot.geometry.array())
    height = (position + rotation @ point_mm)[:, 2]
    drawn = drawn[(height > _LOW_MM) & (height < _HIGH_MM)][:_TRIED]
    return drawn if gap is None else drawn[_is_free(gap(drawn))]


def _is_free(gap_mm: Floats) -> Bools:
    return np.asarray(gap_mm > _FREE_MM)


def _most_telling(slopes: Floats, count: int) -> Ints:
    """Return the numbers of ``count`` poses whose rows (n, r, 6), in 1-sigma, have the largest determinant.

    One by one, then exchanged one by one as long as that helps (Fedorov).
    """
    every = np.einsum("nri,nrj->nij", slopes, slopes)
    chosen: list[int] = []
    total = 1e-6 * np.eye(6)
    for _ in range(count):
        chosen.append(_best(total, every, chosen))
        total = total + every[chosen[-1]]
    for _ in range(5):
        before = list(chosen)
        for place in range(count):
            without = total - every[chosen[place]]
            others = chosen[:place] + chosen[place + 1 :]
            chosen[place] = _best(without, every, others)
            total = without + every[chosen[place]]
        if chosen == before:
            break
    return np.array(chosen)


def _best(total: Floats, every: Floats, taken: list[int]) -> int:
    size = np.linalg.slogdet(total + every)[1]
    size[taken] = -np.inf
    return int(np.argmax(size))


def _expected(payload_kg: float, reach_mm: float) -> Floats:
    """Return the stiffness (6,) in N·mm/rad about A1 to A6 that the arm's class suggests."""
    return np.array([1.0 / estimated(payload_kg, reach_mm).softness[row, 2] for row in (0, 1, 3, 5, 6, 7)])


def _pulls(q_rad: Floats, point_mm: Floats, force_N: float, names: tuple[str, ...], source: str) -> Pulls:
    ways = np.array([DIRECTIONS[name] for name in names])
    points = np.broadcast_to(point_mm, (len(q_rad), 3))
    return Pulls(q_rad, points, force_N * ways, ways, np.full(len(q_rad), np.nan), source)


def _directions(table: MeasuredTable, column: str) -> Floats:
    words = table.texts(column)
    for row, word in enumerate(words):
        if word not in DIRECTIONS:
            raise input_error(
                "table-number",
                f"row {row + FIRST_ROW}, column {column}: found {word[:20]!r}, "
                f"allowed: {', '.join(DIRECTIONS)}",
                "directions are along the axes of the robot root",
                line=row + FIRST_ROW,
                source=table.source,
            )
    return np.array([DIRECTIONS[word] for word in words])
