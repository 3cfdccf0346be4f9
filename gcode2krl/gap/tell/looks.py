"""A diagnosis on one line, and as a notebook shows it."""

from collections.abc import Iterator

from gcode2krl.exchange.findings import findings_block
from gcode2krl.exchange.html import beside, block, line_picture, paragraph, text_table
from gcode2krl.gap.tell.first_sentence import headline
from gcode2krl.gap.tell.result import Gap
from gcode2krl.gap.tell.words import describe, number
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell


def gap_words(gap: Gap) -> str:
    """Return the verdict and the first sentence, cut where it is long."""
    sentence = headline(gap)
    short = sentence if len(sentence) <= _LIMITS.most_letters else f"{sentence[: _LIMITS.most_letters - 1]}…"
    return f"{gap.verdict}: {short}"


def gap_html(gap: Gap) -> str:
    """Return the first sentence, the links, the causes, the residual over time and the findings as HTML."""
    links = text_table(
        ("link", "before", "after", "noise", "unit", "verdict"),
        [
            (
                each.link,
                number(each.rms_before),
                number(each.rms_after),
                number(each.floor),
                each.unit,
                each.verdict,
            )
            for each in gap.links
        ],
    )
    causes = text_table(
        ("cause", "probability"),
        [(describe(cause), f"{cause.probability:.0%}") for cause in gap.causes[: _LIMITS.most_shown]],
    )
    head = paragraph(headline(gap))
    pictures = "".join(_pictures(gap))
    return block(f"Gap({gap.verdict})", head, beside(links, causes, pictures), findings_block(gap.issues))


def _pictures(gap: Gap) -> Iterator[str]:
    """Yield the residual of the first run over time, before and with the named causes."""
    evidence = gap.evidence
    if evidence is None or not evidence.runs:
        return
    run = evidence.runs[0]
    yield paragraph(
        f"{run.run}: {evidence.signal}, {evidence.component} ({evidence.unit}), before and with causes"
    )
    yield line_picture(run.time_s, [run.before, run.after])
