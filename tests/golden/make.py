"""Write the golden programs again; review the difference as an integrator would before committing it."""

import tempfile
from pathlib import Path

from gcode2krl import load_cell, read_gcode, set_targets, write_krl
from tests.golden.test_golden import HERE, PROGRAMS

for part in PROGRAMS:
    own = part.with_suffix(".toml")
    cell = load_cell(own if own.exists() else None)
    with tempfile.TemporaryDirectory() as folder:
        program = write_krl(
            set_targets(read_gcode(part, cell), cell), Path(folder) / f"{part.stem}.src", cell
        )
        for name, text in program.texts.items():
            (HERE / "krl").mkdir(exist_ok=True)
            (HERE / "krl" / name).write_bytes(text)
