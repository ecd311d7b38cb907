"""The way from one lane to the next: curves and corners that stay on the road.

Everything here is plain Python, done once per route; `policies.lanes.tracking` follows what comes out. Turns are
built in the frame of the lane that comes in: its direction is +x, the intersection lies in the origin, the right lane
is the line y = -w.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

from dubins_traffic.cars.body import Car

PIECE_ANGLE = 0.45
"""Longest arc in one piece, radians: the arcs' series hold up to 1/2."""
MARGIN = 0.2
"""What the centre keeps from the edge of the road, in units of w."""
LANE_KEEPING = 0.8
"""In a bend with two arms a left turn stays at least this far right of the centre lines, in units of w."""
PIVOT_COST = 0.5
"""A turn in place counts as that many metres (at 0.7 m/s and pi rad/s it takes as long)."""
SHUFFLE_COST = 8.0
"""The same for a car with a turning radius, which has to shuttle."""
STRAIGHT = 1e-6
"""A turn by less, radians, has no arc.

Between the lanes lies a millionth of w then. The limits of an arc's radius divide by 1 - cos(angle / 2), which is 0 or
rounding alone below 3e-8, and has three digits here.
"""
VISIT = 0.95
"""How near a path has to come to an intersection that it visits, in units of the radius of its disc."""
IMPOSSIBLE = 1e4
"""A turn that the car can't make within the road counts as that many metres."""


class Piece(NamedTuple):
    """Part of a path: a line or an arc of constant curvature, or the line to a corner where the car turns in place.

    Start (x, y), unit heading (c, s), `length` in metres, `bend` in 1/m (left positive). With `pivot` the end has to
    be reached before the next piece is begun.
    """

    x: float
    y: float
    c: float
    s: float
    length: float
    bend: float = 0.0
    pivot: bool = False


@dataclass(frozen=True, slots=True)
class Turn:
    """How to pass from one lane to the next.

    The lane that comes in is left `before` metres ahead of its end, the next one reached `after` metres past its
    start (either may be negative: beyond the intersection). `pieces` are in the frame described above; A route is as
    long as its lanes and the `cost` of its turns together: what the pieces add, less what is left out of the lanes,
    and the price of turning in place.
    """

    before: float
    after: float
    pieces: tuple[Piece, ...]
    cost: float


@dataclass(frozen=True, slots=True)
class Site:
    """What decides a turn: `angle` (left positive, radians), the lengths of both lanes, degree, radius R, car.

    `visit` asks that the path enters the disc of radius R.
    """

    angle: float
    length_in: float
    length_out: float
    degree: int
    radius: float
    car: Car
    visit: bool


@lru_cache(maxsize=4096)
def shape(site: Site) -> Turn:
    """Return the shortest turn the car can make on the road; if there is none, one with the cost IMPOSSIBLE."""
    candidates = [*_curves(site), *_corners(site)]
    if candidates:
        return min(candidates, key=lambda turn: turn.cost)
    radius = max(site.car.bounds.turning_radius, site.car.w)
    turn = _u_curve(site, radius) if abs(site.angle) > pi - 0.05 else _fillet(site, radius)
    return Turn(turn.before, turn.after, turn.pieces, turn.cost + IMPOSSIBLE)


def can_pivot(car: Car) -> bool:
    """Tell whether the car can turn within its own length: without turning radius, or shuttling to and fro."""
    return car.bounds.turning_radius == 0.0 or car.bounds.speed_low <= -0.05


def _turn(before: float, after: float, pieces: tuple[Piece, ...], price: float = 0.0) -> Turn:
    return Turn(before, after, pieces, sum(piece.length for piece in pieces) - before - after + price)


def _room(site: Site) -> float:
    return 0.5 * min(site.length_in, site.length_out)


def _curves(site: Site) -> list[Turn]:
    w = site.car.w
    least = max(1.02 * site.car.bounds.turning_radius, 0.05 * w)
    curves: list[Turn] = []
    if abs(site.angle) > pi - 0.05:
        if least <= (2.0 - MARGIN) * w:
            curves.append(_u_curve(site, max(least, w)))
    elif abs(site.angle) < STRAIGHT:
        curves.append(Turn(0.0, 0.0, (), 0.0))
    else:
        low, high = _radii(site)
        low = max(low, least)
        if site.angle > 0.0 and low > high:
            high = min((3.0 - MARGIN) * w / (1.0 - cos(0.5 * site.angle)), _reach_limit(site, _room(site)))
        brisk = 1.05 * site.car.bounds.speed / site.car.bounds.yaw_rate
        disc = _reach_limit(site, min(site.radius, _room(site)))
        if low <= high:
            curves.append(_fillet(site, max(low, min(high, max(disc, brisk)))))
    return [turn for turn in curves if _fits(site, turn)]


def _reach_limit(site: Site, distance: float) -> float:
    """Return the radius of the fillet that begins `distance` before the intersection."""
    half = abs(_slope(site.angle))
    return distance / half + (site.car.w if site.angle > 0.0 else -site.car.w)


def _slope(angle: float) -> float:
    return sin(angle) / (1.0 + cos(angle))


def _radii(site: Site) -> tuple[float, float]:
    """Return the least and largest radius of a fillet that stays on the road and begins halfway at most."""
    w = site.car.w
    edge = (2.0 - MARGIN) * w
    closing = cos(0.5 * site.angle)
    room = _reach_limit(site, _room(site))
    if site.angle < 0.0:
        return 0.0, min((edge - w) / (1.0 - closing), room)
    apart = LANE_KEEPING * w if site.degree == 2 else 0.0
    least = (w / closing - edge) / (1.0 / closing - 1.0)
    return least, min((w - apart * closing) / (1.0 - closing), room)


