"""Fine cells that say at a glance whether a point lies on the road."""

from __future__ import annotations

from math import ceil, sqrt
from typing import Final, NamedTuple, cast

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.cells import RoadRaster, covered
from dubins_traffic.roads.surface import Surface

CELLS_PER_SEGMENT: Final = 256.0
SAGITTA: Final = 0.1
"""How far the bars that stand for an arc may leave it, in half widths of the road."""


class _Cell(NamedTuple):
    """What stands in a cell of `RoadRaster.pave` in place of the number of a segment."""

    OFF: int = -1
    """No point of it is on the road."""
    ON: int = -2
    """All are."""
    MIXED: int = -3
    """The roads of several segments meet it."""


CELL: Final = _Cell()


def road_raster(surface: Surface, half_width: float) -> RoadRaster:
    """Return the raster of roads `half_width` metres to either side of the segments (kept for next time)."""
    kept = surface.rasters.get(half_width)
    if kept is None:
        kept = surface.rasters[half_width] = _drawn(surface, half_width)
    return kept


def _drawn(surface: Surface, half_width: float) -> RoadRaster:
    cells = surface.cells
    width, height = cells.nx / cells.scale, cells.ny / cells.scale
    finest = sqrt(width * height / (CELLS_PER_SEGMENT * len(surface.lengths)))
    side = max(0.35 * half_width, finest)
    nx, ny = ceil(width / side), ceil(height / side)
    slack = 1e-9 * (side + half_width + abs(cells.x0) + abs(cells.y0) + width + height)
    origin = np.array([cells.x0, cells.y0])
    owner, start, end = surface.bars(slack + SAGITTA * half_width)
    spread = 0.0 if surface.chains is None else SAGITTA * half_width
    item, cx, cy = covered(start - origin, end - origin, half_width + slack + spread, side)
    keep = (cx >= 0) & (cx < nx) & (cy >= 0) & (cy < ny)
    item, cx, cy = owner[item[keep]], cx[keep], cy[keep]
    if surface.chains is not None:
        number = np.unique((item * ny + cy) * nx + cx)
        item, cy, cx = number // (ny * nx), number // nx % ny, number % nx
    x = cast(Floats, cells.x0 + (cx + 0.5) * side)
    y = cast(Floats, cells.y0 + (cy + 0.5) * side)
    distance: Floats = np.sqrt(surface.distance2(x, y, item))
    reach = sqrt(0.5) * side + slack
    keep = distance <= half_width + reach
    number, item, x, y = (cy * nx + cx)[keep], item[keep], x[keep], y[keep]
    paved = np.full(nx * ny, CELL.OFF, dtype=np.int64)
    paved[number] = item
    paved[np.bincount(number, minlength=nx * ny) > 1] = CELL.MIXED
    whole = np.ones(len(number), dtype=np.bool_)
    inner = max(0.0, half_width - slack)
    for dx in (-0.5, 0.5):
        for dy in (-0.5, 0.5):
            whole &= surface.distance2(x + dx * side, y + dy * side, item) < inner * inner
    paved[number[whole]] = CELL.ON
    return RoadRaster(1.0 / side, nx, ny, paved)
