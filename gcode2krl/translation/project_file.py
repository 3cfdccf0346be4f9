"""The keys of ``gcode2krl.toml``, for reading one and for its schema."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from gcode2krl.files.program_names import DIALECT_NAMES


def key_of(name: str) -> str:
    """Return the key of an option: its name with dashes."""
    return name.replace("_", "-")


def _known(dialect: str) -> str:
    if dialect not in DIALECT_NAMES:
        raise ValueError(f"no dialect {dialect!r}; known: {', '.join(DIALECT_NAMES)}")
    return dialect


class Options(BaseModel):
    """Options of `translate`, `predict` and `batch`; a command takes those that it has."""

    model_config = ConfigDict(extra="forbid", strict=True, alias_generator=key_of, defer_build=True)

    cell: str | None = Field(None, description="Cell file.")
    job: str | None = Field(
        None, description="What the CAM knows: its cutters and stock, laid over the cell."
    )
    tools: str | None = Field(None, description="Library of tools that the cell does not have.")
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


class Files(Options):
    """Options of some parts of the folder."""

    match: str = Field(description="Part of the folder, such as mill/*.nc; * goes through folders too.")


class ProjectFile(Options):
    """Options of gcode2krl for the parts in this folder and below."""

    files: list[Files] = Field([], description="Options of the parts that a pattern fits; the last counts.")


def project_schema() -> dict[str, Any]:
    """Return the JSON schema of a project file, for editors."""
    return ProjectFile.model_json_schema(by_alias=True) | {"title": "gcode2krl project file"}
