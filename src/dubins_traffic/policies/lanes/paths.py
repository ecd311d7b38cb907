"""Paths: routes along lanes as rows that compiled policies follow.

Each row is a piece: a line or a short arc, along the middle of a right lane or through an intersection. After the last
row comes row `loop`, so that a path has no end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np

from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.policies.lanes.turns import PIECE_ANGLE, Piece, Site, Turn, advanced, along, angle_between, shape
from dubins_traffic.roads.network import RoadNetwork

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


STRAIGHT_SHARE = 0.999
"""Of the straight end of a lane that bends a turn takes at most this share."""
EDGE = 0.15
"""What an evading car's centre keeps from the edge of the road, in units of w."""
WAITING_GAP = 0.3
"""Metres between a waiting car and the disc it waits for: so far that a car that leaves by the next lane to the right
and keeps a metre away from those that wait can still leave."""

Bounds = tuple[float, float]
"""How far right (negative) and left of a piece of a path a car may keep, metres."""
_BOUNDS: Final = "lanes bounds"


@record
class PathRow:
    """A piece of a path."""

    x: float
    """Its start, metres."""
    y: float
    """Its start, metres."""
    c: float
    """Its unit heading there."""
    s: float
    """Its unit heading there."""
    length: float
    """Metres."""
    bend: float
    """Curvature, 1/m."""
    low: float
    """How far left of it a car may keep at least (right: negative) and stay on the road, metres."""
    high: float
    """How far left of it a car may keep at most, metres."""
    pivot: int
    """1 if the end has to be reached before the next piece is begun, where the car turns in place."""
    waits: int
    """1 if there is a line at which to wait for an intersection."""
    stop: float
    """Metres along the piece to that line."""
    gate_x: float
    """Where that intersection is, metres."""
    gate_y: float
    """Where that intersection is, metres."""
    lane: int = -1
    """Number of the lane, -1 in a turn."""


@dataclass(frozen=True, slots=True)
class Path:
    """`rows` (rows,) and the number of the row that follows the last."""

    rows: Rows[PathRow]
    loop: int


