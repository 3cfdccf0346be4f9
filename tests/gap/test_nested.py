"""A family that contains another is told before it only where it takes clearly more."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.components import Place
from gcode2krl.gap.posterior.families import Evidence
from gcode2krl.gap.posterior.study import CONTAINS, simplest_first


def evidence(on, nats, place="tip"):
    return Evidence(
        place=Place(place, Where.TIP, ()),
        on=on,
        nats=nats,
        gain=2.0 * nats,
        inflation=1.0,
        flipped=np.zeros(1),
        unbounded=nats,
        said=(),
    )


def order(*evidences):
    return [(each.on, each.nats) for each in simplest_first(evidences)]


@pytest.mark.parametrize("larger", sorted(CONTAINS, key=lambda each: each.value))
def test_the_smaller_one_is_told_where_the_larger_takes_hardly_more(larger):
    smaller = min(CONTAINS[larger], key=lambda each: each.value)
    assert order(evidence(larger, 1000.0), evidence(smaller, 985.0)) == [(smaller, 1000.0), (larger, 985.0)]
    assert order(evidence(larger, 1000.0), evidence(smaller, 890.0)) == [(larger, 1000.0), (smaller, 890.0)]


def test_what_each_run_does_over_time_is_the_last_resort():
    """A physical input that does nearly as well comes first; of two of these the better one."""
    near = [evidence(Dependence.RUN_TIME, 1000.0), evidence(Dependence.OWN_TORQUE, 930.0)]
    assert order(*near)[0] == (Dependence.OWN_TORQUE, 1000.0)
    physical = [evidence(Dependence.PLACE, 1000.0), evidence(Dependence.CONSTANT, 930.0)]
    assert order(*physical)[0] == (Dependence.PLACE, 1000.0)


def test_a_chain_ends_at_the_smallest():
    found = order(
        evidence(Dependence.RUN_TIME, 1000.0),
        evidence(Dependence.PLACE, 995.0),
        evidence(Dependence.CONSTANT, 990.0),
    )
    assert [on for on, _ in found] == [Dependence.CONSTANT, Dependence.PLACE, Dependence.RUN_TIME]


def test_families_of_other_places_and_without_evidence_stay():
    apart = [evidence(Dependence.PLACE, 1000.0), evidence(Dependence.CONSTANT, 995.0, place="A1")]
    assert order(*apart) == [(Dependence.PLACE, 1000.0), (Dependence.CONSTANT, 995.0)]
    poor = [evidence(Dependence.PLACE, -1.0), evidence(Dependence.CONSTANT, -1.01)]
    assert order(*poor) == [(Dependence.PLACE, -1.0), (Dependence.CONSTANT, -1.01)]
