"""The page of a long raster: its size, the time to its first paint, and frames per second.

``python benchmarks/report_page.py [--lines 66500] [--five-axes] [--program FILE] [--keep FOLDER]`` predicts
a raster of so many lines (three samples a line), with five axes one whose tool leans to either side by 15
degrees, or a program that is there, writes its page and opens it in a headless browser (``--browser
/usr/bin/chromium``) through playwright. Printed are the time to make the page, its size and what of it is
data and libraries, the first paint, the time until everything can be used, the volume that the page shows
beside that of material removal, frames per second while the view turns and while the robot moves along the
path, what the quickest frame costs, and how long a jump to another second takes until it is drawn, with the
part and with the path, with the renderer: without a graphics card the browser draws by software on the
machine's cores, so that only the same machine can be compared. Without playwright or browser the size alone
is printed.
"""

import argparse
import math
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "examples"))

from make_raster import long_raster  # noqa: E402 - from the examples

from gcode2krl import Prediction, load_cell, predict  # noqa: E402
from gcode2krl.cutting import remove  # noqa: E402
from gcode2krl.report.page import content_of, page  # noqa: E402
from gcode2krl.report.page.one_file import LIBRARIES  # noqa: E402
from gcode2krl.translation.page import part_of  # noqa: E402

FIVE_AXES = HERE.parent / "examples" / "five_axis" / "cell.toml"
SWING_DEG, SWING_MM = 15.0, 200.0
"""How far the tool leans to either side, and the way along X in which it does so once."""
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
FRAME = """async () => {
  const { scene } = window.report, gl = scene.renderer.getContext();
  let least = Infinity;
  for (let k = 0; k < 20; k++) {
    const start = performance.now();
    scene.moving = true;
    scene.draw(start);
    gl.readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4));
    least = Math.min(least, performance.now() - start);
  }
  return least;
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
        part = asked.program or place / f"raster_{asked.lines}.nc"
        if not asked.program:
            lines = swung(long_raster(asked.lines)) if asked.five_axes else long_raster(asked.lines)
            part.write_text("\n".join(lines) + "\n", encoding="ascii")
        prediction = predict(part, load_cell(FIVE_AXES)) if asked.five_axes else predict(part)
        file = place / f"{part.stem}.html"
        start = time.perf_counter()
        history = part_of(prediction)
        events = 0 if history is None else len(history.cell)
        print(f"part cut in {time.perf_counter() - start:.2f} s, {events} events")
        start = time.perf_counter()
        content = content_of(prediction, text=part.read_text(encoding="ascii"), part=history)
        file.write_text(page(content), encoding="utf-8")
        print(f"{part.name}: {content.head['all']} samples, {content.head['rows']} drawn")
        print(f"made in {time.perf_counter() - start:.2f} s")
        say_size(file, len(content.data), len(content.text), len(content.part) + len(content.part_cells))
        browse(file, asked.browser, left_mm3(prediction))


def swung(lines: Iterator[str]) -> Iterator[str]:
    """Yield a raster whose tool leans about X as it goes along."""
    for line in lines:
        found = re.match(r"(?:G\d+ )?X(-?[\d.]+)", line)
        lean_deg = SWING_DEG * math.sin(math.tau * float(found[1]) / SWING_MM) if found else 0.0
        turned = f"{line} A{lean_deg:.3f} C0" if found else line
        yield turned.replace("G43 H13", "G43.4 H13")


def left_mm3(prediction: Prediction) -> float:
    """Return the volume that material removal leaves."""
    assert prediction.motion is not None
    removal = remove(prediction.toolpath, prediction.motion, prediction.cell, is_checked=False)
    return removal.left.volume_mm3


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lines", type=int, default=66_500)
    parser.add_argument("--five-axes", action="store_true")
    parser.add_argument("--program", metavar="FILE", type=Path, help="instead of a raster")
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


def browse(file: Path, browser: str, left_mm3: float) -> None:
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
        shown_mm3 = window.evaluate("report.part.volume()")
        off = 100.0 * (shown_mm3 / left_mm3 - 1.0)
        print(f"shown {shown_mm3 / 1000.0:.2f} cm3, {off:+.3f} % of what removal leaves")
        for shown, path in (("part", False), ("part and path", True)):
            window.evaluate(SHOWN, [path, False])
            for what, script in (("turning", TURNING), ("playing", PLAYING)):
                rate, drawn = window.evaluate(script, SECONDS)
                print(f"{shown}, {what}: {rate:.0f} frames/s, {drawn if path else 0} segments")
            print(f"{shown}, a frame that moves: {window.evaluate(FRAME):.0f} ms")
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