class PathMaker:
    """Makes the paths of one problem. `visited` are intersections whose discs every turn has to enter."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._network = problem.network
        self._visited = frozenset(problem.goal_vertices)
        self._lengths: list[float] = problem.network.lengths.tolist()
        begins, ends = problem.network.tangents.tolist(), problem.network.end_tangents.tolist()
        self._begins = [way for (tx, ty), (ux, uy) in zip(begins, ends, strict=True) for way in ((tx, ty), (-ux, -uy))]
        self._ends = [(-tx, -ty) for k in range(len(self._begins)) for tx, ty in (self._begins[k ^ 1],)]
        self._bent = {
            lane: lane_pieces(problem.network, lane, problem.car.w)
            for lane in range(problem.network.lanes)
            if problem.network.bent[lane >> 1]
        }
        self._degrees: list[int] = problem.network.degrees.tolist()
        self._points: list[tuple[float, float]] = [(x, y) for x, y in problem.network.points.tolist()]
        self._turns: dict[tuple[int, int], Turn] = {}

    def turn(self, lane: int, other: int) -> Turn:
        """Return the turn from one lane to a successor."""
        turn = self._turns.get((lane, other))
        if turn is None:
            v = self._network.lane_ends(lane)[1]
            site = Site(
                round(angle_between(*self._ends[lane], *self._begins[other]), 9),
                self._straight(lane, -1),
                self._straight(other, 0),
                self._degrees[v],
                self._problem.intersection_radius,
                self._problem.car,
                v in self._visited,
            )
            turn = self._turns[lane, other] = shape(site)
        return turn

    def _straight(self, lane: int, end: int) -> float:
        """Return the length of a lane; of one that bends, twice that of its straight first or last line."""
        if lane not in self._bent:
            return self._lengths[lane >> 1]
        bent = self._bent[lane][end]
        return 2.0 * STRAIGHT_SHARE * (bent.end - bent.begin)

    def turn_cost(self, lane: int, other: int) -> float:
        """Return what a turn adds to the length of a route, metres."""
        return self.turn(lane, other).cost

    def path(self, lanes: Sequence[int], start: float, loop: int) -> Path:
        """Return the path along `lanes`, from `start` metres along the first.

        After the last lane follows `lanes[loop]`; 1 <= loop, and the last lane is `lanes[loop - 1]` again.
        """
        rows: list[dict[str, float]] = []
        loop_row = 0
        begin = start
        for k, lane in enumerate(lanes):
            following = lanes[k + 1] if k + 1 < len(lanes) else lanes[loop]
            if k == loop:
                loop_row = len(rows)
            turn = self.turn(lane, following)
            rows += self._lane_rows(lane, begin, turn)
            rows += self._turn_rows(lane, turn)
            begin = turn.after
        path = table(PathRow, len(rows))
        for name in dict.fromkeys(chain.from_iterable(rows)):
            usual = path[name].tolist()
            path[name] = [values.get(name, value) for values, value in zip(rows, usual, strict=True)]
        self._bound(path)
        return Path(path, loop_row)

    def _lane_rows(self, lane: int, begin: float, turn: Turn) -> list[dict[str, float]]:
        """Return the rows along a lane, from `begin` metres along its road to its next turn."""
        problem = self._problem
        w = problem.car.w
        length = self._lengths[lane >> 1]
        end = max(length - turn.before, begin)
        rows: list[dict[str, float]] = []
        for low, _, piece in self._lane_parts(lane, begin, end):
            row = {
                "x": piece.x,
                "y": piece.y,
                "c": piece.c,
                "s": piece.s,
                "length": piece.length,
                "lane": lane,
            }
            rows.append(row | {"bend": piece.bend, "low": -w + EDGE * w, "high": 3.0 * w - EDGE * w, "pivot": 0})
            begin = low
        sharp = bool(turn.pieces[0].pivot) if turn.pieces else turn.cost != 0.0
        rows[-1]["pivot"] = int(sharp)
        v = self._network.lane_ends(lane)[1]
        if self._degrees[v] != 2:
            reach = problem.intersection_radius + problem.car.body.reach
            stop = min(length - reach - WAITING_GAP, end)
            stop = max(stop, min(reach, length - reach - 0.02)) - begin
            rows[-1] |= {"waits": 1, "stop": stop, "gate_x": self._points[v][0], "gate_y": self._points[v][1]}
        return rows

    def _lane_parts(self, lane: int, begin: float, end: float) -> list[LanePiece]:
        """Return the pieces of the middle of a right lane from `begin` to `end` metres along its road."""
        if lane in self._bent:
            return cut(self._bent[lane], begin, end)
        (x0, y0), _ = self._network.lane_line(lane, -self._problem.car.w)
        tx, ty = self._begins[lane]
        return [LanePiece(begin, end, Piece(x0 + begin * tx, y0 + begin * ty, tx, ty, end - begin))]

    def _turn_rows(self, lane: int, turn: Turn) -> list[dict[str, float]]:
        tx, ty = self._ends[lane]
        x0, y0 = self._points[self._network.lane_ends(lane)[1]]
        rows: list[dict[str, float]] = []
        for piece in turn.pieces:
            row = {"x": x0 + piece.x * tx - piece.y * ty, "y": y0 + piece.x * ty + piece.y * tx}
            row |= {
                "c": piece.c * tx - piece.s * ty,
                "s": piece.c * ty + piece.s * tx,
                "length": piece.length,
            }
            rows.append(row | {"bend": piece.bend, "pivot": int(piece.pivot)})
        return rows

    def _bound(self, rows: Rows[PathRow]) -> None:
        """Fill `low` and `high` of the rows in turns; what is known of a piece of road is kept with the network."""
        known = cast(dict[Piece, Bounds], self._network.known.setdefault((_BOUNDS, self._problem.car.w), {}))
        turning: list[tuple[PathRow, Piece]] = []
        for r in np.flatnonzero(rows["lane"] < 0).tolist():
            row = rows[r]
            turning.append((row, Piece(row.x, row.y, row.c, row.s, row.length, row.bend)))
        missing = list(dict.fromkeys(piece for _, piece in turning if piece not in known))
        if missing:
            known.update(zip(missing, self._bounds(missing), strict=True))
        for row, piece in turning:
            row.low, row.high = known[piece]

    def _bounds(self, pieces: Sequence[Piece]) -> list[Bounds]:
        """Return how far cars may be right (negative) and left of pieces of turns, metres, never up to a turn's centre.

        Offsets are tried at three places of each.
        """
        w = self._problem.car.w
        offsets = 0.1 * w * np.arange(-30, 31)
        points = np.empty((len(pieces), 3, len(offsets), 2))
        for i, piece in enumerate(pieces):
            for k in range(3):
                sigma = 0.5 * k * piece.length
                x, y = along(piece, sigma)
                c, s = np.cos(piece.bend * sigma), np.sin(piece.bend * sigma)
                tx, ty = piece.c * c - piece.s * s, piece.s * c + piece.c * s
                points[i, k, :, 0] = x - offsets * ty
                points[i, k, :, 1] = y + offsets * tx
        free = np.min(self._network.on_road(points, (2.0 - EDGE) * w).astype(np.int64), axis=1).tolist()
        bounds: list[Bounds] = []
        for is_free, piece in zip(free, pieces, strict=True):
            right = left = 30
            while right > 0 and is_free[right - 1]:
                right -= 1
            while left < 60 and is_free[left + 1]:
                left += 1
            low, high = float(offsets[right]), float(offsets[left])
            if piece.bend != 0.0:
                inner = max(0.0, 1.0 / abs(piece.bend) - w)
                low = max(low, -inner) if piece.bend < 0.0 else low
                high = min(high, inner) if piece.bend > 0.0 else high
            bounds.append((low, high))
        return bounds


class LanePiece(NamedTuple):
    """A piece of the middle of a right lane, from `begin` to `end` metres along the lane's road."""

    begin: float
    end: float
    piece: Piece


