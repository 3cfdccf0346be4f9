"""``run.toml``: what a person states about a measured run."""

import difflib
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.files.toml_guard import NotTomlError, read_bounded_toml

FrameName = Literal["base", "tcp", "sensor"]
Origin = Literal["interpolator", "filtered", "measured"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
_DOCS = "docs/runs.md lists the keys"


class _Table(BaseModel):
    """A table of ``run.toml``; values do not change."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class RunFrames(_Table):
    """The frame in which an instrument states its values."""

    tracker: FrameName = "base"
    force: FrameName = "base"


class Noise(_Table):
    """1-sigma of the instruments, None where it is not stated."""

    tcp_mm: Positive | None = None
    force_N: Positive | None = None
    q_act_deg: Positive | None = None
    q_load_deg: Positive | None = None


class Channels(_Table):
    """Where the controller's channels come from; None where it is not stated.

    An interpolator position may be 40-100 ms ahead of the drives; under RSI correction the commanded values
    do not include the correction.
    """

    position_cmd: Origin | None = None
    q_cmd: Origin | None = None
    q_act: Origin | None = None
    q_load: Origin | None = None
    rsi: bool | None = None
    """RSI correction on or off."""
    correction: Literal["absolute", "relative"] = "absolute"
    """Whether a logged correction is the total or the increment of its cycle."""
    decimals: Annotated[int, Field(ge=0, le=12)] | None = None


class Clocks(_Table):
    """What ``t_s`` of a table reads at the prediction's start; it is subtracted on loading."""

    controller_s: Finite = 0.0
    tracker_s: Finite = 0.0
    force_s: Finite = 0.0


class Files(_Table):
    """File names, where they are not the usual ones."""

    controller: str | None = None
    tracker: str | None = None
    force: str | None = None
    poses: str | None = None
    scan: str | None = None


class Layout(_Table):
    """How the columns of another exporter's table became those of the run; empty where they were its own."""

    file: str | None = None
    columns: dict[str, str] = Field(default_factory=dict)
    """Their name → column of the run without its unit."""
    units: dict[str, str] = Field(default_factory=dict)
    order: str | None = None
    """Of the three angles of an orientation."""


class RunHead(_Table):
    """``run.toml`` as read."""

    cell: str | None = None
    program: str | None = None
    prediction: str | None = None
    started: datetime | None = None
    """Aware; a time without zone is taken as UTC."""
    angles: Literal["absolute", "relative"] = "absolute"
    mode: Literal["T1", "T2", "AUT", "EXT"] | None = None
    override_percent: Annotated[float, Field(gt=0, le=200)] = 100.0
    in_air: bool | None = None
    """Nothing was cut, so that the prediction counts without its forces; None: the tip tells."""
    frames: RunFrames = RunFrames()
    noise: Noise = Noise()
    channels: Channels = Channels()
    clocks: Clocks = Clocks()
    files: Files = Files()
    layout: Layout = Layout()
    notes: dict[str, Any] = Field(default_factory=dict)

    @field_validator("started")
    @classmethod
    def _aware(cls, value: datetime | None) -> datetime | None:
        return value.replace(tzinfo=UTC) if value is not None and value.tzinfo is None else value


def read_head(file: Path) -> tuple[RunHead, tuple[Issue, ...]]:
    """Read ``run.toml``; keys it does not know are warnings.

    Raises `NotUnderstoodError` that names the file, the key, what was found and what is allowed.
    """
    data = _read(file)
    try:
        head = RunHead.model_validate(data)
    except ValidationError as error:
        issues = [_wrong_key(detail) for detail in error.errors(include_url=False)]
        raise NotUnderstoodError(issues, str(file)) from None
    return head, tuple(_unknown_keys(data, RunHead, file.name))


def _read(file: Path) -> dict[str, Any]:
    try:
        return read_bounded_toml(file)
    except OSError as error:
        words, remedy = f"cannot read: {error.strerror}", "a run needs a run.toml; an empty one will do"
        raise input_error("file-unreadable", words, remedy, source=str(file)) from None
    except NotTomlError as error:
        raise input_error("not-toml", str(error), _DOCS, source=str(file)) from None


def _wrong_key(detail: Any) -> Issue:
    key = ".".join(str(step) for step in detail["loc"])
    value = repr(detail["input"])
    value = value if len(value) <= 60 else value[:57] + "…"
    allowed = detail["msg"].removeprefix("Input should be ")
    return Issue("error", "run-key", 0, f"{key}: found {value}, allowed: {allowed}", _DOCS)


def _unknown_keys(data: dict[str, Any], kind: type[BaseModel], file: str, above: str = "") -> list[Issue]:
    issues: list[Issue] = []
    for key, value in data.items():
        field = kind.model_fields.get(key)
        if field is None:
            near = difflib.get_close_matches(key, kind.model_fields, n=1)
            remedy = f"did you mean {above}{near[0]}?" if near else "free text belongs into [notes]"
            message = f"{file}: {above}{key}: there is no such key, it is left out"
            issues.append(Issue("warning", "run-key", 0, message, remedy))
        elif isinstance(value, dict) and isinstance(field.default, BaseModel):
            issues += _unknown_keys(value, type(field.default), file, f"{above}{key}.")
    return issues
