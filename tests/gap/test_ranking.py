"""Which candidates are refitted: the gains of orthogonal waves are known in closed form."""

import numpy as np
import pytest

from gcode2krl.effects import Effect, Parameter, Role
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import Candidates, nuisance_for
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.examination import Examination, LinkData
from gcode2krl.gap.posterior.likelihood import refit
from gcode2krl.gap.posterior.selection import ranked, shortlist, threshold
from tests.gap.constructed import STEP_S, question, trace, wave

COUNT = 500
TIME_S = STEP_S * np.arange(COUNT)
WAVES = [wave(hz) for hz in (2.0, 3.0, 5.0)]


def examination(*sizes):
    """Return an examination of waves of given sizes in units of the noise, before anything is accepted."""
    y = sum(size * each.form(TIME_S) for size, each in zip(sizes, WAVES, strict=True))
    traces, asked, known = [trace(y[:, None])], question(WAVES), Signatures()
    nuisance = nuisance_for(traces, asked, known)
    candidates = Candidates.of(asked.blocks, traces, known)
    data = LinkData.of(traces[0].link, traces, asked, known, candidates, nuisance, [white(1.0)])
    fitted = refit(data.likelihood, ())
    return Examination(data, fitted, level=threshold(len(WAVES)))


def scores_of(found):
    return ranked(found, found.data.gram(found.fitted), found.data.candidates.columns)


def names(found, scores):
    return [score.column.block.effect.name for score in scores]


def test_surprising_ones_come_the_largest_gain_first():
    found = examination(0.9, 1.2, 0.05)
    scores = scores_of(found)
    assert names(found, scores) == ["wave_3", "wave_2"]
    # a sine of whole turns has the power of half its rows; the prior of its size costs almost nothing
    assert [score.gain for score in scores] == pytest.approx(
        [1.44 * COUNT / 2.0, 0.81 * COUNT / 2.0], rel=0.02
    )


def test_nothing_is_ranked_where_nothing_is():
    assert scores_of(examination(0.0, 0.0, 0.0)) == []


def test_the_shortlist_leaves_out_what_is_far_behind():
    found = examination(0.5, 2.0, 0.0)
    scores = scores_of(found)
    assert names(found, scores) == ["wave_3", "wave_2"]
    assert names(found, shortlist(found, scores, COUNT)) == ["wave_3"]
    close = examination(1.9, 2.0, 0.0)
    assert names(close, shortlist(close, scores_of(close), COUNT)) == ["wave_3", "wave_2"]


class Tone(Effect):
    """A tone at a frequency that is searched."""

    name, family, links = "tone", "joint", frozenset({"servo"})
    parameters = (
        Parameter("size_rad", "rad", -9.0, 9.0, nominal=0.0, start=1.0, source="a test", linear=True),
        Parameter("hz", "Hz", 1.0, 21.0, None, start=5.0, source="a test", role=Role.FREQUENCY),
    )


def test_what_is_searched_is_judged_by_its_scatter_after_the_refit(monkeypatch):
    """A frequency a little off leaves as much, where a tone is strongest, as scatter would."""
    monkeypatch.setattr("gcode2krl.gap.posterior.gram.Gram.inflation", lambda gram, columns: 1e3)
    found = examination(0.5, 0.0, 0.0)
    assert scores_of(found) == []
    for effect in WAVES:
        monkeypatch.setattr(type(effect), "frequency", Tone.parameters[1], raising=False)
    assert names(found, scores_of(found)) == ["wave_2"]
