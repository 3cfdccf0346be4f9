"""``gcode2krl stiffness-map``: how far the tool bends away over the workspace and over the spin."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cli.console import Console
from gcode2krl.cli.help_examples import examples
from gcode2krl.cli.inputs import cell_files, common_options, read_cell, require_folder
from gcode2krl.errors import Gcode2KrlError, Issue, RefusedError, input_error
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

if TYPE_CHECKING:
    from gcode2krl.cell import Cell

Three = tuple[float, float, float]
MOST_LOAD_N = 1e6
"""A larger load is taken for a wrong unit: no robot holds it."""
LATERAL_N = 100.0
"""Size of the load where none is given."""
_AXIS = np.array([[0.0, 0.0, 1.0]])
_ACROSS = np.eye(3)[:2]
_SPIN_STEP_DEG = 2.0
_STEPS_TO_REACH = 25
_MOST_POSES = 100_000
_TABLES = ("workspace", "spin", "joints")


@click.command("stiffness-map", epilog=examples("gcode2krl stiffness-map", "gcode2krl stiffness-map --json"))
@common_options
@click.option(
    "--load",
    "load_N",
    type=float,
    nargs=3,
    metavar="FX FY FZ",
    help="Force on the tool in N along $BASE; default: 100 N across the tool, wherever it bends most.",
)
@click.option(
    "--feed",
    type=float,
    nargs=3,
    metavar="X Y Z",
    help="Feed direction: only what is normal to it counts; default: all of the deflection.",
)
@click.option(
    "--at",
    "at_mm",
    type=float,
    nargs=3,
    default=(0.0, 0.0, 0.0),
    metavar="X Y Z",
    show_default=True,
    help="Point in $BASE of the spin map and of the joints; its Z is the height of the workspace map.",
)
@click.option("--tool", type=int, help="Tool number; default: the mounted one, else the first.")
@click.option(
    "--step", "step_mm", type=float, metavar="MM", help="Grid of the workspace map; default: reach/25."
)
@click.option("-o", "--output", default="stiffness-map", show_default=True, metavar="FOLDER")
def command(
    cell_path: str | None,
    as_json: bool,
    quiet: bool,
    load_N: Three | None,
    feed: Three | None,
    at_mm: Three,
    tool: int | None,
    step_mm: float | None,
    output: str,
) -> int:
    """Draw how far the robot bends under a load: over $BASE's plane, over the spin, and joint by joint.

    The tool axis is Z of $BASE. Pose and branch are those of a program there: one branch, nearest to HOME,
    within the joint limits. Figures and CSV go into the folder.
    """
    from gcode2krl.compliance import assumed_stiffness

    console = Console(quiet, as_json)
    folder, inputs = Path(output), cell_files(cell_path)
    try:
        require_folder(folder, [f"{name}{kind}" for name in _TABLES for kind in (".png", ".csv")], inputs)
        cell = read_cell(cell_path)
        case = Case.of(cell, load_N, feed, tool)
        with console.stage("mapping"):
            plane, spins = plane_map(case, at_mm[2], step_mm), spin_map(case, at_mm)
            result, shares = pose_cost(case, at_mm)
            files = _save(case, at_mm, plane, spins, shares, folder, inputs)
    except Gcode2KrlError as error:
        return console.refused(error, ["deflection_mm"])
    usable = np.where(spins.usable, spins.deflection_mm, np.nan)
    best = int(np.nanargmin(usable)) if np.isfinite(usable).any() else None
    result |= {
        "stiffest_spin_deg": None if best is None else float(spins.spin_deg[best]),
        "stiffest_spin_mm": None if best is None else float(usable[best]),
    }
    issues = [assumed] if (assumed := assumed_stiffness(cell, "note")) is not None else []
    if as_json:
        return console.record(result, issues, files=files)
    console.say(f"{output}: {', '.join(file.name for file in files)}")
    console.say(f"  {case.words}, tool T{case.tool}, at X {at_mm[0]:g} Y {at_mm[1]:g} Z {at_mm[2]:g}")
    console.say(f"  deflection {result['deflection_mm']:.4f} mm at spin {case.spin_deg:g} deg")
    if best is not None:
        console.say(f"  stiffest at spin {spins.spin_deg[best]:g} deg: {usable[best]:.4f} mm")
    most = max(shares, key=lambda name: shares[name])
    console.say(f"  most of it from {most}: {shares[most] / max(sum(shares.values()), 1e-12):.0%}")
    console.findings(issues, cell.name)
    return 0


@dataclass(frozen=True)
class Case:
    """Cell, tool and load of the maps."""

    cell: "Cell"
    tool: int
    load_N: Floats | None
    feed: Floats

    @classmethod
    def of(cls, cell: "Cell", load: Three | None, feed: Three | None, tool: int | None) -> "Case":
        """Return the case of a command's options; raises `NotUnderstoodError` for an impossible option."""
        number = tool if tool is not None else cell.usual_tool
        if number is None or number not in cell.tool:
            known = ", ".join(f"T{name}" for name in sorted(cell.tool))
            raise input_error(
                "tool-unknown", f"T{number} is not in the cell, which has {known}", "choose one"
            )
        for name, values in (("--load", load), ("--feed", feed)):
            if values is not None and not (np.isfinite(values).all() and np.any(values)):
                raise input_error("option-value", f"{name} {values} has no direction", "give three numbers")
        if load is not None and max(map(abs, load)) > MOST_LOAD_N:
            sentence = f"--load {load}: more than {MOST_LOAD_N:g} N"
            raise input_error("option-value", sentence, "give newtons")
        load_N = None if load is None else np.array(load, dtype=float)
        return cls(cell, number, load_N, np.array(feed if feed is not None else (0.0, 0.0, 0.0), dtype=float))

    @property
    def spin_deg(self) -> float:
        """Spin of the cell; 0 where the cell has it searched."""
        spin = self.cell.frames.spin
        return 0.0 if isinstance(spin, str) else float(spin)

    @property
    def words(self) -> str:
        """The load in words."""
        if self.load_N is None:
            return f"{LATERAL_N:g} N across the tool, worst direction"
        x, y, z = self.load_N
        return f"load X {x:g} Y {y:g} Z {z:g} N"

    def poses(self, position_mm: Floats, spin_deg: Floats) -> tuple[Floats, Floats]:
        """Return joints (n, 6) of poses (n, 3) at spins (n,) and their distance (n,) to the limits in rad.

        All in one branch, chosen as for a program that goes from HOME to each pose.
        """
        from gcode2krl.pose import tool_rotation
        from gcode2krl.robot.branch import Path as Poses
        from gcode2krl.robot.branch import best_branch
        from gcode2krl.robot.standing import limit_margin

        count = len(position_mm)
        rotation = tool_rotation(np.repeat(_AXIS, count, axis=0), spin_deg * RAD_PER_DEG)
        tool = np.full(count, self.tool, dtype=np.int32)
        poses = Poses(position_mm, rotation, tool, np.ones(count, dtype=np.bool_))
        q = best_branch(poses, np.arange(count), self.cell).q_rad
        return q, limit_margin(q, self.cell)

    def worst_load(self, q_rad: Floats) -> tuple[Floats, Floats]:
        """Return the loads (n, 3) along ``$BASE`` and how far they bend poses (n, 6) in mm; NaN as the pose.

        If no load is given, the load across the tool that bends most: the deflections under two perpendicular
        loads span all others (linear within 0.03 % at 100 N), and their singular value is the largest.
        """
        from gcode2krl.compliance import deflection_magnitude, deflection_of, project_normal

        nothing = np.zeros(3)
        if self.load_N is not None:
            size = deflection_magnitude(q_rad, self.load_N, self.feed, self.cell, self.tool)
            return np.repeat(self.load_N[None, :], len(q_rad), axis=0), size
        bent = [
            project_normal(
                deflection_of(q_rad, LATERAL_N * way, nothing, nothing, self.cell, self.tool)[0], self.feed
            )
            for way in _ACROSS
        ]
        both = np.stack(bent, axis=2)
        reached: Bools = np.asarray(np.isfinite(both).all(axis=(1, 2)))
        _, size, directions = np.linalg.svd(np.where(reached[:, None, None], both, 0.0), full_matrices=False)
        return LATERAL_N * directions[:, 0] @ _ACROSS, np.where(reached, size[:, 0], np.nan)


