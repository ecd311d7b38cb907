"""Where a point lies on a network, compiled: the same answers, bit for bit, as `RoadNetwork` gives.

Every function takes the table `t` of `roads.table.pack` and the number `net` of a network in it; segments,
intersections and lanes are numbered within the network. Lane 2s runs along segment s, lane 2s + 1 back.
"""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.table import RoadTable


@jit
def distance2(t: RoadTable, net: int, s: int, x: float, y: float) -> float:
    """Return the squared distance from a point to segment s."""
    k = t.seg_off[net] + s
    rx = x - t.seg[k, 0]
    ry = y - t.seg[k, 1]
    tx = t.seg[k, 2]
    ty = t.seg[k, 3]
    along = rx * tx + ry * ty
    if along <= 0.0:
        return rx * rx + ry * ry
    if along >= t.seg[k, 4]:
        qx = x - t.seg[k, 5]
        qy = y - t.seg[k, 6]
        return qx * qx + qy * qy
    across = tx * ry - ty * rx
    return across * across


@jit
def cell_of(t: RoadTable, net: int, x: float, y: float) -> int:
    """Return the number of the cell that holds a point, -1 outside the box of cells."""
    u = (x - t.cell_box[net, 0]) * t.cell_box[net, 2]
    v = (y - t.cell_box[net, 1]) * t.cell_box[net, 2]
    nx = t.cell_dim[net, 0]
    if u >= 0.0 and v >= 0.0 and u < nx and v < t.cell_dim[net, 1]:
        return t.cell_dim[net, 2] + int(v) * nx + int(u)
    return -1


@jit
def nearest_segment(t: RoadTable, net: int, x: float, y: float) -> tuple[int, float]:
    """Return the nearest segment and the squared distance to it; the lower number of equally near ones."""
    cell = cell_of(t, net, x, y)
    if cell < 0:
        best = 0
        least = distance2(t, net, 0, x, y)
        for s in range(1, t.seg_off[net + 1] - t.seg_off[net]):
            d2 = distance2(t, net, s, x, y)
            if d2 < least:
                best = s
                least = d2
        return best, least
    first = t.seg_start[cell]
    best = t.seg_item[first]
    least = distance2(t, net, best, x, y)
    for k in range(first + 1, t.seg_start[cell + 1]):
        s = t.seg_item[k]
        d2 = distance2(t, net, s, x, y)
        if d2 < least:
            best = s
            least = d2
    return best, least


@jit
def on_road(t: RoadTable, net: int, x: float, y: float) -> bool:
    """Whether a point lies within the roads' half width of a segment (its ends capped by discs)."""
    limit = t.half_width[net] * t.half_width[net]
    cell = cell_of(t, net, x, y)
    if cell < 0:
        for s in range(t.seg_off[net + 1] - t.seg_off[net]):
            if distance2(t, net, s, x, y) <= limit:
                return True
        return False
    for k in range(t.seg_start[cell], t.seg_start[cell + 1]):
        if distance2(t, net, t.seg_item[k], x, y) <= limit:
            return True
    return False


@jit
def vertex_distance2(t: RoadTable, net: int, v: int, x: float, y: float) -> float:
    """Return the squared distance from a point to intersection v."""
    k = t.vert_off[net] + v
    rx = x - t.vert[k, 0]
    ry = y - t.vert[k, 1]
    return rx * rx + ry * ry


@jit
def nearest_vertex(t: RoadTable, net: int, x: float, y: float) -> tuple[int, float]:
    """Return the nearest intersection and the squared distance to it; the lower number of equally near ones."""
    cell = cell_of(t, net, x, y)
    if cell < 0:
        best = 0
        least = vertex_distance2(t, net, 0, x, y)
        for v in range(1, t.vert_off[net + 1] - t.vert_off[net]):
            d2 = vertex_distance2(t, net, v, x, y)
            if d2 < least:
                best = v
                least = d2
        return best, least
    first = t.vert_start[cell]
    best = t.vert_item[first]
    least = vertex_distance2(t, net, best, x, y)
    for k in range(first + 1, t.vert_start[cell + 1]):
        v = t.vert_item[k]
        d2 = vertex_distance2(t, net, v, x, y)
        if d2 < least:
            best = v
            least = d2
    return best, least


@jit
def lane_coordinates(t: RoadTable, net: int, lane: int, x: float, y: float) -> tuple[float, float]:
    """Return (s, l) of a point: metres along a lane from its start, metres left of the segment's centre line."""
    k = t.seg_off[net] + (lane >> 1)
    rx = x - t.seg[k, 0]
    ry = y - t.seg[k, 1]
    along = rx * t.seg[k, 2] + ry * t.seg[k, 3]
    left = t.seg[k, 2] * ry - t.seg[k, 3] * rx
    if lane & 1:
        return t.seg[k, 4] - along, -left
    return along, left


@jit
def lane_direction(t: RoadTable, net: int, lane: int) -> tuple[float, float]:
    """Return the unit vector along a lane."""
    k = t.seg_off[net] + (lane >> 1)
    if lane & 1:
        return -t.seg[k, 2], -t.seg[k, 3]
    return t.seg[k, 2], t.seg[k, 3]


@jit
def lane_start(t: RoadTable, net: int, lane: int) -> int:
    """Return the intersection in which a lane begins."""
    return t.ends[t.seg_off[net] + (lane >> 1), lane & 1]


@jit
def lane_end(t: RoadTable, net: int, lane: int) -> int:
    """Return the intersection in which a lane ends."""
    return t.ends[t.seg_off[net] + (lane >> 1), 1 - (lane & 1)]
