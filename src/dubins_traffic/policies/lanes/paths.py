"""Paths: routes along lanes as rows that compiled policies follow.

Each row is a piece: a line or a short arc, along the middle of a right lane or through an intersection. After the last
row comes row `loop`, so that a path has no end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.policies.lanes.turns import Piece, Site, Turn, along, angle_between, shape
from dubins_traffic.roads.straight import require_straight

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

EDGE = 0.15
"""What an evading car's centre keeps from the edge of the road, in units of w."""
WAITING_GAP = 0.3
"""Metres between a waiting car and the disc it waits for: so far that a car that leaves by the next lane to the right
and keeps a metre away from those that wait can still leave."""


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
        require_straight(problem.network, "driving on lanes")
        self._problem = problem
        self._network = problem.network
        self._visited = frozenset(problem.goal_vertices)
        self._lengths: list[float] = problem.network.lengths.tolist()
        self._directions = [
            (sign * tx, sign * ty) for tx, ty in problem.network.tangents.tolist() for sign in (1.0, -1.0)
        ]
        self._degrees: list[int] = problem.network.degrees.tolist()
        self._points: list[tuple[float, float]] = [(x, y) for x, y in problem.network.points.tolist()]
        self._turns: dict[tuple[int, int], Turn] = {}
        self._shapes: dict[Site, Turn] = {}

    def turn(self, lane: int, other: int) -> Turn:
        """Return the turn from one lane to a successor."""
        found = self._turns.get((lane, other))
        if found is None:
            v = self._network.lane_ends(lane)[1]
            site = Site(
                round(angle_between(*self._directions[lane], *self._directions[other]), 9),
                self._lengths[lane >> 1],
                self._lengths[other >> 1],
                self._degrees[v],
                self._problem.intersection_radius,
                self._problem.car,
                v in self._visited,
            )
            if site not in self._shapes:
                self._shapes[site] = shape(site)
            found = self._turns[lane, other] = self._shapes[site]
        return found

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
            rows.append(self._lane_row(lane, begin, turn))
            rows += self._turn_rows(lane, turn)
            begin = turn.after
        path = table(PathRow, len(rows))
        for k, values in enumerate(rows):
            for name, value in values.items():
                setattr(path[k], name, value)
        self._bound(path)
        return Path(path, loop_row)

    def _lane_row(self, lane: int, begin: float, turn: Turn) -> dict[str, float]:
        problem = self._problem
        w = problem.car.w
        (x0, y0), _ = self._network.lane_line(lane, -w)
        tx, ty = self._directions[lane]
        length = self._lengths[lane >> 1]
        end = max(length - turn.before, begin)
        sharp = bool(turn.pieces[0].pivot) if turn.pieces else turn.cost != 0.0
        v = self._network.lane_ends(lane)[1]
        row = {
            "x": x0 + begin * tx,
            "y": y0 + begin * ty,
            "c": tx,
            "s": ty,
            "length": end - begin,
            "lane": lane,
        }
        row |= {"low": -w + EDGE * w, "high": 3.0 * w - EDGE * w, "pivot": int(sharp)}
        if self._degrees[v] != 2:
            reach = problem.intersection_radius + problem.car.body.reach
            stop = min(length - reach - WAITING_GAP, end)
            stop = max(stop, min(reach, length - reach - 0.02)) - begin
            row |= {"waits": 1, "stop": stop, "gate_x": self._points[v][0], "gate_y": self._points[v][1]}
        return row

    def _turn_rows(self, lane: int, turn: Turn) -> list[dict[str, float]]:
        tx, ty = self._directions[lane]
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
        """Fill `low` and `high` of the rows in turns by trying offsets at three places; never up to a turn's centre."""
        w = self._problem.car.w
        turns = np.flatnonzero(rows["lane"] < 0).tolist()
        if not turns:
            return
        offsets = 0.1 * w * np.arange(-30, 31)
        points = np.empty((len(turns), 3, len(offsets), 2))
        for i, r in enumerate(turns):
            row = rows[r]
            piece = Piece(row.x, row.y, row.c, row.s, row.length, row.bend)
            for k in range(3):
                sigma = 0.5 * k * piece.length
                x, y = along(piece, sigma)
                c, s = np.cos(piece.bend * sigma), np.sin(piece.bend * sigma)
                tx, ty = piece.c * c - piece.s * s, piece.s * c + piece.c * s
                points[i, k, :, 0] = x - offsets * ty
                points[i, k, :, 1] = y + offsets * tx
        free = np.min(self._network.on_road(points, (2.0 - EDGE) * w).astype(np.int64), axis=1).tolist()
        for i, r in enumerate(turns):
            low = high = 30
            while low > 0 and free[i][low - 1]:
                low -= 1
            while high < 60 and free[i][high + 1]:
                high += 1
            row = rows[r]
            row.low, row.high = float(offsets[low]), float(offsets[high])
            if row.bend != 0.0:
                inner = max(0.0, 1.0 / abs(row.bend) - w)
                row.low = max(row.low, -inner) if row.bend < 0.0 else row.low
                row.high = min(row.high, inner) if row.bend > 0.0 else row.high
