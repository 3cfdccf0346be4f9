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
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.files.toml_guard import NotTomlError, read_bounded_toml

NAME = "gcode2krl.toml"
_PATHS = ("cell", "job", "search", "effects")
_DESTINATIONS = {
    "cell": "cell_path",
    "job": "job_path",
    "simplify": "simplify_mm",
    "tolerance": "tolerance_mm",
    "chord-tolerance": "chord_tolerance_mm",
    "dt": "dt_s",
    "effect": "effects",
    "effects": "effect_folders",
}
"""Of keys whose option has another name in its command."""
_KEYS = {destination: key for key, destination in _DESTINATIONS.items()}


def _key(name: str) -> str:
    return name.replace("_", "-")


def _known(dialect: str) -> str:
    if dialect not in DIALECT_NAMES:
        raise ValueError(f"no dialect {dialect!r}; known: {', '.join(DIALECT_NAMES)}")
    return dialect


class _Options(BaseModel):
    """Options of `translate`, `predict` and `batch`; a command takes those that it has."""

    model_config = ConfigDict(extra="forbid", strict=True, alias_generator=_key)

    cell: str | None = Field(None, description="Cell file.")
    job: str | None = Field(
        None, description="What the CAM knows: its cutters and stock, laid over the cell."
    )
    dialect: Annotated[str, AfterValidator(_known)] | None = Field(
        None,
        description="What the post wrote the G-code for.",
        json_schema_extra={"enum": list(DIALECT_NAMES)},
    )
    search: list[str] | None = Field(None, description="Folders with subprograms.")
    block_delete: bool | None = Field(None, description="Skip lines that begin with /.")
    chord_tolerance: float | None = Field(
        None, gt=0.0, description="Largest error of the chords of an arc, mm."
    )
    tolerance: float | None = Field(None, gt=0.0, description="Blend corners within this, mm.")
    simplify: float | None = Field(
        None, gt=0.0, description="Merge feed moves into straight ones within this, mm."
    )
    allow: list[str] | None = Field(None, description="Findings to allow, CODE or CODE:LINE.")
    strict: bool | None = Field(None, description="Warnings refuse a program too.")
    no_guard: bool | None = Field(None, description="Leave out the checks at a program's start.")
    split: Literal["defs", "files"] | None = Field(None, description="How a long program is split.")
    max_lines: int | None = Field(None, ge=100, description="Motions in a part of a program.")
    compensate: Literal["offline"] | None = Field(
        None, description="Move the targets against the predicted deflection."
    )
    no_forces: bool | None = Field(None, description="Leave out material removal, forces and deflection.")
    pilot: Literal["index", "values", "none"] | None = Field(
        None, description="How a program carries the pilot force."
    )
    comment_every: int | None = Field(
        None, ge=0, description="Motions between comments with the G-code line."
    )
    dt: float | None = Field(None, gt=0.0, description="Sample time of a prediction, s.")
    csv: bool | None = Field(None, description="Write the tables of a prediction as CSV too.")
    plot: bool | None = Field(None, description="Draw a prediction.")
    effect: list[str] | None = Field(None, description="Effects of a prediction, NAME:key=value,...")
    effects: list[str] | None = Field(None, description="Folders of effects of your own.")


class _Files(_Options):
    """Options of some parts of the folder."""

    match: str = Field(description="Part of the folder, such as mill/*.nc; * goes through folders too.")


class _ProjectFile(_Options):
    """Options of gcode2krl for the parts in this folder and below."""

    files: list[_Files] = Field([], description="Options of the parts that a pattern fits; the last counts.")


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
        words = ", ".join(
            f"{key}={_word(value)}" for key, value in zip(self.keys, self.options.values(), strict=True)
        )
        remedy = "nothing to do where they are meant; --isolated takes none"
        return (Issue("note", "project-options", 0, f"{self.file} states {words}", remedy),)

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
        return tuple(_KEYS.get(name, _key(name)) for name in self.options)


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


def project_schema() -> dict[str, Any]:
    """Return the JSON schema of a project file, for editors."""
    return _ProjectFile.model_json_schema(by_alias=True) | {"title": "gcode2krl project file"}


@lru_cache(maxsize=64)
def _read(file: Path, _changed_ns: int) -> _ProjectFile:
    try:
        return _ProjectFile.model_validate(read_bounded_toml(file))
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

    place = ".".join(str(step) for step in fault["loc"])
    if fault["type"] != "extra_forbidden":
        return Issue("error", "project-key", 0, f"{place}: {fault['msg']}", "docs/project.md lists the keys")
    known = list(map(_key, _Files.model_fields))
    near = closest(str(fault["loc"][-1]), known)
    remedy = f"did you mean {near}?" if near else f"keys: {', '.join(known)}, files"
    return Issue("error", "project-key", 0, f"{place}: there is no such key", remedy)


def _stated(options: _Options) -> dict[str, Any]:
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


def _word(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
