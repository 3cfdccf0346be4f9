"""A worker: a process that carries out calls from its standard input, one after another.

It is started by `gcode2krl.batch.worker_process`, ignores Ctrl-C, and ends with its standard input, so none
is left when the batch is killed.
"""

import os
import pickle
import signal
from typing import IO, Any

from gcode2krl.batch.talk import Raised, receive, send


def serve() -> None:
    """Answer calls until standard input ends: the value of a call, or `Raised`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with os.fdopen(os.dup(0), "rb") as calls, os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # what a library prints must not get between the answers
        while _serve_one(calls, answers):
            pass


def _serve_one(calls: IO[bytes], answers: IO[bytes]) -> bool:
    """Carry out a call; False where there is none."""
    try:
        call = receive(calls)
    except EOFError:
        return False
    send(answers, _answer(call))
    return True


def _answer(call: bytes) -> Any:
    try:
        function, argument = pickle.loads(call)
        return function(argument)
    except Exception as error:
        return Raised(type(error).__name__, str(error))
