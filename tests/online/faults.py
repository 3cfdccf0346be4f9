"""Drive every state of an RSI session with every fault, and measure the largest step of the correction.

An episode brings a session into one phase, adds a fault for some cycles, and goes on. Every answer is
checked: finite, within the largest correction, at most one step from the answer before (or from zero, where
the controller was started anew), no answer once closed, nothing changed once held, the IPOC echoed.
Telegrams are made in memory; one in 50 goes through text and parser.
"""

import itertools
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl import load_cell
from gcode2krl import robot as arm
from gcode2krl.cell import Cell
from gcode2krl.cell.sections.online import Gains, Online, Probe, RobotLink
from gcode2krl.online.compensator import Compensator, build_compensator
from gcode2krl.online.limits import Bounds
from gcode2krl.online.server import warm_up
from gcode2krl.online.session import Phase, Session, begin, exchange, silent
from gcode2krl.online.telegram import Answer, MalformedError, Telegram, answer_text, parse
from gcode2krl.pilot import Knots, PilotHeader
from gcode2krl.units import DEG_PER_RAD

Floats = np.ndarray
ROUNDING = 1e-9
AS_TEXT = 0.02
START_MM = np.array([50.0, 0.0, 40.0])
GARBAGE = (
    b"",
    b"\x00\xff" * 300,
    b"<Rob",
    b'<Rob Type="KUKA"><RIst X="1"/></Rob>',
    b'<!DOCTYPE x [<!ENTITY a "aaaa">]><Rob>&a;</Rob>',
    b"<Rob>" + b"<A/>" * 2000 + b"</Rob>",
)


@dataclass
class Robot:
    """A controller: its program, and its reaction to corrections."""

    device: Compensator
    jacobian: Floats
    """(3, 6) of the tip, mm a rad."""
    q_rad: Floats
    rng: np.random.Generator
    ipoc: int = 5_000_000
    relative: bool = False
    ignores: bool = False
    lag: float = 1.0
    moves: bool = False
    noise_mm: float = 0.0
    position_mm: Floats = field(default_factory=START_MM.copy)
    told: dict[str, float] = field(default_factory=dict)
    reports: bool = True
    """POSCORRMON is in the telegram."""

    def __post_init__(self) -> None:
        width = len(self.device.bounds.most)
        self.asked, self.applied = np.zeros(width), np.zeros(width)
        self.waiting = deque([np.zeros(width)] * int(self.rng.integers(1, 5)))

    @property
    def cycle_ms(self) -> int:
        return round(1000.0 * self.device.settings.cycle_s)

    def telegram(self) -> Telegram:
        """Return the telegram of this cycle."""
        shift = self.applied if len(self.applied) == 3 else self.jacobian @ self.applied
        noise = self.rng.normal(0.0, self.noise_mm, 3) if self.noise_mm else 0.0
        nan = np.full(6, np.nan)
        told = {"knot": np.nan, "checksum": np.nan, "override_percent": np.nan, "t1": np.nan, **self.told}
        return Telegram(
            ipoc=self.ipoc,
            position_mm=self.position_mm + shift + noise,
            command_mm=self.position_mm.copy(),
            q_rad=self.q_rad,
            q_command_rad=self.q_rad,
            late=0.0,
            monitor_mm=shift.copy() if self.reports else nan[:3],
            values=nan[:4],
            load=nan,
            **told,
        )

    def take(self, answer: Answer | None) -> None:
        """Take an answer, None if there is none (the last correction stays), and go on to the next cycle."""
        if answer is not None and answer.ipoc == self.ipoc:
            self.asked = answer.correction.copy()
        self.waiting.append(np.zeros_like(self.asked) if self.ignores else self.asked)
        now = self.waiting.popleft()
        self.applied = self.applied + (now if self.relative else self.lag * (now - self.applied))
        self.ipoc += self.cycle_ms
        if self.moves:
            self.position_mm = self.position_mm + np.array([25.0, 0.0, 0.0]) * self.device.settings.cycle_s

    def start_anew(self, ipoc: int) -> None:
        """RSI restarts: no correction."""
        self.asked, self.applied = np.zeros_like(self.asked), np.zeros_like(self.applied)
        self.waiting = deque([np.zeros_like(self.asked)] * len(self.waiting))
        self.ipoc = ipoc


