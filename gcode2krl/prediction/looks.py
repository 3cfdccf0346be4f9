"""A prediction on one line, and as a notebook shows it."""

import re
from dataclasses import dataclass
from typing import Any

from gcode2krl.errors import Issue
from gcode2krl.exchange.findings import counted, findings_block
from gcode2krl.exchange.html import beside, block, path_picture, text_table
from gcode2krl.prediction.forecast import LoadFigures, load_figures
from gcode2krl.tables import Deflection, Forces, Motion, Toolpath
from gcode2krl.units import MM_PER_M, NMM_PER_NM

_MOST_LETTERS = 60
"""Of a program's name on one line."""
_SERIOUS = ("error", "warning")


@dataclass(frozen=True)
class Figures:
    """The figures of a prediction; None where a stage did not run."""

    name: str
    moves: int
    time_s: float | None
    path_mm: float | None
    loads: LoadFigures | None
    issues: tuple[Issue, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by the names of a record."""
        return {
            "moves": self.moves,
            "time_s": self.time_s,
            "path_mm": self.path_mm,
            "max_force_N": self.loads.force_N if self.loads is not None else None,
            "max_deflection_mm": self.loads.deflection_mm if self.loads is not None else None,
        }

    @classmethod
    def of(
        cls,
        toolpath: Toolpath,
        motion: Motion | None,
        forces: Forces | None,
        deflection: Deflection | None,
        issues: tuple[Issue, ...],
    ) -> "Figures":
        """Return the figures of tables."""
        timed = motion if motion is not None and len(motion) else None
        return cls(
            name=re.split(r"[\\/]", toolpath.source)[-1][-_MOST_LETTERS:] or "program",
            moves=max(len(toolpath) - 1, 0),
            time_s=None if timed is None else float(timed.time_s[-1]),
            path_mm=None if timed is None else float(timed.path_mm[-1]),
            loads=None if forces is None else load_figures(forces, deflection),
            issues=issues,
        )


def figures_words(figures: Figures) -> str:
    """Return ``part.nc: 436 moves, 78.3 s, 895 N, 2.47 mm, 2 warnings``."""
    words = [f"{figures.moves} moves"]
    if figures.time_s is not None:
        words.append(f"{figures.time_s:.1f} s")
    if figures.loads is not None:
        words.append(f"{figures.loads.force_N:.0f} N")
        if figures.loads.deflection_mm is not None:
            words.append(f"{figures.loads.deflection_mm:.3g} mm")
    serious = counted(figures.issues, _SERIOUS) or counted(figures.issues)
    return f"{figures.name}: {', '.join([*words, *([serious] if serious else [])])}"


def figures_html(title: str, figures: Figures, toolpath: Toolpath, cell_name: str) -> str:
    """Return figures, findings and the path from above as HTML."""
    rows: list[tuple[str, str]] = [("program", figures.name), ("cell", cell_name or "without a name")]
    rows.append(("moves", str(figures.moves)))
    if figures.time_s is not None and figures.path_mm is not None:
        rows.append(("time", f"{figures.time_s:.1f} s of motion"))
        rows.append(("path", f"{figures.path_mm / MM_PER_M:.3f} m"))
    rows += _loads(figures.loads)
    shown = toolpath.is_position()
    picture = path_picture(toolpath.position_mm[shown], ~toolpath.rapid[shown])
    return block(title, beside(text_table((), rows), picture), findings_block(figures.issues))


def _loads(loads: LoadFigures | None) -> list[tuple[str, str]]:
    if loads is None:
        return [("force", "not known")]
    rows = [
        ("force", f"up to {loads.force_N:.0f} N +- {loads.force_band:.0%} (90 %)"),
        ("torque", f"up to {loads.torque_Nmm / NMM_PER_NM:.2f} Nm"),
        ("cut", f"{loads.in_cut:.0%} of the time, a_p up to {loads.a_p_mm:.2f} mm"),
    ]
    if loads.deflection_mm is None:
        return [*rows, ("deflection", "not known")]
    return [
        *rows,
        ("deflection", f"up to {loads.deflection_mm:.3g} mm +- {loads.deflection_band:.0%} (90 %)"),
    ]
