"""Write the cells of ``examples/cells/`` from the answers beside them, as `gcode2krl init` does.

python examples/make_cells.py
"""

import sys
from pathlib import Path

from gcode2krl.cli.main import _run

CELLS = Path(__file__).with_name("cells")


def make(folder: Path = CELLS) -> None:
    """Write a cell for each file of answers, and the schema."""
    for answers in sorted((CELLS / "answers").glob("*.toml")):
        code = _run(["init", str(folder / answers.name), "--answers", str(answers), "--force"])
        if code != 0:
            sys.exit(f"{answers.name}: exit code {code}")


if __name__ == "__main__":
    make()
