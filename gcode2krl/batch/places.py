"""Where the program of each part goes, and which names a controller would not tell apart."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from gcode2krl.batch.parts import Part
from gcode2krl.errors import Issue, input_error
from gcode2krl.files.program_names import program_stem
from gcode2krl.krl import suggested_name
from gcode2krl.krl.names import name_problem


def program_name(part: Part, taken: Sequence[str]) -> str:
    """Return the name of a part's program: the file's, or one made from it that a controller takes."""
    stem = program_stem(part.key)
    return suggested_name(stem, taken) if name_problem(stem, taken) else stem


def refuse_collisions(parts: Iterable[Part], name_of: Callable[[Part], str]) -> None:
    """Raise `NotUnderstoodError` where two parts of one folder have one program name; names both."""
    seen: dict[str, Part] = {}
    for part in parts:
        place = f"{part.folder}{name_of(part)}"
        other = seen.setdefault(place.casefold(), part)  # neither KRL nor Windows tells case apart
        if other is not part:
            sentence = f"{other.file} and {part.file} would both be written as {place}.src"
            raise input_error("output-is-input", sentence, "rename one of them")


def refuse_inputs_below(out: Path, parts: Iterable[Part]) -> None:
    """Raise `NotUnderstoodError` where the output folder is a file."""
    if out.exists() and not out.is_dir():
        raise input_error("output-unwritable", "this is a file", "name a folder", source=str(out))


def alike(parts: Iterable[Part], name_of: Callable[[Part], str]) -> Mapping[str, Issue]:
    """Return part → finding for parts of different folders whose programs have one name."""
    of_name: dict[str, list[Part]] = {}
    for part in parts:
        of_name.setdefault(name_of(part).casefold(), []).append(part)
    findings = {}
    for same in of_name.values():
        for part in same if len(same) > 1 else ():
            others = [other.key for other in same if other is not part]
            more = f" and {len(others) - 1} more" if len(others) > 1 else ""
            sentence = f"{others[0]}{more} has the program name {name_of(part)} too"
            remedy = "a controller keeps one program of a name: rename one if both go to the same robot"
            findings[part.key] = Issue("note", "krl-name", 0, sentence, remedy)
    return findings
