"""Forces and readings of force that are in no library.

An effect each: what happens, where that is known from, and when.
"""

import numpy as np

from tests.plant import memory
from tests.plant.effects.depends import force as force_
from tests.plant.effects.registry import SIZE, UNKNOWN, Draw, acting, declare, numbers
from tests.plant.robot import SLOW, GRAVITY_m_s2, Run, STEP_s
from tests.plant.scene import DEGREE


@declare(
    UNKNOWN,
    "force",
    0.1,
    1000.0,
    signal="force",
    all_runs=True,
    depends=force_("smooth", "time_smooth", "time_step", "travel", "place", links=("force", "mechanics")),
)
def cable_jerks_free(draw: Draw):
    """A cable hooks at the cell's fence, is drawn tight and jerks free: a pull that ends at once.

    It pulls like a spring with the way of the tip from where it hooked; at its breaking force or after some
    tenths of a second the hook slips and the load is gone within milliseconds.

    `size` in N just before it comes free.
    """
    number, at_s, lasts_s = int(draw.rng.integers(2)), draw.uniform(4.0, 10.0), draw.uniform(0.3, 1.2)

    def at(size):
        def load(run: Run):
            if run.number != number:
                return
            tight = (run.slow_s >= at_s - lasts_s) & (run.slow_s < at_s)
            way = run.place_mm[::SLOW] - np.array(
                [np.interp(at_s - lasts_s, run.t_s, x) for x in run.place_mm.T]
            )
            pull = -way * tight[:, None]
            largest = np.linalg.norm(pull, axis=1).max()
            rising = np.where(tight, (run.slow_s - at_s + lasts_s) / lasts_s, 0.0)[:, None]
            line = np.array([0.6, 0.6, 0.53]) * rising  # where the arm stands still while it is hooked
            run.force_N = run.force_N + size * (pull / largest if largest > 1.0 else line)

        moments = [{"run": f"run-{number + 1}", "t_s": at_s}]
        return numbers(N=size, lasts_s=lasts_s) | {"moments": moments}, {"load": load}

    return None, at


SEEN = ("force", "mechanics")


@declare(
    UNKNOWN,
    "force",
    0.05,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("smooth", "own_angle", "place", "travel", links=SEEN),
)
def cable_snag(draw: Draw):
    """A cable of the dress pack catches when A1 has turned so far: from there it pulls like a spring.

    A one-sided stop at an angle; when the arm turns back the cable is loose again.

    `size` in N per degree of A1 beyond the stop.
    """
    from_deg, side = draw.uniform(-1.2, 1.2), draw.sign()
    way = draw.direction()

    def load(run: Run, size: float):
        beyond = np.maximum(side * (run.q_load[::SLOW, 0] / DEGREE - from_deg), 0.0)
        run.force_N = run.force_N + size * beyond[:, None] * way

    return None, acting(load, N_per_deg=SIZE, from_deg=from_deg, side=side)


@declare(
    UNKNOWN,
    "force",
    0.01,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("loop", "own_angle", "reversals", "velocity", "place", links=("force", "mechanics")),
)
def carrier_drags(draw: Draw):
    """The cable carrier rubs along its trough: it drags against the motion, more the further A1 is turned.

    A chain that leaves its bend rests on more links; drag is friction times the weight that lies in the
    trough, here with the square of A1's angle from the middle, against the direction of motion.

    `size` in N at 3 degrees from the middle.
    """
    middle_deg = draw.uniform(-1.0, 1.0)

    def load(run: Run, size: float):
        angle = run.q_load[:, 0]
        along = np.tanh(run.rates(angle) / 0.002)[::SLOW]
        far = ((angle[::SLOW] / DEGREE - middle_deg) / 3.0) ** 2
        run.force_N = run.force_N + (size * far * along)[:, None] * np.array([0.0, 1.0, 0.0])

    return None, acting(load, N=SIZE, middle_deg=middle_deg)


