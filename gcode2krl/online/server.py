"""The UDP side of RSI: one socket, one peer, one answer for each telegram, and answer times.

Python on an ordinary computer is not a hard real-time controller. A collection of garbage, another process,
the operating system may delay an answer by many cycles; the controller then keeps the last correction
(``HOLDON``) and stops after ``Timeout`` cycles. Use it to try out, to measure, and as the reference for
a PLC.
"""

import gc
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error
from gcode2krl.online.compensator import Compensator, start, step
from gcode2krl.online.limits import towards
from gcode2krl.online.pilot_gate import Gate
from gcode2krl.online.recorder import Recorder
from gcode2krl.online.session import Phase, Session, begin, exchange, sample_of, silent
from gcode2krl.online.telegram import LONGEST, MalformedError, Telegram, answer_text, parse
from gcode2krl.robot import forward

ForceSource = Callable[[Telegram], Floats]
"""Returns the force sensor's present load (6,) in N and N·mm, NaN without a value. Called once a cycle."""
MOST_TIMES = 1_000_000
_WAIT_S = 0.05


def force_in_telegram(telegram: Telegram) -> Floats:
    """Return the load that the controller itself reports."""
    return telegram.load


@dataclass
class Statistics:
    """What happened on the wire, and how long the answers took."""

    telegrams: int = 0
    answered: int = 0
    malformed: int = 0
    foreign: int = 0
    """Datagrams from other senders than the peer."""
    pilot_cycles: int = 0
    """Answers in which the pilot was used."""
    answer_s: list[float] = field(default_factory=list)
    """Times from a telegram's arrival to its answer."""

    def as_dict(self) -> dict[str, Any]:
        """Return the counts, and median, 99.9 % and largest answer time in ms."""
        times = np.array(self.answer_s) * 1000.0 if self.answer_s else np.full(1, np.nan)
        quantiles = np.quantile(times, [0.5, 0.999, 1.0]).tolist()
        known = [value if np.isfinite(value) else None for value in quantiles]
        counts = ("telegrams", "answered", "malformed", "foreign", "pilot_cycles")
        return {**{name: getattr(self, name) for name in counts}, **dict(zip(_QUANTILES, known, strict=True))}


_QUANTILES = ("answer_ms_median", "answer_ms_999", "answer_ms_worst")


def open_socket(device: Compensator) -> socket.socket:
    """Return the bound socket of the settings; raises `NotUnderstoodError` where it cannot be opened."""
    link = device.settings.link
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        server.bind((link.address, link.port))
    except OSError as error:
        server.close()
        words = f"cannot listen on {link.address}:{link.port}: {error.strerror or error}"
        raise input_error(
            "online-port", words, "another program has the port, or the address is not ours"
        ) from None
    return server


def serve(
    device: Compensator,
    server: socket.socket,
    recorder: Recorder,
    *,
    force: ForceSource = force_in_telegram,
    stop: threading.Event | None = None,
    on_change: Callable[[Session], None] | None = None,
) -> tuple[Session, Statistics]:
    """Answer telegrams until the session is closed or ``stop`` is set; returns how it ended.

    Where ``robot_address`` is set, only its datagrams are read. The first well-formed telegram decides who
    the peer is, address and port. ``on_change`` is called when the phase changes.
    """
    stop = stop or threading.Event()
    robot = device.settings.link.robot_address
    session, statistics = begin(device), Statistics()
    peer: tuple[str, int] | None = None
    warm_up(device)
    heard_s = time.monotonic()
    server.settimeout(_WAIT_S)
    collects = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()  # a collection takes longer than a control cycle, and a cycle leaves no circular references
    try:
        while not stop.is_set() and session.phase is not Phase.CLOSED:
            received = _receive(server)
            arrived_s = time.monotonic()
            before = session
            if received is None:
                session = silent(session, arrived_s - heard_s, device.settings)
                _note(before, session, recorder, on_change)
                continue
            data, sender = received
            telegram = _parsed(data, sender, peer, robot, statistics)
            if telegram is None:
                session = silent(session, arrived_s - heard_s, device.settings)
                _note(before, session, recorder, on_change)
                continue
            peer, heard_s = sender, arrived_s
            load = force(telegram)
            session, answer = exchange(session, telegram, load, device)
            text = None if answer is None else answer_text(answer, device.settings)
            if text is not None:
                _send(server, text, sender)
                _count(statistics, session, time.monotonic() - arrived_s)
            recorder.telegram(data, text)
            recorder.load(telegram.ipoc, load)
            _note(before, session, recorder, on_change)
    finally:
        gc.unfreeze()
        if collects:
            gc.enable()
    return session, statistics


def warm_up(device: Compensator) -> None:
    """Take one step standing at HOME: the first of each function, with its imports, costs many cycles."""
    q_rad = device.cell.home_q_rad()
    position, _ = forward(q_rad[None], device.cell, device.tool)
    nothing = np.full(6, np.nan)
    rests = Telegram(
        ipoc=0,
        position_mm=position[0],
        command_mm=position[0],
        q_rad=q_rad,
        q_command_rad=q_rad,
        late=0.0,
        monitor_mm=nothing[:3],
        knot=-1.0,
        checksum=0.0,
        override_percent=100.0,
        t1=0.0,
        values=nothing[:4],
        load=nothing,
    )
    step(device, start(device), sample_of(rests, np.zeros(6)))
    towards(np.zeros_like(device.bounds.most), np.zeros_like(device.bounds.most), device.bounds)


def _receive(server: socket.socket) -> tuple[bytes, tuple[str, int]] | None:
    """Return the next datagram, None after a while without one."""
    try:
        data, sender = server.recvfrom(LONGEST + 1)
    except (TimeoutError, ConnectionError):  # Windows reports a peer's closed port here
        return None
    return data, (sender[0], sender[1])


def _parsed(
    data: bytes,
    sender: tuple[str, int],
    peer: tuple[str, int] | None,
    robot: str | None,
    statistics: Statistics,
) -> Telegram | None:
    if _is_foreign(sender, peer, robot):
        statistics.foreign += 1
        return None
    try:
        telegram = parse(data)
    except MalformedError:
        statistics.malformed += 1
        return None
    statistics.telegrams += 1
    return telegram


def _is_foreign(sender: tuple[str, int], peer: tuple[str, int] | None, robot: str | None) -> bool:
    """Tell whether a datagram comes from another sender than the controller, if that is known."""
    if peer is not None:
        return sender != peer
    return robot is not None and sender[0] != robot


def _send(server: socket.socket, text: bytes, sender: tuple[str, int]) -> None:
    try:
        server.sendto(text, sender)
    except OSError:  # the peer is gone: no more telegrams will come, and the session times out
        return


def _count(statistics: Statistics, session: Session, took_s: float) -> None:
    statistics.answered += 1
    statistics.pilot_cycles += session.phase is Phase.RUNNING and session.gate == Gate.OPEN
    if len(statistics.answer_s) < MOST_TIMES:
        statistics.answer_s.append(took_s)


def _note(
    before: Session, after: Session, recorder: Recorder, on_change: Callable[[Session], None] | None
) -> None:
    changed = (before.phase, before.reason, before.gate, before.lost) != (
        after.phase,
        after.reason,
        after.gate,
        after.lost,
    )
    if changed:
        gate = Gate(after.gate).name.lower()
        recorder.event(after.ipoc, after.phase.value, after.reason, gate, after.lost, after.ignored)
    if on_change is not None and (before.phase, before.reason) != (after.phase, after.reason):
        on_change(after)
