"""Families against dense matrices, and on signals whose dependence is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.components import (
    Grid,
    Place,
    free,
    odd,
    polynomials,
    products,
    smooth,
    smooth_in_each,
    smooth_sum,
)
from gcode2krl.gap.posterior.families import (
    AMPLITUDES,
    Columns,
    Rows,
    View,
    evidence_of,
    log_evidence,
    log_mean,
)
from gcode2krl.gap.posterior.gram import MOST
from gcode2krl.gap.posterior.study import studies
from gcode2krl.gap.thresholds import PosteriorThresholds
from tests.gap import constructed as c

COUNT = 500


def view_of(traces, nuisance=(), sigma=1.0):
    """Return rows, view and grid of traces beside white noise, without any effect in the model."""
    rows = Rows(c.likelihood(traces, nuisance, sigma))
    nothing = [np.zeros((*trace.shape[::-1], 0)) for trace in traces]
    view = View.of(rows, [trace.residual for trace in traces], nothing)
    return rows, view, Grid(traces, [sigma] * traces[0].shape[1])


def best_of(traces, sigma=1.0):
    rows, view, grid = view_of(traces, sigma=sigma)
    return studies(rows, [view], grid)[0]


def joint_traces(form, runs=3, sigma=1.0, seed=0):
    """Return servo traces of A1 and A2; ``form`` of the inputs and the number of a run is added to A1."""
    made = []
    for number in range(runs):
        blank = c.trace(np.zeros((COUNT, 2)), number=number)
        values = c.noise(COUNT, seed + number, sigma, 2)
        values[:, 0] += form(Admissible(blank), number)
        made.append(c.trace(values, number=number))
    return made


# Evidence


def test_the_evidence_is_that_of_dense_gaussians():
    one = c.trace(c.noise(60, 1))
    rows, view, _ = view_of([one], [[c.columns_nuisance("wave", np.sin(one.time_s))]])
    raw = np.stack([np.ones(60), one.time_s, one.time_s**2], axis=1)[None]
    columns = rows.of([raw])
    place = Place("A1", Where.JOINT, [np.ones((1, 60, 1))])
    found = evidence_of(
        view,
        place,
        Dependence.CONSTANT,
        [raw],
        Columns(columns),
        (np.eye(3),),
        np.ones((1, 2)),
    )

    nuisance = view.nuisance.dense
    plain = np.eye(60) + nuisance @ nuisance.T
    assert len(rows) == 60

    def log_density(covariance):
        _, det = np.linalg.slogdet(covariance)
        return -0.5 * det - 0.5 * view.residual @ np.linalg.solve(covariance, view.residual)

    dense = [log_density(plain + a**2 * columns @ columns.T) - log_density(plain) for a in AMPLITUDES]
    assert found.unbounded == pytest.approx(log_mean(np.array(dense)), abs=1e-6)


def test_the_log_mean_is_that_of_exponentials():
    values = np.array([[1.0, 2.0], [700.0, 0.0]])
    assert log_mean(values)[0] == pytest.approx(np.log(np.mean(np.exp(values[0]))))
    assert log_mean(values)[1] == pytest.approx(700.0 - np.log(2.0))


def test_columns_that_explain_nothing_cost_their_numbers():
    assert np.all(log_evidence(np.array([100.0, 10.0]), np.zeros(2)) < 0.0)


def test_nuisance_at_its_bound_leaves_the_rest_to_the_family():
    """A shift of 30 deviations: unbounded nuisance would take it for a cost, bounded nuisance may not."""
    one = c.trace(30.0 + c.noise(COUNT, 2))
    nuisance = [[c.columns_nuisance("zero", np.ones(COUNT))]]
    rows, view, grid = view_of([one], nuisance)
    study = studies(rows, [view], grid)[0]
    constant = next(each for each in study.evidences if each.on is Dependence.CONSTANT)
    assert float(np.abs(view.solved(view.cross)).max()) > MOST  # unbounded it would leave its bound
    assert constant.gain == pytest.approx(view.chi2 - COUNT, rel=0.02)
    assert constant.nats > 10.0 * constant.unbounded


# What a signal depends on


def _step(own, run):
    return 1.0 * (own.since_start_s > 4.3) if run == 1 else float(run > 1) + 0.0 * own.hours


@pytest.mark.parametrize(
    ("on", "form"),
    [
        # the motion is a sine: its acceleration is a function of its angle
        ("own angle|acceleration", lambda own, run: 3.0 * np.sin(40.0 * own.q_rad[:, 0])),
        ("velocity", lambda own, run: 8.0 * own.rate_rad_s[:, 0]),
        ("reversals", lambda own, run: 0.7 * np.sign(own.rate_rad_s[:, 0])),
        ("reversals", lambda own, run: np.sign(own.rate_rad_s[:, 0]) * np.exp(-own.since_start_s / 4.0)),
        ("run to run", lambda own, run: (1.0, -0.8, 0.4)[run] + 0.0 * own.hours),
        ("step in time", _step),
        ("tone", lambda own, run: np.sin(2.0 * np.pi * 3.3 * own.since_start_s + run)),
        ("constant", lambda own, run: 1.0 + 0.0 * own.hours),
    ],
)
def test_the_dependence_of_a_signal_is_found(on, form):
    study = best_of(joint_traces(form))
    best = study.evidences[0]
    assert best.place.name == "A1"
    assert best.on in [Dependence(each) for each in on.split("|")]
    assert study.p < 0.01


def test_a_step_has_its_moment_and_its_run():
    best = best_of(joint_traces(_step)).evidences[0]
    assert best.at[0] == 1
    assert best.at[1] == pytest.approx(4.3, abs=0.1)
    assert best.signal[2][-1, 0] == pytest.approx(1.0, abs=0.1)
    assert np.all(best.signal[0] == 0.0)


def test_a_tone_has_its_frequency():
    tone = best_of(joint_traces(lambda own, run: np.sin(2.0 * np.pi * 3.3 * own.since_start_s)))
    assert tone.evidences[0].at[1] == pytest.approx(3.3, abs=0.05)


def test_noise_depends_on_nothing():
    """Of twelve draws the largest family has p < 0.05 in one at most but for one in eight times."""
    p = [best_of(joint_traces(lambda own, run: 0.0, seed=100 * seed)).p for seed in range(12)]
    assert sum(each < 0.05 for each in p) <= 2
    top = [
        best_of(joint_traces(lambda own, run: 0.0, seed=100 * seed)).evidences[0].nats for seed in range(4)
    ]
    assert max(top) < 10.0


def test_a_shift_of_the_tip_has_its_direction():
    shift = np.array([0.3, -0.1, 0.2])
    traces = [c.trace(shift * (run > 0) + c.noise(COUNT, run, 0.02, 3), "mechanics", run) for run in range(3)]
    study = best_of(traces, sigma=0.02)
    tip = next(e for e in study.evidences if e.place.name == "tip" and e.on is Dependence.RUN_TO_RUN)
    assert tip.signal[1][0] == pytest.approx(shift, abs=0.01)
    assert tip.nats > study.evidences[0].nats - 10.0


# What a force and a torque remember


def force_inputs():
    """Return the motion with a force that comes and goes, no two times alike."""
    time_s = c.motion().time_s
    waves = [np.sin(2.0 * np.pi * hz * time_s + hz) for hz in (0.9, 1.7, 0.53)]
    return replace(c.motion(), force_base_N=80.0 * np.tanh(3.0 * np.stack(waves, axis=1)))


def force_study(form, sigma_N=2.0):
    made = []
    for number in range(2):
        blank = c.trace(np.zeros((COUNT, 3)), "force", number, force_inputs())
        added = form(blank) + c.noise(COUNT, number, sigma_N, 3)
        made.append(c.trace(added, "force", number, force_inputs()))
    return best_of(made, sigma=sigma_N)


@pytest.mark.parametrize("delay_s", [0.01, 0.045, 0.12])
def test_a_late_force_depends_on_its_own_rate(delay_s):
    best = force_study(lambda blank: blank.late(delay_s) - blank.nominal).evidences[0]
    assert (best.place.name, best.on) == ("force", Dependence.VELOCITY)


def dahl(x, width):
    """Return the smooth loop (n,) of Dahl (1968) along x, of unit height."""
    z = np.zeros(len(x))
    for i, step in enumerate(np.diff(x)):
        z[i + 1] = np.sign(step) + (z[i] - np.sign(step)) * np.exp(-abs(step) / width)
    return z


def test_a_force_sensor_with_a_loop_depends_on_the_force():
    best = force_study(lambda blank: 4.0 * np.stack([dahl(f, 20.0) for f in blank.nominal.T], axis=1))
    assert best.evidences[0].on is Dependence.FORCE
    (other, *_) = [each for each in best.evidences if each.on is not Dependence.FORCE]
    assert best.evidences[0].nats > 1.2 * other.nats


def test_a_hose_that_swings_depends_on_the_acceleration():
    """A pendulum of 0.5 m behind the tip, along x."""

    def pull(blank):
        at = blank.inputs.position_mm[:, 0] - blank.inputs.position_mm[0, 0]
        w = (9.81 / 0.5) ** 0.5
        _, hung, _ = signal.lsim(([w * w], [1.0, 0.12 * w, w * w]), at, blank.inputs.time_s)
        return np.outer(6.0 * (hung - at) / np.std(hung - at), [1.0, 0.0, 0.0])

    best = force_study(pull).evidences[0]
    assert (best.place.name, best.on) == ("force", Dependence.ACCELERATION)


def test_a_cable_that_drags_depends_on_reversals():
    def drag(blank):
        q = blank.inputs.q_cmd_rad[:, 0]
        angle = (q - q.min()) / np.ptp(q)
        return np.outer(12.0 * angle**2 * np.sign(np.gradient(q)), [0.0, 1.0, 0.0])

    best = force_study(drag).evidences[0]
    assert (best.place.name, best.on) == ("force", Dependence.REVERSALS)


@pytest.mark.parametrize(("link", "place"), [("mechanics", "tip"), ("force", "force")])
def test_metres_cut_move_the_tip_and_in_air_no_force(link, place):
    own = force_inputs()
    own.force_base_N[:200] = 0.0
    traces = [c.trace(np.zeros((COUNT, 3)), link, 0, own)]
    families = Grid(traces, [1.0] * 3).families(Dependence.METRES_CUT)
    cut = next(family for family in families if family.on is Dependence.METRES_CUT)
    assert cut.place.name == place
    assert cut.columns[0][:, :199].any() == (place == "tip")


@pytest.mark.parametrize("share", [0.03, 0.3])
@pytest.mark.parametrize("joint", [1, 2])
def test_a_smooth_loop_of_a_torque_is_no_time_in_the_run(share, joint):
    """Of narrow and of wide loops the family takes all but a hundredth."""
    traces, loops = [], []
    for number in range(3):
        values = c.noise(COUNT, number, 1.0, 6)
        torque = Admissible(c.trace(values, "gear", number)).torque_Nm[:, joint]
        loops.append(3.0 * dahl(torque, share * np.ptp(torque)))
        values[:, joint] += loops[-1]
        traces.append(c.trace(values, "gear", number))
    best = best_of(traces).evidences[0]
    assert (best.place.name, best.on) == (f"A{joint + 1}", Dependence.OWN_TORQUE)
    loop = np.concatenate(loops)
    assert np.mean((np.concatenate(best.signal)[:, 0] - loop) ** 2) < 0.01 * np.mean(loop**2)


# Functions


def test_smooth_functions_span_a_bend_and_are_shared_by_runs():
    x = [np.linspace(-1.0, 1.0, 200), np.linspace(0.0, 2.0, 300)]
    made = smooth(x)
    assert [each.shape[0] for each in made.columns] == [200, 300]
    y = np.concatenate([np.tanh(2.0 * each) for each in x])
    basis = np.concatenate(made.columns)
    left = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) < 0.02
    assert smooth_in_each(x).width == 2 * made.width
    assert smooth([np.ones(5)]).width == 0
    assert smooth_sum([np.stack([each, each**2, 0.0 * each], axis=1) for each in x]).width == 2 * made.width


def test_functions_that_do_nothing_are_left_out():
    made = free([np.stack([np.zeros(9), np.arange(9.0)], axis=1)])
    assert made.width == 1
    assert np.mean(made.columns[0] ** 2) == pytest.approx(1.0)


def test_odd_functions_are_odd():
    x = np.linspace(-3.0, 3.0, 31)
    (columns,) = odd([x])
    assert columns == pytest.approx(-columns[::-1])
    assert odd([np.zeros(4)])[0].shape == (4, 0)


def test_powers_and_products():
    (powers,) = polynomials([np.array([[0.0, 2.0], [10.0, 4.0]])], 2)
    assert powers.tolist() == [[1.0, -1.0, -1.0, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]]
    (made,) = products([np.array([[2.0, 3.0]])], [np.array([[5.0, 7.0]])])
    assert made.tolist() == [[10.0, 14.0, 15.0, 21.0]]


# Rows


def test_blocks_keep_white_noise_white():
    trace = c.trace(c.noise(3000, 5, 2.0), inputs=c.motion(12.0, 0.004))
    rows, view, _ = view_of([trace], sigma=2.0)
    assert len(rows) == 600
    assert np.var(view.residual) == pytest.approx(1.0, abs=0.15)
    assert rows.step_s == pytest.approx(0.02)


def test_one_component_alone_has_its_own_rows():
    _, view, _ = view_of([c.trace(c.noise(COUNT, 3, 1.0, 2))])
    assert view.at(1).residual.tolist() == view.residual[COUNT:].tolist()
    assert view.at(None) is view


def test_amplitudes_reach_from_a_tenth_of_the_noise_to_a_hundred_times_it():
    limits = PosteriorThresholds()
    assert AMPLITUDES.tolist() == list(limits.amplitudes) == sorted(limits.amplitudes)
    assert AMPLITUDES[0] <= 0.1
    assert AMPLITUDES[-1] >= 100.0
    assert limits.significant_p >= 1.0 / (1.0 + limits.flips)


def test_the_tail_goes_on_where_the_flips_end():
    sound = [best_of(joint_traces(lambda own, run: 0.0 * own.hours, seed=10 * i)).tail_p for i in range(6)]
    assert min(sound) > 1e-3
    strong = best_of(joint_traces(lambda own, run: 8.0 * own.rate_rad_s[:, 0]))
    assert strong.p == pytest.approx(1.0 / 201.0)
    assert strong.tail_p < 0.1 * strong.p