def lane_pieces(network: RoadNetwork, lane: int, w: float) -> list[LanePiece]:
    """Return the pieces of a lane of a segment that bends, one for each line and arc of its chain.

    `w` is half the width of a lane, metres. On an arc that turns left the right lane is longer than the road.
    """
    chains, s, back = network.chains, lane >> 1, bool(lane & 1)
    numbers = range(int(chains.first[s]), int(chains.first[s + 1]))
    pieces: list[LanePiece] = []
    done = 0.0
    for k in reversed(numbers) if back else numbers:
        place, way = (chains.end, -chains.end_tangent) if back else (chains.start, chains.tangent)
        (x, y), (c, sine) = place[k].tolist(), way[k].tolist()
        length, side, radius = (float(array[k]) for array in (chains.length, chains.side, chains.radius))
        bend = (-side if back else side) / radius if side else 0.0
        stretch = 1.0 + bend * w
        piece = Piece(x + w * sine, y - w * c, c, sine, length * stretch, bend / stretch)
        pieces.append(LanePiece(done, done + length, piece))
        done += length
    return pieces


def cut(pieces: list[LanePiece], begin: float, end: float) -> list[LanePiece]:
    """Return the pieces from `begin` to `end` metres along the road, arcs in short ones; one at least.

    Before its begin and beyond its end the first and the last line go on.
    """
    cut_off: list[LanePiece] = []
    for k, whole in enumerate(pieces):
        low = begin if k == 0 else max(begin, whole.begin)
        high = end if k == len(pieces) - 1 else min(end, whole.end)
        if high > low or (k == len(pieces) - 1 and not cut_off):
            cut_off += _parts(whole, low, high)
    return cut_off


def _parts(whole: LanePiece, low: float, high: float) -> list[LanePiece]:
    """Return the part of a piece from `low` to `high` metres along the road, in short arcs."""
    piece = whole.piece
    stretch = piece.length / (whole.end - whole.begin)
    count = int(abs(piece.bend) * stretch * (high - low) / PIECE_ANGLE) + 1
    step = (high - low) / count
    pieces: list[LanePiece] = []
    for k in range(count):
        first = low + k * step
        x, y, c, s = advanced(piece, stretch * (first - whole.begin))
        pieces.append(LanePiece(first, first + step, Piece(x, y, c, s, stretch * step, piece.bend)))
    return pieces
