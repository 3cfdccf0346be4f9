"""One RSI session as a pure step: a telegram comes in, an answer goes out, and a phase says what may happen.

    waiting -> resting -> probing -> settling -> running -> held | zero | closed

The correction is zero until the robot has shown, standing in air, that it takes corrections as absolute: a
small correction along the tool axis moves it by that amount and no more, and without it the robot goes back.
A robot that adds corrections up is recognised here, and ends in ``zero``. Any fault after this proof ends in
one of two final states: ``held`` sends the last correction unchanged and tells the program to stop (a
correction is never taken back in material), ``closed`` does not answer, and the controller's own time-out
stops the robot. A robot that moves away although the correction is constant, and a controller that was
restarted, lead to ``closed``: for them the held correction would be a jump. No answer differs from the one
before by more than one step of `limits.Bounds`, in any state.
"""

import enum
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.online import Online
from gcode2krl.frames import rotation_from_quaternion
from gcode2krl.online.compensator import Compensator, CycleInputs, State, joints_at, start, step
from gcode2krl.online.feed import feed_of
from gcode2krl.online.limits import towards
from gcode2krl.online.pilot_gate import NO_KNOT_YET, Announced, Gate
from gcode2krl.online.telegram import Answer, Telegram
from gcode2krl.robot import forward

_S_PER_MS = 1e-3
RESTART_MS = 1000
"""An IPOC that falls by more means that the controller was restarted; by less, that a datagram came late."""
JUMP_MS = 60_000
SEEN_SHARE, BACK_SHARE, ADDS_UP_SHARE = 0.4, 0.3, 1.6
"""Fractions of the probe at which the robot has moved, is back, and has moved too far."""
SEEN_CYCLES = 2
RUNAWAY_CYCLES = 3
RUNAWAY_MM = 0.5
"""How far beyond the largest correction the robot may be from the program, normal to it; our choice, more
than a position controller overshoots. In ``held`` it counts from the distance at the start of that phase."""
STILL_THERE_SHARE = 0.5
"""A robot that has less than this fraction of the held correction has lost it; our choice: lag and rounding
do not remove half of it while the link is silent."""


class Phase(enum.Enum):
    """What a session is doing."""

    WAITING = "waiting"
    RESTING = "resting"
    PROBING = "probing"
    SETTLING = "settling"
    RUNNING = "running"
    HELD = "held"
    ZERO = "zero"
    CLOSED = "closed"


UNKNOWN_KNOT = -2
SAME_VALUE = 0.02
"""N and s: forces are written with two decimals and pass through the controller's 4-byte REAL."""
ENDED = (Phase.HELD, Phase.ZERO, Phase.CLOSED)


@dataclass(frozen=True)
class Session:
    """The state of a session; `begin` returns the first one."""

    phase: Phase
    device: State
    sent: Floats
    """The last correction."""
    reason: str = ""
    """Reason of the phase."""
    ipoc: int = -1
    cycles: int = 0
    """Telegrams in this phase."""
    rest_mm: Floats = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) position of the robot at rest."""
    probe: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) direction of the probe."""
    seen: int = 0
    """Telegrams in a row in which the probe was seen."""
    away: int = 0
    """Telegrams in a row in which the robot was too far from the program."""
    furthest_mm: float = 0.0
    """How far from the program the robot may be, normal to it."""
    gate: int = Gate.NOT_STARTED
    knot: int = UNKNOWN_KNOT
    """The knot announced by the form ``values``."""
    lost: int = 0
    """Telegrams that never came."""
    late: float = np.nan
    """Answers that the controller has missed so far, as it reports; NaN if it does not."""
    has_missed: bool = False
    """True: the controller reports that it missed an answer since the telegram before."""
    ignored: int = 0
    """Telegrams that came twice or too late."""

    @property
    def ready(self) -> bool:
        """True while corrections are made."""
        return self.phase is Phase.RUNNING


