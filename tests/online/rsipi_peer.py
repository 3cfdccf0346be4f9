"""Runs the echo server of RSIPI as the controller; started with the interpreter that has it installed.

    python rsipi_peer.py CONFIG MODE CYCLE_MS CYCLES TIMEOUT

Prints a JSON object with what it saw: cycles, faulty packets, the correction it has applied.
"""

import contextlib
import io
import json
import os
import sys
import tempfile
import time


def main(config, mode, cycle_ms, cycles, timeout):
    os.chdir(tempfile.mkdtemp())  # it makes a folder of logs where it stands
    with contextlib.redirect_stdout(io.StringIO()) as said:
        import logging

        from RSIPI import rsi_echo_server
        from RSIPI.rsi_echo_server import EchoServer

        # on a real robot, by RSIPI's own findings, RSol and ASPos stay those of the program
        rsi_echo_server.STATE_TO_SETPOINT.clear()
        logging.disable(logging.CRITICAL)
        server = EchoServer(config, delay_ms=int(cycle_ms), mode=mode, timeout_packets=int(timeout))
        for tag in ("RIst", "RSol"):
            server.state[tag].update(X=50.0, Y=0.0, Z=40.0)
        for tag in ("AIPos", "ASPos"):
            joints = dict(zip(("A1", "A2", "A3", "A4", "A5", "A6"), JOINTS, strict=True))
            server.state[tag].update(joints)
        server.base_pose = {k: dict(v) for k, v in server.state.items() if isinstance(v, dict)}
        furthest = 0.0
        server.start()
        first = server.ipoc_value
        while server.running and (server.ipoc_value - first) < int(cycles) * int(cycle_ms):
            furthest = max(
                furthest, *(abs(server.state["RIst"][k] - server.base_pose["RIst"][k]) for k in "XYZ")
            )
            time.sleep(0.001)
        broke_off = not server.running
        server.stop()
    found = {
        "cycles": (server.ipoc_value - first) // int(cycle_ms),
        "faulty": server.faulty_packets,
        "broke_off": broke_off,
        "applied": {k: server.state["RIst"][k] - server.base_pose["RIst"][k] for k in "XYZ"},
        "furthest": furthest,
        "said": said.getvalue()[-500:],
    }
    print(json.dumps(found))


JOINTS = (0.0, -95.0, 120.0, 0.0, 65.0, 0.0)

if __name__ == "__main__":
    main(*sys.argv[1:])
