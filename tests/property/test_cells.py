"""Uniform cells: every cell that a segment passes through is named, however steep the segment is.

And whoever looks a point up gets the answer that he would get without cells.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dubins_traffic.kernels.records import join
from dubins_traffic.roads.cover import covered
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.lookup import CELL, nearest_segment, nearest_vertex, on_road
from dubins_traffic.roads.packing import pack

coordinates = st.floats(-30, 30) | st.integers(-30, 30).map(float)
SUBNORMAL = 6.67522158e-313


@given(coordinates, coordinates, coordinates, coordinates, st.floats(0.3, 7.0), st.floats(0.0, 1.0))
@example(0.0, 0.0, SUBNORMAL, 3.0, 3.0, 0.0)
@example(3.0, 0.0, 3.0, 9.0, 3.0, 0.5)
def test_every_point_lies_in_a_cell_of_its_segment(
    x0: float, y0: float, x1: float, y1: float, size: float, pad: float
) -> None:
    item, column, row = covered(np.array([[x0, y0]]), np.array([[x1, y1]]), pad, size)
    cells = set(zip(column.tolist(), row.tolist(), strict=True))
    assert set(item.tolist()) == {0}
    for share in np.linspace(0.0, 1.0, 40).tolist():
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        for dx, dy in ((0.0, 0.0), (pad, 0.0), (-pad, 0.0), (0.0, pad), (0.0, -pad)):
            assert (int(np.floor((x + dx) / size)), int(np.floor((y + dy) / size))) in cells


def test_a_point_lies_on_each_of_several_networks_where_it_would_on_that_alone() -> None:
    networks = [generate(*size, 7, bent=0.3) for size in ((2, 1), (20, 26), (60, 80), (3, 2))]
    widths = [0.6, 0.3, 0.05, 1.0]
    together = pack(networks, widths)
    points = np.random.default_rng(1).uniform(-5.0, 40.0, (400, 2))
    for net, (network, width) in enumerate(zip(networks, widths, strict=True)):
        alone = pack([network], [width])
        for x, y in points.tolist():
            for find in (nearest_segment, nearest_vertex, on_road):
                assert find(together, net, x, y) == find(alone, 0, x, y), (find, net, x, y)
        first = together.grid[net].pave_first
        assert np.array_equal(together.pave[first : first + len(alone.pave)], alone.pave)


@pytest.mark.parametrize(("count", "roads", "bent"), [(2, 1, 0.0), (20, 26, 0.0), (20, 26, 0.6), (150, 210, 0.3)])
@pytest.mark.parametrize("half_width", [0.05, 0.6, 3.0])
def test_a_point_lies_where_it_would_without_cells(count: int, roads: int, bent: float, half_width: float) -> None:
    network = generate(count, roads, 7, rigid_motion=True, bent=bent)
    with_cells = pack([network], [half_width])
    grid = join([with_cells.grid])
    grid["nx"] = grid["pave_nx"] = 0
    without = with_cells.replace(grid=grid)
    random = np.random.default_rng(1)
    far = np.ptp(network.points, axis=0) + 4.0
    points = network.points.min(axis=0) - 2.0 + far * random.random((1500, 2))
    ends = network.points[:, None] + random.normal(0.0, half_width, (len(network.points), 5, 2))
    for x, y in np.concatenate([points, ends.reshape(-1, 2)]).tolist():
        for find in (nearest_segment, nearest_vertex, on_road):
            assert find(with_cells, 0, x, y) == find(without, 0, x, y), (find, x, y)
    if half_width == 0.6 and count > 2:
        assert {int(CELL.OFF), int(CELL.ON), int(CELL.MIXED)} < set(with_cells.pave.tolist())
