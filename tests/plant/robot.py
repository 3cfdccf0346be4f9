"""One run of the plant: command, servo, gear, cut, bend, sense. Effects hook in between the stages.

An effect is a set of hooks, one per stage, each a function that changes the `Run` in place: `world` before
anything is planned, `command` after the commanded joints, `lags` before and `servo` after the servo, `gear`
after the gear, `load` after the cut, `bend` before the structure gives way, `tip` and `sense` at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import PchipInterpolator

from tests.plant import arm as arms
from tests.plant import chips, memory, path, turning
from tests.plant.programs import SHOWN_s, Track
from tests.plant.scene import DEGREE, GEAR_RATIO, JOINT_ROW, GRAVITY_m_s2, World
from tests.plant.waypoints import Waypoints

STEP_s = 0.001
SLOW = 4  # forces and bending every fourth sample
TAIL_s = 0.25
SIGN = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])  # the controller's angle about the hinge's z

Hooks = dict[str, Callable[["Run"], None]]


@dataclass(frozen=True)
class Mismatch:
    """Normal mismatch, which is never a cause: of one robot and process (case) and one day (run)."""

    stiffness: np.ndarray = field(default_factory=lambda: np.ones(10))
    coefficients: np.ndarray = field(default_factory=lambda: np.ones(6))
    gain: np.ndarray = field(default_factory=lambda: np.ones(3))
    lag_s: np.ndarray = field(default_factory=lambda: np.zeros(6))
    play_deg: np.ndarray = field(default_factory=lambda: np.zeros(6))
    play_start: np.ndarray = field(default_factory=lambda: np.zeros(6))
    transmission_deg: np.ndarray = field(default_factory=lambda: np.zeros(6))
    phase: np.ndarray = field(default_factory=lambda: np.zeros(6))
    shift_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    turn_rad: np.ndarray = field(default_factory=lambda: np.zeros(3))
    clocks_s: dict = field(default_factory=dict)
    force_zero_N: np.ndarray = field(default_factory=lambda: np.zeros(3))


class Run:
    """State of one run; arrays are per sample at `t_s` (fast) or `slow_s` (every fourth)."""

    def __init__(self, way: Waypoints | Track, world: World, mismatch: Mismatch, age_s: float = 0.0):
        self.way, self.mismatch = way, mismatch
        self.believed = world  # the world that controller and prediction assume
        self.world = world.but(stiffness_Nmm_rad=world.stiffness_Nmm_rad * mismatch.stiffness[:, None])
        self.world = self.world.cutting(coefficients=world.cutter.coefficients * mismatch.coefficients)
        self.age_s = age_s
        self.zero_rad = np.zeros(6)  # true minus indicated angle
        self.payload = []  # (kg, centre in the tool frame)
        self.clocks = {name: (offset, 0.0) for name, offset in mismatch.clocks_s.items()}
        self.jumps = {}  # table -> (time, seconds)
        self.units = {}
        self.depth_taper_mm = 0.0
        self.reshape: list = []  # Arm -> Arm: what is crooked in the arm's reference pose
        self.axes = None  # of the tool in `$BASE` where it is not upright
        self.pauses = ()  # of a long dwell: when, and the seconds that are not simulated
        self.spindle = ()  # from second, rpm; else as the world's cutter

    def body(self) -> arms.Arm:
        """The true arm."""
        arm = arms.reference_pose(self.world)
        for change in self.reshape:
            arm = change(arm)
        return arm

    def delay(self, table: str, offset_s: float, skew: float = 0.0) -> None:
        """Add an offset and a skew to a table's clock."""
        old = self.clocks.get(table, (0.0, 0.0))
        self.clocks[table] = (old[0] + offset_s, old[1] + skew)

    @property
    def velocity_mm_s(self) -> np.ndarray:
        """Velocity of the commanded path at the slow samples."""
        return self.rates(self.place_mm)[::SLOW]

    @staticmethod
    def rates(x: np.ndarray) -> np.ndarray:
        """Time derivative at the fast samples."""
        return np.gradient(x, STEP_s, axis=0)


def to_root(world: World, place_mm: np.ndarray) -> np.ndarray:
    """`$BASE` to the robot's root."""
    return place_mm @ world.base.axes.T + world.base.origin_mm


def to_base(world: World, place_mm: np.ndarray) -> np.ndarray:
    """The robot's root to `$BASE`."""
    return (place_mm - world.base.origin_mm) @ world.base.axes


