"""Named causes, written into a cell file so that the next prediction has them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gcode2krl.cell import library, resolve_cell
from gcode2krl.errors import input_error
from gcode2krl.files import write_together
from gcode2krl.gap.tell.result import Gap


def apply_to_cell(gap: Gap, file: Path, base: Path | None, sources: Sequence[str]) -> int:
    """Write the named causes into a cell file as ``[[effects]]`` and return how many there are.

    Parameters
    ----------
    file : the cell file that is written; if it exists, its other keys are kept and its comments are lost.
    base : the cell file to begin from where ``file`` does not exist.
    sources : names of the runs that the causes come from.

    Raises
    ------
    NotUnderstoodError
        A file is no cell file, or cannot be written.
    """
    import tomli_w

    begin = file if file.exists() else base
    data: dict[str, Any] = library.read_toml(begin) if begin is not None else {}
    before = data.get("effects", [])
    if not isinstance(before, list):
        raise input_error("cell-key", "effects: found no list", "write [[effects]]", source=str(file))
    causes = [applied for applied in gap.named if applied.effect.kind == "cause"]
    entries = [
        {
            "name": cause.effect.name,
            **({"target": cause.target} if cause.target is not None else {}),
            "parameters": {name: float(f"{value:.6g}") for name, value in cause.values.items()},
            "source": f"diagnosed from {', '.join(sources)}",
        }
        for cause in causes
    ]
    replaced = {(entry["name"], entry.get("target")) for entry in entries}
    kept = [entry for entry in before if (entry.get("name"), entry.get("target")) not in replaced]
    data["effects"] = [*kept, *entries]
    resolve_cell(data, folder=file.parent, source=str(file))
    write_together({file: tomli_w.dumps(data).encode("utf-8")})
    return len(entries)
