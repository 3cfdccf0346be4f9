"""The server over real UDP on loopback, with a controller of our own and, where it is installed, RSIPI's."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from gcode2krl.cell.sections.online import Online, RobotLink
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.krl.rsi_files import ethernet_xml
from gcode2krl.online.compensator import build_compensator
from gcode2krl.online.recorder import Recorder
from gcode2krl.online.server import open_socket, serve
from gcode2krl.online.session import Phase
from tests.online.krc import Krc
from tests.online.relay import GARBAGE, Relay

SIDE = np.array([0.0, 250.0, 0.0, 0.0, 0.0, 0.0])


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextmanager
def running(cell, *, folder=None, force=None, **link):
    """Run a server in a thread; yields its port and what it ends with."""
    link = {"port": free_port(), "silence_s": 1.5, **link}
    settings = Online(link=RobotLink(**link))
    device = build_compensator(cell, settings, load_frame="base")
    stop, outcome = threading.Event(), {}
    with open_socket(device) as server, Recorder(folder) as recorder:

        def work():
            outcome["end"] = serve(
                device, server, recorder, force=force or (lambda telegram: SIDE), stop=stop
            )

        thread = threading.Thread(target=work)
        thread.start()
        outcome["stop"] = lambda: (stop.set(), thread.join())
        yield server.getsockname()[1], outcome
        stop.set()
        thread.join()
        outcome["recorder"] = recorder


class Wire:
    """The controller's socket."""

    def __init__(self, port, wait_s=5.0, host="127.0.0.1"):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((host, 0))
        self.socket.settimeout(wait_s)
        self.to = ("127.0.0.1", port)

    def ask(self, data, wait=True):
        """Send, and return the answer to it; what else comes is dropped, as a controller does."""
        self.socket.sendto(data, self.to)
        ipoc = re.search(rb"<IPOC>\d+</IPOC>", data)
        while wait:
            try:
                answer = self.socket.recv(65535)
            except (TimeoutError, ConnectionError):
                return None
            if ipoc is not None and answer.startswith(b"<Sen") and ipoc[0] in answer:
                return answer
        return None


def exchange(wire, krc, cycles, steps=None):
    for _ in range(cycles):
        answer = wire.ask(krc.telegram())
        krc.take(answer)
        if steps is not None:
            steps.append(krc.asked.copy())


def test_a_session_over_udp_compensates_and_ends_when_the_peer_is_silent(cell, tmp_path):
    with running(cell, folder=tmp_path / "run") as (port, outcome):
        wire, krc = Wire(port), Krc(cell)
        exchange(wire, krc, 200)
        assert krc.ready
        wire.socket.settimeout(2.5)
        with pytest.raises(TimeoutError):
            wire.socket.recv(10)
    session, statistics = outcome["end"]
    assert (session.phase, session.reason) == (Phase.CLOSED, "silence")
    assert statistics.answered == statistics.telegrams == 200
    assert abs(krc.applied[1]) > 0.5
    found = statistics.as_dict()
    assert 0.0 < found["answer_ms_median"] <= found["answer_ms_999"] <= found["answer_ms_worst"]


def test_one_peer_only_and_garbage_does_nothing(cell):
    with running(cell) as (port, outcome):
        wire, krc, stranger = Wire(port), Krc(cell), Wire(port, 0.02)
        steps = []
        for data in GARBAGE:
            assert stranger.ask(data, wait=False) is None
        exchange(wire, krc, 120, steps)
        other = Krc(cell, ipoc=999)
        for k in range(30):
            assert stranger.ask(other.telegram()) is None
            wire.ask(GARBAGE[k % len(GARBAGE)], wait=False)
            exchange(wire, krc, 3, steps)
        assert krc.ready
    _, statistics = outcome["end"]
    assert statistics.foreign == 30
    assert statistics.malformed == 30 + len(GARBAGE)
    assert statistics.answered == krc.answered == 210
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() <= 0.2 + 1e-3


@pytest.mark.slow
def test_a_bad_network_never_moves_the_robot_faster_than_the_limit(cell):
    """Of 1,500 telegrams 2 % are lost, doubled, late or mixed with garbage."""
    force = lambda telegram: SIDE * np.sin(0.002 * telegram.ipoc)  # noqa: E731
    with running(cell, force=force, lost_cycles=50) as (port, outcome):
        relay = Relay(lose=0.02, double=0.02, delay=0.02, garbage=0.02, delay_s=0.003)
        relay.start(port)
        # a busy machine is late too; what is lost is lost for longer
        wire, krc = Wire(relay.port, 0.04), Krc(cell, speed_mm_s=0.0)
        steps = []
        for _ in range(1500):
            krc.take(wire.ask(krc.telegram()))
            steps.append(krc.asked.copy())
        relay.close()
    session, statistics = outcome["end"]
    assert all(count > 20 for count in relay.count.values())
    assert session.phase is Phase.RUNNING or session.reason == "silence"
    assert krc.answered > 1350
    lost_in_a_row = 3  # answers that were lost leave a gap of as many steps
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() <= 0.2 * (1 + lost_in_a_row)
    assert statistics.malformed > 10
    assert session.ignored > 10


