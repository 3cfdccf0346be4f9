"""The next run: the same robot with the same fault, later that day, on a test program.

`python -m tests.plant.next_run CASE.label.json PROGRAM.json -o folder --prediction ../prediction`
"""

import argparse
import json
import sys
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from tests.plant import arm as arms
from tests.plant import folders, instruments, kinds, mismatch, truth, writing
from tests.plant.faults import Fault
from tests.plant.instruments import Instruments
from tests.plant.plans import Day, Plan
from tests.plant.programs import Program, Track, program_of
from tests.plant.robot import SLOW, Hooks, Run, simulate
from tests.plant.scene import CELL_TOML, GRAVITY_m_s2

LONG_s, SLOW_Hz = 60.0, 50.0
PLANNED = ("advance_stop", "corner", "override", "other_program", "velocity_rule")  # in the motion's law


def drive_next(
    label: dict,
    program: dict | Program,
    folder: str | Path,
    prediction: str,
    after_s: float = 600.0,
    number: int = 1,
    keys: dict | None = None,
) -> dict:
    """Write a run of a case's machine on a test program to `folder`; returns the label of this run.

    `label`: of `draw_case`. `program`: plain data (`programs.program_of`). `prediction`: for `run.toml`,
    as are more `keys` (`program`). The run begins `after_s` after the start of the case's last run.
    `number`: 1, 2 … of the runs after the case's; it draws the day's mismatch and noise.
    The label has `effects[]` with `signals` on this run and `acts`: whether the program lets it act at all.
    """
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; give a new folder for the run")
    program = program if isinstance(program, Program) else program_of(program)
    plan, _ = kinds.plan_of(**label["made_with"])
    day = _day(plan, label["seed"], number, after_s, program.name)
    sizes = [entry["size"] for entry in label["effects"]]
    acting = [(f, size, _acts(f, program)) for f, size in zip(plan.faults, sizes, strict=True)]
    run = _drive(plan, day, program, [f.hooks(size) for f, size, acts in acting if acts])
    writing.write_text(folder.parent / "cell.toml", CELL_TOML)
    how = _instruments(plan, program, float(run.t_s[-1]))
    folders.write_run(
        folder, day, run, how, {"cell": "../cell.toml", "prediction": prediction} | (keys or {})
    )
    return {
        "run": folder.name,
        "program": program.name,
        "number": day.number,
        "started": day.started.isoformat(),
        "age_s": day.age_s,
        "duration_s": float(run.elapsed_s[-1]),
        "effects": _changes(plan, day, program, run, acting),
    }


def _instruments(plan: Plan, program: Program, length_s: float) -> Instruments:
    """The case's instruments; a long program is logged more slowly, and on one in the air nothing is cut."""
    how = plan.how if not isinstance(program.way, Track) else replace(plan.how, scan=False)
    if length_s <= LONG_s:
        return how
    slow_s = max(how.controller_s, 1.0 / SLOW_Hz)
    return replace(
        how,
        tracker_hz=min(how.tracker_hz, SLOW_Hz),
        force_hz=min(how.force_hz, SLOW_Hz),
        controller_s=round(slow_s / how.controller_s) * how.controller_s,
    )


def _day(plan: Plan, seed: int, number: int, after_s: float, name: str) -> Day:
    last, rng = plan.days[-1], np.random.default_rng([seed, 2, number])
    return Day(
        last.number + number,
        name,
        mismatch.of_day(plan.robot, rng, plan.options.law),
        last.started + timedelta(seconds=round(after_s)),
        last.age_s + round(after_s),
        int(rng.integers(1 << 31)),
    )


def _acts(fault: Fault, program: Program) -> bool:
    """Joints over time leave no room for an error of the motion's own law."""
    return not (isinstance(program.way, Track) and fault.kind.name in PLANNED)


def _drive(plan: Plan, day: Day, program: Program, hooks: list[Hooks]) -> Run:
    hung: list[Hooks] = [{"load": hang(program)}] if program.weights else []
    return simulate(
        program.way,
        plan.world,
        [*hung, *hooks],
        day.mismatch,
        day.age_s,
        day.number,
        program.pauses,
        program.spindle,
    )


def hang(program: Program):
    """Known masses on the tool, as forces and moments at the TCP."""

    def load(run: Run) -> None:
        arm, elapsed_s = run.body(), run.elapsed_s[::SLOW]
        axes = arms.pose(arm, np.ascontiguousarray(run.q_load[::SLOW]))[1]
        for weight in program.weights:
            on = (elapsed_s >= weight.from_s) & (elapsed_s < weight.to_s)
            down = np.array([0.0, 0.0, -GRAVITY_m_s2 * weight.kg])
            pull = on[:, None] * (down + run.world.base.axes @ np.asarray(weight.pull_N, float))
            run.force_N = run.force_N + pull
            run.moment_Nmm = run.moment_Nmm + np.cross(axes @ np.asarray(weight.at_mm), pull)

    return load


def _changes(plan: Plan, day: Day, program: Program, run: Run, acting: list) -> list[dict]:
    how = replace(plan.how, foreign=())
    bare = instruments.clean(_drive(plan, day, program, []), how)
    out = []
    for fault, size, acts in acting:
        alone = run if len(acting) == 1 else _drive(plan, day, program, [fault.hooks(size)] if acts else [])
        change = truth.differences(instruments.clean(alone, how), bare)
        out.append(
            {
                "effect": fault.kind.name,
                "target": fault.target,
                "acts": acts,
                "signals": truth.sizes([change], how),
            }
        )
    return out


def main(arguments: list[str] | None = None) -> int:
    """Write one run and print its label."""
    parser = argparse.ArgumentParser(prog="python -m tests.plant.next_run", description=__doc__)
    parser.add_argument("label", type=Path)
    parser.add_argument("program", type=Path, help="plain data as JSON")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the run")
    parser.add_argument("--prediction", required=True, help="as run.toml is to say it")
    parser.add_argument("--after", type=float, default=600.0, help="seconds after the last run's start")
    options = parser.parse_args(arguments)
    try:
        label = json.loads(options.label.read_text(encoding="utf-8"))
        program = json.loads(options.program.read_text(encoding="utf-8"))
        done = drive_next(label, program, options.output, options.prediction, options.after)
    except (OSError, ValueError, KeyError) as error:
        print(f"next_run: {error}", file=sys.stderr)
        return 2
    writing.write_label(options.output.with_name(options.output.name + ".label.json"), done)
    print(json.dumps(done["effects"], indent=1, default=float))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