@declare(
    UNKNOWN,
    "force",
    0.005,
    20.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force", "force_by_place", "noise", links=("force", "mechanics")),
)
def chip_packing(draw: Draw):
    """Chips pack in a slot and come loose: extra force in heaps, most where the cutter is enclosed.

    Without enough coolant aluminium chips weld to the flutes and are cut again; a recut chip costs up to as
    much as the cut itself, for tenths of a second.

    `size` is the mean of the heaps as a share of the cutting force.
    """
    seed, lasts_s = int(draw.rng.integers(1 << 30)), draw.uniform(0.15, 0.5)

    def load(run: Run, size: float):
        rng = np.random.default_rng([seed, run.number])
        n, keeps = len(run.slow_s), float(np.exp(-SLOW * STEP_s / lasts_s))
        heap = np.maximum(memory.coloured(rng.normal(size=n), keeps) - 0.8, 0.0)
        enclosed = np.minimum(run.cut.width_mm / run.world.cutter.diameter_mm, 1.0) ** 2
        more = (1.0 + size * 5.0 * heap * enclosed)[:, None]  # the mean of a heap is a fifth
        run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

    return None, acting(load, share=SIZE, lasts_s=lasts_s)


@declare(
    UNKNOWN,
    "force",
    0.1,
    200.0,
    signal="force",
    all_runs=True,
    depends=force_("drift", "time_since_start", "time_smooth", "time_step", links=SEEN),
)
def coolant_jet(draw: Draw):
    """The coolant jet pushes at the tool: full pressure at first, less once the line has filled.

    A jet of 20 l/min at 30 m/s gives up 10 N, at high pressure several times that (momentum, rho·Q·v). It is
    on from the first cutting move to the last.
    """
    way, falls_s, left = draw.direction(), draw.log_uniform(1.5, 6.0), draw.uniform(0.2, 0.6)

    def load(run: Run, size: float):
        wet = np.flatnonzero(run.cut.depth_mm > 0.0)
        if not len(wet):
            return  # no cut, no coolant
        on = (run.slow_s >= run.slow_s[wet[0]]) & (run.slow_s <= run.slow_s[wet[-1]])
        since = np.maximum(run.slow_s - run.slow_s[wet[0]], 0.0)
        push = size * on * (left + (1.0 - left) * np.exp(-since / falls_s))
        run.force_N = run.force_N + push[:, None] * way

    return None, acting(load, N=SIZE, falls_s=falls_s, left=left)


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force"),
)
def cross_talk(draw: Draw):
    """The force sensor's beams are not quite linear: a large side force shows as a force along the axis.

    Sheets state cross-talk of 1 to 3 % after a linear decoupling; what is left goes with the square of the
    load.

    `size` is the share of a force of 200 N that shows in another axis; it grows with the square.
    """
    order = draw.rng.permutation(3)

    def sense(run: Run, size: float):
        side = run.sensed_N[:, order[0]] - run.mismatch.force_zero_N[order[0]]
        run.sensed_N = run.sensed_N.copy()
        run.sensed_N[:, order[1]] += size * side**2 / 200.0

    return None, acting(sense, share=SIZE, of="xyz"[order[0]], into="xyz"[order[1]])


@declare(
    UNKNOWN,
    "force",
    1e-3,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("periodic", "metres_cut", "force", "time_smooth", links=("force", "mechanics")),
)
def edge_builds_up(draw: Draw):
    """Aluminium welds to the cutting edge, grows and breaks away: the force creeps up and falls again.

    A built-up edge changes the rake and the depth; its cycle goes with the length of cut, not with time
    (Trent and Wright, Metal Cutting).

    `size` is the share by which the force has grown when the edge breaks away.
    """
    cycle_m, begins = draw.uniform(0.08, 0.25), draw.uniform(0.0, 1.0)

    def load(run: Run, size: float):
        grown = np.mod(run.metres_cut / cycle_m + begins, 1.0)
        more = 1.0 + size * grown[:, None]
        run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

    return None, acting(load, share=SIZE, cycle_m=cycle_m)


@declare(
    UNKNOWN,
    "force",
    0.002,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force_by_place", "place", "force", links=SEEN),
)
def hard_spot(draw: Draw):
    """A weld or an inclusion in the block: the force is higher in one region of it.

    A repair weld in an aluminium block is harder by half; castings have chilled corners.
    """
    place, radius = draw.rng.uniform([30.0, -45.0], [130.0, 45.0]), draw.uniform(40.0, 70.0)

    def load(run: Run, size: float):
        away = np.linalg.norm(run.place_mm[::SLOW, :2] - place, axis=1) / radius
        harder = (1.0 + size * np.exp(-(away**2)))[:, None]
        run.force_N, run.moment_Nmm = run.force_N * harder, run.moment_Nmm * harder

    return None, acting(load, share=SIZE, place_mm=place, radius_mm=radius)


