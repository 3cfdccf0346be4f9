import numpy as np

from gcode2krl.report.page.passes import MOST_PASSES, passes_of


def motion(*runs):
    """Samples of runs (tool, z, count), each after two rapid samples."""
    z, rapid, tool, line = [], [], [], []
    for number, (own, height, count) in enumerate(runs):
        z += [20.0, 20.0, *[height] * count]
        rapid += [True, True, *[False] * count]
        tool += [own] * (count + 2)
        line += [10 * number + 1] * 2 + [10 * number + 2] * count
    return np.array(z), np.array(rapid), np.array(tool, np.int32), np.array(line, np.int32)


def test_a_pass_lies_between_two_rapids():
    number, passes = passes_of(*motion((1, -2.0, 4), (1, -4.0, 3), (2, -4.0, 5)))
    assert number.tolist() == [-1, -1, 0, 0, 0, 0, -1, -1, 1, 1, 1, -1, -1, 2, 2, 2, 2, 2]
    assert [(one.tool, one.low_mm, one.first_line) for one in passes] == [
        (1, -2, 2),
        (1, -4, 12),
        (2, -4, 22),
    ]
    assert passes[2].name == "T2, Z -4.00 mm, lines 22-22"


def test_the_same_height_twice_stays_two_passes_while_there_are_few():
    """Else the second would hide the first."""
    _, passes = passes_of(*motion((1, -2.0, 4), (1, -2.0, 4)))
    assert len(passes) == 2


def test_a_tool_change_without_a_rapid_begins_a_pass():
    z, tool = np.zeros(6), np.array([1, 1, 1, 2, 2, 2], np.int32)
    number, _ = passes_of(z, np.zeros(6, bool), tool, np.arange(6, dtype=np.int32))
    assert number.tolist() == [0, 0, 0, 1, 1, 1]


def test_many_runs_are_joined_by_tool_and_height():
    runs = [(tool, -float(level), 3) for tool in (1, 2) for _ in range(10) for level in (1, 2, 3)]
    number, passes = passes_of(*motion(*runs))
    assert len(passes) == 6
    z, rapid, tool, _ = motion(*runs)
    for k, one in enumerate(passes):
        rows = number == k
        assert set(tool[rows]) == {one.tool}
        assert len(set(z[rows])) == 1
        assert np.count_nonzero(rows) == 30
    assert (number[rapid] == -1).all()


def test_many_heights_become_bands_without_losing_a_sample():
    runs = [(1, -0.137 * level, 2) for level in range(500)]
    number, passes = passes_of(*motion(*runs))
    assert 1 < len(passes) <= MOST_PASSES
    assert np.count_nonzero(number >= 0) == 1000
    tops = [one.high_mm for one in passes]
    assert tops == sorted(tops, reverse=True)


def test_a_motion_of_rapids_has_no_pass():
    number, passes = passes_of(np.zeros(3), np.ones(3, bool), np.ones(3, np.int32), np.ones(3, np.int32))
    assert passes == []
    assert number.tolist() == [-1, -1, -1]
