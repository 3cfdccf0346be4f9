"""summary.md, rendered by an independent Markdown reader."""

import pytest
from lxml import html
from markdown_it import MarkdownIt

from gcode2krl.batch.written import contents, summary_md
from gcode2krl.batch.written.summary import MOST_BYTES
from gcode2krl.batch.written.words import markdown, printable
from tests.batch.written.records import ERROR, NASTY, OF_CELL, WARNING, many, record

READER = MarkdownIt("commonmark").enable(["table", "strikethrough"])


def page(records, before=None):
    return html.fromstring(f"<body>{READER.render(summary_md(records, before))}</body>")


def tables(found):
    """Return heading → rows of texts."""
    read = {}
    for table in found.iter("table"):
        heading = table.xpath("preceding-sibling::h2[1]")[0].text
        read[heading] = [[cell.text_content() for cell in row] for row in table.iter("tr")]
    return read


def test_the_refused_come_first_with_finding_and_remedy():
    twice = [WARNING, ERROR, ERROR | {"line": 130}]
    found = page([record("a.nc"), record("c.nc", 2, [OF_CELL]), record("b.nc", 1, twice)])
    assert found.findtext("h1") == "1 of 3 parts written, 1 refused, 1 not understood"
    rows = tables(found)["Not written"]
    assert rows[1] == [
        "b.nc",
        "refused",
        "120",
        "the robot cannot reach X 4000 Y 0 Z 100 [out-of-reach]",
        "move the part nearer",
    ]
    assert rows[2][:3] == ["c.nc", "not understood", "cells/big.toml:3"]
    assert [heading.text for heading in found.iter("h2")] == ["Not written", "Longest"]


def test_a_good_run_is_short():
    assert page([record("a.nc")]).findtext("h1") == "The only part was written"
    found = page([record("a.nc", cached=True), record("b.nc", 0, [WARNING], max_force_N=500.0)])
    assert found.findtext("h1") == "All 2 parts were written"
    facts = [line.text_content() for line in found.iter("li")]
    assert facts == [
        "machining time: 2 min 37 s",
        "largest force: 500 N (b.nc)",
        "largest deflection: 0.613 mm (b.nc)",
        "computed in: 2.5 s",
        "from the cache: 1 part",
        "warnings: 1",
    ]
    assert page([]).findtext("h1") == "No parts"


def test_the_longest_come_first():
    records = many(60)
    rows = tables(page(records))["Longest"][1:]
    known = sorted((one for one in records if one["time_s"]), key=lambda one: -one["time_s"])
    assert [row[0] for row in rows] == [one["part"] for one in known[:10]]


def test_what_changed_is_shown():
    found = page([record("a.nc", 1, [ERROR]), record("b.nc", time_s=80.0)], [record("a.nc"), record("b.nc")])
    rows = tables(found)["Against the last run"][1:]
    assert [row[:2] for row in rows] == [["a.nc", "refused, was written"], ["b.nc", "other figures"]]
    assert rows[1][2] == "1 min 18 s → 1 min 20 s (+2.2\xa0%)"
    assert "Nothing changed since the last run." in page([record("a.nc")], [record("a.nc")]).text_content()


HOSTILE = [
    NASTY,
    "| a | b |",
    "<img src=x onerror=alert(1)><script>alert(1)</script>",
    "![x](https://example.org/x.png) [y](javascript:alert(1)) <https://example.org>",
    "**bold** _it_ `code` ~~gone~~ &lt; &#60; \\| \\",
    "# heading",
    "line\n\n# another\r\n| x |",
    "--- | ---",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_is_shown_as_it_is(text):
    issue = ERROR | {"message": text, "code": text, "remedy": text}
    found = page([record(text, 1, [issue]), record(f"{text}2")], [record(f"{text}3")])
    marks = {"div", "h1", "h2", "ul", "li", "p", "table", "thead", "tbody", "tr", "th", "td"}
    assert {element.tag for element in found.iter()} == marks
    shown = " ".join(printable(text).split())
    row = tables(found)["Not written"][1]
    assert row[0] == shown.replace("\\", "/")
    assert row[3] == f"{shown} [{shown}]"
    assert row[4] == shown
    assert len(found.findall("h1")) == 1


def test_a_text_survives_the_reader():
    text = "".join(map(chr, range(32, 127))) + "äß→"
    assert html.fromstring(READER.render(f"x{markdown(text)}x")).text_content().strip() == f"x{text}x"


def test_it_is_never_too_large():
    """The worst that can be: all is refused or changed, and every character must be escaped."""
    worst = "|" * 5000
    issue = ERROR | {"message": worst, "code": worst, "remedy": worst, "file": worst}
    records = [record(f"{number}{worst}", 1, [issue]) for number in range(300)]
    records += [record(f"w{number}{worst}", time_s=1e9 + number) for number in range(300)]
    before = [record(one["part"]) for one in records]
    assert len(summary_md(records, before).encode()) < MOST_BYTES
    assert "and 200 more" in summary_md(records, before)


def test_every_file_says_that_parts_were_made_for_the_demonstration_cell():
    theirs, ours = record("a.nc"), record("b.nc") | {"cell": {"name": "demo", "file": None, "sha256": "0"}}
    names = ("summary.md", "index.html", "junit.xml", "findings.sarif")
    for records, sentence in (([ours], "Every part"), ([theirs, ours], "1 of 2 parts")):
        made = contents(records)
        for name in names:
            assert f"{sentence} was translated for the demonstration cell" in made[name].decode("utf-8") or (
                name == "junit.xml" and b"translated for the demonstration cell" in made[name]
            ), name
    assert not any(b"demonstration" in contents([theirs])[name] for name in names)
