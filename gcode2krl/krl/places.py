"""The files of a program: what they are called, and how they come into their places together."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gcode2krl import krl_words as w
from gcode2krl.cell.sections.robot import RsiVersion
from gcode2krl.errors import Issue, input_error
from gcode2krl.files import Staging, refuse_inputs
from gcode2krl.files.program_names import program_stem
from gcode2krl.krl.names import name_problem, suggested_name
from gcode2krl.krl.rsi_files import file_names

_ALIKE = "; a controller needs file and DEF alike"


class ProgramFiles:
    """The files of a program: beside their places until it is verified, or without any."""

    def __init__(self, file: Path | None, name: str, inputs: Sequence[str | Path]) -> None:
        self.file, self.name, self.inputs = file, name, inputs
        self.staging = Staging()
        self.texts: dict[str, bytes] = {}

    def __enter__(self) -> "ProgramFiles":
        return self

    def __exit__(self, *_: object) -> None:
        self.staging.discard()

    def write(self, texts: Mapping[str, Iterable[bytes]]) -> None:
        """Write the program piece by piece, in the place of what has been written before.

        ``texts`` then holds what the files say: it is read from them.
        """
        self.staging.discard()
        self.texts.clear()
        if self.file is not None:
            refuse_inputs([_place(self.file, part, self.name) for part in texts], self.inputs)
        for part, pieces in texts.items():
            if self.file is None:
                self.texts[part] = b"".join(pieces)
            else:
                place = _place(self.file, part, self.name)
                self.texts[part] = self.staging.write(place, pieces).read_bytes()

    def take_places(self) -> list[Path]:
        """Put the files in their places and return these; none where there is no file."""
        if self.file is None:
            return []
        self.staging.take_places()
        return [_place(self.file, part, self.name) for part in self.texts]


def output_files(file: Path, online: str | None, rsi: RsiVersion = "3") -> list[Path]:
    """Return the files that a program may consist of, but for its parts; ``rsi`` counts if it is online."""
    of_rsi = [file.with_name(name) for name in file_names(online, rsi)] if online is not None else []
    return [file, file.with_suffix(w.DATA_SUFFIX), file.with_suffix(w.SIDECAR_SUFFIX), *of_rsi]


def _place(file: Path, part: str, program_name: str) -> Path:
    if part == f"{program_name}{w.SOURCE_SUFFIX}":
        return file
    for suffix in (w.DATA_SUFFIX, w.SIDECAR_SUFFIX):
        if part == f"{program_name}{suffix}":
            return file.with_suffix(suffix)
    return file.with_name(part)


def program_file(
    path: str | Path, name: str | None, source: str, taken: Sequence[str] = ()
) -> tuple[Path, list[Issue]]:
    """Return the ``.src`` that a program becomes, and what there is to say about its name.

    Where ``path`` is a folder the name is ``name``, or made from that of the source (G-code) so that a
    controller takes it. A file must have a good name already, as a controller finds the program by it.

    Raises
    ------
    NotUnderstoodError
        Where file or name are no names for a program, or differ.
    """
    place = Path(path)
    if name is not None:
        require_name(name, taken)
    if place.is_dir() and place.suffix.lower() != w.SOURCE_SUFFIX:
        return _file_in(place, name, program_stem(_last_step(source)), taken)
    if place.suffix.lower() != w.SOURCE_SUFFIX:
        sentence = f"the output {place.name!r} does not end in .src and is no folder"
        raise input_error("option-value", sentence, "name it part.src, or create the folder first")
    problem = name_problem(place.stem, taken)
    good = suggested_name(name if name is not None else place.stem, taken)
    if problem:
        sentence = f"{place.stem!r} cannot be a program's name: {problem}{_ALIKE}"
        raise input_error(
            "krl-name", sentence, f"-o {place.with_name(good)}{w.SOURCE_SUFFIX}", source=place.name
        )
    if name is not None and name.upper() != place.stem.upper():
        sentence = f"--name {name} and the file {place.name} differ{_ALIKE}"
        remedy = f"-o {place.with_name(name)}.src, or leave out --name"
        raise input_error("krl-name", sentence, remedy, source=place.name)
    return place, []


def _file_in(folder: Path, name: str | None, stem: str, taken: Sequence[str]) -> tuple[Path, list[Issue]]:
    """Return the file in a folder, of a given name or of one made from a stem."""
    if name is not None:
        return folder / f"{name}{w.SOURCE_SUFFIX}", []
    problem = name_problem(stem, taken)
    if not problem:
        return folder / f"{stem}{w.SOURCE_SUFFIX}", []
    good = suggested_name(stem, taken)
    sentence = f"the program is called {good}: {stem!r} cannot be a program's name ({problem})"
    return folder / f"{good}{w.SOURCE_SUFFIX}", [
        Issue("note", "krl-name", 0, sentence, "or choose a name with --name")
    ]


def require_name(name: str, taken: Sequence[str]) -> None:
    """Raise `NotUnderstoodError` where a name that was asked for is none for a program."""
    problem = name_problem(name, taken) if name else "is empty"
    if problem:
        remedy = f"--name {suggested_name(name, taken)}: at most 24 of A-Z, 0-9, _; not starting with a digit"
        raise input_error("krl-name", f"--name {name!r}: {problem}", remedy)


def _last_step(source: str) -> str:
    return re.split(r"[\\/]", source)[-1]
