"""The parts of the site: contents, check of links, equations, pages of findings. .ci/run builds it."""

import importlib
import re

import pytest

from gcode2krl.codes import all_codes
from tests.conftest import ROOT

SITE = ROOT / "docs" / "site"


@pytest.fixture
def part(monkeypatch):
    """Return a function that imports a module of ``docs/site``, or skips where its library is missing."""
    monkeypatch.syspath_prepend(str(SITE))

    def load(name, needs=None):
        if needs is not None:
            pytest.importorskip(needs, reason="needs the extra docs")
        return importlib.import_module(name)

    return load


def test_every_document_is_in_the_contents():
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    contents = settings[settings.index("\nnav:") : settings.index("\ntheme:")]
    listed = re.findall(r"[\w/]+\.md", contents)
    assert {path.name for path in (ROOT / "docs").glob("*.md")} <= set(listed)
    assert len(listed) == len(set(listed))


PAGE = '<html><body><h1 id="top">a</h1>{}</body></html>'


@pytest.mark.parametrize(
    ("body", "trouble"),
    [
        ('<a href="b.html#there">b</a> <a href="#top">top</a> <a href="https://example.org">far</a>', None),
        ('<a href="/b.html">from the root</a> <img src="data:image/png;base64,AA">', None),
        ('<a href="c.html">c</a>', "no such file"),
        ('<a href="b.html#nowhere">b</a>', "no such anchor"),
        ('<a href="#nowhere">here</a>', "no such anchor"),
        ('<script src="https://example.org/x.js"></script>', "fetched from elsewhere"),
        ('<link rel="stylesheet" href="//example.org/x.css">', "fetched from elsewhere"),
        ('<img src="missing.png">', "no such file"),
    ],
)
def test_links_are_checked(part, tmp_path, body, trouble):
    (tmp_path / "a.html").write_text(PAGE.format(body), encoding="utf-8")
    (tmp_path / "b.html").write_text(PAGE.format('<p id="there">b</p>'), encoding="utf-8")
    lines = part("links").broken(tmp_path)
    assert len(lines) == (trouble is not None)
    assert trouble is None or lines[0].endswith(trouble)


def test_each_finding_has_a_page_and_the_table_leads_to_it(part):
    pages = part("finding_pages")
    made = pages.pages()
    assert set(made) == {f"findings/{name}.md" for name in all_codes()}
    for name, code in all_codes().items():
        text = made[f"findings/{name}.md"]
        assert all(words in text for words in (code.why, code.remedy, code.example, code.severity))
    table = pages.linked((ROOT / "docs" / "findings.md").read_text(encoding="utf-8"))
    assert set(re.findall(r"\(findings/([a-z0-9-]+)\.md\)", table)) == set(all_codes())


def test_documents_and_findings_that_are_named_become_links(part):
    def linked(text, page="a.md"):
        return part("crosslinks").linked(text, page, {"runs"}, {"spindle-off", "allow"})

    assert linked("see docs/runs.md, `docs/runs.md`") == "see [runs](runs.md), [runs](runs.md)"
    assert linked("`spindle-off`") == "[`spindle-off`](findings/spindle-off.md)"
    assert linked("docs/runs.md", "findings/x.md") == "[runs](../runs.md)"
    for same in ("`allow`", "docs/none.md", "[x](docs/runs.md)", "`a docs/runs.md`", "[`spindle-off`](y.md)"):
        assert linked(same) == same
    block = "```text\ndocs/runs.md\n```\n"
    assert linked(block) == block


def test_every_equation_of_the_documents_can_be_shown_and_numbers_rise(part):
    mathml = part("mathml", "latex2mathml")
    count = 0
    for path in sorted((ROOT / "docs").glob("*.md")):
        blocks = re.findall(r"^```math\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S)
        numbers = [int(number) for text in blocks for number in re.findall(r"\\tag\{(\d+)\}", text)]
        assert numbers == list(range(1, len(numbers) + 1)), path.name
        assert all("<math" in mathml.block(text) for text in blocks)
        count += len(blocks)
    assert count > 30
