"""The picture of a report for the documents: the page of the test piece as a browser shows it.

python docs/report_picture.py [--browser PATH] [-o FILE.png]

It needs the extra ``browser`` and a Chromium.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

from gcode2krl import predict
from gcode2krl.cell import resolve_cell
from gcode2krl.report.page import content_of, write_page

ROOT = Path(__file__).resolve().parents[1]
PIECE = ROOT / "examples" / "test_piece.nc"
STOCK_MM = [[0.0, -100.0, -30.0], [300.0, 100.0, 0.0]]
SIZE = {"width": 1280, "height": 720}


def main() -> None:
    """Predict the test piece, write its page and take its picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--browser", default="/usr/bin/chromium")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "images" / "report.png")
    given = parser.parse_args()
    cell = resolve_cell({"based_on": "demonstration", "stock": {"box_mm": STOCK_MM}})
    prediction = predict(PIECE, cell)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tool:
        page = Path(folder) / "report.html"
        text = PIECE.read_text(encoding="ascii")
        stock_mm = np.array(STOCK_MM)
        write_page(content_of(prediction, text=text, stock_mm=stock_mm), page)
        arguments = ["--no-sandbox", "--enable-unsafe-swiftshader"]
        browser = tool.chromium.launch(executable_path=given.browser, args=arguments)
        window = browser.new_page(viewport=SIZE)
        window.goto(page.as_uri())
        window.wait_for_function("window.report !== undefined")
        window.wait_for_timeout(1500)
        window.screenshot(path=given.output, full_page=True)
        browser.close()


if __name__ == "__main__":
    main()
