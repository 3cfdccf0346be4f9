"""The index page in a headless browser: sorting by click and by keyboard, the filter, colours, time."""

import pytest

from gcode2krl.batch.written import index_html
from tests.batch.written.records import ERROR, NASTY, many, record
from tests.report.page.browser import opened_browser
from tests.report.page.test_browser import TEXTS, contrast

pytestmark = pytest.mark.browser
NAMES = """() => Array.from(
  document.querySelectorAll("#parts tbody tr:not(.hidden)"), (row) => row.cells[1].textContent)"""
CELLS = """(k) => Array.from(
  document.querySelectorAll("#parts tbody tr"), (row) => row.cells[k].textContent)"""
FOCUS = "document.activeElement.id || document.activeElement.dataset.column || ''"


@pytest.fixture(scope="module")
def browser():
    with opened_browser() as made:
        yield made


def opened(browser, folder, records, before=None, **options):
    file = folder / "index.html"
    file.write_text(index_html(records, before), encoding="utf-8")
    window = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}, **options).new_page()
    window.said = []
    window.on("pageerror", lambda error: window.said.append(str(error)))
    window.on("console", lambda one: window.said.append(one.text))
    window.on("request", lambda one: window.said.append(one.url) if one.url != file.as_uri() else None)
    window.goto(file.as_uri())
    return window


def sort_of(window, column):
    return window.locator(f"th:has([data-column={column}])").get_attribute("aria-sort")


def test_a_click_sorts_and_another_turns(browser, tmp_path):
    records = many(100)
    window = opened(browser, tmp_path, records)
    known = sorted((one["time_s"], one["part"]) for one in records if one["time_s"] is not None)
    unknown = {one["part"] for one in records if one["time_s"] is None}
    window.click("[data-column=time]")
    assert sort_of(window, "time") == "ascending"
    names = window.evaluate(NAMES)
    assert names[: len(known)] == [part for _, part in known]
    assert set(names[len(known) :]) == unknown
    window.click("[data-column=time]")
    assert sort_of(window, "time") == "descending"
    names = window.evaluate(NAMES)
    assert names[: len(known)] == [part for _, part in reversed(known)]
    assert set(names[len(known) :]) == unknown
    window.click("[data-column=part]")
    assert sort_of(window, "time") is None
    assert window.evaluate(NAMES)[:3] == ["finishing/part3.nc", "finishing/part7.nc", "finishing/part11.nc"]
    assert window.said == []


def test_the_keyboard_does_all(browser, tmp_path):
    window = opened(browser, tmp_path, many(30), many(30, seed=2))
    order = []
    for _ in range(11):
        window.keyboard.press("Tab")
        order.append(window.evaluate(FOCUS))
    columns = ["part", "verdict", "time", "force", "deflection", "change", "findings"]
    assert [one for one in order if one][:8] == ["filter", *columns]
    window.focus("[data-column=force]")
    assert window.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    window.keyboard.press("Enter")
    assert sort_of(window, "force") == "ascending"
    window.keyboard.press("Space")
    assert sort_of(window, "force") == "descending"
    forces = [float(text.removesuffix(" N")) for text in window.evaluate(CELLS, 4) if text != "–"]
    assert forces == sorted(forces, reverse=True)
    assert window.said == []


def test_the_filter(browser, tmp_path):
    records = many(100)
    window = opened(browser, tmp_path, records)
    assert window.text_content("#shown") == "100 of 100"
    window.fill("#filter", "refused POCKETS/")
    expected = {
        one["part"] for one in records if one["exit_code"] == 1 and one["part"].startswith("pockets/")
    }
    assert set(window.evaluate(NAMES)) == expected
    assert window.text_content("#shown") == f"{len(expected)} of 100"
    window.click("[data-column=part]")
    assert set(window.evaluate(NAMES)) == expected
    window.fill("#filter", "")
    assert len(window.evaluate(NAMES)) == 100


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_can_be_read(browser, tmp_path, scheme):
    window = opened(browser, tmp_path, many(100), many(100, seed=2), color_scheme=scheme)
    texts = window.evaluate(TEXTS)
    assert len(texts) > 300
    poor = [(name, ink, ground) for name, ink, ground in texts if contrast(ink, ground) < 4.5]
    assert poor == []


def test_hostile_text_runs_nowhere(browser, tmp_path):
    text = f"</script><img src=x onerror=alert(1)><script>alert(1)</script>{NASTY}"
    window = opened(
        browser, tmp_path, [record(text, 1, [ERROR | {"message": text, "code": text}])], [record("x")]
    )
    window.on("dialog", lambda dialog: window.said.append(dialog.message))
    window.click("[data-column=findings]")
    assert window.said == []
    assert window.locator("img").count() == 0


def test_a_narrow_window_scrolls_the_table_and_not_the_page(browser, tmp_path):
    window = opened(browser, tmp_path, many(20))
    window.set_viewport_size({"width": 480, "height": 800})
    assert window.evaluate("document.documentElement.scrollWidth <= innerWidth")
