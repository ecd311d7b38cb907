"""Uniform cells: every cell that a segment passes through is named, however steep the segment is."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from dubins_traffic.roads.surface import covered

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