def joints_for(world: World, place_mm: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    """The controller's angles at places in `$BASE`, with the tool upright or its axes there (n, 3, 3)."""
    axes = np.broadcast_to(np.eye(3), (len(place_mm), 3, 3)) if axes is None else axes
    return arms.inverse(world, to_root(world, place_mm), world.base.axes @ axes)


def _command(run: Run) -> None:
    if isinstance(run.way, Track):
        _follow(run, run.way)
    else:
        _plan(run)
    run.slow_s = run.t_s[::SLOW]
    run.reported_mm = run.place_mm.copy()
    run.elapsed_s = run.t_s.copy()
    for at_s, seconds in run.pauses:
        run.elapsed_s[run.t_s >= at_s] += seconds
    run.spindle_rad_s = np.full(len(run.t_s), run.world.cutter.spindle_rad_s)
    for from_s, rpm in run.spindle:
        run.spindle_rad_s[run.elapsed_s >= from_s] = rpm * np.pi / 30.0
    run.lag_s = np.broadcast_to(run.mismatch.lag_s + run.world.lag_s, run.q_cmd.shape).copy()


def _plan(run: Run) -> None:
    """The plant's own law of motion along waypoints."""
    run.links = path.chains(run.way, run.believed)
    if not run.links:
        raise ValueError("these waypoints go nowhere; give the joints as a track")
    if run.way.left_out_s is not None:
        begins = path.stands(run.way, run.links)
        long = run.way.left_out_s > 0.0
        run.pauses = tuple(zip(begins[long] + SHOWN_s, run.way.left_out_s[long], strict=True))
    last_s = run.links[-1].end_s + run.way.hold_s[-1]
    run.t_s = np.arange(0.0, last_s + TAIL_s, STEP_s)
    run.place_mm = path.commanded(run.links, run.t_s, run.believed)
    upright = run.way.turns_deg is None or not np.any(run.way.turns_deg)
    run.axes = None if upright else turning.axes_at(run.way, run.links, run.t_s)
    run.q_cmd = joints_for(run.believed, run.place_mm, run.axes)
    if np.abs(np.diff(run.q_cmd, axis=0)).max() > 0.1:
        raise ValueError("the wrist flips on these waypoints; give their joints as a track")


def _follow(run: Run, track: Track) -> None:
    """Joints that are given over time, smooth between their samples."""
    run.links = []
    run.t_s = np.arange(0.0, track.t_s[-1] + TAIL_s, STEP_s)
    run.q_cmd = PchipInterpolator(track.t_s, track.q_rad, axis=0)(np.minimum(run.t_s, track.t_s[-1]))
    place, axes = arms.pose(arms.reference_pose(run.believed), np.ascontiguousarray(run.q_cmd))
    run.place_mm, run.axes = to_base(run.believed, place), run.believed.base.axes.T @ axes


def _servo(run: Run) -> None:
    run.q_act = np.empty_like(run.q_cmd)
    for j in range(6):
        run.q_act[:, j] = memory.lag(run.q_cmd[:, j].copy(), run.lag_s[:, j].copy(), STEP_s)


def ripple(q_rad: np.ndarray, joint: int, amplitude_deg, harmonic: int, phase: float) -> np.ndarray:
    """Transmission error of one joint, rad."""
    return amplitude_deg * DEGREE * np.sin(harmonic * GEAR_RATIO[joint] * q_rad + phase)


def slack(q_rad: np.ndarray, gap_deg, start: float) -> np.ndarray:
    """Angle added by a play of ± gap/2, rad."""
    half = np.broadcast_to(np.asarray(gap_deg, float) * DEGREE / 2.0, q_rad.shape).copy()
    return memory.play(q_rad.copy(), half, start) - q_rad


def _gear(run: Run) -> None:
    run.q_load = run.q_act.copy()
    m = run.mismatch
    for j in range(6):
        q = run.q_act[:, j]
        if m.play_deg[j] > 0.0:
            run.q_load[:, j] += slack(q, m.play_deg[j], m.play_start[j])
        if m.transmission_deg[j] > 0.0:
            run.q_load[:, j] += ripple(q, j, m.transmission_deg[j], 1, m.phase[j])


def cut_at(run: Run, t_s: np.ndarray, place_mm: np.ndarray) -> chips.Cut:
    """Engagement at times, at their commanded places, in the material that the previous tooth has left."""
    starts, before_mm, gone_mm = [c.start_s for c in run.links], place_mm.copy(), np.zeros(len(t_s))
    owner = np.clip(np.searchsorted(starts, t_s, side="right") - 1, 0, None)
    for i, chain in enumerate(run.links):
        mine = owner == i
        gone_mm[mine] = path.distance(chain, t_s[mine] - run.world.cutter.tooth_s)
        before_mm[mine] = path.at_distance(chain, gone_mm[mine], run.believed)
    return chips.cut(place_mm, before_mm, owner.astype(float), gone_mm, run.pieces, run.world)


def take_cut(run: Run) -> None:
    """The cut of waypoints; a track is driven in the air."""
    if not run.links:
        n = len(run.slow_s)
        zero = np.zeros((n, 3))
        run.cut = chips.Cut(zero, zero, np.zeros(n), np.zeros(n), np.zeros((n, 2)))
        run.force_N, run.moment_Nmm, run.metres_cut = zero.copy(), zero.copy(), np.zeros(n)
        return
    run.pieces = chips.pieces(run.links, run.believed)
    place = run.place_mm[::SLOW]
    run.cut = cut_at(run, run.slow_s, place)
    turn = run.world.base.axes.T
    run.force_N = run.cut.force_N @ turn  # along the root's axes
    run.moment_Nmm = run.cut.moment_Nmm @ turn
    contact = run.cut.depth_mm > 0.0
    step = np.linalg.norm(np.diff(place, axis=0, prepend=place[:1]), axis=1)
    run.metres_cut = np.cumsum(step * contact) / 1000.0


def _weight(run: Run, arm, q_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment at the TCP of loads that are not in the model."""
    force, moment = np.zeros((len(q_rad), 3)), np.zeros((len(q_rad), 3))
    if run.payload:
        axes = arms.pose(arm, q_rad)[1]
        for kg, centre in run.payload:
            pull = np.array([0.0, 0.0, -GRAVITY_m_s2 * kg])
            force += pull
            moment += np.cross(axes @ np.asarray(centre), pull)
    return force, moment


def _structure(run: Run) -> None:
    arm = run.body()
    run.arm = arm
    q_true = run.q_load + run.zero_rad
    slow = np.ascontiguousarray(q_true[::SLOW])
    force, moment = _weight(run, arm, slow)
    turning = arms.torques(arm, slow, run.force_N + force, run.moment_Nmm + moment)
    angles = turning / run.world.stiffness_Nmm_rad
    angles[:, JOINT_ROW, 2] += run.extra_rad * SIGN
    rigid, _ = arms.pose(arm, slow)
    bent, _ = arms.bent(arm, slow, angles)
    run.twist_rad = angles[:, JOINT_ROW, 2] * SIGN  # about each joint, the controller's sign
    run.bending_mm = bent - rigid
    place, axes = arms.pose(arm, q_true)
    run.tip_mm = to_base(run.world, place + fast(run, run.bending_mm))
    run.tip_axes = run.world.base.axes.T @ axes
    run.part_mm = np.zeros((len(run.slow_s), 3))  # how far the part stands aside where it is cut


def joint_torques(run: Run) -> np.ndarray:
    """Moments about the six joints by the cut, the controller's sign, N·mm, at the slow samples."""
    arm = run.body()
    slow = np.ascontiguousarray(run.q_load[::SLOW])
    turning = arms.torques(arm, slow, run.force_N, run.moment_Nmm)
    return turning[:, JOINT_ROW, 2] * SIGN


def fast(run: Run, slow: np.ndarray) -> np.ndarray:
    """Slow columns at the fast samples, straight in between."""
    columns = [np.interp(run.t_s, run.slow_s, slow[:, k]) for k in range(slow.shape[1])]
    return np.stack(columns, axis=1)


def _frame(run: Run) -> None:
    """The day's tracker frame: a small shift and turn about the middle of the work."""
    run.tip_mm = run.tip_mm + run.mismatch.shift_mm + np.cross(run.mismatch.turn_rad, run.tip_mm)


def _sense(run: Run) -> None:
    """Force on the tool in the sensor's axes (those of the flange), gain and zero."""
    flange = run.tip_axes[::SLOW] @ run.believed.tool.axes.T
    run.sensor_axes = flange
    along = run.force_N @ run.world.base.axes
    run.sensed_N = np.einsum("nji,nj->ni", flange, along) * run.mismatch.gain + run.mismatch.force_zero_N
    moment = run.moment_Nmm @ run.world.base.axes
    run.sensed_Nmm = np.einsum("nji,nj->ni", flange, moment) * run.mismatch.gain


def _unbent(run: Run) -> None:
    run.extra_rad = np.zeros((len(run.slow_s), 6))


def _measured(run: Run) -> None:
    _frame(run)
    _sense(run)


STAGES: dict[str, Callable[[Run], None] | None] = {  # what is done before the hooks of each stage
    "world": None,
    "command": _command,
    "lags": None,
    "servo": _servo,
    "gear": _gear,
    "load": take_cut,
    "bend": _unbent,
    "tip": _structure,
    "sense": _measured,
}


def simulate(
    way: Waypoints | Track,
    world: World,
    effects: list[Hooks],
    mismatch=None,
    age_s=0.0,
    number=0,
    pauses=(),
    spindle=(),
) -> Run:
    """Drive waypoints or a track with these effects at work."""
    run = Run(way, world, mismatch or Mismatch(), age_s)
    run.number, run.pauses, run.spindle = number, pauses, spindle
    for stage, work in STAGES.items():
        if work is not None:
            work(run)
        for hooks in effects:
            if stage in hooks:
                hooks[stage](run)
    return run
