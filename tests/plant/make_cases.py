"""Measured runs of a robot with something wrong.

`python -m tests.plant.make_cases --cases 10 --seed 1 -o folder`
"""

import argparse
import sys
import time
from pathlib import Path

from tests.plant.cases import line_of, make_case
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN


def main(arguments: list[str] | None = None) -> int:
    """Write cases and print a line for each."""
    parser = argparse.ArgumentParser(prog="python -m tests.plant.make_cases", description=__doc__)
    parser.add_argument("--cases", type=int, default=10, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="of the first case; case i has seed + i")
    parser.add_argument("-o", "--output", type=Path, help="folder for case-0001 …")
    parser.add_argument(
        "--effect", help="name, name@target, open:name, several with +, or none; default: drawn"
    )
    parser.add_argument("--form", choices=["same", "other"], help="default: a third are other forms")
    parser.add_argument("--runs", type=int, default=3, help="runs of a case")
    parser.add_argument("--twist", action="store_true", help="load encoders see the elastic twist too")
    parser.add_argument("--list", action="store_true", help="list the effects and stop")
    options = parser.parse_args(arguments)
    if options.list:
        print("\n".join([*LIBRARY, *SLIPS, *(f"open:{name}" for name in UNKNOWN)]))
        return 0
    if options.output is None:
        parser.error("-o is missing: a folder for the cases")
    for i in range(options.cases):
        start = time.perf_counter()
        try:
            label = make_case(
                options.seed + i,
                options.output / f"case-{i + 1:04d}",
                options.effect,
                options.form,
                runs=options.runs,
                twist=options.twist,
            )
        except ValueError as error:
            print(f"make_cases: {error}", file=sys.stderr)
            return 2
        print(f"case-{i + 1:04d}  {time.perf_counter() - start:4.1f} s  {line_of(label)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