def _fillet(site: Site, radius: float) -> Turn:
    half = _slope(site.angle)
    start = site.car.w * half - radius * abs(half)
    bend = (1.0 if site.angle > 0.0 else -1.0) / radius
    pieces = _arc(start, -site.car.w, 1.0, 0.0, bend, abs(site.angle))
    return _turn(-start, -start, pieces)


def _u_curve(site: Site, radius: float) -> Turn:
    """Turn round: a half circle between the lanes, or for a larger radius a bulb that first swings right."""
    w = site.car.w
    centre = -min(0.5 * site.radius, _room(site))
    if radius <= w:
        return _turn(-centre, -centre, _arc(centre, -w, 1.0, 0.0, 1.0 / w, pi))
    swing = sqrt(4.0 * radius * radius - (w + radius) * (w + radius))
    turn = acos((w + radius) / (2.0 * radius))
    start = centre - swing
    pieces = _arc(start, -w, 1.0, 0.0, -1.0 / radius, turn)
    pieces += _arc(*_end(pieces[-1]), 1.0 / radius, pi + 2.0 * turn)
    pieces += _arc(*_end(pieces[-1]), -1.0 / radius, turn)
    return _turn(-start, -start, pieces)


def _corners(site: Site) -> list[Turn]:
    """Turns made of straight lines with turns in place between them."""
    w = site.car.w
    straight = abs(site.angle) < STRAIGHT and not (site.visit and w > VISIT * site.radius)
    if straight or not can_pivot(site.car):
        return []
    cost = PIVOT_COST if site.car.bounds.turning_radius == 0.0 else SHUFFLE_COST
    half = _slope(site.angle) if abs(site.angle) < pi - 0.05 else inf
    turns: list[Turn] = []
    if abs(w * half) <= _room(site):
        turns.append(_turn(-w * half, -w * half, (), cost))
    near = min(0.6 * site.radius, _room(site))
    far = min(_room(site), max(site.radius, 2.0 * w))
    turns.append(_polyline(site, near, (), 2.0 * cost))
    turns.append(_polyline(site, far, ((0.0, 0.0),), 3.0 * cost))
    return [turn for turn in turns if _fits(site, turn)]


def _polyline(site: Site, distance: float, via: tuple[tuple[float, float], ...], cost: float) -> Turn:
    w = site.car.w
    c, s = cos(site.angle), sin(site.angle)
    end = (distance * c + w * s, distance * s - w * c)
    points = ((-distance, -w), *via, end)
    pieces: list[Piece] = []
    for (x0, y0), (x1, y1) in pairwise(points):
        length = hypot(x1 - x0, y1 - y0)
        if length > 1e-6:
            pieces.append(Piece(x0, y0, (x1 - x0) / length, (y1 - y0) / length, length, 0.0, True))
    return _turn(distance, distance, tuple(pieces), cost)


def _fits(site: Site, turn: Turn) -> bool:
    """Tell whether the turn stays on both roads, and enters the disc if it must."""
    w = site.car.w
    c, s = cos(site.angle), sin(site.angle)
    edge = (2.0 - 0.5 * MARGIN) * w
    nearest = inf
    points = [(-turn.before, -w), (turn.after * c + w * s, turn.after * s - w * c)]
    for piece in turn.pieces:
        points += [along(piece, k * piece.length / 4.0) for k in range(5)]
    for x, y in points:
        a, b = max(x, 0.0), max(-(x * c + y * s), 0.0)
        off_in = hypot(a, y)
        off_out = hypot(b, y * c - x * s)
        if min(off_in, off_out) > edge:
            return False
        nearest = min(nearest, hypot(x, y))
    room = max(turn.before, turn.after) <= _room(site) + 1e-9
    return room and (not site.visit or nearest <= VISIT * site.radius)


def _arc(x: float, y: float, c: float, s: float, bend: float, angle: float) -> tuple[Piece, ...]:
    count = max(1, int(angle / PIECE_ANGLE) + 1)
    length = angle / abs(bend) / count
    pieces: list[Piece] = []
    for _ in range(count):
        pieces.append(Piece(x, y, c, s, length, bend))
        x, y, c, s = _end(pieces[-1])
    return tuple(pieces)


def _end(piece: Piece) -> tuple[float, float, float, float]:
    return advanced(piece, piece.length)


def advanced(piece: Piece, distance: float) -> tuple[float, float, float, float]:
    """Return the point `distance` metres along a piece, and the unit heading there."""
    x, y = along(piece, distance)
    turn = piece.bend * distance
    c, s = cos(turn), sin(turn)
    return x, y, piece.c * c - piece.s * s, piece.s * c + piece.c * s


def along(piece: Piece, distance: float) -> tuple[float, float]:
    """Return the point `distance` metres along a piece."""
    turn = piece.bend * distance
    if abs(turn) < 1e-12:
        forward, left = distance, 0.0
    else:
        forward, left = sin(turn) / piece.bend, (1.0 - cos(turn)) / piece.bend
    return piece.x + forward * piece.c - left * piece.s, piece.y + forward * piece.s + left * piece.c


def angle_between(tx: float, ty: float, ux: float, uy: float) -> float:
    """Return the angle from direction t to direction u, left positive, in (-pi, pi]."""
    return atan2(tx * uy - ty * ux, tx * ux + ty * uy)
