"""The figure of ``gcode2krl identify stiffness``: angles, residuals, intervals over the cell's stiffness."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcode2krl.cell import Cell
from gcode2krl.identify.stiffness import AXES, KEYS, StiffnessIdentification, in_cell
from gcode2krl.report.drawing import BLUE, GREEN, GREY, SKY, VERMILION

_PER_MILLION = 1e6


def figure(result: StiffnessIdentification, cell: Cell) -> Figure:
    """Return measured against model angles, the residuals, and the intervals over the cell's stiffness."""
    drawing = Figure(figsize=(10.0, 7.6), layout="constrained")
    places = drawing.subplot_mosaic([["angles", "residuals"], ["intervals", "intervals"]])
    _draw_angles(places["angles"], result)
    _draw_residuals(places["residuals"], result)
    _draw_intervals(places["intervals"], result, cell)
    drawing.suptitle(
        f"stiffness of {', '.join(fit.joint for fit in result.joints)}, {result.level:.0%} intervals"
    )
    return drawing


def _draw_angles(axes: Axes, result: StiffnessIdentification) -> None:
    reach = 0.0
    for axis, colour in enumerate((BLUE, VERMILION, GREEN)):
        for number, fit in enumerate(result.joints):
            model, angle = (values[:, axis] * _PER_MILLION for values in (fit.model_rad, fit.angle_rad))
            label = f"about {AXES[axis]}" if number == 0 else None
            axes.plot(model, angle, ".", color=colour, markersize=3.0, label=label)
            reach = max(reach, float(abs(model).max(initial=0.0)))
    axes.plot([-reach, reach], [-reach, reach], "-", color=GREY, linewidth=0.8, label="equal")
    axes.set(
        xlabel="angle of the fit in µrad",
        ylabel="measured angle in µrad",
        title="angles of the virtual joints",
    )
    axes.legend(loc="upper left")


def _draw_residuals(axes: Axes, result: StiffnessIdentification) -> None:
    start = 0
    reach = max([4.8, *(1.2 * float(abs(fit.residual).max(initial=0.0)) for fit in result.joints)])
    for number, fit in enumerate(result.joints):
        count = fit.residual.size
        position = range(start, start + count)
        axes.plot(position, fit.residual.ravel(), ".", color=(BLUE, SKY)[number % 2], markersize=2.0)
        axes.text(
            start + 0.5 * count, 0.96 * reach, fit.joint, ha="center", va="top", fontsize=7.0, rotation=90.0
        )
        start += count
    for sigma in (-2.0, 2.0):
        axes.axhline(sigma, color=GREY, linestyle="--", linewidth=0.8)
    axes.set(
        xlabel="coordinate of a reading", ylabel="residual in sigma", title="residuals; dashed: ± 2 sigma"
    )
    axes.set_ylim(-reach, reach)


def _draw_intervals(axes: Axes, result: StiffnessIdentification, cell: Cell) -> None:
    labels: list[str] = []
    for fit in result.joints:
        for key, estimate in zip(KEYS, fit.k_Nmm_rad, strict=True):
            place, in_file = len(labels), in_cell(cell, fit.joint, key)
            labels.append(f"{fit.joint} {key}")
            if estimate is None:
                axes.text(place, 1.0, "?", ha="center", va="center", color=VERMILION)
                continue
            unit = in_file or estimate.value
            middle = estimate.value / unit
            reach = [[middle - estimate.low / unit], [estimate.high / unit - middle]]
            axes.errorbar([place], [middle], yerr=reach, fmt=".", color=BLUE, capsize=2.0)
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    axes.set_xticks(range(len(labels)), labels, rotation=90.0)
    axes.set(
        ylabel="identified / cell", title="intervals over the stiffness in the cell; ? is not determined"
    )