@dataclass
class Report:
    """Sum of all episodes."""

    cycles: int = 0
    answers: int = 0
    largest_step: float = 0.0
    """Largest step relative to the limit."""
    largest_rate: float = 0.0
    """The same over the controller's time between two answers."""
    largest_sum: float = 0.0
    ended: Counter[str] = field(default_factory=Counter)
    met: set[tuple[str, str]] = field(default_factory=set)
    """(phase, fault) that really coincided."""
    violations: list[str] = field(default_factory=list)
    slowest_s: float = 0.0


@dataclass
class Watch:
    """Checks the answers of one episode."""

    device: Compensator
    report: Report
    name: str
    last: Floats = field(default_factory=lambda: np.zeros(0))
    last_ipoc: int = -1
    ended: Phase | None = None

    def __post_init__(self) -> None:
        self.last = np.zeros(len(self.device.bounds.most))

    def see(self, before: Session, session: Session, answer: Answer | None, ipoc: int) -> None:
        """Take one exchange."""
        report, bounds = self.report, self.device.bounds
        if before.phase is Phase.CLOSED and answer is not None:
            self._fail("answered after the end")
        if answer is None:
            return
        if answer.ipoc != ipoc:
            self._fail("another IPOC")
        if before.phase is Phase.HELD and (answer.correction != before.sent).any():
            self._fail("a held correction changed")
        if session.phase is not Phase.RUNNING and answer.ready:
            self._fail("ready, but not running")
        step = in_steps(answer.correction - self.last, bounds)
        if not np.isfinite(answer.correction).all() or step > 1.0 + ROUNDING:
            self._fail(f"a step of {step:.4g} limits ({before.phase.value} -> {session.phase.value})")
        cycles = max((ipoc - self.last_ipoc) / (1000.0 * bounds.cycle_s), 1.0) if self.last_ipoc >= 0 else 1.0
        probe = self.device.settings.probe.amplitude_mm if bounds.is_vector else 0.0
        most = max(float(bounds.most[0]), probe) if bounds.is_vector else 1.0
        size = (
            np.linalg.norm(answer.correction)
            if bounds.is_vector
            else np.abs(answer.correction / bounds.most).max()
        )
        if size > most * (1.0 + ROUNDING):
            self._fail(f"a correction of {size:.4g}")
        report.answers += 1
        report.largest_step = max(report.largest_step, step)
        report.largest_rate = max(report.largest_rate, step / cycles)
        report.largest_sum = max(report.largest_sum, float(size) / most)
        self.last, self.last_ipoc = answer.correction.copy(), ipoc

    def start_anew(self) -> None:
        """The controller has no correction any more."""
        self.last = np.zeros_like(self.last)

    def _fail(self, words: str) -> None:
        self.report.violations.append(f"{self.name}: {words}")


def in_steps(change: Floats, bounds: Bounds) -> float:
    """Return a change of the correction in largest steps."""
    shares = change / bounds.step
    return float(np.linalg.norm(shares) if bounds.is_vector else np.abs(shares).max())


# faults: each may change the robot, the telegram, the load, or say how the telegram comes


@dataclass
class Cycle:
    """What a fault may change in one cycle."""

    robot: Robot
    telegram: Telegram
    load: Floats
    first: bool
    """True in the first cycle of the fault."""
    rng: np.random.Generator
    comes: str = "once"
    """once, never, twice, late, garbage"""


Fault = Callable[[Cycle], None]


def _comes(how: str) -> Fault:
    def fault(now: Cycle) -> None:
        now.comes = how

    return fault


def _jump(column: str, size: float) -> Fault:
    def fault(now: Cycle) -> None:
        value = getattr(now.telegram, column)
        off = size * np.sign(now.rng.normal(size=value.shape))
        now.telegram = replace(now.telegram, **{column: np.nan_to_num(value) + off})

    return fault


def _ipoc(by: Callable[[Cycle], int]) -> Fault:
    def fault(now: Cycle) -> None:
        if now.first:
            now.robot.ipoc = max(now.robot.ipoc + by(now), 1)
            now.telegram = replace(now.telegram, ipoc=now.robot.ipoc)

    return fault


def _load(value: float, columns: slice = slice(0, 6)) -> Fault:
    def fault(now: Cycle) -> None:
        now.load[columns] = value

    return fault


def _sets(**attributes: object) -> Fault:
    def fault(now: Cycle) -> None:
        for name, value in attributes.items():
            setattr(now.robot, name, value)

    return fault


