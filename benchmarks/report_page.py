"""The page of a long raster: its size, the time to its first paint, and frames per second.

``python benchmarks/report_page.py [--lines 66500] [--browser /usr/bin/chromium] [--keep FOLDER]`` predicts a
raster of so many lines (three samples a line), writes its page and opens it in a headless browser through
playwright. Printed are the time to make the page, its size and what of it is data and libraries, the first
paint, the time until everything can be used, frames per second while the view turns and while the robot
moves along the path, and how long a jump to another second takes until it is drawn, with the part and with
the path, with the renderer: without a graphics card the browser draws by software on the
machine's cores, so that only the same machine can be compared. Without playwright or browser the size alone
is printed.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "examples"))

from make_raster import long_raster  # noqa: E402 - from the examples

from gcode2krl import predict  # noqa: E402
from gcode2krl.report.page import content_of, page  # noqa: E402
from gcode2krl.report.page.one_file import LIBRARIES  # noqa: E402
from gcode2krl.translation.page import part_of  # noqa: E402

SECONDS = 4.0
JUMPS = 40
TURNING = """async (seconds) => {
  const { scene } = window.report, axis = { x: 0, y: 0, z: 1 };
  const frame = () => new Promise(requestAnimationFrame);
  const turn = async (until) => {
    while (performance.now() < until) {
      const { position } = scene.camera, at = scene.controls.target;
      const x = position.x - at.x, y = position.y - at.y, c = Math.cos(0.03), s = Math.sin(0.03);
      position.x = at.x + c * x - s * y;
      position.y = at.y + s * x + c * y;
      scene.controls.update();
      await frame();
    }
  };
  await turn(performance.now() + 2000);  // the level of detail finds its place
  const first = scene.frames, start = performance.now();
  await turn(start + 1000 * seconds);
  return [(scene.frames - first) / ((performance.now() - start) / 1000), scene.drawn];
}"""
PLAYING = """async (seconds) => {
  const { scene } = window.report;
  window.report.select(0);
  window.report.play(true);
  await new Promise((done) => setTimeout(done, 2000));
  const first = scene.frames, start = performance.now();
  await new Promise((done) => setTimeout(done, 1000 * seconds));
  const rate = (scene.frames - first) / ((performance.now() - start) / 1000);
  window.report.play(false);
  return [rate, scene.drawn];
}"""
JUMPING = """(jumps) => {
  const { scene, columns, rows } = window.report, end = columns.time[rows - 1], took = [];
  const gl = scene.renderer.getContext();
  for (let k = 0; k < jumps; k++) {
    const start = performance.now();
    const wanted = (end * ((k * 7919) % 1000)) / 1000;
    window.report.select(Math.max(columns.time.findIndex((time) => time >= wanted), 0));
    scene.draw(start);
    gl.readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4));
    took.push(performance.now() - start);
  }
  took.sort((a, b) => a - b);
  return [took[jumps >> 1], took[jumps - 1]];
}"""
SHOWN = """([path, finished]) => {
  const tick = (id, on) => {
    const box = document.getElementById(id);
    if (box && box.checked !== on) box.click();
  };
  tick("show-path", path);
  tick("show-finished", finished);
}"""
RESTING = """async () => {
  const { scene } = window.report;
  await new Promise((done) => setTimeout(done, 800));
  const start = performance.now();
  scene.renderer.render(scene.scene, scene.camera);
  scene.renderer.getContext().readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4));
  return [performance.now() - start, scene.drawn];
}"""


def main() -> None:
    asked = arguments()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(asked.keep or folder)
        part = place / f"raster_{asked.lines}.nc"
        part.write_text("\n".join(long_raster(asked.lines)) + "\n", encoding="ascii")
        prediction = predict(part)
        file = place / f"raster_{asked.lines}.html"
        start = time.perf_counter()
        history = part_of(prediction)
        events = 0 if history is None else len(history.cell)
        print(f"part cut in {time.perf_counter() - start:.2f} s, {events} events")
        start = time.perf_counter()
        content = content_of(prediction, text=part.read_text(encoding="ascii"), part=history)
        file.write_text(page(content), encoding="utf-8")
        print(f"{asked.lines} lines, {content.head['all']} samples, {content.head['rows']} drawn")
        print(f"made in {time.perf_counter() - start:.2f} s")
        say_size(file, len(content.data), len(content.text), len(content.part) + len(content.part_cells))
        browse(file, asked.browser)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lines", type=int, default=66_500)
    parser.add_argument("--browser", default="/usr/bin/chromium")
    parser.add_argument("--keep", metavar="FOLDER", help="leave program and page there")
    return parser.parse_args()


def say_size(file: Path, data: int, text: int, part: int) -> None:
    libraries = sum(one.stat().st_size for one in LIBRARIES.iterdir())
    print(
        f"{file.stat().st_size / 1e6:.2f} MB: samples {data / 1e6:.2f}, G-code {text / 1e6:.2f}, "
        f"part {part / 1e6:.2f}, "
        f"libraries {libraries / 1e6:.2f}"
    )


def browse(file: Path, browser: str) -> None:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("no playwright: not opened")
        return
    if not Path(browser).exists():
        print(f"no browser at {browser}: not opened")
        return
    with sync_playwright() as tool:
        opened = tool.chromium.launch(
            executable_path=browser, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        window = opened.new_page(viewport={"width": 1280, "height": 800})
        window.goto(file.as_uri())
        window.wait_for_function("window.report !== undefined", timeout=120_000)
        ready_ms = window.evaluate("performance.now()")
        paint_ms = window.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
        print(f"first paint {paint_ms:.0f} ms, everything there {ready_ms:.0f} ms")
        print(f"drawn by {window.evaluate(RENDERER)}")
        for shown, path in (("part", False), ("part and path", True)):
            window.evaluate(SHOWN, [path, False])
            for what, script in (("turning", TURNING), ("playing", PLAYING)):
                rate, drawn = window.evaluate(script, SECONDS)
                print(f"{shown}, {what}: {rate:.0f} frames/s, {drawn if path else 0} segments")
            usual_ms, longest_ms = window.evaluate(JUMPING, JUMPS)
            print(f"{shown}, a jump: {usual_ms:.0f} ms, at most {longest_ms:.0f} ms")
        took_ms, drawn = window.evaluate(RESTING)
        print(f"at rest: one frame of {drawn} segments in {took_ms:.0f} ms")
        opened.close()


RENDERER = """() => {
  const gl = window.report.scene.renderer.getContext();
  return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
}"""

if __name__ == "__main__":
    main()