def begin(device: Compensator) -> Session:
    """Return the state before the first telegram."""
    return Session(Phase.WAITING, start(device), np.zeros(len(device.bounds.most)))


def exchange(
    session: Session, telegram: Telegram, load: Floats, device: Compensator
) -> tuple[Session, Answer | None]:
    """Return the state after a telegram and its answer, None where it must not be answered.

    ``load`` (6,) is the present load of the force sensor, NaN without a value.
    """
    before = session
    session, is_new = _counted(session, telegram.ipoc, device.settings)
    if session.phase is Phase.CLOSED or not is_new:
        return session, None
    session = replace(session, late=telegram.late, has_missed=bool(telegram.late > session.late))
    if session.phase is Phase.WAITING:
        session = _enter(session, Phase.RESTING, "", rest_mm=telegram.position_mm)
    if _silent_too_long(before, session, device.settings) and _lost_correction(session, telegram, device):
        return _enter(session, Phase.CLOSED, "restarted"), None
    session = _STEPS[session.phase](session, telegram, load, device)
    if session.phase is Phase.CLOSED:
        return session, None
    session = replace(session, cycles=session.cycles + 1)
    return session, Answer(telegram.ipoc, session.sent, session.ready)


def silent(session: Session, silence_s: float, settings: Online) -> Session:
    """Return the state after ``silence_s`` without a telegram: closed if that is too long."""
    if session.phase in (Phase.WAITING, Phase.CLOSED) or silence_s < settings.link.silence_s:
        return session
    return _enter(session, Phase.CLOSED, "silence")


def _enter(session: Session, phase: Phase, reason: str, **more: object) -> Session:
    return replace(session, phase=phase, reason=reason, cycles=0, **more)  # type: ignore[arg-type]


