"""The command line as a user meets it."""

import contextlib
import os
import subprocess
import sys

from tests.conftest import ROOT


def on_a_terminal(folder, *words, typed="", stdout=None):
    """Run ``gcode2krl`` at a terminal; return its code, what that shows, and a stdout apart from it."""
    ours, theirs = os.openpty()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", "COLUMNS": "120"}
    process = subprocess.Popen(
        [sys.executable, "-m", "gcode2krl", *map(str, words)],
        cwd=folder,
        env=environment,
        stdin=theirs,
        stdout=stdout or theirs,
        stderr=theirs,
    )
    os.close(theirs)
    os.write(ours, typed.encode())
    shown = b""
    with contextlib.suppress(OSError):  # the other end is closed
        while piece := os.read(ours, 65536):
            shown += piece
    os.close(ours)
    out, _ = process.communicate(timeout=60)
    return process.returncode, shown.decode("utf-8").replace("\r\n", "\n"), out
