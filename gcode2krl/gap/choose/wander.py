"""Wander of an instrument: what each run has in its own way over time, within what noise may be.

Random walks, 1/f noise and the zero of an amplifier are smooth in time, or nearly so, in all runs and alike
in no two. Where time in each run says clearly more of a rest than any other input, moves the signal by no
more than slow noise may (`noise_most_slow`), and leaves nothing significant once taken off, it is noise of a
long memory. What happens in one run alone is an event.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.choose.examination import Examination
from gcode2krl.gap.choose.family_tests import LinkFamilies, Rest
from gcode2krl.gap.choose.gap_size import size_of_gap
from gcode2krl.gap.families.evidence import Evidence
from gcode2krl.gap.fit.design import nuisance_for
from gcode2krl.gap.fit.noise import Noise
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.thresholds import THRESHOLDS


def is_wander(found: Examination, traces: Sequence[Trace], rest: Rest) -> bool:
    """Tell whether what is left of a link without any cause (`rest`, of these traces) is such a wander.

    Trackers and force sensors wander; an encoder counts.
    """
    if (
        found.link.of_joints
        or len(traces) < 2
        or not rest.study.evidences
        or not _is_own_time(rest.study.evidences)
    ):
        return False
    best = rest.study.evidences[0]
    if not _is_small(best, found.noise):
        return False
    steady = [_less(trace, best, signal) for trace, signal in zip(traces, best.signal, strict=True)]
    for before, after in zip(traces, steady, strict=True):
        found.data.known.same(before, after)  # what was measured changes no signature
    plain = _without_causes(found)
    nuisance = nuisance_for(steady, found.question, found.data.known)
    if size_of_gap(steady, nuisance, found.noise, (), found.mismatch).significant:
        return False
    return not LinkFamilies(plain, steady).rest.is_gap


def _is_own_time(evidences: Sequence[Evidence]) -> bool:
    """Tell whether time in each run, smoothly, says clearly more than every other input."""
    best = evidences[0]
    others = [each.nats for each in evidences if each.on is not Dependence.RUN_TIME]
    least = THRESHOLDS.families.alike_nats * best.inflation
    return best.on is Dependence.RUN_TIME and best.nats - max(others, default=0.0) > least


def _is_small(evidence: Evidence, noise: Sequence[Noise]) -> bool:
    """Tell whether a family moves each component by no more than slow noise may, and every run moves."""
    component = evidence.place.component
    at = slice(None) if component is None else slice(component, component + 1)
    rms = np.sqrt(np.mean(np.concatenate(evidence.signal) ** 2, axis=0))
    most = THRESHOLDS.fit.noise_most_slow * np.array([each.short_sigma for each in noise[at]])
    moved = [float(np.linalg.norm(np.std(signal, axis=0))) for signal in evidence.signal]
    is_stationary = min(moved) >= THRESHOLDS.fit.noise_wander_share * max(moved)
    return is_stationary and bool(np.all(rms <= most))


def _less(trace: Trace, evidence: Evidence, signal: Floats) -> Trace:
    component = evidence.place.component
    measured = trace.measured.copy()
    if component is None:
        measured -= signal
    else:
        measured[:, component] -= signal[:, 0]
    return replace(trace, measured=measured)


def _without_causes(found: Examination) -> Examination:
    while found.cause_numbers:
        number = found.cause_numbers[-1]
        found = found.dropping(number, refit(found.likelihood, found.without(number)))
    return found
