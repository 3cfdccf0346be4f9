"""Fuzz inputs from outside: programs, cells, predictions, meshes, telegrams, KRL programs.

python benchmarks/fuzz.py predictions --count 10000 --seed 1
"""

import argparse
import sys
from importlib import import_module

KINDS = ("gcode", "cells", "predictions", "meshes", "telegrams", "krl")


def main(argv: list[str] | None = None) -> int:
    """Hand over to the benchmark of a kind."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--count", help="cases; default: that of the kind")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--minutes", help="of gcode: read beside rs274 for so long")
    chosen = parser.parse_args(argv)
    count = ["--count", chosen.count] if chosen.count is not None else []
    if chosen.minutes is not None:
        if chosen.kind != "gcode":
            parser.error("--minutes is of gcode alone")
        count = ["--minutes", chosen.minutes]
    return int(import_module(f"fuzz_{chosen.kind}").main([*count, "--seed", chosen.seed]))


if __name__ == "__main__":
    sys.exit(main())
