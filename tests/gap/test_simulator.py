"""Commanded paths are simulated once for what they were planned from, whatever object holds it."""

from dataclasses import replace

import numpy as np

from gcode2krl.effects import Applied, library
from gcode2krl.gap.compare import pair
from gcode2krl.gap.compare.pair import Simulator
from tests.gap.constructed import Added, applied, motion


class Counted(Added):
    """Takes (1 + size) of the time; counts how often it is planned."""

    def __init__(self):
        super().__init__("counted", np.sin)
        self.times = 0

    def replan(self, inputs, applied):
        self.times += 1
        return replace(inputs, time_s=inputs.time_s * (1.0 + applied["size_rad"]))


def test_a_path_is_planned_once_and_by_value():
    simulator, effect = Simulator(), Counted()
    first = simulator.commanded(motion(), [applied(effect, 0.1)])
    same = replace(motion(), time_s=motion().time_s.copy(), q_cmd_rad=motion().q_cmd_rad.copy())
    assert simulator.commanded(same, [applied(effect, 0.1)]) is first
    assert effect.times == 1
    np.testing.assert_allclose(first.time_s, motion().time_s * 1.1)


def test_another_size_target_or_motion_is_another_path():
    simulator, effect = Simulator(), Counted()
    first = simulator.commanded(motion(), [applied(effect, 0.1)])
    moved = replace(motion(), q_cmd_rad=motion().q_cmd_rad + 0.1)
    later = replace(motion(), time_s=motion().time_s + 1.0)
    others = [
        simulator.commanded(motion(), [applied(effect, 0.2)]),
        simulator.commanded(motion(), [applied(effect, 0.1, "A2")]),
        simulator.commanded(moved, [applied(effect, 0.1)]),
        simulator.commanded(later, [applied(effect, 0.1)]),
        simulator.commanded(motion(), []),
    ]
    assert len({id(each) for each in [first, *others]}) == 6
    np.testing.assert_array_equal(others[2].q_cmd_rad, moved.q_cmd_rad)


def test_an_effect_that_is_in_the_plan_already_is_not_planned_again():
    simulator, effect = Simulator(), Counted()
    planned = replace(applied(effect, 0.1), planned=True)
    np.testing.assert_array_equal(simulator.commanded(motion(), [planned]).time_s, motion().time_s)
    assert effect.times == 0
    assert simulator.commanded(motion(), [applied(effect, 0.1)]).time_s[-1] > motion().time_s[-1]


def test_the_oldest_are_forgotten_beyond_64():
    simulator, clock = Simulator(), library()["clock"]
    short = motion(1.0)

    def late(number):
        return [Applied(clock, "controller", {"offset_s": 1e-3 * number, "skew": 0.0})]

    first, second = (simulator.commanded(short, late(number)) for number in (0, 1))
    for number in range(2, 65):
        simulator.commanded(short, late(number))
    assert simulator.commanded(short, late(1)) is second
    assert simulator.commanded(short, late(0)) is not first


def test_two_simulators_share_nothing():
    path = [applied(Counted(), 0.1)]
    assert Simulator().commanded(motion(), path) is not Simulator().commanded(motion(), path)


def test_of_long_runs_the_last_fine_path_alone_is_kept(monkeypatch):
    simulator, made = Simulator(), []

    def finer(inputs):
        made.append(replace(inputs))
        return made[-1]

    monkeypatch.setattr(pair, "with_corners", finer)
    for limit, kept in ((10**6, [0, 1]), (10, [2])):
        monkeypatch.setattr(pair, "_LIMITS", replace(pair._LIMITS, remembered_rows=limit))
        for later_s in (1.0, 2.0) if limit > 10 else (3.0,):
            simulator.commanded(replace(motion(), time_s=motion().time_s + later_s), [])
        assert list(simulator._fine.values()) == [made[number] for number in kept]
