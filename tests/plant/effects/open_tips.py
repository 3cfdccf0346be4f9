"""Movements of the tip, the part or what measures them, that are in no library.

An effect each: what happens, where that is known from, and when.
"""

import numpy as np

from tests.plant import masses, memory
from tests.plant.effects.depends import Depends
from tests.plant.effects.depends import tip as tip_
from tests.plant.effects.registry import SIZE, UNKNOWN, Draw, acting, declare
from tests.plant.effects.surroundings import grown
from tests.plant.robot import SLOW, Run, STEP_s, fast, to_root
from tests.plant.scene import euler


@declare(
    UNKNOWN,
    "set-up",
    1e-4,
    3.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("smooth", "own_torque", "place", "acceleration", "own_angle"),
)
def base_rocks(draw: Draw):
    """The robot's base plate stands on three of four feet and rocks over a diagonal as the arm passes it.

    Weight and inertia of the arm about the diagonal press one foot or the other down; near the balance the
    plate tips from one to the other, a turn of clearance over foot distance, here against a soft shim.

    `size` in mm at 1.5 m from foot to foot; the balance lies within the work.
    """
    side, soft = draw.sign(), draw.log_uniform(0.1, 0.5)
    line = np.array([np.cos(np.pi / 4.0), side * np.sin(np.pi / 4.0), 0.0])

    def tip(run: Run, size: float):
        moment = masses.moment_about(run, np.zeros(3)) @ line
        middle, wide = np.median(moment), max(float(moment.std()), 1.0)
        turn = size / 1500.0 * np.tanh((moment - middle) / (soft * wide))
        place = to_root(run.world, run.tip_mm)
        swing = np.cross(fast(run, turn[:, None] * line), place) @ run.world.base.axes
        run.tip_mm = run.tip_mm + swing

    return None, acting(tip, mm=SIZE, soft=soft, side=side)


STAND_mm = np.array([-1800.0, 1500.0, 400.0])


@declare(
    UNKNOWN,
    "sensor",
    1e-3,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("step", "time_step", "run_to_run", "noise"),
)
def beam_comes_back(draw: Draw):
    """The tracker loses its beam and starts anew from another distance: an offset till the next loss.

    An absolute distance meter sets the interferometer anew to 10 to 50 micrometres; chips or a hand in the
    beam do it some times a run (ASME B89.4.19, on re-acquisition).

    `size` in mm along the beam, drawn anew at each loss.
    """
    seed, every_s = int(draw.rng.integers(1 << 30)), draw.uniform(3.0, 7.0)

    def tip(run: Run, size: float):
        rng = np.random.default_rng([seed, run.number])
        losses = np.cumsum(rng.exponential(every_s, 12))
        offsets = np.concatenate([[0.0], rng.normal(size=12)])
        beam = run.tip_mm - STAND_mm
        beam = beam / np.linalg.norm(beam, axis=1, keepdims=True)
        along = offsets[np.searchsorted(losses, run.t_s)]
        run.tip_mm = run.tip_mm + size * along[:, None] * beam

    return None, acting(tip, mm=SIZE, every_s=every_s)


GROWS_s, FADES_s = 0.25, 0.1


def swollen(deep: np.ndarray, dt_s: float) -> np.ndarray:
    """Amplitude 0 ... 1 that grows exponentially where it is deep, up to 1, and fades elsewhere."""
    out, now = np.empty(len(deep)), 0.02
    for i in range(len(deep)):
        now += dt_s * (now * (1.0 - now) / GROWS_s if deep[i] else -(now - 0.02) / FADES_s)
        out[i] = now
    return out - 0.02


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    3.0,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("periodic", "force", "tone", "force_by_place"),
)
def chatter(draw: Draw):
    """Mode-coupling chatter of a robot: the arm's slow mode grows while the tool is deep in the material.

    Two modes of nearly equal stiffness feed each other above a depth of cut; with robots this comes at their
    structural 8 to 20 Hz, not at the spindle's (Pan, Zhang, Zhu, Wang 2006, "Chatter analysis of robotic
    machining process").
    """
    hz, way, limit_mm = draw.uniform(8.0, 20.0), draw.direction(), draw.uniform(1.5, 3.5)

    def tip(run: Run, size: float):
        grown = fast(run, swollen(run.cut.depth_mm > limit_mm, SLOW * STEP_s)[:, None])
        wave = np.sin(2.0 * np.pi * hz * run.t_s)[:, None]
        run.tip_mm = run.tip_mm + size * grown * wave * way

    return None, acting(tip, mm=SIZE, hz=hz, limit_mm=limit_mm)


