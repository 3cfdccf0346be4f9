"""The part on the page against two others: what `--part` leaves, and the twin's deviation map.

``python benchmarks/part_map.py`` cuts the paper's test piece and two examples. Printed are the volume that
the page shows and by how much it differs from that which material removal leaves, of what stands and of
what is cut; then, for the test piece, the error on walls and floors beside that of the twin without
compensation: root mean squares, how far they differ, and how many of the twin's places on walls are on a
wall of the page.
"""

from pathlib import Path

import numpy as np

from gcode2krl import predict
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.cutting import history_of, remove
from gcode2krl.online.judge import judged
from gcode2krl.online.surface import Surface, surface_of
from gcode2krl.online.twin import World, simulate, twin_of
from gcode2krl.prediction import Prediction
from gcode2krl.tables import PartHistory

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
STOCK_MM = [[0.0, -100.0, -30.0], [300.0, 100.0, 0.0]]
_UPRIGHT, _LEVEL = 0.1, 0.9
"""z of a normal below which a cell is on a wall, and above which it is on a floor."""


def main() -> None:
    piece = resolve_cell({"based_on": "demonstration", "stock": {"box_mm": STOCK_MM}})
    plain = resolve_cell({"based_on": "demonstration"})
    for name, cell in (("test_piece", piece), ("contour_arcs", plain), ("raster_finish", plain)):
        prediction, history = part_of(name, cell, cell.controller.cycle_s)
        say_volume(name, prediction, history)
    prediction, history = part_of("test_piece", piece, piece.online.cycle_s)
    say_map(prediction, history)


def part_of(name: str, cell: Cell, dt_s: float) -> tuple[Prediction, PartHistory]:
    prediction = predict(EXAMPLES / f"{name}.nc", cell, dt_s=dt_s)
    assert prediction.motion is not None
    return prediction, history_of(prediction.toolpath, prediction.motion, cell)


def say_volume(name: str, prediction: Prediction, history: PartHistory) -> None:
    assert prediction.motion is not None
    removal = remove(prediction.toolpath, prediction.motion, prediction.cell, is_checked=False)
    raw, left = history.volume_mm3(-1), removal.left.volume_mm3
    shown = history.volume_mm3()
    stands, cut = 100.0 * (shown / left - 1.0), 100.0 * ((raw - shown) / (raw - left) - 1.0)
    print(
        f"{name}: {shown / 1000.0:.2f} cm3 stand ({stands:+.3f} %), "
        f"{(raw - shown) / 1000.0:.2f} cm3 cut ({cut:+.3f} %)"
    )


def say_map(prediction: Prediction, history: PartHistory) -> None:
    settings = prediction.cell.online
    places = judged(prediction, settings.cycle_s)
    run = simulate(twin_of(prediction, settings, World()), "uncompensated")
    surface = surface_of(prediction, run, places)
    assert prediction.deflection is not None
    error_mm = history.error_mm(prediction.deflection.deflection_base_mm)
    is_wall = np.abs(history.normal[:, :, 2]) < _UPRIGHT
    of_page, of_twin = walls(history, error_mm, is_wall, surface)
    found = np.isfinite(of_page)
    say("walls", of_page[found], of_twin[found])
    print(f"  {found.mean():.1%} of the twin's {len(found)} places on walls are on one of the page")
    floor = floors(history, np.where(history.normal[:, :, 2] > _LEVEL, error_mm, np.nan), surface)
    both = np.isfinite(floor) & np.isfinite(surface.floor_mm)
    say("floors", floor[both], surface.floor_mm[both])


def walls(history: PartHistory, error_mm: Floats, is_wall: Bools, surface: Surface) -> tuple[Floats, Floats]:
    """Return the page's error at each of the twin's places on walls, and the twin's.

    A place lies on the border of cells, of which any may have the wall: the nearest counts, NaN without one.
    """
    column, row = cells(history, surface.wall_mm[:, :2])
    best = np.full(len(row), np.nan)
    for i, j in sorted(np.ndindex(3, 3), key=lambda step: np.hypot(step[0] - 1, step[1] - 1)):
        r, c = (
            np.clip(row + i - 1, 0, error_mm.shape[0] - 1),
            np.clip(column + j - 1, 0, error_mm.shape[1] - 1),
        )
        best = np.where(np.isfinite(best) | ~is_wall[r, c], best, error_mm[r, c])
    return best, surface.wall_off_mm


def floors(history: PartHistory, error_mm: Floats, surface: Surface) -> Floats:
    """Return the page's error at the middles of the twin's cells (ny, nx)."""
    x, y = np.meshgrid(*((edges[1:] + edges[:-1]) / 2.0 for edges in (surface.x_mm, surface.y_mm)))
    column, row = cells(history, np.stack([x.ravel(), y.ravel()], axis=1))
    inside = (row >= 0) & (column >= 0) & (row < error_mm.shape[0]) & (column < error_mm.shape[1])
    floor = np.full(x.size, np.nan)
    floor[inside] = error_mm[row[inside], column[inside]]
    return floor.reshape(x.shape)


def cells(history: PartHistory, place_mm: Floats) -> tuple[Ints, Ints]:
    """Return the columns and rows of the cells in which places (n, 2) lie."""
    column, row = np.floor((place_mm - history.origin_mm) / history.cell_mm).astype(np.int64).T
    return column, row


def say(what: str, page: Floats, twin: Floats) -> None:
    rms = [float(np.sqrt(np.mean(values**2))) for values in (page, twin, page - twin)]
    print(
        f"{what}: RMS {rms[0]:.3f} mm on the page, {rms[1]:.3f} mm in the twin "
        f"({100.0 * (rms[0] / rms[1] - 1.0):+.1f} %), of the difference {rms[2]:.3f} mm, "
        f"correlation {np.corrcoef(page, twin)[0, 1]:.3f}, {len(page)} places"
    )


if __name__ == "__main__":
    main()