def _counted(session: Session, ipoc: int, settings: Online) -> tuple[Session, bool]:
    """Take over the IPOC, and return whether it is new; a gap or a restart changes the phase."""
    if session.ipoc < 0:
        return replace(session, ipoc=ipoc), True
    step_ms = round(settings.cycle_s / _S_PER_MS)
    ahead = ipoc - session.ipoc
    if ahead < -RESTART_MS:
        return _enter(session, Phase.CLOSED, "ipoc-restart"), False
    if ahead <= 0:
        return replace(session, ignored=session.ignored + 1), False
    missing = max(ahead // step_ms - 1, 0)
    following = replace(session, ipoc=ipoc, lost=session.lost + min(missing, JUMP_MS))
    if session.phase in ENDED:
        return following, True
    is_running = session.phase is Phase.RUNNING
    reason = ""
    if ahead % step_ms:
        reason = "ipoc-cycle"
    elif missing > (settings.link.lost_cycles if is_running else 0):  # the proof needs every telegram
        reason = "ipoc-jump" if ahead > JUMP_MS else "telegrams-lost"
    if not reason:
        return following, True
    return _enter(following, Phase.HELD if is_running else Phase.RESTING, reason), True


def _rest(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Send zero until the robot has stood still for some time."""
    probe = device.settings.probe
    session = _towards_zero(session, device)
    if session.sent.any():
        return replace(session, cycles=0)
    if np.abs(telegram.position_mm - session.rest_mm).max() > probe.rest_mm:
        return replace(session, rest_mm=telegram.position_mm, cycles=0)
    if session.cycles < probe.rest_cycles:
        return session
    _, rotation = forward(telegram.q_rad[None], device.cell, device.tool)
    away = rotation_from_quaternion(rotation)[0, :, 2]
    return _probe(_enter(session, Phase.PROBING, "", probe=away, seen=0), telegram, load, device)


def _probe(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Send a small correction until the robot has moved by it twice in a row: one that adds up moves on."""
    probe = device.settings.probe
    moved = _moved(session, telegram)
    if moved > ADDS_UP_SHARE * probe.amplitude_mm:
        return _adds_up(session, device)
    seen = session.seen + 1 if moved >= SEEN_SHARE * probe.amplitude_mm else 0
    if seen >= SEEN_CYCLES or session.cycles >= probe.most_cycles:
        return _towards_zero(_enter(session, Phase.SETTLING, "", seen=seen), device)
    shift = probe.amplitude_mm * session.probe
    if len(session.sent) == 6:
        joints = joints_at(telegram.q_command_rad[None], shift[None], device.cell)[0]
        shift = joints - telegram.q_command_rad
    if not np.isfinite(shift).all():
        return _towards_zero(_enter(session, Phase.ZERO, "reach"), device)
    return replace(session, sent=towards(session.sent, shift, device.bounds), seen=seen)


def _settle(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Send zero again: the robot must come back."""
    probe = device.settings.probe
    moved = _moved(session, telegram)
    if moved > ADDS_UP_SHARE * probe.amplitude_mm:
        return _adds_up(session, device)
    session = _towards_zero(session, device)
    if session.sent.any():
        return replace(session, cycles=0)
    if session.cycles < probe.settle_cycles:
        return session
    off_mm = np.abs(telegram.position_mm - session.rest_mm - moved * session.probe).max()
    if off_mm > probe.rest_mm:
        return _enter(session, Phase.RESTING, "moved", rest_mm=telegram.position_mm)
    if not session.seen:
        return _enter(session, Phase.RESTING, "probe-not-seen", rest_mm=telegram.position_mm)
    if moved > BACK_SHARE * probe.amplitude_mm:
        return _adds_up(session, device)
    furthest_mm = device.settings.most_mm + RUNAWAY_MM
    return _enter(session, Phase.RUNNING, "", device=start(device), away=0, furthest_mm=furthest_mm)


def _run(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Compensate, as long as the robot is where it should be and the sensor has values.

    After an answer that the controller missed the correction is not continued: the next one would be a step.
    """
    session = _watched(session, telegram)
    if session.away >= RUNAWAY_CYCLES:
        most_mm = _away_mm(session, telegram) + RUNAWAY_MM
        return _enter(session, Phase.HELD, "too-far", away=0, furthest_mm=most_mm)
    knot = knot_of(telegram.values, session.knot, device)
    reported = telegram if device.pilot_form == "index" else replace(telegram, knot=float(knot))
    state, out = step(device, session.device, sample_of(reported, load))
    sent = out.correction[0]
    if session.has_missed:
        state, sent = state._replace(limit=session.device.limit), session.sent
    after = replace(session, device=state, sent=sent, gate=int(out.gate[0]), knot=knot)
    return _enter(after, Phase.HELD, "sensor") if out.sensor_lost[0] else after


def _hold(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Repeat the last correction; close if the robot moves away although the correction is constant."""
    feed, _ = feed_of(session.device.feed, telegram.command_mm[None])
    session = _watched(replace(session, device=session.device._replace(feed=feed)), telegram)
    return _enter(session, Phase.CLOSED, "adds-up") if session.away >= RUNAWAY_CYCLES else session


def _to_zero(session: Session, telegram: Telegram, load: Floats, device: Compensator) -> Session:
    """Go to zero and stay there."""
    return _towards_zero(session, device)


_STEPS = {
    Phase.RESTING: _rest,
    Phase.PROBING: _probe,
    Phase.SETTLING: _settle,
    Phase.RUNNING: _run,
    Phase.HELD: _hold,
    Phase.ZERO: _to_zero,
}


def _adds_up(session: Session, device: Compensator) -> Session:
    """End in ``zero``: a robot that adds corrections up, without one so far, stands still at zero."""
    return _towards_zero(_enter(session, Phase.ZERO, "adds-up"), device)


def _towards_zero(session: Session, device: Compensator) -> Session:
    """Go one step towards zero; the probe is at most one step (`Online`), so this is zero for a probe."""
    return replace(session, sent=towards(session.sent, np.zeros_like(session.sent), device.bounds))


def _moved(session: Session, telegram: Telegram) -> float:
    """Return how far the robot is from its rest position along the probe, in mm."""
    return float((telegram.position_mm - session.rest_mm) @ session.probe)


def _watched(session: Session, telegram: Telegram) -> Session:
    """Count the telegrams in a row in which the robot is too far from the program."""
    away = session.away + 1 if _away_mm(session, telegram) > session.furthest_mm else 0
    return replace(session, away=away)


def _away_mm(session: Session, telegram: Telegram) -> float:
    """Return how far the robot is from the program.

    Measured by the applied correction if the controller reports it, else by RIst minus RSol, of which only
    the component normal to the movement counts: along it the robot lags behind its program.
    """
    if np.isfinite(telegram.monitor_mm).all():
        return float(np.linalg.norm(telegram.monitor_mm))
    offset = telegram.position_mm - telegram.command_mm
    along = session.device.feed.direction
    length = float(along @ along)
    if length > 0.0:
        offset = offset - (offset @ along) / length * along
    return float(np.linalg.norm(offset))


def _silent_too_long(before: Session, after: Session, settings: Online) -> bool:
    """Tell whether the controller has missed so many answers that it gave up and may be restarted."""
    cycle_ms = round(settings.cycle_s / _S_PER_MS)
    return before.ipoc >= 0 and after.ipoc - before.ipoc > settings.link.timeout_cycles * cycle_ms


def _lost_correction(session: Session, telegram: Telegram, device: Compensator) -> bool:
    """Tell whether repeating the correction would be a jump: more than a step, and the robot has lost it.

    RSI restarts at zero; its program then waits for `ready`, but corrections apply at once. A position that
    cannot be the robot's does not show that the robot still has the correction.
    """
    sent, step = session.sent, device.bounds.step
    largest = np.linalg.norm(sent / step) if device.bounds.is_vector else np.abs(sent / step).max()
    if largest <= 1.0:
        return False
    if _away_mm(session, telegram) > session.furthest_mm:
        return True
    wanted_mm = sent
    if len(sent) == 6:
        both = np.stack([telegram.q_command_rad, telegram.q_command_rad + sent])
        tips, _ = forward(both, device.cell, device.tool)
        wanted_mm = tips[1] - tips[0]
    there_mm = telegram.position_mm - telegram.command_mm
    if np.isfinite(telegram.monitor_mm).all():
        there_mm = telegram.monitor_mm
    return float(there_mm @ wanted_mm) < STILL_THERE_SHARE * float(wanted_mm @ wanted_mm)


def knot_of(values: Floats, last: int, device: Compensator) -> int:
    """Return which knot of the sidecar announced values (4,) are: the last one, the next, or none of them.

    Before the first knot all values are zero. They are compared with the decimals in which they are written.
    """
    table = device.table
    if not np.isfinite(values).all():
        return UNKNOWN_KNOT
    if not values.any():
        return NO_KNOT_YET
    for knot in (last, last + 1):
        if 0 <= knot < len(table.time_s):
            row = np.append(table.force_N[knot], table.lead_s[knot])
            if np.abs(values - row).max() <= SAME_VALUE:
                return knot
    return UNKNOWN_KNOT


def sample_of(telegram: Telegram, load: Floats) -> CycleInputs:
    """Return a telegram and the sensor's load (6,) as one row for the compensator."""
    pilot = (telegram.knot, telegram.checksum, telegram.override_percent, telegram.t1)
    return CycleInputs(
        time_s=np.array([_S_PER_MS * telegram.ipoc]),
        load=load[None],
        q_rad=telegram.q_rad[None],
        q_command_rad=telegram.q_command_rad[None],
        position_mm=telegram.command_mm[None],
        announced=Announced(*(np.array([value]) for value in pilot)),
    )