def _tells(**told: float) -> Fault:
    def fault(now: Cycle) -> None:
        now.robot.told |= told

    return fault


def _stalls(now: Cycle) -> None:
    """The robot is stuck while its program goes on."""
    now.telegram = replace(
        now.telegram, command_mm=now.telegram.command_mm + np.array([0.0, 0.3 * now.rng.random(), 5.0])
    )


def _bends(now: Cycle) -> None:
    """Joints at their limits, or anywhere."""
    q = now.rng.uniform(-4.0, 4.0, 6)
    now.telegram = replace(now.telegram, q_rad=q, q_command_rad=q)


def _restarts(now: Cycle) -> None:
    """RSI is switched off and on again: it takes longer than the controller waits for answers."""
    if now.first:
        ahead = now.rng.choice([10, 100, 1000, 100_000, -1_000_000]) * now.robot.cycle_ms
        now.robot.start_anew(max(now.robot.ipoc + int(ahead), 1))
        now.telegram = now.robot.telegram()
        now.comes = "anew"


def _restarts_relative(now: Cycle) -> None:
    _restarts(now)
    now.robot.relative = True


FAULTS: dict[str, Fault] = {
    "nothing": lambda now: None,
    "lost telegrams": _comes("never"),
    "late telegrams": _comes("late"),
    "telegrams twice": _comes("twice"),
    "garbage between": _comes("garbage"),
    "silence of a second": _comes("silent"),
    "IPOC off the cycle": _ipoc(lambda now: 3),
    "IPOC ahead": _ipoc(lambda now: int(now.rng.integers(2, 40)) * now.robot.cycle_ms),
    "IPOC far ahead": _ipoc(lambda now: 10**9),
    "IPOC back": _ipoc(lambda now: -int(now.rng.integers(1, 200)) * now.robot.cycle_ms),
    "IPOC far back": _ipoc(lambda now: -4_000_000),
    "RIst jumps by 6 mm": _jump("position_mm", 6.0),
    "RIst jumps by 1e9 mm": _jump("position_mm", 1e9),
    "RIst jumps by 0.3 mm": _jump("position_mm", 0.3),
    "RSol jumps by 6 mm": _jump("command_mm", 6.0),
    "RSol jumps by 1e90 mm": _jump("command_mm", 1e90),
    "AIPos jumps by 0.5 rad": _jump("q_rad", 0.5),
    "ASPos jumps by 0.5 rad": _jump("q_command_rad", 0.5),
    "AIPos jumps by 1e90 rad": _jump("q_rad", 1e90),
    "POSCORRMON jumps by 5 mm": _jump("monitor_mm", 5.0),
    "joints anywhere": _bends,
    "the robot is stuck": _stalls,
    "sensor NaN": _load(np.nan),
    "sensor inf": _load(np.inf),
    "sensor silent in one channel": _load(np.nan, slice(4, 5)),
    "a force of 5 kN": _load(5000.0, slice(0, 1)),
    "a force step of 1.9 kN": _load(1900.0, slice(1, 2)),
    "a moment of 1e15 Nmm": _load(1e15, slice(3, 6)),
    "pilot: another checksum": _tells(checksum=1.0),
    "pilot: knots out of order": lambda now: now.robot.told.update(knot=float(now.rng.integers(-3, 9))),
    "pilot: ends": _tells(knot=np.nan),
    "pilot: a knot of 1e12": _tells(knot=1e12),
    "override 30 %": _tells(override_percent=30.0),
    "T1": _tells(t1=1.0),
    "the robot adds up": _sets(relative=True),
    "the robot ignores": _sets(ignores=True),
    "the robot is slow": _sets(lag=0.02),
    "RIst is noisy": _sets(noise_mm=1.0),
    "POSCORRMON ends": _sets(reports=False),
    "RSI anew": _restarts,
    "RSI anew, relative": _restarts_relative,
}
PHASES = tuple(phase for phase in Phase if phase is not Phase.WAITING)


# episodes


