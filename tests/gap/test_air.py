"""Dry runs beside a prediction with forces: stated, or told by where the tip is."""

from dataclasses import replace

import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import without_cuts
from tests.gap.synthetic import TRUE_STEP_S, applied, prediction, runs


def _pair(cuts, in_air=None, effects=()):
    nominal = prediction(dt_s=TRUE_STEP_S)
    ran = nominal if cuts else replace(nominal, forces=None, deflection=None)
    run = runs(list(effects), 1, 3, base=ran, force=False, normal=cuts)[0]
    run = replace(run, head=run.head.model_copy(update={"in_air": in_air}))
    return Pair(run=run, number=0, inputs=inputs_of(nominal))


@pytest.mark.parametrize(
    ("cuts", "stated", "is_in_air", "codes"),
    [
        (False, None, True, ["run-in-air"]),
        (False, True, True, []),
        (False, False, False, []),
        (True, None, False, []),
        (True, True, True, []),
    ],
)
def test_a_run_in_air_has_no_forces(cuts, stated, is_in_air, codes):
    (pair,), issues = without_cuts([_pair(cuts, stated)])
    assert (not pair.inputs.force_base_N.any()) == is_in_air
    assert (pair.inputs.forces is None) == is_in_air
    assert [issue.code for issue in issues] == codes


def test_a_gap_as_large_as_the_deflection_is_no_run_in_air():
    stiff = [*applied("stiffness:target=A1,scale=2"), *applied("stiffness:target=A2,scale=2")]
    (pair,), issues = without_cuts([_pair(True, effects=stiff)])
    assert pair.inputs.force_base_N.any()
    assert not issues
