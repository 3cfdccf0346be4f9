"""How a long computation tells how far it is, and costs nothing where nobody looks.

A function with several stages takes a `Begin` and calls it with the name of the stage that begins. It gets
the stage's `Progress` and may call that as often as it likes, from any thread, with what is done and what
there is to do, in any unit: `Paced` passes on only a few calls a second.
"""

import time
from collections.abc import Callable

Progress = Callable[[float, float], None]
"""Called with (done, total); where the total is not known it is 0."""
Begin = Callable[[str], Progress]
"""Called with the name of a stage as it begins; the stage before it is over."""

LEAST_S = 0.1
"""Between two updates: a person sees no more, and a terminal over a network takes no more."""


def unheard(done: float, total: float) -> None:
    """Tell nobody."""


def unseen(stage: str) -> Progress:
    """Begin a stage that nobody looks at."""
    return unheard


class Paced:
    """A `Progress` that passes on at most one call in ``LEAST_S``, and always the last one."""

    def __init__(self, show: Progress, clock: Callable[[], float] = time.monotonic) -> None:
        self._show, self._clock = show, clock
        self._next_s = -float("inf")

    def __call__(self, done: float, total: float) -> None:
        """Tell how much is done of how much."""
        now_s = self._clock()
        if now_s >= self._next_s or (done >= total > 0.0):
            self._next_s = now_s + LEAST_S
            self._show(done, total)
