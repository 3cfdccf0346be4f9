"""Answer times of `online serve`, at 4 ms over UDP on loopback.

The controller is a process of its own. It sends a telegram every cycle by its clock, as a KRC4 does, whether
it was answered or not, and applies what comes back. Printed are what the server needs from a telegram to its
answer, what the controller waits for it, and how many answers came after the next telegram was due: a
controller with `Timeout` 5 stops after five such cycles in a row. Where this machine holds up the controller
itself, which a KRC4's would not, its clock starts anew and that is counted. Python is not a hard real-time
controller; the worst figure says why.

    python benchmarks/online_cycle.py                      10 minutes at 4 ms
    python benchmarks/online_cycle.py --seconds 10         small
    python benchmarks/online_cycle.py --cycle-ms 12 --mode axis --load 2    two busy processes beside it
"""

import argparse
import json
import multiprocessing
import os
import re
import socket
import subprocess
import sys
import threading
import time

import numpy as np

PROGRAM_MM = np.array([50.0, 0.0, 40.0])
JOINTS_DEG = (0.0, -95.0, 120.0, 0.0, 65.0, 0.0)
STAND_S = 3.0
NAMES = ("median", "99.9 %", "worst")


def words(position):
    """Return a pose's attributes."""
    x, y, z = position
    return f'X="{x:.4f}" Y="{y:.4f}" Z="{z:.4f}" A="0" B="0" C="0"'


def controller(port, seconds, cycle_ms):
    """Send telegrams by the clock; return waiting times and late answers."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", 0))
    correction, ipoc = np.zeros(3), 1_000_000
    axes = " ".join(f'A{k}="{v}"' for k, v in enumerate(JOINTS_DEG, start=1))
    waited, late, late_in_a_row, most_in_a_row, held_up, held_up_s = [], 0, 0, 0, 0, 0.0
    began = time.perf_counter()
    due = began
    while time.perf_counter() - began < seconds:
        due += cycle_ms / 1000.0
        behind_s = time.perf_counter() + 0.75 * cycle_ms / 1000.0 - due
        if behind_s > 0.0:
            due, held_up, held_up_s = due + behind_s, held_up + 1, max(held_up_s, behind_s)
        moving_s = max(due - began - STAND_S, 0.0)
        to_and_fro = 1.0 - abs((moving_s / 8.0) % 2.0 - 1.0)  # 100 mm at 12.5 mm/s
        program = PROGRAM_MM + np.array([100.0 * to_and_fro, 0.0, 0.0])
        actual = program + correction
        text = (
            f'<Rob Type="KUKA"><RIst {words(actual)}/><RSol {words(program)}/>'
            f'<AIPos {axes}/><ASPos {axes}/><Delay D="{late}"/><IPOC>{ipoc}</IPOC></Rob>'
        )
        sent = time.perf_counter()
        wire.sendto(text.encode(), ("127.0.0.1", port))
        answered = False
        while (left := due - time.perf_counter()) > 0.0:
            wire.settimeout(left)
            try:
                answer = wire.recv(4096)
            except (TimeoutError, ConnectionError):
                break
            if f"<IPOC>{ipoc}</IPOC>".encode() not in answer:
                continue
            waited.append(time.perf_counter() - sent)
            found = re.search(rb'<RKorr X="([^"]+)" Y="([^"]+)" Z="([^"]+)"', answer)
            if found is not None:
                correction = np.array([float(value) for value in found.groups()])
            answered = True
            break
        late += not answered
        late_in_a_row = 0 if answered else late_in_a_row + 1
        most_in_a_row = max(most_in_a_row, late_in_a_row)
        ipoc += cycle_ms
        if (left := due - time.perf_counter()) > 0.0:
            time.sleep(left)
    cycles = (ipoc - 1_000_000) // cycle_ms
    times = np.array(waited) * 1000.0
    return {
        "cycles": cycles,
        "late": late,
        "late_in_a_row": most_in_a_row,
        "held_up": held_up,
        "held_up_ms": 1000.0 * held_up_s,
        "waited_ms": dict(
            zip(("median", "99.9 %", "worst"), np.quantile(times, [0.5, 0.999, 1.0]).tolist(), strict=True)
        ),
    }


def burn(seconds):
    """Keep a core busy."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


def measure(options):
    """Return the records of controller and server."""
    from gcode2krl import load_cell
    from gcode2krl.cell.sections.online import Online, RobotLink
    from gcode2krl.online.compensator import build_compensator
    from gcode2krl.online.recorder import Recorder
    from gcode2krl.online.server import open_socket, serve

    settings = Online(cycle_s=options.cycle_ms / 1000.0, mode=options.mode, link=RobotLink(lost_cycles=100))
    settings = settings.model_copy(update={"link": settings.link.model_copy(update={"port": 0})})
    device = build_compensator(load_cell(), settings, load_frame="base")
    stop = threading.Event()
    phases = {}

    def force(telegram):
        return np.array([0.0, 300.0 * np.sin(0.001 * telegram.ipoc), -50.0, 0.0, 0.0, 2000.0])

    with open_socket(device) as server, Recorder(None) as recorder:
        arguments = [sys.executable, __file__, "--peer", str(server.getsockname()[1])]
        arguments += ["--seconds", str(options.seconds), "--cycle-ms", str(options.cycle_ms)]
        busy = [
            multiprocessing.Process(target=burn, args=(options.seconds + 2,)) for _ in range(options.load)
        ]
        for one in busy:
            one.start()
        peer = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
        threading.Thread(target=lambda: (peer.wait(), stop.set()), daemon=True).start()
        session, statistics = serve(
            device,
            server,
            recorder,
            force=force,
            stop=stop,
            on_change=lambda now: phases.update({now.phase.value: now.ipoc}),
        )
        seen = json.loads(peer.stdout.read())
        for one in busy:
            one.join()
    return seen, {
        **statistics.as_dict(),
        "phases": phases,
        "ended": session.phase.value,
        "reason": session.reason,
    }


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--cycle-ms", type=int, default=4, choices=(4, 12))
    parser.add_argument("--mode", default="cartesian", choices=("cartesian", "axis"))
    parser.add_argument("--load", type=int, default=0, help="busy processes beside it")
    parser.add_argument("--peer", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peer is not None:
        print(json.dumps(controller(options.peer, options.seconds, options.cycle_ms)))
        return
    seen, served = measure(options)
    waited = seen["waited_ms"]
    share = 100.0 * seen["late"] / max(seen["cycles"], 1)
    beside = f"{os.cpu_count()} cores, {options.load} busy beside"
    print(f"{seen['cycles']} cycles of {options.cycle_ms} ms, {options.mode}, {beside}")
    print(
        f"  server, telegram to answer   median {served['answer_ms_median']:.3f} ms, 99.9 % "
        f"{served['answer_ms_999']:.3f} ms, worst {served['answer_ms_worst']:.3f} ms"
    )
    print(
        f"  controller waits for it      median {waited['median']:.3f} ms, 99.9 % {waited['99.9 %']:.3f} ms, "
        f"worst {waited['worst']:.3f} ms of those in time"
    )
    print(
        f"  answers too late             {seen['late']} ({share:.4f} %), "
        f"most in a row {seen['late_in_a_row']}"
    )
    held = f"{seen['held_up']} times, by {seen['held_up_ms']:.0f} ms at most"
    print(f"  the controller's own clock   held up {held}")
    print(f"  ended {served['ended']} {served['reason']}, phases {served['phases']}")


if __name__ == "__main__":
    main()
