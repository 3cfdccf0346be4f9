"""``gcode2krl.toml``: the options of the parts of a folder, found upwards from a part.

Keys are the options of the commands without their dashes. A table ``[[files]]`` holds for the parts that its
``match`` fits, a later one before an earlier one. What a command line states comes before the file; names of
other files begin at its folder.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files.toml_guard import NotTomlError, read_bounded_toml

if TYPE_CHECKING:  # pydantic costs a help text a noticeable start
    from gcode2krl.translation.project_file import Options, ProjectFile

NAME = "gcode2krl.toml"
_PATHS = ("cell", "job", "tools", "search", "effects")
_DESTINATIONS = {
    "cell": "cell_path",
    "job": "job_path",
    "tools": "tools_path",
    "simplify": "simplify_mm",
    "tolerance": "tolerance_mm",
    "chord-tolerance": "chord_tolerance_mm",
    "dt": "dt_s",
    "effect": "effects",
    "effects": "effect_folders",
}
"""Of keys whose option has another name in its command."""
_KEYS = {destination: key for key, destination in _DESTINATIONS.items()}


@dataclass(frozen=True)
class Project:
    """The project file of a part and the options that a command takes from it."""

    file: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    """By the names of the command's parameters, which are those of `Order`."""

    def without(self, stated: Collection[str], known: Collection[str]) -> "Project":
        """Return the project with the options of a command that its line does not state."""
        taken = {name: value for name, value in self.options.items() if name in known and name not in stated}
        return Project(self.file if taken else None, taken)

    @property
    def issues(self) -> tuple[Issue, ...]:
        """The note that says which options come from the file."""
        if self.file is None:
            return ()
        folder = self.file.parent
        words = ", ".join(
            f"{key}={_word(value, folder)}"
            for key, value in zip(self.keys, self.options.values(), strict=True)
        )
        remedy = "nothing to do where they are meant; --isolated takes none"
        return (
            Issue("note", "project-options", 0, f"{_below(self.file, Path.cwd())} states {words}", remedy),
        )

    @property
    def record(self) -> dict[str, Any]:
        """The key ``project`` of a record; none without a file."""
        if self.file is None:
            return {}
        from gcode2krl.result import sha256_of

        stated = {"file": str(self.file), "sha256": sha256_of(self.file), "options": list(self.keys)}
        return {"project": stated}

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the options in the file."""
        return tuple(_KEYS.get(name, name.replace("_", "-")) for name in self.options)


def project_of(part: str | Path) -> Project:
    """Return what the nearest ``gcode2krl.toml`` at or above a part's folder states for it.

    Raises `NotUnderstoodError` where it cannot be read, or has a key or a value that no option has.
    """
    place = Path(part).absolute()
    file = next((folder / NAME for folder in place.parents if (folder / NAME).is_file()), None)
    if file is None:
        return Project()
    stated = _read(file, file.stat().st_mtime_ns)
    keys = _stated(stated)
    below = place.relative_to(file.parent).as_posix()
    for files in stated.files:
        if fnmatchcase(below, files.match):
            keys |= _stated(files)
    return Project(
        file, {_DESTINATIONS.get(key, key.replace("-", "_")): _value(file, key, keys[key]) for key in keys}
    )


@lru_cache(maxsize=64)
def _read(file: Path, _changed_ns: int) -> "ProjectFile":
    from pydantic import ValidationError

    from gcode2krl.translation.project_file import ProjectFile

    try:
        return ProjectFile.model_validate(read_bounded_toml(file))
    except NotTomlError as error:
        raise input_error("not-toml", str(error), "correct the file", source=str(file)) from None
    except OSError as error:
        raise input_error(
            "file-unreadable", f"cannot read: {error.strerror}", "name the right file", source=str(file)
        ) from None
    except ValidationError as error:
        raise NotUnderstoodError([_issue(fault) for fault in error.errors()], str(file)) from None


def _issue(fault: Mapping[str, Any]) -> Issue:
    from gcode2krl.codes import closest
    from gcode2krl.translation.project_file import Files, key_of

    place = ".".join(str(step) for step in fault["loc"])
    if fault["type"] != "extra_forbidden":
        return Issue("error", "project-key", 0, f"{place}: {fault['msg']}", "docs/project.md lists the keys")
    known = list(map(key_of, Files.model_fields))
    near = closest(str(fault["loc"][-1]), known)
    remedy = f"did you mean {near}?" if near else f"keys: {', '.join(known)}, files"
    return Issue("error", "project-key", 0, f"{place}: there is no such key", remedy)


def _stated(options: "Options") -> dict[str, Any]:
    return options.model_dump(by_alias=True, exclude_none=True, exclude={"files", "match"})


def _value(file: Path, key: str, value: Any) -> Any:
    """Return the value of an option as its command has it; names of files begin at the project's folder."""
    if key in _PATHS:
        value = (
            [str(file.parent / name) for name in value]
            if isinstance(value, list)
            else str(file.parent / value)
        )
    return tuple(value) if isinstance(value, list) else value


def _word(value: Any, folder: Path) -> str:
    return ",".join(_below(each, folder) for each in (value if isinstance(value, tuple) else (value,)))


def _below(value: Any, folder: Path) -> str:
    """Return a value as text, the place of a file as seen from a folder above it."""
    path = Path(str(value))
    return (
        path.relative_to(folder).as_posix()
        if path.is_absolute() and path.is_relative_to(folder)
        else str(value)
    )
