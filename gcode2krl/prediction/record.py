"""Reads ``prediction.toml``: every key must have its type; an error names the key in one line."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationError,
)

from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files.toml_guard import NotTomlError, read_bounded_toml
from gcode2krl.tables import Event

SCHEMA = "gcode2krl/prediction/1"
REMEDY = "predict the part again"
_LARGEST_LINE = 2**31 - 1
_Line = Annotated[int, Field(strict=True, ge=0, le=_LARGEST_LINE)]
_Row = Annotated[int, Field(strict=True, ge=0, le=_LARGEST_LINE)]
_Band = Annotated[FiniteFloat, Field(ge=0)]
_NotNegative = Annotated[FiniteFloat, Field(ge=0)]
_Plain = StrictBool | StrictInt | FiniteFloat | StrictStr


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class _IssueRecord(_Part):
    severity: Literal["error", "warning", "note"]
    code: Annotated[str, Field(strict=True, pattern=r"^[a-z0-9-]{1,64}$")]
    line: _Line
    message: StrictStr
    remedy: StrictStr = ""
    file: StrictStr = ""
    file_line: _Line = 0


class _EventValues(_Part):
    """What an event may state; `_WANTED` lists what each kind must state."""

    line: _Line
    m: StrictInt | None = None
    tool: Annotated[int, Field(strict=True, ge=0)] | None = None
    rpm: FiniteFloat | None = None
    mist: StrictBool | None = None
    flood: StrictBool | None = None
    text: StrictStr | None = None
    p: FiniteFloat | None = None
    implied: StrictBool | None = None
    dwell_s: _NotNegative | None = None


_WANTED = {
    "tool": {"tool"},
    "spindle": {"rpm", "m"},
    "coolant": {"mist", "flood", "m"},
    "message": {"text", "m"},
}


class _EventRecord(_Part):
    row: _Row
    kind: Literal["tool", "spindle", "coolant", "message"]
    values: _EventValues

    def event(self) -> Event:
        """Return the event; raises `ValueError` where its kind states less than it must."""
        values = self.values.model_dump(exclude_unset=True)
        absent = _WANTED[self.kind] - values.keys()
        if absent:
            raise ValueError(f"a {self.kind} event without {', '.join(sorted(absent))}")
        return Event(self.row, self.kind, values)


class _RestartRecord(_Part):
    """`tables.Restart` without its material."""

    line: Annotated[int, Field(strict=True, ge=1, le=_LARGEST_LINE)]
    begins_line: Annotated[int, Field(strict=True, ge=1, le=_LARGEST_LINE)]
    way_rows: Annotated[int, Field(strict=True, ge=0, le=3)]


class _SimplifiedRecord(_Part):
    """`tables.Simplified`."""

    tolerance_mm: Annotated[FiniteFloat, Field(gt=0)]
    moves: _Row
    left_out: _Row
    largest_mm: _NotNegative
    worst_line: _Line


class _ClearanceRecord(_Part):
    """Names of `tables.Clearance`."""

    links: tuple[StrictStr, ...] = ()
    obstacles: tuple[StrictStr, ...] = ()


class _Inputs(BaseModel):
    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)
    __pydantic_extra__: dict[str, _Plain | list[_Plain]]

    program: StrictStr = ""
    dt_s: Annotated[FiniteFloat, Field(gt=0)] | None = None


class PredictionRecord(BaseModel):
    """The head of a prediction; `cell` is checked when it is made into a `Cell`."""

    model_config = ConfigDict(extra="ignore", frozen=True, defer_build=True)

    inputs: _Inputs
    issues: tuple[_IssueRecord, ...]
    toolpath_events: tuple[_EventRecord, ...]
    targets_events: tuple[_EventRecord, ...]
    cell: dict[str, Any]
    restart: _RestartRecord | None = None
    simplified: _SimplifiedRecord | None = None
    clearance: _ClearanceRecord = _ClearanceRecord.model_construct()
    correction_mm: _NotNegative = 0.0
    forces_relative_band: _Band = 0.0
    deflection_relative_band: _Band = 0.0

    def findings(self) -> tuple[Issue, ...]:
        """Return the findings."""
        return tuple(
            Issue(i.severity, i.code, i.line, i.message, i.remedy, file=i.file, file_line=i.file_line)
            for i in self.issues
        )

    def plain_inputs(self) -> dict[str, Any]:
        """Return program, version and settings as they were saved."""
        return self.inputs.model_dump(exclude_unset=True)


def read_record(file: Path) -> PredictionRecord:
    """Read ``prediction.toml``; raises `NotUnderstoodError` of one line that names file and key."""
    try:
        tables = read_bounded_toml(file)
    except OSError as error:
        raise input_error("file-unreadable", f"cannot read: {error.strerror}", source=str(file)) from None
    except NotTomlError as error:
        raise input_error("not-toml", str(error), REMEDY, source=str(file)) from None
    if tables.get("unfinished"):
        sentence = "the prediction was not written completely"
        raise input_error("prediction-unfinished", sentence, "predict again", source=str(file))
    schema = tables.get("schema")
    if schema != SCHEMA:
        message = f"schema: found {repr(schema)[:60]}, allowed: {SCHEMA}"
        raise input_error("prediction-schema", message, REMEDY, source=str(file))
    try:
        return PredictionRecord.model_validate(tables)
    except ValidationError as error:
        raise _wrong_key(error, file) from None


def events_of(records: tuple[_EventRecord, ...], rows: int, table: str) -> tuple[Event, ...]:
    """Return the events of a table of ``rows`` rows; raises `ValueError` for one outside of it."""
    events = tuple(record.event() for record in records)
    for event in events:
        if event.row >= rows:
            raise ValueError(f"{table}: an event at row {event.row}, of {rows}")
    return events


def _wrong_key(error: ValidationError, file: Path) -> NotUnderstoodError:
    first, *others = error.errors(include_url=False)
    key = ".".join(str(step) for step in first["loc"])[:120]
    allowed = first["msg"].removeprefix("Input should be ")
    reason = (
        "missing" if first["type"] == "missing" else f"found {repr(first['input'])[:60]}, allowed: {allowed}"
    )
    more = f" (and {len(others)} more)" if others else ""
    return input_error("prediction-key", f"{key}: {reason}{more}", REMEDY, source=str(file))