@dataclass(frozen=True)
class PlaneMap:
    """Deflection (j, i) over X (i) and Y (j) of a plane; NaN where no program can go."""

    x_mm: Floats
    y_mm: Floats
    z_mm: float
    deflection_mm: Floats
    q_rad: Floats
    """(j·i, 6)"""


@dataclass(frozen=True)
class SpinMap:
    """Deflection (n,) over the spin, and where the pose is impossible or singular."""

    spin_deg: Floats
    deflection_mm: Floats
    beyond: Bools
    singular: Bools
    margin_rad: Floats

    @property
    def usable(self) -> Bools:
        """(n,) True where the pose is neither beyond a limit nor singular."""
        return np.asarray(~self.beyond & ~self.singular)


def plane_map(case: Case, z_mm: float, step_mm: float | None = None) -> PlaneMap:
    """Return the deflection over the plane at a height in ``$BASE``, as far as the arm reaches."""
    a1_mm, a2_mm, _, c2_mm, c3_mm, c4_mm = case.cell.robot.geometry.array()
    tip_mm = float(np.linalg.norm(case.cell.tool_matrix(case.tool)[:3, 3]))
    reach_mm = float(abs(a1_mm) + c2_mm + np.hypot(a2_mm, c3_mm) + c4_mm + tip_mm)
    step_mm = reach_mm / _STEPS_TO_REACH if step_mm is None else step_mm
    if not (np.isfinite(step_mm) and step_mm > 0.0 and (2.0 * reach_mm / step_mm + 1.0) ** 2 <= _MOST_POSES):
        raise input_error(
            "option-value", f"--step {step_mm:g} mm: not between 10 mm and the reach", "leave it out"
        )
    foot = np.linalg.inv(case.cell.base_matrix())[:2, 3]
    line = np.arange(-np.floor(reach_mm / step_mm), np.floor(reach_mm / step_mm) + 1.0) * step_mm
    x_mm, y_mm = foot[0] + line, foot[1] + line
    at = np.stack([*np.meshgrid(x_mm, y_mm), np.full((len(y_mm), len(x_mm)), z_mm)], axis=2).reshape(-1, 3)
    q, margin = case.poses(at, np.full(len(at), case.spin_deg))
    _, size = case.worst_load(q)
    size = np.where(margin >= 0.0, size, np.nan).reshape(len(y_mm), len(x_mm))
    return PlaneMap(x_mm, y_mm, z_mm, size, q)


