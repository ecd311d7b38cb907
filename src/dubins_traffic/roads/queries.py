"""Where points lie on a network: `roads.lookup` asked for many at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.lookup import lane_coordinates, nearest_segment, nearest_vertex
from dubins_traffic.roads.table import RoadTable


def nearest(t: RoadTable, points: npt.ArrayLike, *, vertices: bool = False) -> tuple[Ints, Floats]:
    """Return number of and squared distance to the nearest segment, or vertex, of points (..., 2); ties: the lower."""
    points = np.asarray(points, dtype=np.float64)
    flat = np.ascontiguousarray(points.reshape(-1, 2))
    number, square = np.empty(len(flat), dtype=np.int64), np.empty(len(flat))
    put_nearest(t, vertices, flat, number, square)
    return number.reshape(points.shape[:-1]), square.reshape(points.shape[:-1])


def coordinates(t: RoadTable, lane: int, points: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return (s, l) of points (..., 2) on a lane: metres along it, and left of the segment's centre line."""
    points = np.asarray(points, dtype=np.float64)
    flat = np.array(points.reshape(-1, 2), order="C")
    put_coordinates(t, lane, flat)
    return flat[:, 0].reshape(points.shape[:-1]), flat[:, 1].reshape(points.shape[:-1])


@jit
def put_nearest(t: RoadTable, vertices: bool, points: Floats, number: Ints, square: Floats) -> None:
    """Find what is nearest to points in the first network.

    Parameters
    ----------
    t : RoadTable
        The roads.
    vertices : bool
        Whether intersections are sought, else segments.
    points : (N, 2) float64
        Points, m.
    number : (N,) int64
        Set to the numbers of what is nearest.
    square : (N,) float64
        Set to the squared distances, m^2.
    """
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        number[k], square[k] = nearest_vertex(t, 0, x, y) if vertices else nearest_segment(t, 0, x, y)


@jit
def put_coordinates(t: RoadTable, lane: int, points: Floats) -> None:
    """Put lane coordinates in the place of points.

    Parameters
    ----------
    t : RoadTable
        The roads.
    lane : int
        A lane of the first network.
    points : (N, 2) float64
        Points, m; set to metres along the lane, and left of the centre line.
    """
    for k in range(points.shape[0]):
        points[k, 0], points[k, 1] = lane_coordinates(t, 0, lane, points[k, 0], points[k, 1])