@declare(
    UNKNOWN,
    "force",
    0.01,
    500.0,
    signal="force",
    all_runs=True,
    depends=force_("periodic", "acceleration", "tone", links=SEEN),
)
def hose_swings(draw: Draw):
    """The hose pack hangs in a bow and swings when the arm accelerates: it pulls to and fro for seconds.

    A bow of 0.3 to 1 m swings like a pendulum at 0.5 to 1 Hz, f = sqrt(g/l) / 2 pi.

    `size` in N per 100 mm that the bow is aside.
    """
    bow_m, damping = draw.uniform(0.3, 1.0), draw.uniform(0.03, 0.1)
    hz = float(np.sqrt(GRAVITY_m_s2 / bow_m) / (2.0 * np.pi))

    def load(run: Run, size: float):
        aside = np.zeros((len(run.slow_s), 3))
        for k in (0, 1):
            hung = memory.second_order(run.place_mm[:, k].copy(), hz, damping, STEP_s)
            aside[:, k] = (hung - run.place_mm[:, k])[::SLOW]
        run.force_N = run.force_N + size * aside / 100.0

    return None, acting(load, N_per_100mm=SIZE, hz=hz, damping=damping)


@declare(
    UNKNOWN,
    "sensor",
    1e-4,
    10.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("smooth", "force"),
)
def sensor_saturates(draw: Draw):
    """An amplifier of the force sensor runs into its supply: large forces read too small.

    A gain set one step too high clips softly from a fraction of the range on; the bias of the tool's weight
    brings one axis nearer to it.

    `size` is the square of 300 N over the level at which the reading stops: 1 stops at 300 N.
    """
    bias_N = draw.uniform(-80.0, 80.0)

    def sense(run: Run, size: float):
        stop_N = 300.0 / np.sqrt(size)
        zero = stop_N * np.tanh(bias_N / stop_N)
        run.sensed_N = stop_N * np.tanh((run.sensed_N + bias_N) / stop_N) - zero

    return None, acting(sense, stop_N=lambda size: 300.0 / float(np.sqrt(size)), bias_N=bias_N)


@declare(
    UNKNOWN,
    "force",
    0.002,
    10.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("step", "time_step", "force", "metres_cut", links=SEEN),
)
def tool_chips(draw: Draw):
    """A cutting edge chips at one moment: from then on the cut costs more, in all later runs too.

    A chipped edge rubs where it should cut; forces rise by a tenth to a half within one revolution.

    `size` is the rise as a share of the force.
    """
    number, at_s = int(draw.rng.integers(2)), draw.uniform(5.0, 9.0)

    def at(size):
        def load(run: Run):
            after = run.number > number or (run.number == number) * (run.slow_s >= at_s)
            more = (1.0 + size * np.broadcast_to(after, len(run.slow_s)))[:, None]
            run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

        values = numbers(run=f"run-{number + 1}", at_s=at_s, size=size, unit="share of the force")
        return values, {"load": load}

    return None, at


def lifted(press: np.ndarray, hold: float, down_s: float) -> np.ndarray:
    """Lift in 0 ... 1: at once with the load beyond the hold, back with the pump's time."""
    out, now, keeps = np.empty(len(press)), 0.0, np.exp(-SLOW * STEP_s / down_s)
    for i, load in enumerate(press):
        now = max(now * keeps, min(max(load / hold - 1.0, 0.0), 1.0))
        out[i] = now
    return out


@declare(
    UNKNOWN,
    "force",
    1e-3,
    5.0,
    signal="force",
    needs=("cut",),
    all_runs=True,
    depends=force_("loop", "force_memory", "force", "force_by_place", links=("force", "mechanics", "part")),
)
def vacuum_lifts(draw: Draw):
    """A vacuum clamp lifts the part a little under side load and draws it down slowly: the cut is deeper.

    Holding force is pressure times area; where the load's lever reaches the seal it opens, the part rises by
    tenths, and the extra depth costs force until the pump has drawn it down.

    `size` is the extra force at full lift as a share.
    """
    hold_N, down_s = draw.uniform(60.0, 150.0), draw.uniform(0.3, 1.5)

    def load(run: Run, size: float):
        lift = lifted(np.linalg.norm(run.force_N[:, :2], axis=1), hold_N, down_s)
        more = 1.0 + size * lift[:, None]
        run.force_N, run.moment_Nmm = run.force_N * more, run.moment_Nmm * more

    return None, acting(load, share=SIZE, hold_N=hold_N, down_s=down_s)
