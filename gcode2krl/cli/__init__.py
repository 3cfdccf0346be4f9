"""The command line: one thin file for each command."""

import atexit
import gc

gc.set_threshold(200_000)  # nearly all objects of a start are kept: a search for cycles among them finds none
atexit.register(gc.freeze)  # nor does the one with which Python ends, which took 0.15 s