def spin_map(case: Case, at_mm: Three) -> SpinMap:
    """Return the deflection at a point over the spin from -180 to 180 degrees."""
    from gcode2krl.robot.standing import WRIST_ZONE_RAD

    spin = np.arange(-180.0, 180.0 + _SPIN_STEP_DEG / 2.0, _SPIN_STEP_DEG)
    q, margin = case.poses(np.repeat([np.array(at_mm, dtype=float)], len(spin), axis=0), spin)
    _, size = case.worst_load(q)
    singular = np.abs(np.sin(q[:, 4])) < np.sin(WRIST_ZONE_RAD)
    return SpinMap(spin, size, ~(margin >= 0.0), singular, margin)


def pose_cost(case: Case, at_mm: Three) -> tuple[dict[str, Any], dict[str, float]]:
    """Return figures of the pose at a point, and what each virtual joint adds along the deflection in mm.

    Raises `RefusedError` where the robot cannot be there.
    """
    from gcode2krl.cell.sections import VIRTUAL_JOINTS
    from gcode2krl.compliance import joint_shares, project_normal

    q, margin = case.poses(np.array([at_mm], dtype=float), np.array([case.spin_deg]))
    if not margin[0] >= 0.0:
        x, y, z = at_mm
        sentence = f"X {x:g} Y {y:g} Z {z:g} cannot be reached at spin {case.spin_deg:g} deg"
        raise RefusedError(Issue("error", "out-of-reach", 0, sentence, "choose another point with --at"))
    load, size = case.worst_load(q)
    rotation = case.cell.base_matrix()[:3, :3]
    alone_root = joint_shares(q, load @ rotation.T, np.zeros(3), case.cell, case.tool)[0]
    alone = project_normal(alone_root @ rotation, case.feed)
    total = alone.sum(axis=0)
    share = alone @ (total / max(float(np.linalg.norm(total)), 1e-300))
    figures = {
        "deflection_mm": float(size[0]),
        "load_N": load[0].tolist(),
        "q_deg": (q[0] * DEG_PER_RAD).tolist(),
        "shares_mm": dict(zip(VIRTUAL_JOINTS, share.tolist(), strict=True)),
    }
    return figures, figures["shares_mm"]


def _save(
    case: Case,
    at: Three,
    plane: PlaneMap,
    spins: SpinMap,
    shares: dict[str, float],
    folder: Path,
    inputs: list[Path],
) -> list[Path]:
    """Write figures and CSV; returns the files."""
    import polars as pl

    from gcode2krl.files import write_together
    from gcode2krl.report.figures import save_figures
    from gcode2krl.report.stiffness_figures import joint_cost_figure, spin_figure, workspace_figure

    place = f"X {at[0]:g} Y {at[1]:g} Z {at[2]:g}"
    chosen = None if isinstance(case.cell.frames.spin, str) else case.spin_deg
    figures = {
        "workspace": workspace_figure(
            plane.x_mm, plane.y_mm, plane.deflection_mm, f"Deflection at Z {plane.z_mm:g} mm: {case.words}"
        ),
        "spin": spin_figure(
            spins.spin_deg,
            spins.deflection_mm,
            spins.beyond,
            spins.singular,
            chosen,
            f"Deflection over the spin at {place}: {case.words}",
        ),
        "joints": joint_cost_figure(
            list(shares), np.array(list(shares.values())), f"Which joint bends at {place}: {case.words}"
        ),
    }
    x, y = np.meshgrid(plane.x_mm, plane.y_mm)
    angles = {f"a{axis + 1}_deg": plane.q_rad[:, axis] * DEG_PER_RAD for axis in range(6)}
    tables: dict[str, dict[str, Any]] = {
        "workspace": {
            "x_mm": x.ravel(),
            "y_mm": y.ravel(),
            "z_mm": np.full(x.size, plane.z_mm),
            "deflection_mm": plane.deflection_mm.ravel(),
            **angles,
        },
        "spin": {
            "spin_deg": spins.spin_deg,
            "deflection_mm": spins.deflection_mm,
            "limit_margin_deg": spins.margin_rad * DEG_PER_RAD,
            "usable": spins.usable,
        },
        "joints": {"joint": list(shares), "share_mm": list(shares.values())},
    }
    drawn = save_figures(figures, folder, inputs)
    written = {folder / f"{name}.csv": pl.DataFrame(columns).write_csv for name, columns in tables.items()}
    write_together(written, inputs)
    return [*drawn, *written]
