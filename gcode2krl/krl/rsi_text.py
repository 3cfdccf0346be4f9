"""What stands in a program that is corrected online: RSI on above the first cut, off above the last.

Corrections are absolute only. The program waits, standing, until the server has proven that the robot takes
them so, and an interrupt stops it where the server is not there any more. RSI_CREATE, RSI_ON, RSI_OFF and
RSI_DELETE are called as public programs for RSI 3, 4 and 5 call them (docs/krl_truth.md).
"""

from dataclasses import dataclass

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.cell.sections.online import Online
from gcode2krl.cell.sections.robot import RsiVersion
from gcode2krl.krl.rsi_files import Form, created_name, file_names, rsi_texts
from gcode2krl.tables import Targets

DECLARATIONS = f"{w.DECL} INT {w.RSI_RESULT},{w.RSI_ID}"


@dataclass(frozen=True)
class RsiText:
    """RSI of one program: the rows at whose end it is switched, and the text."""

    name: str
    """Of the files, see `file_names`."""
    cell: Cell
    form: Form
    """How the program carries the pilot force."""
    on: int
    """Row of Targets: the PTP to the clearance plane above the first position."""
    off: int
    """Row of Targets: the last before HOME, on the clearance plane."""
    tool: int

    @property
    def start(self) -> str:
        """The statements at the end of row `on`."""
        return start_statements(self.name, self.cell.online, self.cell.controller.rsi_version)

    @property
    def end(self) -> str:
        """The statements at the end of row `off`."""
        return end_statements(self.cell.online)

    @property
    def lost(self) -> str:
        """The subprogram of the interrupt."""
        return lost_subprogram(self.cell.online, self.cell, self.tool)

    @property
    def notes(self) -> list[str]:
        """Lines of the header."""
        files = " and ".join(file_names(self.name, self.cell.controller.rsi_version))
        return [f"corrected online by RSI: {files}", *used_variables(self.cell, self.form)]

    @property
    def files(self) -> dict[str, str]:
        """File name → text of what belongs beside the program."""
        version = self.cell.controller.rsi_version
        return rsi_texts(self.name, self.cell.online, self.cell.pilot, self.form, version)


def rsi_rows(targets: Targets) -> tuple[int, int]:
    """Return the rows (on, off): the first PTP that is not HOME, and the last row that is not HOME."""
    away = np.flatnonzero(~targets.home)
    return int(away[0]), int(away[-1])


def start_statements(name: str, settings: Online, rsi: RsiVersion) -> str:
    """Return the KRL that switches RSI on, where the robot stands in air.

    The output that shows readiness keeps its value when RSI ends, so it is put out first. An interrupt sees
    it fall, not that it is out already, so the program looks again once the interrupt is on.
    """
    cycle = w.RSI_FAST if settings.cycle_s < w.RSI_SLOW_CYCLE_S else w.RSI_SLOW
    ready = f"{w.OUT}[{settings.link.ready_output}]"
    return "\n".join(
        [
            f"{w.FOLD} RSI on: gcode2krl online serve must listen before",
            f"{w.WAIT} {w.SEC} 0.0",
            f"{ready}=FALSE",
            f'{w.RSI_RESULT}=RSI_CREATE("{created_name(name, rsi)}",{w.RSI_ID},TRUE)',
            *_until_ok("RSI_CREATE failed"),
            f"{w.RSI_RESULT}=RSI_ON(#ABSOLUTE,{cycle})",
            *_until_ok("RSI_ON failed"),
            f"{w.WAIT} {w.FOR} {ready} ; the absolute mode is proven",
            f"{w.INTERRUPT} {w.DECL} {w.RSI_INTERRUPT} {w.WHEN} {ready}==FALSE {w.DO} {w.LOST_SUBPROGRAM}( )",
            f"{w.INTERRUPT} ON {w.RSI_INTERRUPT}",
            f"{w.WAIT} {w.FOR} {ready}",
            f"{w.ENDFOLD} (RSI on)",
        ]
    )


def end_statements(settings: Online) -> str:
    """Return the KRL that switches RSI off: on the clearance plane, behind the last retract."""
    return "\n".join(
        [
            f"{w.FOLD} RSI off",
            f"{w.WAIT} {w.SEC} 0.0",
            f"{w.INTERRUPT} OFF {w.RSI_INTERRUPT}",
            f"{w.RSI_RESULT}=RSI_OFF()",
            *_until_ok("RSI_OFF failed"),
            f"{w.RSI_RESULT}=RSI_DELETE({w.RSI_ID})",
            f"{w.OUT}[{settings.link.ready_output}]=FALSE",
            f"{w.ENDFOLD} (RSI off)",
        ]
    )


def lost_subprogram(settings: Online, cell: Cell, tool: int) -> str:
    """Return the subprogram of the interrupt: stop on the path, out along the tool axis, and no further.

    RSI holds the correction (``HOLDON``): it is never taken back in material. The program does not go on,
    as the way back into the cut would be straight from where it was left.
    """
    axis = cell.tool[tool].axis or "+z"
    away = settings.link.retract_mm if axis[0] == "+" else -settings.link.retract_mm
    return "\n".join(
        [
            f"{w.DEF} {w.LOST_SUBPROGRAM}( )",
            f"{w.INTERRUPT} OFF {w.RSI_INTERRUPT}",
            w.BRAKE,
            f"LIN_REL {{{axis[1].upper()} {away:.3f}}} #TOOL",
            "LOOP",
            f"{w.HALT} ; the RSI link is lost: switch the spindle off, cancel the program",
            w.BLOCKS["LOOP"],
            w.END,
        ]
    )


def used_variables(cell: Cell, form: Form) -> list[str]:
    """Return notes on the variables and signals of the controller that the files use."""
    pilot, link = cell.pilot, cell.online.link
    reads = {
        "index": f"{pilot.index_variable} number of the knot, {pilot.hash_variable} checksum, ",
        "values": f"{pilot.value_variable}[1..4] next knot, {pilot.hash_variable} checksum, ",
        "none": "",
    }[form]
    return [
        f"RSI reads {reads}$OV_PRO, $OUT[{link.t1_output}] (on in T1)",
        f"RSI writes $OUT[{link.ready_output}] (on while corrections are made)",
    ]


def _until_ok(message: str) -> tuple[str, ...]:
    return (
        f"WHILE {w.RSI_RESULT}<>RSIOK",
        f"{w.HALT} ; {message}: cancel the program",
        w.BLOCKS["WHILE"],
    )
