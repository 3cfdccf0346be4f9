"""Answers that are put together by hand, with evidence to draw: no diagnosis is run."""

from dataclasses import replace

import numpy as np

from gcode2krl.gap.answer.evidence import Against, Evidence, RunEvidence
from gcode2krl.gap.answer.result import (
    AtPart,
    CauseResult,
    DependsOnResult,
    Gap,
    GapSize,
    IntervalResult,
    LinkResult,
    NotExamined,
    Unexplained,
    Where,
)
from gcode2krl.gap.posterior.cause_tests import Interval

BACKLASH = CauseResult(
    effect="backlash",
    target="A2",
    link="mechanics",
    probability=0.94,
    parameters={"gap_deg": Interval(0.0212, 0.0192, 0.0232)},
    shrink=0.976,
    rms_after=0.06,
)
LAG = replace(BACKLASH, effect="servo_lag", target="A4", parameters={}, probability=0.8, shrink=None)
UNSURE = replace(BACKLASH, effect="thermal", target=None, parameters={}, probability=0.31)
TIP = AtPart(what="tip", unit="mm", rms_before=0.4123, rms_after=0.0611, noise=0.0304, link="mechanics")
STEP = DependsOnResult(
    link="mechanics",
    at="tip",
    on="time in the run",
    form="step",
    probability=0.93,
    share=0.88,
    at_time_s=11.2,
    run="run-1",
    size=0.14,
    unit="mm",
    direction=(0.9, 0.3, 0.1),
)
STRETCH = IntervalResult(
    run="run-1",
    signal="tcp",
    t_start_s=2.0,
    t_end_s=4.0,
    lines=(120, 131),
    rms=0.8,
    what="reversal of A2",
    share=0.85,
)
TIME_S = np.arange(0.0, 10.0, 0.01)


def run_evidence(name="run-1", **more):
    """Return a run in which the gap is 0.3 mm from 2 s to 4 s and gone with the causes."""
    gap = np.where((TIME_S >= 2.0) & (TIME_S < 4.0), 0.3, 0.0)
    turn = 2.0 * np.pi * TIME_S / 10.0
    given = {
        "run": name,
        "time_s": TIME_S,
        "line": (1 + TIME_S // 1.0).astype(np.int64),
        "position_mm": np.stack(
            [100.0 * np.cos(turn), 50.0 * np.sin(turn), 10.0 * np.sin(2.0 * turn)], axis=1
        ),
        "before": gap,
        "after": 0.0 * gap,
        "size_before": gap,
        "size_after": 0.0 * gap,
        "against": Against("speed of A2 (deg/s)", np.sin(turn)),
    }
    return RunEvidence(**(given | more))


def evidence(*runs, **more):
    given = {
        "signal": "tcp",
        "component": "along what A2 moves",
        "unit": "mm",
        "noise": 0.03,
        "size_unit": "mm",
        "runs": runs or (run_evidence(), run_evidence("run-2")),
    }
    return Evidence(**(given | more))


GAP = Gap(
    verdict="explained",
    gap=GapSize(
        signal="tcp",
        unit="mm",
        rms_before=0.4123,
        rms_after=0.0611,
        noise_floor=0.0304,
        shrink=0.976,
        held_out=True,
    ),
    links=(
        LinkResult(link="servo", rms_before=1e-3, rms_after=1e-3, floor=None, unit="deg", verdict="no_gap"),
        LinkResult(
            link="mechanics",
            rms_before=0.4123,
            rms_after=0.0611,
            floor=0.0304,
            unit="mm",
            verdict="explained",
        ),
    ),
    where=Where(),
    causes=(BACKLASH,),
    unexplained=Unexplained(rms=0.06, significant=False, structure="white"),
    not_examined=(NotExamined(link="force", needs="force.csv"),),
    runs=("run-1", "run-2"),
    at_part=TIP,
)
UNEXPLAINED = replace(
    GAP,
    verdict="unexplained",
    causes=(),
    at_part=replace(TIP, rms_after=0.4123),
    unexplained=Unexplained(rms=0.4123, significant=True, structure="structured", depends_on=(STEP,)),
)
