"""Random road networks for tests, made by hand: parts of grids, turned and moved."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from dubins_traffic.roads.network import RoadNetwork


@st.composite
def networks(draw: st.DrawFn, length: float = 3.0, most: int = 6) -> RoadNetwork:
    """Draw a connected part of a grid: a random tree on some of its points and some of the other segments."""
    rows, columns = draw(st.integers(1, most)), draw(st.integers(2, most))
    grid = list(RoadNetwork.grid(rows, columns).segments)
    order = draw(st.permutations(grid))
    extra = draw(st.floats(0.0, 1.0))
    group: dict[Any, Any] = {}

    def root(point: Any) -> Any:
        while group.get(point, point) != point:
            point = group[point]
        return point

    kept = []
    for k, (x0, y0, x1, y1) in enumerate(order):
        a, b = root((x0, y0)), root((x1, y1))
        if a != b:
            group[a] = b
            kept.append((x0, y0, x1, y1))
        elif k < extra * len(order):
            kept.append((x0, y0, x1, y1))
    transform = tuple(draw(st.floats(-b, b)) for b in (100.0, 100.0, 10.0))
    return RoadNetwork(tuple(kept), length, transform, (rows, columns))
