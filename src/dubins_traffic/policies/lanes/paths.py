"""Paths: routes along lanes as rows of numbers that compiled laws follow.

A path is an array (rows, FIELDS). Each row is a piece: a line or a short arc, along the middle of a right lane or
through an intersection. After the last row comes row `loop`, so that a path has no end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.policies.lanes.turns import Piece, Site, Turn, along, angle_between, shape

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

# These numbers are compiled into functions with @jit: the mark puts this file into the fingerprint of their cache.
X, Y, C, S, LENGTH, BEND = range(6)
"""Start, unit heading, metres and curvature of a piece."""
LOW, HIGH = 6, 7
"""How far a car may keep left of the piece (right: negative) and stay on the road, metres."""
PIVOT = 8
"""Not 0: the end has to be reached before the next piece is begun, where the car turns in place."""
STOP, GATE_X, GATE_Y = 9, 10, 11
"""Metres along the piece to the line at which to wait for the intersection at (GATE_X, GATE_Y), or NO_STOP."""
LANE = 12
"""Number of the lane, -1 in a turn."""
FIELDS = 13

NO_STOP = 1e9
EDGE = 0.15
"""What an evading car's centre keeps from the edge of the road, in units of w."""
WAITING_GAP = 0.3
"""Metres between a waiting car and the disc it waits for: so far that a car that leaves by the next lane to the right
and keeps a metre away from those that wait can still leave."""


@dataclass(frozen=True, slots=True)
class Path:
    """`rows` (rows, FIELDS) and the number of the row that follows the last."""

    rows: Floats
    loop: int


class PathMaker:
    """Makes the paths of one problem. `visited` are intersections whose discs every turn has to enter."""

    def __init__(self, problem: Problem) -> None:
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
        rows: list[list[float]] = []
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
        array = np.array(rows, dtype=np.float64).reshape(len(rows), FIELDS)
        self._bound(array)
        return Path(array, loop_row)

    def _lane_row(self, lane: int, begin: float, turn: Turn) -> list[float]:
        problem = self._problem
        w = problem.car.w
        (x0, y0), _ = self._network.lane_line(lane, -w)
        tx, ty = self._directions[lane]
        length = self._lengths[lane >> 1]
        end = max(length - turn.before, begin)
        sharp = bool(turn.pieces[0].pivot) if turn.pieces else turn.cost != 0.0
        v = self._network.lane_ends(lane)[1]
        stop = NO_STOP
        if self._degrees[v] != 2:
            reach = problem.intersection_radius + problem.car.body.reach
            stop = min(length - reach - WAITING_GAP, end)
            stop = max(stop, min(reach, length - reach - 0.02)) - begin
        row = [x0 + begin * tx, y0 + begin * ty, tx, ty, end - begin, 0.0]
        row += [-w + EDGE * w, 3.0 * w - EDGE * w, float(sharp), stop, *self._points[v], float(lane)]
        return row

    def _turn_rows(self, lane: int, turn: Turn) -> list[list[float]]:
        tx, ty = self._directions[lane]
        x0, y0 = self._points[self._network.lane_ends(lane)[1]]
        rows: list[list[float]] = []
        for piece in turn.pieces:
            x, y = x0 + piece.x * tx - piece.y * ty, y0 + piece.x * ty + piece.y * tx
            c, s = piece.c * tx - piece.s * ty, piece.c * ty + piece.s * tx
            row = [x, y, c, s, piece.length, piece.bend, 0.0, 0.0, float(piece.pivot), NO_STOP, x0, y0, -1.0]
            rows.append(row)
        return rows

    def _bound(self, rows: Floats) -> None:
        """Fill LOW and HIGH of the rows in turns by trying offsets at three places; never up to a turn's centre."""
        w = self._problem.car.w
        turns = np.flatnonzero(rows[:, LANE] < 0)
        if not len(turns):
            return
        offsets = 0.1 * w * np.arange(-30, 31)
        points = np.empty((len(turns), 3, len(offsets), 2))
        for i, r in enumerate(turns):
            piece = Piece(*rows[r, : PIVOT - 2].tolist())
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
            rows[r, LOW], rows[r, HIGH] = offsets[low], offsets[high]
            if rows[r, BEND] != 0.0:
                inner = max(0.0, 1.0 / abs(rows[r, BEND]) - w)
                rows[r, LOW] = max(rows[r, LOW], -inner) if rows[r, BEND] < 0.0 else rows[r, LOW]
                rows[r, HIGH] = min(rows[r, HIGH], inner) if rows[r, BEND] > 0.0 else rows[r, HIGH]
