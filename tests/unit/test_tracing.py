"""How near points are to a polyline, and to a curve of parts that are exchanged: as if all were measured."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.fitting import traced
from dubins_traffic.maps.polylines import dense, nearest


@given(st.integers(0, 1000), st.integers(1, 300), st.integers(2, 300))
@settings(max_examples=60, deadline=None)
def test_the_nearest_side_is_that_of_all(seed: int, count: int, sides: int) -> None:
    dice = np.random.default_rng(seed)
    points, line = (np.cumsum(dice.normal(size=(n, 2)), axis=0) for n in (count, sides))
    away, side = nearest(points, line)
    pairs = np.array([[_away(p, line[k], line[k + 1]) for k in range(sides - 1)] for p in points])
    assert np.allclose(away, pairs.min(axis=1), rtol=1e-12, atol=1e-12)
    assert np.allclose(pairs[np.arange(count), side], away, rtol=1e-12, atol=1e-12)


def _away(point: Floats, a: Floats, b: Floats) -> float:
    share = min(1.0, max(0.0, float((point - a) @ (b - a) / ((b - a) @ (b - a)))))
    return float(np.hypot(*(point - a - share * (b - a))))


@given(st.integers(0, 1000), st.integers(3, 12), st.data())
@settings(max_examples=60, deadline=None)
def test_a_trace_of_exchanged_parts_is_that_of_the_new_curve_beside_them(
    seed: int, count: int, data: st.DataObject
) -> None:
    dice = np.random.default_rng(seed)
    parts = [np.stack([k + np.linspace(0.0, 0.8, 3), 0.1 * dice.normal(size=3)], axis=-1) for k in range(count)]
    begin = data.draw(st.integers(1, count - 1))
    end = data.draw(st.integers(begin, min(count - 1, begin + 3)))
    new = [np.array([[0.5 * (begin + end), 0.3]])] if end > begin else []
    points = dense(np.concatenate(parts), 0.1)
    found = traced(points, parts).exchanged(begin, end, new)
    whole = traced(points, [*parts[:begin], *new, *parts[end:]])
    assert (found.away >= whole.away - 1e-12).all()
    same = found.owner == whole.owner
    assert np.allclose(found.away[same], whole.away[same])
    assert same.mean() > 0.8
