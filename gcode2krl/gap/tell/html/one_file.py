"""``--html gap.html``: the answer as one file without network, written whole or not at all."""

from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from gcode2krl.files import write_together
from gcode2krl.gap.tell.evidence import Evidence, RunEvidence
from gcode2krl.gap.tell.first_sentence import headline, stretch
from gcode2krl.gap.tell.html.path_svg import Strip, View, points, scale_colours, strip, views
from gcode2krl.gap.tell.html.pictures import largest_size, picture_bytes, run_figure
from gcode2krl.gap.tell.report import left_lines, where_words, worst
from gcode2krl.gap.tell.result import CauseResult, Gap
from gcode2krl.gap.tell.words import alike, depends, describe, happened, kind, named, next_run, number
from gcode2krl.report.page.one_file import base_css
from gcode2krl.version import __version__

_VERDICTS = {
    "no_gap": "no gap",
    "explained": "explained",
    "partly_explained": "partly explained",
    "unexplained": "not explained",
}


@dataclass(frozen=True)
class RunOnPage:
    """One run as the page shows it."""

    name: str
    views: list[View]
    strip: Strip
    points: dict[str, list[Any]]
    picture: str
    """PNG in base 64."""


def write_page(gap: Gap, file: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Write the page; raises `NotUnderstoodError` where the file cannot be written or is an input."""
    write_together({file: page(gap).encode("utf-8")}, inputs)


def page(gap: Gap) -> str:
    """Return the page: the first sentence, where, why, what remains and the next run."""
    evidence = gap.evidence
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            gap=gap,
            sentence=headline(gap),
            verdict=_VERDICTS[gap.verdict],
            stretches=gap.where.intervals[: worst(gap.where.intervals)[0]],
            where_words=where_words(gap.where.intervals) if gap.where.intervals else None,
            runs=[] if evidence is None else [_run(gap, evidence, run) for run in evidence.runs],
            evidence=evidence,
            colours=scale_colours(),
            largest=0.0 if evidence is None else largest_size(evidence),
            causes=[_cause(cause) for cause in gap.causes],
            events=[happened(each) for each in gap.events],
            left=list(left_lines(gap)),
            courses=[(depends(each), each.course) for each in gap.unexplained.depends_on if each.course],
            next_run=[] if gap.next_run is None else next_run(gap.next_run),
            version=__version__,
            base_css=base_css(),
        )
    )


def _run(gap: Gap, evidence: Evidence, run: RunEvidence) -> RunOnPage:
    return RunOnPage(
        name=run.run,
        views=views(evidence, run),
        strip=strip(evidence, run, gap.where.intervals),
        points=points(run),
        picture=b64encode(picture_bytes(run_figure(gap, run))).decode("ascii"),
    )


def _cause(cause: CauseResult) -> dict[str, Any]:
    """Return a cause with its words."""
    return {
        "words": describe(cause),
        "said": cause.words,
        "is_named": cause.is_named,
        "probability": cause.probability,
        "shrink": cause.shrink,
        "kind": kind(cause),
        "alike": alike(cause.indistinguishable_from),
        "rivals": [
            (named(rival.effect, rival.target), rival.probability)
            for rival in cause.rivals or ()
            if rival.probability >= 0.01
        ],
    }


def _environment() -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("gcode2krl.gap.tell.html", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"number": number, "percent": lambda value: f"{value:.0%}", "stretch": stretch}
    return made