@declare(
    UNKNOWN,
    "geometry",
    1e-4,
    1.0,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("loop", "force_memory", "force", "own_torque_memory"),
)
def collet_tilts(draw: Draw):
    """A worn collet lets the tool tilt under side load, and it stays tilted until the load turns it back.

    The shank sits on two rings; with clearance c over a grip of g the tip of a tool of length l moves by
    c·l/g, with friction that holds it. A bell-mouthed collet of 0.01 mm clearance gives tens of micrometres
    at the tip.

    `size` in mm at the tip, reached at 60 N beyond the friction.
    """
    grip_N = draw.uniform(20.0, 80.0)

    def tip(run: Run, size: float):
        side = (run.force_N @ run.world.base.axes)[:, :2]
        grip = np.full(len(side), grip_N)
        moved = [np.tanh(memory.play(side[:, k].copy(), grip, 0.0) / 60.0) for k in (0, 1)]
        aside = np.stack([*moved, np.zeros(len(side))], axis=1)
        run.tip_mm = run.tip_mm + size * fast(run, aside)

    return None, acting(tip, mm=SIZE, grip_N=grip_N)


@declare(UNKNOWN, "geometry", 0.001, 1.0, signal="tcp", all_runs=True, depends=tip_("smooth", "time_smooth"))
def crane_passes(draw: Draw):
    """A hall crane passes: the floor settles under its rail and rises again, within seconds.

    A slab under a moving load bends by tenths of a millimetre over metres; the robot's foot tilts and the
    tracker's stand does not tilt alike. It happens once, in one run.
    """
    number, at_s, width_s = int(draw.rng.integers(3)), draw.uniform(4.0, 9.0), draw.uniform(0.8, 2.5)
    way = draw.direction() * np.array([0.5, 0.5, 1.0])

    def tip(run: Run, size: float):
        if run.number == number:
            under = np.exp(-0.5 * ((run.t_s - at_s) / width_s) ** 2)
            run.tip_mm = run.tip_mm - size * under[:, None] * way

    return None, acting(tip, mm=SIZE, run=f"run-{number + 1}", at_s=at_s, width_s=width_s)


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("periodic", "tone", "time_smooth"),
)
def floor_sways(draw: Draw):
    """A press next door: the floor sways in bursts that die away, whatever the robot does.

    The stroke of a press or a passing truck sets the slab in motion at its own 1.5 to 4 Hz, lightly damped.
    """
    way, hz, every = draw.direction(), draw.uniform(1.5, 4.0), draw.uniform(3.0, 6.0)

    def tip(run: Run, size: float):
        since = np.mod(run.elapsed_s + 0.7, every)
        burst = np.exp(-since / 0.6) * np.sin(2.0 * np.pi * hz * since)
        run.tip_mm = run.tip_mm + size * burst[:, None] * way

    return None, acting(tip, mm=SIZE, hz=hz, every_s=every)


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    1.0,
    signal="tcp",
    all_runs=True,
    depends=tip_("loop", "acceleration", "reversals", "jerk"),
)
def nest_rattles(draw: Draw):
    """The reflector's magnet nest is loose on its post: it stays where the last jolt has left it.

    Friction holds the nest up to an acceleration; beyond it slips, by hundredths of a millimetre, against the
    jolt.

    `size` in mm, the whole slack; friction holds up to 0.2 to 0.6 m/s².
    """
    holds = draw.uniform(200.0, 600.0)

    def tip(run: Run, size: float):
        jolt = run.rates(run.rates(run.place_mm))
        aside = np.zeros_like(jolt)
        for k in range(3):
            smooth = memory.lag(jolt[:, k].copy(), np.full(len(jolt), 0.01), STEP_s)
            held = memory.play(smooth, np.full(len(jolt), holds), 0.0)
            aside[:, k] = -0.5 * np.tanh(held / holds)
        run.tip_mm = run.tip_mm + size * aside

    return None, acting(tip, mm=SIZE, holds_mm_s2=holds)


@declare(
    UNKNOWN,
    "geometry",
    1e-3,
    0.5,
    signal="tcp",
    all_runs=True,
    depends=tip_("step", "time_since_start", "time_step", "spindle_speed", "temperature"),
    moments=True,
)
def preload_jump(draw: Draw):
    """The spindle's bearings lose their preload spring's friction at one speed or warmth: the nose jumps
    axially.

    Outer rings on springs stick in their seats and let go at once as the rings warm; the jump of 5 to 30
    micrometres comes at the same time after each start of the spindle, and goes when it cools.

    `size` in mm along the tool, once the shaft has a part of its warmth.
    """
    warms_s, lets_go = draw.uniform(5.0, 12.0), draw.uniform(0.3, 0.6)

    def tip(run: Run, size: float):
        free = grown(run, warms_s) >= lets_go
        run.tip_mm = run.tip_mm - size * free[:, None] * run.tip_axes[:, :, 2]

    return None, acting(tip, mm=SIZE, warms_s=warms_s, lets_go=lets_go)


