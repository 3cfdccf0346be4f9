"""A headless browser for pages: the Chromium of the machine, driven by playwright."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

VARIABLE = "GCODE2KRL_BROWSER"
"""Path of the browser; where it is set, a test fails instead of being skipped."""
_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")


def browser_path() -> str:
    """Return the browser, or skip the test with a word."""
    stated = os.environ.get(VARIABLE)
    if stated:
        return stated
    pytest.importorskip("playwright", reason="the extra 'browser' is not installed: pages are not opened")
    found = next(filter(None, map(shutil.which, _NAMES)), None)
    if found is None:
        pytest.skip(f"no Chromium on this machine ({VARIABLE} may name one): pages are not opened")
    return found


@contextmanager
def opened_browser() -> Iterator:
    """Yield a browser that draws 3D by software and has no network."""
    path = browser_path()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        arguments = ["--no-sandbox", "--enable-unsafe-swiftshader"]
        made = tool.chromium.launch(executable_path=path, args=arguments)
        yield made
        made.close()


def opened_page(browser, file: Path, width: int = 1280, height: int = 800):
    """Return the page of a file once its views are there; what it complains about is in its list ``said``."""
    window = browser.new_context(offline=True, viewport={"width": width, "height": height}).new_page()
    window.said = []
    window.on("pageerror", lambda error: window.said.append(str(error)))
    window.on("console", lambda one: window.said.append(one.text) if one.type == "error" else None)
    window.on("request", lambda one: window.said.append(one.url) if one.url != file.as_uri() else None)
    window.goto(file.as_uri())
    window.wait_for_function("window.report !== undefined", timeout=60_000)
    return window
