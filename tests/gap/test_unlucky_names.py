"""A user's effects are what they state, however they and their parameters are called.

Names here are those that other effects, links, signals and tables have. A fit that goes by names takes any
`phase` for that of a sine, any `hz` for a frequency and any `harmonic` for a count.
"""

import functools

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.gap import Gap, diagnose
from tests.gap.synthetic import applied, prediction, runs

pytestmark = pytest.mark.slow

CLOCK_WORKS = '''
"""Six sizes, each on a joint of its own, with names that mean something elsewhere."""

import numpy as np

from gcode2krl.effects import Dependence, Effect, Parameter, Where

NAMES = ("phase", "hz", "harmonic", "gap_deg", "offset_s", "scale")


class ClockWorks(Effect):
    """Each motor is off by its size, in degrees, where its joint moves at its highest speed."""

    name = "clock_works"
    family = "servo_lag"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.VELOCITY})
    parameters = tuple(
        Parameter(name, "deg", -0.1, 0.1, nominal=0.0, start=0.01, linear=True, source="test")
        for name in NAMES
    )

    def targets(self, cell):
        return ("controller", "q_cmd")

    def servo(self, q_act_rad, inputs, applied):
        speed = np.gradient(inputs.q_cmd_rad, inputs.time_s, axis=0)
        share = (speed / np.abs(speed).max(axis=0)) ** 2
        power = share if applied.target == "controller" else share**4
        return q_act_rad + np.radians(applied.vector(NAMES)) * power


EFFECT = ClockWorks()
'''

MECHANICS = '''
"""What rings, with a real phase and frequency that are not called so; the effect is called as a link."""

import numpy as np

from gcode2krl.effects import Dependence, Effect, Parameter, Role, Where


class Ringing(Effect):
    """The tip rings along z after the start: mm·exp(-t/1 s)·sin(2·pi·beat·t + turn)."""

    name = "mechanics"
    family = "tip"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.RUN_START, Dependence.TONE})
    parameters = (
        Parameter("mm", "mm", 0.0, 2.0, nominal=0.0, start=0.1, linear=True, source="test"),
        Parameter("turn", "rad", -3.2, 3.2, nominal=None, start=0.0, source="test", role=Role.PHASE),
        Parameter("beat", "Hz", 2.0, 20.0, nominal=None, start=5.0, source="test", role=Role.FREQUENCY),
    )

    def tcp(self, tcp_mm, deflection_mm, inputs, applied):
        angle = 2.0 * np.pi * applied["beat"] * inputs.time_s + applied["turn"]
        ringing = applied["mm"] * np.exp(-inputs.time_s) * np.sin(angle)
        return tcp_mm + ringing[:, None] * np.array([0.0, 0.0, 1.0])


EFFECT = Ringing()
'''

SIZES = {
    "phase": 0.004,
    "hz": -0.006,
    "harmonic": 0.005,
    "gap_deg": -0.003,
    "offset_s": 0.004,
    "scale": 0.006,
}
TONE = {"mm": 0.3, "turn": 2.0, "beat": 6.3}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "clock_works.py").write_text(CLOCK_WORKS, encoding="utf-8")
    (tmp_path / "servo.py").write_text(MECHANICS, encoding="utf-8")
    return tmp_path


def _gap(folder, name, target, values, **signals) -> Gap:
    effect = library([folder])[name]
    return diagnose(
        prediction(), runs([Applied(effect, target, values)], 2, 11, **signals), effects=[str(folder)]
    )


def test_sizes_called_phase_hz_and_harmonic_are_fitted_as_sizes(folder):
    gap = _gap(folder, "clock_works", "controller", SIZES, tracker=False, force=False)
    cause = gap.causes[0]
    assert (gap.verdict, cause.effect, cause.target) == ("explained", "clock_works", "controller")
    assert len(gap.named_causes) == 1
    assert gap.gap.shrink > 0.95
    for name, truth in SIZES.items():
        value = cause.parameters[name]
        assert value.value == pytest.approx(truth, rel=0.05), name
        # 90 % intervals of six numbers: each holds the truth once it is widened by half of itself
        around = 0.25 * (value.high - value.low)
        assert value.low - around <= truth <= value.high + around, name
        assert value.high - value.low < 0.3 * abs(truth), name


def test_a_phase_and_a_frequency_are_found_by_their_roles(folder):
    gap = _gap(folder, "mechanics", None, TONE, force=False)
    cause = gap.causes[0]
    assert (gap.verdict, cause.effect, cause.link) == ("explained", "mechanics", "mechanics")
    found = {name: each.value for name, each in cause.parameters.items()}
    assert found["mm"] == pytest.approx(TONE["mm"], rel=0.1)
    assert found["beat"] == pytest.approx(TONE["beat"], abs=0.01)
    assert np.cos(found["turn"] - TONE["turn"]) > 0.97
    turn = cause.parameters["turn"]
    assert 0.0 < turn.high - turn.low < 1.5  # of an angle, about its value


@functools.cache
def _lagging_runs():
    return runs(applied("servo_lag:target=A3,tau_s=0.012"), 2, 5, force=False)


def test_a_folder_of_effects_changes_no_answer_that_they_have_no_part_in(folder):
    without = diagnose(prediction(), _lagging_runs())
    beside = diagnose(prediction(), _lagging_runs(), effects=[str(folder)])
    assert _names(without) == _names(beside) == [("servo_lag", "A3")]
    assert (without.verdict, _verdicts(without)) == (beside.verdict, _verdicts(beside))
    # noise is what no candidate explains: with more candidates its last digits move, and the fit's with them
    one, other = (gap.causes[0].parameters["tau_s"] for gap in (without, beside))
    assert one == pytest.approx(other, rel=1e-3)
    assert without.gap.shrink == pytest.approx(beside.gap.shrink, abs=1e-4)


def _names(gap: Gap):
    return [(each.effect, each.target) for each in gap.named_causes]


def _verdicts(gap: Gap):
    return [(each.link, each.verdict) for each in gap.links]
