"""Run the notebooks of this folder and print what each cell took; python examples/notebooks/run.py

Needs ``pip install ".[notebook]"``. Nothing is written: the notebooks keep no outputs. With names of
notebooks only these are run; ``--keep FOLDER`` leaves them there with their outputs.
"""

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent
LONGEST_S = 60.0
"""All notebooks together should take no longer."""
_FIRST_LETTERS = 70


def run(file: Path, keep: Path | None) -> float:
    """Run one notebook; print a line a cell; return the seconds. Raises where a cell fails."""
    notebook = nbformat.read(file, as_version=4)
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": HERE}}
    )
    started = time.perf_counter()
    print(f"{file.name}")
    with client.setup_kernel(env={name: value for name, value in os.environ.items() if name != "MPLBACKEND"}):
        for number, cell in enumerate(notebook.cells):
            if cell.cell_type == "code":
                before = time.perf_counter()
                client.execute_cell(cell, number)
                require_pictures(cell.outputs)
                print(
                    f"  cell {number:2d}  {time.perf_counter() - before:5.1f} s  {first_words(cell.outputs)}"
                )
    if keep is not None:
        nbformat.write(notebook, keep / file.name)
    taken_s = time.perf_counter() - started
    print(f"  {taken_s:.1f} s")
    return taken_s


def require_pictures(outputs: list[Any]) -> None:
    """Raise where a figure is only told of and not shown."""
    for output in outputs:
        data = output.get("data", {})
        if data.get("text/plain", "").startswith("<Figure") and "image/png" not in data:
            raise AssertionError(f"{data['text/plain']} is not shown")


def first_words(outputs: list[Any]) -> str:
    """Return the first line of what a cell has shown."""
    for output in outputs:
        text = output.get("text") or output.get("data", {}).get("text/plain", "")
        if text.strip():
            return str(text.strip().splitlines()[0][:_FIRST_LETTERS])
    return ""


def main() -> int:
    """Run all notebooks, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NOTEBOOK")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="leave the notebooks with outputs there")
    given = parser.parse_args()
    files = [Path(name) for name in given.names] or sorted(HERE.glob("*.ipynb"))
    if given.keep is not None:
        given.keep.mkdir(parents=True, exist_ok=True)
    total_s = sum(run(file, given.keep) for file in files)
    print(f"{len(files)} notebooks in {total_s:.1f} s{'' if total_s < LONGEST_S else ', which is too long'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
