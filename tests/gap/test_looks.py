"""A diagnosis on one line, in a notebook, and as a figure; the numbers are those of its report."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError
from gcode2krl.gap.answer.evidence import Evidence, RunEvidence
from gcode2krl.gap.answer.result import AtPart, Gap, GapSize, LinkResult, Unexplained, Where
from gcode2krl.gap.answer.words import gap_html, gap_words


def run(name):
    """A run whose residual is a wave."""
    time_s = 0.01 * np.arange(300)
    wave = np.sin(time_s)
    return RunEvidence(
        run=name,
        time_s=time_s,
        line=np.ones(300, dtype=np.int64),
        position_mm=np.stack([time_s, wave, 0.0 * wave], axis=1),
        before=wave,
        after=0.1 * wave,
        size_before=np.abs(wave),
        size_after=0.1 * np.abs(wave),
        against=None,
    )


@pytest.fixture
def gap():
    evidence = Evidence(
        signal="tcp",
        component="along x",
        unit="mm",
        noise=0.02,
        size_unit="mm",
        runs=(run("run-1"), run("a<b")),
    )
    return Gap(
        verdict="unexplained",
        gap=GapSize(signal="tcp", unit="mm", rms_before=0.7, rms_after=0.07),
        links=(
            LinkResult(
                link="mechanics", rms_before=0.7, rms_after=0.07, floor=0.02, unit="mm", verdict="unexplained"
            ),
        ),
        where=Where(),
        causes=(),
        unexplained=Unexplained(rms=0.07, significant=True, structure="structured"),
        not_examined=(),
        at_part=AtPart(what="tip", unit="mm", rms_before=0.7, rms_after=0.07, noise=0.02, link="mechanics"),
        evidence=evidence,
    )


def test_on_one_line(gap):
    assert gap_words(gap).startswith("unexplained: The tip is off by 0.70 mm RMS")
    assert repr(gap) == f"Gap({gap_words(gap)})"


def test_as_a_notebook_shows_it(gap):
    page = gap_html(gap)
    ET.fromstring(page)
    assert "<td" in page
    assert "mechanics" in page
    assert "<svg" in page
    assert len(page) < 30_000


def test_a_run_is_drawn_by_its_name(gap):
    assert gap.plot().get_suptitle().startswith("run-1")
    assert gap.plot("a<b").get_suptitle().startswith("a<b")
    assert gap.plot()._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(Gcode2KrlError, match=r"no run 'run-9'.*the runs are run-1, a<b"):
        gap.plot("run-9")
    with pytest.raises(Gcode2KrlError, match="nothing was compared"):
        replace(gap, evidence=None).plot()
