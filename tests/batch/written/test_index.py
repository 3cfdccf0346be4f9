"""index.html without a browser: what stands in it, and that hostile text stays text."""

import json
import re

import pytest
from lxml import html

from gcode2krl.batch.written import index_html
from gcode2krl.batch.written.index import HEIGHT, WIDTH, svg_path
from tests.batch.written.records import ERROR, NASTY, OF_CELL, WARNING, many, record


def page(records, before=None):
    return html.fromstring(index_html(records, before))


def rows(found):
    rows = found.xpath("//*[@id='parts']/tbody/tr")
    return [[" ".join(cell.text_content().split()) for cell in row] for row in rows]


def test_a_row_a_part_and_what_was_not_written_first():
    records = [
        record("b10.nc"),
        record("b2.nc", files=["b2.src", "a b#.html"]),
        record("z.nc", 1, [ERROR, ERROR | {"line": 130}, WARNING]),
    ]
    found = page(records)
    assert found.findtext(".//h1") == "2 of 3 parts written, 1 refused"
    assert [row[1] for row in rows(found)] == ["z.nc", "b2.nc", "b10.nc"]
    assert rows(found)[0][2:] == [
        "refused",
        "–",
        "–",
        "–",
        "line 120: the robot cannot reach X 4000 Y 0 Z 100 out-of-reach move the part nearer and 1 more",
    ]
    assert rows(found)[1][2:6] == ["written", "1 min 18 s", "412 N", "0.613 mm"]
    assert found.xpath("//a/@href") == ["./a%20b%23.html"]


def test_nothing_is_fetched_and_nothing_runs_that_is_not_its_own():
    text = index_html(many(50), many(30))
    assert not re.search(r"<(link|img|iframe|object)|@import|url\(|https?://", text)
    assert not re.search(r"\bfetch\(|XMLHttpRequest|innerHTML", text)
    assert "default-src 'none'" in text
    assert text.count("<script") == text.count("</script>") == 2


def test_hostile_text_stays_text():
    text = f"</script><img src=x onerror=alert(1)>{NASTY}"
    issue = ERROR | {"message": text, "code": text, "remedy": text}
    records = [record(text, 1, [issue, OF_CELL], files=["javascript:alert(1).html"])]
    found = page(records, [record(f"{text}2")])
    assert found.xpath("//img | //b") == []
    assert len(found.xpath("//script")) == 2
    assert found.xpath("//a/@href") == ["./javascript%3Aalert%281%29.html"]
    assert rows(found)[0][1].startswith("</script><img src=x")
    index_html(records, records).encode("utf-8")


def test_keys_are_those_of_the_rows():
    records = many(80)
    found = page(records, many(80, seed=2))
    keys = json.loads(found.xpath("//script[@id='keys']")[0].text)
    names = [row[1] for row in rows(found)]
    of = {one["part"]: one for one in records}
    assert keys["time"] == [of[name]["time_s"] for name in names]
    assert keys["force"] == [of[name]["max_force_N"] for name in names]
    assert {len(column) for column in keys.values()} == {80}
    assert sorted(keys["part"]) == list(range(80))
    buttons = found.xpath("//th/button/@data-column")
    assert buttons == list(keys)


def test_the_last_run_is_a_column_where_there_was_one():
    records = [record("a.nc", 1, [ERROR]), record("b.nc", time_s=80.0), record("c.nc"), record("d.nc")]
    before = [record("a.nc"), record("b.nc"), record("c.nc")]
    found = page(records, before)
    changes = [row[6] for row in rows(found)]
    assert changes == ["was written", "time +2.2 %", "the same", "new"]
    sentence = "1 not written any more, 1 new, 1 with other figures, 1 the same"
    assert sentence in found.get_element_by_id("difference").text_content()
    assert page(records).xpath("//*[@id='difference']") == []


def test_no_parts_make_a_page():
    found = page([])
    assert found.findtext(".//h1") == "No parts"
    assert found.xpath("//script") == []


@pytest.mark.parametrize(
    ("points", "drawn"),
    [
        ((), ""),
        (((1.0, 1.0),), ""),
        (((1.0, 1.0), (1.0, 1.0)), ""),
        (((0.0, 0.0), (10.0, 0.0)), "M12,128l360,0"),
        (((5.0, -1e6), (5.0, 1e6)), "M192,244l0,-232"),
    ],
)
def test_thumbnails(points, drawn):
    assert svg_path(points) == drawn


def test_a_thumbnail_stays_in_its_box():
    for one in many(20):
        path = svg_path([tuple(point) for point in one["thumbnail"] or [(0.0, 0.0), (1.0, 2.0)]])
        numbers = list(map(int, re.findall(r"-?\d+", path)))
        x, y = numbers[:2]
        for dx, dy in zip(numbers[2::2], numbers[3::2], strict=True):
            x, y = x + dx, y + dy
            assert 0 <= x <= WIDTH
            assert 0 <= y <= HEIGHT
