"""The record as a model, for its JSON schema: what every command says, and the figures of some."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
NotNegative = Annotated[int, Field(ge=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class InputFile(_Strict):
    """A file or a folder that was read."""

    file: str = Field(description="As it was named; stdin for standard input.")
    sha256: Sha256 = Field(
        description="Of the bytes; of a folder of the lines `<sha256>  <name>` of its files."
    )
    size_bytes: NotNegative


class CellName(_Strict):
    """The cell that a command worked with."""

    name: str
    file: str | None = Field(description="null: the demonstration cell, or the cell of a prediction.")
    sha256: Sha256 = Field(
        description="Of the resolved values (base, models, job) as JSON with sorted keys; a file that they "
        "name counts by its content."
    )


class Counts(_Strict):
    """How many findings of each severity there are."""

    errors: NotNegative
    warnings: NotNegative
    notes: NotNegative


class Finding(_Strict):
    """One finding."""

    severity: Literal["error", "warning", "note"]
    code: str = Field(description="docs/findings.md lists them.")
    line: NotNegative = Field(description="Of the G-code or the file, from 1; 0 where there is none.")
    column: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Of the culprit in its line, in characters from 1, where it is certain."
    )
    message: str
    remedy: str
    file: str | None = Field(
        default=None,
        description="What the line is of where it is not the input: a cell, job or subprogram.",
    )


class Record(BaseModel):
    """What a command of gcode2krl was given, did and found; figures are keys beside these."""

    model_config = ConfigDict(extra="allow", strict=True, title="gcode2krl result")

    schema_: Literal["gcode2krl/result/1"] = Field(alias="schema")
    command: str = Field(description="translate, predict, identify force …")
    version: str = Field(description="Of gcode2krl.")
    input: InputFile | None = Field(description="The first input; null where there is none to read.")
    cell: CellName | None = Field(description="null where none was read.")
    options: dict[str, Any] = Field(description="Those that differ from their defaults, with their units.")
    exit_code: Annotated[int, Field(ge=0, le=2)] = Field(description="0 done, 1 refused, 2 not understood.")
    counts: Counts
    files: list[str] = Field(description="Files that were written.")
    sha256: dict[str, Sha256] = Field(description="Of these files.")
    issues: list[Finding]


def result_schema() -> dict[str, Any]:
    """Return the JSON schema of a record."""
    return Record.model_json_schema(by_alias=True)