def settings_at_random(rng: np.random.Generator, axis: bool) -> Online:
    """Return settings of every kind."""
    rate, step = float(rng.choice([50.0, 20.0, 200.0])), float(rng.choice([0.25, 0.05, 1.0]))
    cycle = float(rng.choice([0.004, 0.012]))
    gains = Gains(
        p=float(rng.choice([1.0, 0.5, 3.0, -2.0])),
        i_1_s=float(rng.choice([0.0, 0.0, 20.0])),
        d_s=float(rng.choice([0.0, 0.0, 0.02])),
    )
    probe = Probe(amplitude_mm=min(0.1, step, rate * cycle), rest_cycles=5, settle_cycles=8, most_cycles=12)
    return Online(
        cycle_s=cycle,
        mode="axis" if axis else "cartesian",
        rate_mm_s=rate,
        step_mm=step,
        most_mm=float(rng.choice([2.5, 0.5, 10.0])),
        gains=gains,
        axis_gains=(gains,) * 6,
        probe=probe,
        link=RobotLink(lost_cycles=int(rng.choice([5, 1, 50]))),
    )


def pilot() -> tuple[Knots, PilotHeader]:
    """Return a sidecar whose force steps."""
    time_s = np.array([0.1, 0.25, 0.9, 1.0])
    knots = Knots(
        line=np.ones(4, dtype=np.int32),
        path_mm=25.0 * time_s,
        time_s=time_s,
        lead_s=np.full(4, 0.04),
        force_N=np.array([[0, 0, 0], [0, 300, -50], [0, -310, -50], [0, 0, 0.0]]),
        deflection_mm=np.zeros((4, 3)),
    )
    return knots, PilotHeader("base", "index", "$SEN_PINT[1]", 0.04, 12345)


@dataclass
class Episodes:
    """What all episodes share."""

    cell: Cell
    rng: np.random.Generator
    report: Report = field(default_factory=Report)

    def __post_init__(self) -> None:
        level = np.array([[0.0, 0.0, 0.0, 1.0]])
        self.q_rad = arm.inverse(START_MM[None], level, self.cell, 1)[0, 2]
        turned = np.concatenate([self.q_rad[None], self.q_rad + 1e-5 * np.eye(6)])
        tips, _ = arm.forward(turned, self.cell, 1)
        self.jacobian = ((tips[1:] - tips[0]) / 1e-5).T

    def run(self, target: Phase, names: tuple[str, ...]) -> None:
        """Bring a session into a phase, add faults, and go on."""
        rng, report = self.rng, self.report
        axis = bool(rng.random() < 0.3)
        own = settings_at_random(rng, axis)
        knots, header = pilot() if rng.random() < 0.5 else (None, None)
        device = build_compensator(self.cell, own, load_frame="base", knots=knots, header=header)
        peer = Robot(
            device,
            self.jacobian,
            self.q_rad,
            rng,
            lag=float(rng.choice([1.0, 0.3])),
            reports=bool(rng.random() < 0.5),
        )
        peer.relative = target is Phase.ZERO
        watch = Watch(device, report, f"{target.value}, {', '.join(names)}{' (axis)' if axis else ''}")
        session, force = begin(device), rng.normal(0.0, 300.0, 6) * [1, 1, 1, 0, 0, 0]
        begins = self._reach(target)
        lasts = [int(rng.choice([1, 2, 3, 4, 7, 20, 40])) for _ in names]
        since = -1
        total = begins + 50 + int(rng.integers(0, 40))
        for k in range(total):
            if since < 0 and session.phase is target and k >= begins - 40:
                since = k + int(rng.integers(0, 3 if target in _SHORT else 40))
            peer.moves = session.phase is Phase.RUNNING
            self._announce(peer, k, knots is not None and session.phase is Phase.RUNNING)
            load = force * np.sin(0.05 * k) + rng.normal(0.0, 5.0, 6) * (force != 0.0)
            now = Cycle(peer, peer.telegram(), load, False, rng)
            if target in (Phase.HELD, Phase.CLOSED) and k == begins - 45 and session.phase is Phase.RUNNING:
                session = self._end(session, target)
            if since >= 0:
                for name, last in zip(names, lasts, strict=True):
                    if since <= k < since + last:
                        now.first = k == since
                        report.met.add((session.phase.value, name))
                        FAULTS[name](now)
            session = self._exchange(session, now, device, watch)
            report.cycles += 1
        report.ended[f"{session.phase.value} {session.reason}".strip()] += 1

    def _reach(self, target: Phase) -> int:
        """Return the cycle by which a phase can have been reached."""
        return {Phase.RESTING: 40, Phase.PROBING: 40, Phase.SETTLING: 40, Phase.ZERO: 50}.get(target, 100)

    def _end(self, session: Session, target: Phase) -> Session:
        reason = "made so by the test"
        return replace(session, phase=target, reason=reason, cycles=0)

    def _announce(self, peer: Robot, k: int, runs: bool) -> None:
        if runs and "knot" not in peer.told:
            peer.told = {"knot": -1.0, "checksum": 12345.0, "override_percent": 100.0, "t1": 0.0}
        elif runs and k % 20 == 0 and peer.told["knot"] < 3:
            peer.told["knot"] += 1.0

    def _exchange(self, session: Session, now: Cycle, device: Compensator, watch: Watch) -> Session:
        """Exchange one telegram, however it comes."""
        peer, telegram = now.robot, now.telegram
        if now.comes == "never":
            peer.take(None)
            return session
        if now.comes == "silent":
            session = silent(session, 2.0 * device.settings.link.silence_s, device.settings)
        if now.comes == "anew":
            watch.start_anew()
        if now.comes == "garbage":
            _refused(now.rng)
        coming = [telegram]
        if now.comes == "twice":
            coming = [telegram, telegram]
        if now.comes == "late":
            late = replace(telegram, ipoc=max(telegram.ipoc - 10 * peer.cycle_ms, 0))
            coming = [late, telegram]
        answer = None
        for each in coming:
            each = _through_text(each) if now.rng.random() < AS_TEXT else each
            before, began_s = session, time.perf_counter()
            session, given = exchange(session, each, now.load, device)
            self.report.slowest_s = max(self.report.slowest_s, time.perf_counter() - began_s)
            watch.see(before, session, given, each.ipoc)
            if given is not None:
                answer = given
                answer_text(given, device.settings)
        peer.take(answer)
        return session


