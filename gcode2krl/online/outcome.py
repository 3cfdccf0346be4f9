"""Results of the twin: the four figures of the paper, and the details behind them."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.errors import Issue
from gcode2krl.online.depth import depth_by_side, tool_axis
from gcode2krl.online.judge import Judged
from gcode2krl.online.pilot_gate import Gate
from gcode2krl.online.twin import CASES, Case, Twin, TwinRun, as_settings, simulate
from gcode2krl.progress import Progress, unheard

MATTERS_MM = 0.01
"""A smaller difference is neither better nor worse: a robot's path repeats no more closely."""
_MOST_LINES = 5


class WorseLine(NamedTuple):
    """A line of G-code in which a compensation makes the part worse."""

    line: int
    excess_mm: float
    """By how much at the worst sample."""
    time_s: float
    """For how long."""


class Gain(NamedTuple):
    """A case beside the uncompensated one, over the samples that are judged."""

    rms_mm: float
    rms_less_percent: float | None
    better_share: float
    worse_share: float
    """Of the judged time; the rest differs by less than `MATTERS_MM`."""
    worst_line: int
    """Where the largest deviation of the case is."""
    worse: tuple[WorseLine, ...]
    """The largest excess first."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {**self._asdict(), "worse": [each._asdict() for each in self.worse]}


def gain_of(
    before_mm: Floats, after_mm: Floats, counts: Bools, source_line: Ints32, cycle_s: float
) -> Gain | None:
    """Return what a case gains; all (n,), deviations normal to the feed. None where nothing is judged."""
    if not counts.any():
        return None
    before, after, line = before_mm[counts], after_mm[counts], source_line[counts]
    excess = after - before
    rms_before, rms_after = _rms(before), _rms(after)
    worse = excess > MATTERS_MM
    findings = [
        _worse_line(int(number), excess, worse & (line == number), cycle_s)
        for number in np.unique(line[worse])
    ]
    findings.sort(key=lambda each: -each.excess_mm)
    return Gain(
        rms_mm=rms_after,
        rms_less_percent=100.0 * (1.0 - rms_after / rms_before) if rms_before else None,
        better_share=float((excess < -MATTERS_MM).mean()),
        worse_share=float(worse.mean()),
        worst_line=int(line[np.argmax(after)]),
        worse=tuple(findings[:_MOST_LINES]),
    )


def _worse_line(number: int, excess_mm: Floats, where: Bools, cycle_s: float) -> WorseLine:
    return WorseLine(number, float(excess_mm[where].max()), float(where.sum() * cycle_s))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


Runs = Mapping[Case, TwinRun]


def simulate_all(twin: Twin, progress: Progress = unheard) -> dict[Case, TwinRun]:
    """Return the four cases."""
    runs = {}
    for case in CASES:
        runs[case] = simulate(twin, case)
        progress(len(runs), len(CASES))
    return runs


def figures_of(runs: Runs, judged: Judged) -> dict[str, float | None]:
    """Return the largest deviation normal to the feed of each case in mm; None where nothing is judged."""
    return {f"{case}_mm": _worst(run, judged.counts) for case, run in runs.items()}


def as_json(twin: Twin, runs: Runs, judged: Judged, source_line: Ints32) -> dict[str, Any]:
    """Return the object of ``online simulate --json``; ``source_line`` (n,) is the line of each sample."""
    figures = figures_of(runs, judged)
    before, after = figures["uncompensated_mm"], figures["pilot_mm"]
    reduction = 100.0 * (1.0 - after / before) if before and after is not None else None
    return {
        **figures,
        "reduction_percent": reduction,
        "gain": {case: _gain(runs, case, judged, source_line) for case in runs},
        "depth": depth_by_side(twin, dict(runs), judged),
        "depth_mm": {case: _depth(twin, run, judged) for case, run in runs.items()},
        "descents_mm": {case: _worst(run, judged.ploughs) for case, run in runs.items()},
        "lines": [
            _line_row(int(n), runs, judged, source_line) for n in np.unique(source_line[judged.counts])
        ],
        "pilot": pilot_of(twin, runs),
        "max_force_N": float(np.linalg.norm(runs["uncompensated"].force_N, axis=1).max(initial=0.0)),
        "settings": as_settings(twin),
    }


def _gain(runs: Runs, case: Case, judged: Judged, source_line: Ints32) -> dict[str, Any] | None:
    """Return what a case gains over no compensation; see `gain.Gain`."""
    run, before = runs[case], runs["uncompensated"]
    cycle_s = float(run.time_s[1] - run.time_s[0]) if len(run.time_s) > 1 else 0.0
    gain = gain_of(before.normal_mm, run.normal_mm, judged.counts, source_line, cycle_s)
    return gain.as_dict() if gain is not None else None


def pilot_of(twin: Twin, runs: Runs) -> dict[str, Any]:
    """Return whether the pilot was used, and why not."""
    device = runs["pilot"].device
    if device is None:
        raise ValueError("the case with pilot has no compensator")
    cycles = np.bincount(device.gate, minlength=len(Gate))
    return {
        "knots": len(twin.knots),
        "used_share": float((device.weight > 0.0).mean()) if len(device.weight) else 0.0,
        "distrusted_cycles": int(device.distrusted.sum()),
        "gate_cycles": {gate.name.lower(): int(cycles[gate]) for gate in Gate if cycles[gate]},
    }


def findings(twin: Twin, runs: Runs, judged: Judged) -> list[Issue]:
    """Return the findings that a reader of the figures should know."""
    issues = []
    pilot = pilot_of(twin, runs)
    closed = [
        name for name in ("checksum", "override", "mode", "order", "speed") if name in pilot["gate_cycles"]
    ]
    if closed:
        sentence = f"the pilot was refused ({', '.join(closed)}): the measured force alone is compensated"
        issues.append(Issue("warning", "pilot-refused", 0, sentence, "it is valid at 100 % override only"))
    if pilot["distrusted_cycles"]:
        sentence = (
            f"the pilot was wrong by more than {twin.settings.threshold_N:g} N in steady cuts "
            f"({pilot['distrusted_cycles']} cycles): not used there"
        )
        issues.append(Issue("warning", "pilot-wrong", 0, sentence, "measure the force coefficients"))
    if judged.ploughs.any():
        worst = max(_worst(run, judged.ploughs) or 0.0 for run in runs.values())
        sentence = (
            f"descents with ploughing edges (up to {worst:.2f} mm) are judged separately: a guessed force"
        )
        issues.append(Issue("note", "descent", 0, sentence, ""))
    if not judged.counts.any():
        remedy = "state [stock]: a guessed one may leave nothing to cut"
        issues.append(Issue("warning", "nothing-judged", 0, "no cut leaves a wall on the part", remedy))
    return issues


def _worst(run: TwinRun, where: Any) -> float | None:
    return float(run.normal_mm[where].max()) if where.any() else None


def _depth(twin: Twin, run: TwinRun, judged: Judged) -> float | None:
    """Return the largest deviation along the tool axis in mm."""
    if not judged.counts.any():
        return None
    axis = tool_axis(twin)[judged.counts]
    return float(np.abs(np.einsum("ij,ij->i", run.error_mm[judged.counts], axis)).max())


def _line_row(number: int, runs: Runs, judged: Judged, source_line: Ints32) -> dict[str, float | int | None]:
    in_line = judged.counts & (source_line == number)
    return {"line": number, **{f"{case}_mm": _worst(run, in_line) for case, run in runs.items()}}
