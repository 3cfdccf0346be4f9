"""Does a change of the code change what it computes? The same inputs through two trees, byte by byte.

``make`` stores calibration cases of the independent plant (``tests/plant``) once, ``run`` diagnoses them by
the code on PYTHONPATH, ``programs`` translates and predicts the examples by it, and ``compare`` says what
differs between two such outputs, and how much processor time and memory each took. ``time`` measures both in
the same run, which is the fairer comparison::

    python benchmarks/gap_identity.py make cases
    PYTHONPATH=old python benchmarks/gap_identity.py run cases old-out
    PYTHONPATH=new python benchmarks/gap_identity.py run cases new-out
    python benchmarks/gap_identity.py compare old-out new-out
    python benchmarks/gap_identity.py time old new cases --cases 8

Of the package only the command line and the public names are used, so that modules may move between the
trees. Without PYTHONPATH the code is that of this repository.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
if __name__ == "__main__":  # one thread each, so that sums are made in one order; before numpy is loaded
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "GCODE2KRL_THREADS"):
        os.environ[_name] = "1"
    os.environ.setdefault("MPLBACKEND", "Agg")
    if not os.environ.get("PYTHONPATH"):
        sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE))


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gap_identity.py", description=(__doc__ or "").split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)

    make = commands.add_parser("make", help="store cases: predictions and run folders")
    make.add_argument("folder", type=Path)
    make.add_argument("--cases", type=int, default=86)
    make.add_argument("--seed", type=int, default=3001, help="of the first case")

    run = commands.add_parser("run", help="diagnose the stored cases by the code on PYTHONPATH")
    run.add_argument("folder", type=Path)
    run.add_argument("out", type=Path, help="what is there by the same code is kept")
    run.add_argument("--jobs", type=int, default=1)
    run.add_argument("--every", type=int, default=1, metavar="N", help="only each Nth case")
    run.add_argument("--only", default="", metavar="WORD", help="only cases with this in their name")

    programs = commands.add_parser("programs", help="translate and predict the examples, fit their readings")
    programs.add_argument("out", type=Path)
    programs.add_argument("--only", default="", metavar="WORD", help="only jobs with this in their name")

    compare = commands.add_parser("compare", help="what differs; exit code 1 where anything does")
    compare.add_argument("out_a", type=Path)
    compare.add_argument("out_b", type=Path)
    compare.add_argument("--part", action="store_true", help="B is a part of A: only what B has counts")

    clock = commands.add_parser("time", help="processor time and memory of two trees, case by case in turn")
    clock.add_argument("tree_a", type=Path, help="folder that holds gcode2krl/")
    clock.add_argument("tree_b", type=Path)
    clock.add_argument("folder", type=Path, help="stored cases")
    clock.add_argument("--cases", type=int, default=8)
    clock.add_argument(
        "--rounds", type=int, default=2, help="how often each case, each time by new processes"
    )
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> int:
    """Run a command; exit code 0 done or identical, 1 not identical, 2 options that make no sense."""
    options = arguments(given)
    try:
        if options.command == "make":
            from gap_identity_cases import store

            return store(options.folder, options.cases, options.seed)
        if options.command == "run":
            from gap_identity_run import run

            return run(options.folder, options.out, options.jobs, options.every, options.only)
        if options.command == "programs":
            from gap_identity_programs import programs

            return programs(options.out, options.only)
        if options.command == "time":
            from gap_identity_time import time_trees

            trees = options.tree_a, options.tree_b
            return time_trees(*trees, options.folder, options.cases, options.rounds)
        from gap_identity_compare import compare

        return compare(options.out_a, options.out_b, options.part)
    except ValueError as error:
        print(f"gap_identity: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    raise SystemExit(main())
