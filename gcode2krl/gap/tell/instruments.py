"""What the answer says of the instruments: their noise and where it is known from, steps, rows left out."""

from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl.errors import Issue
from gcode2krl.gap.beside.decimals import step_of
from gcode2krl.gap.beside.trace import Trace, Whose
from gcode2krl.gap.choose.judged import Judgement
from gcode2krl.gap.fit.noise_source import are_repeats
from gcode2krl.gap.fit.pose_noise import is_revisited
from gcode2krl.gap.tell.result import OF_POSES, NoiseResult
from gcode2krl.gap.tell.words import listed, number
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell
_REPEATS, _RUNS = "repeats", "each run by itself"


def noise_of(judgement: Judgement) -> NoiseResult | None:
    """Return the noise of a link, in the unit of the report; None where no instrument measures it."""
    if not judgement.link.has_instrument:
        return None
    models, traces = judgement.examination.noise, judgement.traces
    stated = [trace.declared_sigma for trace in traces if trace.declared_sigma is not None]
    return NoiseResult(
        stated=judgement.factor * max(stated) if stated else None,
        learnt=judgement.factor * _rms([each.sigma for each in models]),
        short=judgement.factor * _rms([each.short_sigma for each in models]),
        source=_source(traces),
    )


def _source(traces: Sequence[Trace]) -> str:
    if traces[0].still:
        return _REPEATS if is_revisited(traces) else OF_POSES
    return _REPEATS if are_repeats(traces) else _RUNS


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def readings_of_noise(judgements: Sequence[Judgement]) -> Iterator[str]:
    """Yield for each link whose noise is neither stated nor repeated what it may be."""
    for judgement in judgements:
        noise = noise_of(judgement)
        if noise is None or noise.stated is not None or noise.source == _REPEATS:
            continue
        unit = judgement.link.unit
        said = f"{judgement.link.name}: the noise is neither stated nor repeated; "
        said += f"taken as {number(noise.learnt)} {unit}"
        if judgement.traces[0].still and judgement.verdict == "no_gap":
            off = judgement.factor * (judgement.size.before / judgement.traces[0].shape[1]) ** 0.5
            said += f"; were it less, the {number(off)} {unit} that the poses are off by would be a gap"
        if noise.learnt > _LIMITS.same_reading * noise.short:
            said += (
                f", of which {number(noise.short)} {unit} are forgotten within milliseconds: "
                "what wanders within seconds may be a gap"
            )
        yield said


def issues_of(judgements: Sequence[Judgement]) -> Iterator[Issue]:
    """Yield the findings of instruments: more noise than stated, coarse steps, bursts that were left out."""
    for judgement in judgements:
        noise = noise_of(judgement)
        if noise is not None:
            yield from _above_stated(judgement, noise)
            yield from _in_steps(judgement, noise)
            yield from _bursts(judgement)


def _above_stated(judgement: Judgement, noise: NoiseResult) -> Iterator[Issue]:
    most = THRESHOLDS.fit.noise_most_stated
    if noise.stated is None or noise.short < 0.999 * most * noise.stated:
        return
    known, taken = (f"{number(each)} {judgement.link.unit}" for each in (noise.stated, noise.short))
    message = f"noisier than the {known} that run.toml states; no more than {taken} is taken as noise"
    yield Issue("warning", "noise-above-stated", 0, f"{judgement.link.name}: {message}")


def _in_steps(judgement: Judgement, noise: NoiseResult) -> Iterator[Issue]:
    """Yield the finding that readings move in steps that are coarse beside their noise."""
    known = noise.short if noise.stated is None else noise.stated
    traces = judgement.every or judgement.traces
    coarse = {}
    for j, name in enumerate(traces[0].components):
        step = judgement.factor * max(step_of(trace.measured[:, j]) for trace in traces)
        if step > _LIMITS.coarse_steps * known:
            coarse[name] = step
    if not coarse:
        return
    steps, least = (f"{number(each)} {judgement.link.unit}" for each in (max(coarse.values()), known))
    message = f"readings in a ladder of {steps}, the noise is {least}"
    yield Issue(
        "warning", "readings-in-steps", 0, f"{judgement.link.name}, {listed(list(coarse))}: {message}"
    )


def _bursts(judgement: Judgement) -> Iterator[Issue]:
    """Yield a finding for each run with rows that were left out as bursts of the instrument."""
    for trace in judgement.every or judgement.traces:
        bursts = [each for each in trace.events if each.whose is Whose.INSTRUMENT]
        if not bursts:
            continue
        largest = judgement.factor * max(float(np.linalg.norm(each.peak)) for each in bursts)
        lasts_s = sum(each.span_s[1] - each.span_s[0] for each in bursts)
        shown = [f"{each.at_s:.2f} s (line {each.line})" for each in bursts[: _LIMITS.most_bursts]]
        more = f" and {len(bursts) - len(shown)} more" if len(bursts) > len(shown) else ""
        size = f"{number(largest)} {judgement.link.unit}"
        message = f"rough for {lasts_s:.2f} s in all, up to {size}, at {', '.join(shown)}{more}"
        said = f"{trace.run}: {judgement.link.name}: {message}: left out, in step with nothing"
        yield Issue("note", "instrument-bursts", 0, said)
