"""What changed between two runs."""

import json

from gcode2krl.batch.written import contents, difference
from gcode2krl.batch.written.words import difference_rows, difference_sentence, share
from tests.batch.written.records import ERROR, record


def before_and_after():
    before = [
        record("same.nc"),
        record("slower.nc", time_s=100.0),
        record("quicker.nc", time_s=100.0),
        record("refused.nc"),
        record("mended.nc", 1, [ERROR]),
        record("gone.nc"),
        record("still.nc", 2),
        record("noise.nc", time_s=100.0),
    ]
    after = [
        record("same.nc"),
        record("slower.nc", time_s=110.0, max_force_N=825.0),
        record("quicker.nc", time_s=80.0, max_deflection_mm=None),
        record("refused.nc", 1, [ERROR]),
        record("mended.nc"),
        record("new.nc"),
        record("still.nc", 2),
        record("noise.nc", time_s=100.000001),
    ]
    return before, after


def test_each_part_is_where_it_belongs():
    before, after = before_and_after()
    found = difference(after, before)
    assert [part.name for part in found.new] == ["new.nc"]
    assert [part.name for part in found.gone] == ["gone.nc"]
    assert [one.name for one in found.refused] == ["refused.nc"]
    assert [one.name for one in found.mended] == ["mended.nc"]
    assert [(one.name, one.time_s) for one in found.changed] == [("quicker.nc", -20.0), ("slower.nc", 10.0)]
    assert found.changed[0].deflection_mm is None
    assert found.changed[1].force_N == 412.5
    assert found.same == 3  # same, still and noise
    assert found.time_before_s == 300.0 + 78.3
    assert found.time_after_s == 290.000001 + 78.3


def test_two_equal_runs():
    before, _ = before_and_after()
    found = difference(before, reversed(before))
    assert found.is_none
    assert found.same == len(before)
    assert difference_sentence(found) == "Nothing changed since the last run."


def test_in_words():
    before, after = before_and_after()
    sentence = difference_sentence(difference(after, before))
    assert sentence == (
        "Since the last run: 1 not written any more, 1 written now, 1 gone, 1 new, 2 with other figures, "
        "3 the same. The parts that were written both times take 6 min 18 s → 6 min 8 s (-2.6\xa0%)."
    )
    rows = {row.part: row for row in difference_rows(difference(after, before))}
    assert next(iter(rows)) == "refused.nc"
    assert rows["refused.nc"].what == "refused, was written"
    assert rows["slower.nc"].time == "1 min 40 s → 1 min 50 s (+10.0\xa0%)"
    assert rows["slower.nc"].force == "412 N → 825 N (+100.0\xa0%)"
    assert rows["slower.nc"].deflection == "0.613 mm"
    assert rows["quicker.nc"].deflection == "0.613 mm → –"


def test_shares():
    assert share(0.0, 1.0) == share(None, 1.0) == share(1.0, None) == share(1.0, 1.0001) == ""
    assert share(2.0, 1.0) == "-50.0\xa0%"


def test_a_line_carries_what_the_part_was():
    before, after = before_and_after()
    lines = map(json.loads, contents(after, before)["results.jsonl"].splitlines())
    against = {line["part"]: line["against"] for line in lines}
    assert against["new.nc"] is None
    assert against["mended.nc"]["exit_code"] == 1
    assert against["slower.nc"] == {
        "exit_code": 0,
        "time_s": 100.0,
        "max_force_N": 412.5,
        "max_deflection_mm": 0.613,
    }
    assert all(json.loads(line)["against"] is None for line in contents(after)["results.jsonl"].splitlines())