@declare(UNKNOWN, "sensor", 0.002, 0.5, signal="tcp", all_runs=True, depends=tip_("smooth", "place"))
def reflector_incidence(draw: Draw):
    """The reflector's mirrors are not centred in its ball: the place read depends on how the beam comes in.

    Off-centre mirrors or a wrong index of a solid prism move the apparent centre across the beam with the
    angle of incidence, up to 0.05 mm and more at 30 degrees (ASME B89.4.19 tests for it). The ball keeps its
    orientation in the tool and looks 25 degrees past the tracker, so the angle changes with the place.

    `size` in mm at 30 degrees of incidence; the tracker stands 1 m from the work.
    """
    side = draw.uniform(-0.6, 0.6) + np.pi
    past = euler(25.0 * draw.sign(), 0.0, 0.0)
    stand = np.array([1000.0 * np.cos(side) + 80.0, 1000.0 * np.sin(side), draw.uniform(100.0, 500.0)])

    def tip(run: Run, size: float):
        beam = stand - run.tip_mm
        beam = beam / np.linalg.norm(beam, axis=1, keepdims=True)
        middle = past @ stand / np.linalg.norm(stand)
        aim = np.einsum("nij,j->ni", run.tip_axes, middle)  # where the ball looks
        cosine = np.clip(np.sum(beam * aim, axis=1), -1.0, 1.0)
        across = aim - cosine[:, None] * beam
        angle = np.arccos(cosine)[:, None]
        unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        run.tip_mm = run.tip_mm + size * (np.degrees(angle) / 30.0) ** 2 * unit

    return None, acting(tip, mm=SIZE, stand_mm=stand)


@declare(UNKNOWN, "sensor", 0.002, 3.0, signal="tcp", all_runs=True, depends=tip_("step", "run_to_run"))
def reflector_reseats(draw: Draw):
    """The reflector's ball sits anew in its nest before each run: another place each time, beyond the usual.

    Dirt or a chip in a magnetic nest is worth hundredths to tenths of a millimetre; within a run nothing
    moves.
    """
    seed = int(draw.rng.integers(1 << 30))

    def tip(run: Run, size: float):
        way = np.random.default_rng([seed, run.number]).normal(size=3)
        run.tip_mm = run.tip_mm + run.tip_axes @ (size * way)

    return None, acting(tip, mm=SIZE)


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    0.5,
    signal="tcp",
    all_runs=True,
    depends=tip_("drift", "time_since_start", "spindle_speed", "time_smooth"),
)
def spindle_bow(draw: Draw):
    """The spindle's housing warms on the side of the drive: the tool's axis bows sideways and tilts.

    A motor or a belt on one side of a spindle gives a gradient across the housing; the nose moves by tens of
    micrometres within the first minutes, at high speed sooner (ISO 230-3 measures it with five probes).

    It overshoots: the near side warms first, the far side follows.
    """
    angle, quick_s, late_s = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(1.5, 4.0), draw.uniform(6.0, 15.0)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])

    def tip(run: Run, size: float):
        bow = grown(run, quick_s) - 0.8 * grown(run, late_s)
        run.tip_mm = run.tip_mm + size * bow[:, None] * (run.tip_axes @ way)

    return None, acting(tip, mm=SIZE, quick_s=quick_s, late_s=late_s)


MIDDLE_mm = np.array([80.0, 0.0])


@declare(
    UNKNOWN,
    "part",
    0.001,
    1.0,
    signal="scan",
    needs=("cut", "scan"),
    all_runs=True,
    depends=Depends("part", ("metres_cut", "time_smooth", "place"), "drift", ("part",)),
)
def stress_release(draw: Draw):
    """Rolled plate bows when its skin is cut away: the robot's tip is where it should be, the part is not.

    Residual stress in 30 mm aluminium plate is worth tenths of a millimetre of bow; it comes with the
    material that is removed, most of it when the skin is through, and it stays (Heymès et al. 1997, on 7xxx
    plate).

    `size` in mm of bow 80 mm from the middle, upwards; each run cuts a fresh block.

    Where the plate has risen under the tool the cut is too deep; for the scan it is drawn flat again.
    """
    skin_m, bend = draw.uniform(0.1, 0.35), draw.uniform(0.3, 1.0)

    def tip(run: Run, size: float):
        freed = 1.0 / (1.0 + np.exp(-(run.metres_cut - skin_m) / (0.2 * skin_m)))
        out = (run.place_mm[::SLOW, :2] - MIDDLE_mm) / 80.0
        bow = 0.5 + np.minimum(out[:, 0] ** 2, 2.0) + bend * np.minimum(out[:, 1] ** 2, 2.0)
        run.part_mm = run.part_mm + (size * freed * bow)[:, None] * np.array([0.0, 0.0, 1.0])

    return None, acting(tip, mm=SIZE, skin_m=skin_m)


