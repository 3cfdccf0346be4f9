"""Run the commands named in ``<!-- output: … -->`` comments of the README and of the first program's page,
and put their output below them.

    python docs/update_readme.py

A comment may end in ``| lines A-B`` to keep part of the output. Commands run in the checkout; files they
write go to a temporary folder where the command says ``{tmp}``, which the page shows without it.
"""

import re
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

STOCK = 'based_on = "demonstration"\n' + "[stock]\nbox_mm = [[0, -100, -30], [300, 100, 0]]\n"
ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", ROOT / "docs" / "first_program.md")
BLOCK = re.compile(
    r"(<!-- output: (?P<command>.*?)(?: \| lines (?P<first>\d+)-(?P<last>\d+))? -->\n)```text\n.*?^```",
    re.M | re.S,
)


def output_of(command: str, folder: str) -> str:
    """Return what a command prints, findings first."""
    words = shlex.split(command.replace("{tmp}", Path(folder).as_posix()))
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    return (done.stderr + done.stdout).replace(f"{Path(folder).as_posix()}/", "")


def main() -> None:
    """Replace the output below each command, and draw the pictures."""
    for path in PAGES:
        refresh(path)
    draw_pictures()


def refresh(path: Path) -> None:
    """Replace the output below each command of a page."""
    with tempfile.TemporaryDirectory() as folder:

        def replaced(match: re.Match[str]) -> str:
            lines = output_of(match["command"], folder).splitlines()
            if match["first"]:
                lines = lines[int(match["first"]) - 1 : int(match["last"])]
            return match[1] + "```text\n" + "\n".join(line.rstrip() for line in lines) + "\n```"

        text = BLOCK.sub(replaced, path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8", newline="\n")


def draw_pictures() -> None:
    """Draw the pictures of the README: those of a prediction of the test piece."""
    images = ROOT / "docs" / "images"
    images.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cell.toml").write_text(STOCK, encoding="utf-8")
        output_of("gcode2krl predict examples/test_piece.nc --cell {tmp}/cell.toml -o {tmp}/p --plot", folder)
        for name in ("path", "kinematics", "joints", "force", "deflection_path", "deflection_joints"):
            shutil.copy(Path(folder) / "p" / f"{name}.png", images / f"{name}.png")


if __name__ == "__main__":
    main()