_SHORT = (Phase.RESTING, Phase.PROBING, Phase.SETTLING)


def _refused(rng: np.random.Generator) -> None:
    """Parse data that is not a telegram."""
    data = (
        GARBAGE[int(rng.integers(len(GARBAGE)))] if rng.random() < 0.5 else rng.bytes(int(rng.integers(300)))
    )
    try:
        parse(data)
    except MalformedError:
        return
    raise AssertionError(f"taken for a telegram: {data!r}")


def _through_text(telegram: Telegram) -> Telegram:
    """Return a telegram after writing and reading it; unchanged if it cannot be written."""
    whole = np.concatenate(
        [telegram.position_mm, telegram.command_mm, telegram.q_rad, telegram.q_command_rad]
    )
    if not np.abs(whole).max() < 1e12 or telegram.ipoc < 0:
        return telegram
    xyz = 'X="{:.4f}" Y="{:.4f}" Z="{:.4f}" A="0" B="0" C="0"'
    axes = " ".join(f'A{n}="{{:.4f}}"' for n in range(1, 7))
    text = (
        f'<Rob Type="KUKA"><RIst {xyz.format(*telegram.position_mm)}/>'
        f"<RSol {xyz.format(*telegram.command_mm)}/>"
        f"<AIPos {axes.format(*(telegram.q_rad * DEG_PER_RAD))}/>"
        f"<ASPos {axes.format(*(telegram.q_command_rad * DEG_PER_RAD))}/>"
        f"<IPOC>{telegram.ipoc}</IPOC></Rob>"
    )
    read = parse(text.encode("ascii"))
    return replace(
        read,
        monitor_mm=telegram.monitor_mm,
        knot=telegram.knot,
        checksum=telegram.checksum,
        override_percent=telegram.override_percent,
        t1=telegram.t1,
    )


def drive(cycles: int, seed: int = 1, say: Callable[[str], None] | None = None) -> Report:
    """Run episodes for ``cycles`` cycles; every pair of phase and fault in turn."""
    episodes = Episodes(load_cell(), np.random.default_rng(seed))
    names, rng, report = list(FAULTS), episodes.rng, episodes.report
    pairs = list(itertools.product(PHASES, names))
    shown = 0
    for mode in ("cartesian", "axis"):
        warm_up(build_compensator(episodes.cell, Online(mode=mode), load_frame="base"))
    while report.cycles < cycles:
        for index in rng.permutation(len(pairs)):
            target, name = pairs[index]
            more = (
                tuple(str(n) for n in rng.choice(names, int(rng.integers(0, 3))))
                if rng.random() < 0.3
                else ()
            )
            episodes.run(target, (name, *more))
            if say is not None and report.cycles // 100_000 > shown:
                shown = report.cycles // 100_000
                say(f"{report.cycles} cycles, {len(report.violations)} violations")
            if report.cycles >= cycles:
                break
    return report