@declare(
    UNKNOWN,
    "geometry",
    1e-3,
    3.0,
    signal="tcp",
    hours=True,
    all_runs=True,
    depends=tip_("drift", "wall_clock", "temperature", "time_smooth", "run_to_run"),
)
def sunny_side(draw: Draw):
    """The sun through a window warms one side of the upper arm: it bows away from the sun, until it sets.

    A beam of height h with dT across it bows by alpha·dT·L²/(2h): 1.1 m of aluminium, 0.25 m high and 4 K
    make 0.2 mm. The bow turns with A1, so that its direction in the room changes with the pose.

    `size` in mm at noon, which comes some hours after the first run.
    """
    noon_h, side = draw.uniform(1.0, 4.0), draw.sign()

    def tip(run: Run, size: float):
        hours = (run.age_s + run.elapsed_s) / 3600.0
        sun = np.maximum(np.cos(np.pi / 2.0 * (hours - noon_h) / 4.0), 0.0)
        turn = -run.q_load[:, 0] + side * np.pi / 2.0
        way = np.stack([np.cos(turn), np.sin(turn), -0.3 * np.ones(len(turn))], axis=1)
        run.tip_mm = run.tip_mm + size * sun[:, None] * way

    return None, acting(tip, mm=SIZE, noon_h=noon_h)


@declare(
    UNKNOWN, "sensor", 0.001, 0.5, signal="tcp", all_runs=True, depends=tip_("smooth", "time_smooth", "noise")
)
def thermal_gusts(draw: Draw):
    """Gusts of warm air from a door or a heater cross the tracker's beam: seconds of wander, then quiet.

    The beam's bend goes with the temperature gradient across it; in a gust it changes within tenths of a
    second (Estler et al. 2002, on large-scale metrology).
    """
    seed, memory_s, lasts_s = int(draw.rng.integers(1 << 30)), draw.uniform(0.3, 1.0), draw.uniform(1.0, 2.5)
    beam = draw.direction() * np.array([1.0, 1.0, 0.2])

    def tip(run: Run, size: float):
        rng = np.random.default_rng([seed, run.number])
        n, keeps = len(run.t_s), float(np.exp(-STEP_s / memory_s))
        gust = np.zeros(n)
        for start in rng.uniform(0.0, run.t_s[-1], 3):
            gust += np.exp(-0.5 * ((run.t_s - start) / (0.4 * lasts_s)) ** 2)
        wander = np.stack([memory.coloured(rng.normal(size=n), keeps) for _ in range(3)], axis=1)
        along = beam / np.linalg.norm(beam)
        across = wander - (wander @ along)[:, None] * along
        run.tip_mm = run.tip_mm + size * gust[:, None] * across

    return None, acting(tip, mm=SIZE, memory_s=memory_s, lasts_s=lasts_s)


RUN_Ns = 2000.0  # impulse of one run of these programs


@declare(
    UNKNOWN,
    "geometry",
    0.001,
    0.5,
    signal="tcp",
    needs=("cut",),
    all_runs=True,
    depends=tip_("drift", "metres_cut", "force", "run_to_run", "time_smooth"),
)
def tool_creeps(draw: Draw):
    """The tool creeps out of its holder as the cut shakes it, and is not pushed back between the runs.

    The helix pulls the shank; each tooth lets it slip by a little, so that it creeps with the impulse of the
    force (pull-out of shrink and collet chucks, a known danger in hard roughing).

    `size` in mm for 2000 N·s.
    """
    over_N = draw.uniform(0.0, 60.0)

    def tip(run: Run, size: float):
        press = np.maximum(np.linalg.norm(run.force_N, axis=1) - over_N, 0.0)
        impulse = np.cumsum(press) * SLOW * STEP_s + run.number * RUN_Ns
        out = fast(run, impulse[:, None]) / RUN_Ns
        run.tip_mm = run.tip_mm - size * out * run.tip_axes[:, :, 2]

    return None, acting(tip, mm=SIZE, over_N=over_N)
