"""What the workers of the tests are asked to do: functions that a worker can import."""

import os
import signal
import sys
import time
from pathlib import Path

from gcode2krl.batch.work import make


def double(number):
    return 2 * number


def environment(_):
    return os.getpid(), os.environ["GCODE2KRL_THREADS"], os.environ["TMPDIR"]


def fail(number):
    raise ValueError(f"no {number}")


def lack_memory(_):
    raise MemoryError


def say(number):
    print("a library that prints")
    os.write(1, b"and one that writes")
    return number


def die(number):
    """End the process as the system does where memory is short."""
    print("the last word", file=sys.stderr, flush=True)
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


def die_at_three(number):
    if number == 3:
        die(number)
    return double(number)


def die_once(marker):
    """Die where the file is not there yet, and make it."""
    place = Path(marker)
    if not place.exists():
        place.write_text("was here")
        die(0)
    return place.name


def make_or_die(task):
    """Do what a worker does, or die of a part that is named so."""
    if "deadly" in str(task.order.part):
        die(0)
    return make(task)


def note_time(task):
    """Sleep, and return when it began and ended."""
    began = time.time()
    time.sleep(task)
    return began, time.time()