def test_the_port_of_another_program_is_an_error_of_one_line(cell):
    port = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        device = build_compensator(cell, Online(link=RobotLink(port=port)))
        with pytest.raises(NotUnderstoodError, match=f"127.0.0.1:{port}"):
            open_socket(device)


def test_it_listens_on_loopback_only_unless_told():
    assert Online().link.address == "127.0.0.1"


def test_the_first_stranger_is_not_the_peer_where_the_robot_is_pinned(cell):
    """A program on another address sends a sound telegram first, and goes on; the robot is served."""
    with running(cell, robot_address="127.0.0.1") as (port, outcome):
        stranger = Wire(port, 0.05, host="127.0.0.2")
        other = Krc(cell, ipoc=999)
        assert stranger.ask(other.telegram()) is None
        wire, krc = Wire(port), Krc(cell)
        for _ in range(20):
            exchange(wire, krc, 5)
            stranger.ask(other.telegram(), wait=False)
        assert krc.ready
    _, statistics = outcome["end"]
    assert krc.answered == statistics.answered == 100
    assert statistics.foreign in (20, 21)  # the last may come when the server has stopped


def test_without_a_pinned_robot_the_first_sound_telegram_decides(cell):
    with running(cell) as (port, outcome):
        first, second = Wire(port, host="127.0.0.2"), Wire(port, 0.05)
        assert first.ask(Krc(cell).telegram()) is not None
        assert second.ask(Krc(cell).telegram()) is None
    assert outcome["end"][1].foreign == 1


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ({"address": "0.0.0.0"}, "give robot_address"),
        ({"robot_address": "192.168.1.20"}, "cannot reach 127.0.0.1"),
        ({"address": "192.168.1.10", "robot_address": "0.0.0.0"}, "the controller's address"),
        ({"address": "192.168.1.10", "robot_address": "robot"}, "IPv4"),
        ({"address": "239.0.0.1"}, "one computer"),
        ({"address": "255.255.255.255"}, "one computer"),
    ],
)
def test_addresses_that_cannot_be_meant_are_refused(link, words):
    with pytest.raises(ValueError, match=words):
        RobotLink(**link)


def test_listening_everywhere_needs_the_robots_address():
    link = RobotLink(address="0.0.0.0", robot_address="192.168.1.20")
    assert (link.address, link.robot_address) == ("0.0.0.0", "192.168.1.20")


# RSIPI (github.com/otherworld-dev/rsi-pi): a controller's echo server that others wrote


def rsipi_python():
    """Return an interpreter that has RSIPI: that of the variable RSIPI_PYTHON, or our own."""
    named = os.environ.get("RSIPI_PYTHON")
    if named and shutil.which(named):
        return named
    has = subprocess.run([sys.executable, "-c", "import RSIPI"], capture_output=True, check=False)
    return sys.executable if has.returncode == 0 else None


def rsipi(cell, tmp_path, mode, cycles, cycle_ms=4, **faults):
    """Run the echo server for some cycles through a bad network; returns what both sides saw."""
    python = rsipi_python()
    if python is None:
        pytest.skip("RSIPI is not installed; RSIPI_PYTHON may name an interpreter that has it")
    relay = Relay(("127.0.0.1", 50000), **faults)
    own = Online(cycle_s=cycle_ms / 1000.0, link=RobotLink(port=relay.port))
    config = tmp_path / "ethernet.xml"
    config.write_text(ethernet_xml(own, "index"), encoding="ascii")

    def force(telegram):
        return SIDE * np.sin(0.003 * telegram.ipoc)

    with running(cell, force=force, lost_cycles=100) as (port, outcome):
        relay.start(port)
        peer = Path(__file__).with_name("rsipi_peer.py")
        arguments = [python, str(peer), str(config), mode, str(cycle_ms), str(cycles), "1000000"]
        ran = subprocess.run(arguments, capture_output=True, text=True, check=True)
        relay.close()
    return json.loads(ran.stdout), *outcome["end"]


def test_rsipi_in_absolute_mode(cell, tmp_path):
    peer, session, statistics = rsipi(cell, tmp_path, "absolute", 500)
    assert session.phase is Phase.RUNNING or session.reason == "silence"
    assert peer["cycles"] >= 500
    assert 0.3 < peer["furthest"] < 2.5
    assert statistics.malformed == 0


def test_rsipi_in_relative_mode_is_held_at_zero(cell, tmp_path):
    peer, session, _ = rsipi(cell, tmp_path, "relative", 300)
    assert session.reason in ("adds-up", "silence")
    assert peer["furthest"] <= 0.3
    assert not session.sent.any()


def test_rsipi_over_a_bad_network(cell, tmp_path):
    cycles = int(os.environ.get("RSIPI_CYCLES", "500"))
    faults = {"lose": 0.02, "double": 0.02, "delay": 0.02, "garbage": 0.02}
    peer, session, statistics = rsipi(cell, tmp_path, "absolute", cycles, **faults)
    print(peer, session.phase, session.reason, session.lost, session.ignored, statistics.as_dict())
    assert session.phase is Phase.RUNNING or session.reason == "silence"
    assert peer["furthest"] < 2.5
    assert statistics.malformed > 0
