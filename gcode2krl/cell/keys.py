"""The key of a cell that a mistyped one most likely means: the closest key of its section."""

from collections.abc import Sequence

from pydantic import BaseModel

from gcode2krl.cell.descriptions import NOT_OF_A_FILE, sections_in
from gcode2krl.codes import closest


def meant_key(cell: type[BaseModel], place: Sequence[str | int]) -> str:
    """Return the dotted key that an unknown key at ``place`` most likely means; empty if none is close."""
    *above, last = place
    kinds: list[type[BaseModel]] = [cell]
    written: list[str] = []
    for step in above:
        below = [kind.model_fields[str(step)].annotation for kind in kinds if str(step) in kind.model_fields]
        if below:  # else the number of a tool, an entry of a list or the name of a work offset
            kinds = [model for annotation in below for model in sections_in(annotation)]
        written.append(str(step))
    known = [name for kind in kinds for name in kind.model_fields if name not in NOT_OF_A_FILE]
    without_unit = [name for name in known if name.rpartition("_")[0] == str(last)]
    near = without_unit[0] if without_unit else closest(str(last), known)
    return ".".join([*written, near]) if near else ""
