"""What became of an order: the written program, or why there is none, and what was known until then."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcode2krl.errors import Gcode2KrlError, Issue
from gcode2krl.result import cell_of, hashes_of, input_of, record_of
from gcode2krl.translation.inputs import STANDARD, StandardInput
from gcode2krl.translation.order import Order

if TYPE_CHECKING:
    from gcode2krl.cell import Cell
    from gcode2krl.chain import Plan
    from gcode2krl.krl import WrittenProgram
    from gcode2krl.prediction.forecast import Forecast
    from gcode2krl.tables import Toolpath


@dataclass(eq=False)
class Attempt:
    """What `carry_out` has done, as far as it got; None where a stage did not run."""

    order: Order
    error: Gcode2KrlError | None = None
    """Why no program was written, None where it was."""
    cell: "Cell | None" = None
    """As resolved, under the job."""
    toolpath: "Toolpath | None" = None
    plan: "Plan | None" = None
    """What the robot would be told, and its joints there."""
    corner_mm: float | None = None
    """The largest corner error."""
    forecast: "Forecast | None" = None
    written: "WrittenProgram | None" = None
    page: Path | None = None
    """The page that was asked for, where it was written."""
    standard: StandardInput | None = None
    """Standard input, where the part was read from it."""

    @property
    def exit_code(self) -> int:
        """0 written, 1 understood and refused, 2 not understood."""
        return 0 if self.error is None else self.error.exit_code

    @property
    def issues(self) -> tuple[Issue, ...]:
        """The findings of the program, or those that refuse it."""
        if self.error is not None:
            return self.error.issues
        return self.written.issues if self.written is not None else ()

    @cached_property
    def record(self) -> dict[str, Any]:
        """The record of the translation (``docs/record.md``); what refuses a program keeps its figures."""
        restart: dict[str, Any] = {}
        if self.toolpath is not None:
            from gcode2krl.restart.rows import restart_record

            restart = restart_record(self.toolpath)
        return record_of(
            "translate",
            self._figures() | restart | self.order.project.record,
            self.issues,
            exit_code=self.exit_code,
            input=self._input(),
            cell=None if self.cell is None else cell_of(self.cell, self.order.cell_path),
            options=self.order.options(),
            files={} if self.written is None else hashes_of(self.written.files),
            issues_file=self._issues_file(),
        )

    def _issues_file(self) -> str | None:
        """Return the file that the findings are about, None where it is the part."""
        source = self.error.source if self.error is not None else ""
        if source in ("", str(self.order.part)) or not Path(source).is_file():
            return None
        return source

    def _input(self) -> Mapping[str, Any] | None:
        if str(self.order.part) != STANDARD:
            return input_of(self.order.part)
        return self.standard.as_input() if self.standard is not None else None

    def quantities(self) -> dict[str, Any] | None:
        """Return the figures with interval and source, see `quantity.quantities`; None before a motion."""
        forecast = self.forecast
        if forecast is None or not forecast.has_motion:
            return None
        from gcode2krl.translation.quantity import quantities

        return quantities(forecast.loads, forecast.time_s, forecast.targets, forecast.cell)

    def _figures(self) -> dict[str, Any]:
        """Return the figures of the JSON contract; one whose stage did not run is null."""
        forecast, written = self.forecast, self.written
        loads = forecast.loads if forecast is not None else None
        pilot = written.pilot if written is not None else None
        return {
            "moves": len(self.toolpath) - 1 if self.toolpath is not None else None,
            "time_s": forecast.time_s if forecast is not None else None,
            "path_mm": forecast.path_mm if forecast is not None else None,
            "max_force_N": loads.force_N if loads is not None else None,
            "max_deflection_mm": loads.deflection_mm if loads is not None else None,
            "quantities": self.quantities(),
            "corner_error_mm": self.corner_mm,
            "verify": written.report.as_dict() if written is not None else {"max_deviation_mm": None},
            "pilot": pilot.as_dict() if pilot is not None else {"knots": None, "max_error_N": None},
        }
