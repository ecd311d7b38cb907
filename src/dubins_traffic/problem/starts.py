"""Where the cars of an instance start.

Free places on right lanes (`Places`) are found exactly, not by trial and error, so that "does not fit" is a fact. All
bits follow from + - * / and square roots in a fixed order. One kernel, `place_trials`, places the cars of one trial or
many.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import deepcopy
from itertools import chain
from math import ceil, floor, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.kernels.random import DOWN, GRID, UP, block
from dubins_traffic.problem.overlap import Point, Shape, body_shape, contains, edges, obstacle_shape, overlap
from dubins_traffic.roads.cover import covered, pairs
from dubins_traffic.roads.network import RoadNetwork

SLACK = 1e-9
"""Added to every clearance, metres, so that rounding never makes it too small."""
ROOMY = 0.5
"""Preferred gap between two bodies, metres for w = 0.3 m: not less than the 0.5 m of free view that the
reference e-agent needs to set off."""
TIGHT = 0.1
"""Gap between two bodies if not all cars fit with `ROOMY`, metres for w = 0.3 m."""
NO_CAR = np.uint64(0xFFFFFFFF)
"""Stands where a running trial's random numbers have a car (`kernels.philox.Draws`)."""
CUTS = 24
"""Number of intervals per car for which there is scratch; of many trials one that needs more is drawn alone."""


class Lines(NamedTuple):
    """Lines by lane: where they start (ax, ay), metres, and their direction (tx, ty), a unit vector; arrays (L,)."""

    ax: Floats
    ay: Floats
    tx: Floats
    ty: Floats

    @staticmethod
    def right(network: RoadNetwork, w: float) -> Lines:
        """Return the centre lines of the right lanes, `w` metres right of the segments': the longest straight runs."""
        lanes = np.arange(network.lanes)
        segment, back = lanes >> 1, (lanes & 1).astype(np.bool_)
        runs = network.runs
        tangent = np.where(back[:, None], -runs.tangent[segment], runs.tangent[segment])
        start = np.where(back[:, None], runs.end[segment], runs.start[segment])
        tx, ty = tangent[:, 0] + 0.0, tangent[:, 1] + 0.0  # no negative zeros
        return Lines(start[:, 0] + w * ty, start[:, 1] - w * tx, tx, ty)

    def relative(self, lane: Ints, x: Floats | float, y: Floats | float) -> tuple[Floats, Floats]:
        """Return metres to (x, y) along the lines of `lane` (K,) and to the left of them."""
        tx, ty = self.tx[lane], self.ty[lane]
        rx, ry = x - self.ax[lane], y - self.ay[lane]
        return rx * tx + ry * ty, tx * ry - ty * rx

    def points(self, lane: Ints, along: Floats) -> tuple[Floats, Floats]:
        """Return x and y of the points `along` metres down the lines of `lane` (K,)."""
        return self.ax[lane] + along * self.tx[lane], self.ay[lane] + along * self.ty[lane]


def chord(along: Floats, left: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where lines enter and leave a disc centred `along` and `left` of them; inf, -inf where they miss it."""
    square = radius * radius - left * left
    half = np.sqrt(np.maximum(square, 0.0))
    hit = square > 0.0
    return np.where(hit, along - half, np.inf), np.where(hit, along + half, -np.inf)


def band(lines: Lines, lane: Ints, a: Point, b: Point, radius: float) -> tuple[Floats, Floats]:
    """Return where the lines of `lane` are inside the box of `radius` to both sides of the edge ab."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = sqrt(dx * dx + dy * dy)
    u, v = dx / length, dy / length
    tx, ty = lines.tx[lane], lines.ty[lane]
    rx, ry = lines.ax[lane] - a[0], lines.ay[lane] - a[1]
    low, high = _between(rx * u + ry * v, tx * u + ty * v, 0.0, length)
    other_low, other_high = _between(ry * u - rx * v, ty * u - tx * v, -radius, radius)
    return np.maximum(low, other_low), np.minimum(high, other_high)


def _between(offset: Floats, rate: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the s for which offset + rate * s lies between `low` and `high`."""
    steep = rate != 0.0
    slope = np.where(steep, rate, 1.0)
    a, b = (low - offset) / slope, (high - offset) / slope
    inside = (offset > low) & (offset < high)
    first = np.where(steep, np.minimum(a, b), np.where(inside, -np.inf, np.inf))
    last = np.where(steep, np.maximum(a, b), np.where(inside, np.inf, -np.inf))
    return first, last


class Intervals(NamedTuple):
    """Intervals of lanes, ascending by lane, then place: arrays (K,) of lane, and of metres along it."""

    lane: Ints
    low: Floats
    high: Floats

    def select(self, index: Ints) -> Intervals:
        """Return the intervals with the numbers `index`."""
        return Intervals(self.lane[index], self.low[index], self.high[index])


class Places:
    """Intervals of right lanes' centre lines in which the centre of a car may stand, those of straight runs only.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    w : float
        The right lane's centre line is this far right of the segment's, metres.
    """

    def __init__(self, network: RoadNetwork, w: float) -> None:
        self._lines = Lines.right(network, w)
        self._near = _Near(network, w)
        self._network = network
        lane = np.arange(network.lanes)
        self._free = Intervals(lane, np.zeros(len(lane)), np.repeat(network.runs.length, 2))

    def copy(self) -> Places:
        """Return an independent copy."""
        twin = object.__new__(Places)
        twin.__dict__.update(self.__dict__)
        return twin

    def block_shape(self, shape: Shape, clearance: float) -> None:
        """Remove all places closer than `clearance` to a shape, or inside it."""
        radius = shape.rounding + clearance + SLACK
        x, y = shape.corners[0]
        reach = max(abs(p - x) + abs(q - y) for p, q in shape.corners)
        index = self._around(x, y, reach + radius)
        intervals = self._free.select(index)
        for a, b in edges(shape):
            intervals = _cut(intervals, *self._stadium(intervals.lane, a, b, radius))
        outside = [not contains(shape, point) for point in self._middles(intervals)]
        self._put(index, intervals.select(np.flatnonzero(np.array(outside, dtype=np.bool_))))

    def block_intersections(self, radius: float) -> None:
        """Remove all places closer than `radius` to an intersection."""
        radius += SLACK
        segment, vertex = self._near.couples(radius)
        lane = np.concatenate([2 * segment, 2 * segment + 1])
        points = self._network.points[np.concatenate([vertex, vertex])]
        along, left = self._lines.relative(lane, points[:, 0], points[:, 1])
        low, high = chord(along, left, radius)
        hit = low < high
        self._free = _subtract(self._free, Intervals(lane[hit], low[hit], high[hit]))

    def tables(self) -> tuple[Floats, Intervals]:
        """Return start and direction of each right lane's centre line, (L, 4), and the free intervals."""
        return np.ascontiguousarray(np.stack(self._lines, axis=-1)), self._free

    def _around(self, x: float, y: float, radius: float) -> Ints:
        """Return the numbers of the intervals of all lanes that may come closer than `radius` to (x, y)."""
        lanes = self._near.lanes(x, y, radius)
        if lanes is None:
            return np.arange(len(self._free.lane))
        begin = np.searchsorted(self._free.lane, lanes, side="left")
        end = np.searchsorted(self._free.lane, lanes, side="right")
        count = end - begin
        return np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))

    def _put(self, index: Ints, new: Intervals) -> None:
        """Replace the intervals with the numbers `index`, which are all of their lanes, by `new`."""
        kept = np.ones(len(self._free.lane), dtype=np.bool_)
        kept[index] = False
        rest = self._free.select(np.flatnonzero(kept))
        place = np.searchsorted(rest.lane, new.lane)
        lane = np.insert(rest.lane, place, new.lane).astype(np.int64)
        low = np.insert(rest.low, place, new.low).astype(np.float64)
        self._free = Intervals(lane, low, np.insert(rest.high, place, new.high).astype(np.float64))

    def _middles(self, intervals: Intervals) -> list[Point]:
        x, y = self._lines.points(intervals.lane, 0.5 * (intervals.low + intervals.high))
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def _stadium(self, lane: Ints, a: Point, b: Point, radius: float) -> tuple[Floats, Floats]:
        """Return where lanes are closer than `radius` to the edge ab: in two discs or the box between them."""
        low, high = chord(*self._lines.relative(lane, *a), radius)
        other_low, other_high = chord(*self._lines.relative(lane, *b), radius)
        low, high = np.minimum(low, other_low), np.maximum(high, other_high)
        if a != b:
            box_low, box_high = band(self._lines, lane, a, b, radius)
            hit = box_low < box_high
            low = np.where(hit, np.minimum(low, box_low), low)
            high = np.where(hit, np.maximum(high, box_high), high)
        return low, high


class _Near:
    """Finds the lanes near a point by uniform cells."""

    def __init__(self, network: RoadNetwork, w: float) -> None:
        self._network = network
        self._w = w
        self._start, self._end = network.runs.start, network.runs.end
        self._size = float(network.lengths.mean())
        self._cells: dict[tuple[int, int], list[int]] | None = None

    def lanes(self, x: float, y: float, radius: float) -> Ints | None:
        """Return the lanes that may come closer than `radius` to (x, y), ascending; None for all of them."""
        reach = radius + self._w
        if reach > 2.0 * self._size:
            return None
        cells = self._table()
        columns = range(floor((x - reach) / self._size), ceil((x + reach) / self._size))
        rows = range(floor((y - reach) / self._size), ceil((y + reach) / self._size))
        near = {s for column in columns for row in rows for s in cells.get((column, row), ())}
        segments = np.array(sorted(near), dtype=np.int64)
        return np.stack([2 * segments, 2 * segments + 1], axis=-1).ravel()

    def couples(self, radius: float) -> tuple[Ints, Ints]:
        """Return segments and intersections that may be closer than `radius` to a lane of the segment."""
        points, count = self._network.points, len(self._start)
        start, end = np.concatenate([self._start, points]), np.concatenate([self._end, points])
        reach = radius + self._w
        size = max(self._size, reach)
        segments: list[Ints] = []
        vertices: list[Ints] = []
        for first, second in pairs(*covered(start, end, 0.5 * reach, size)):
            low, high = np.minimum(first, second), np.maximum(first, second)
            mixed = (low < count) & (high >= count)
            segments.append(low[mixed])
            vertices.append(high[mixed] - count)
        return np.concatenate(segments), np.concatenate(vertices)

    def _table(self) -> dict[tuple[int, int], list[int]]:
        if self._cells is None:
            self._cells = {}
            item, column, row = covered(self._start, self._end, 0.0, self._size)
            for s, i, j in zip(item.tolist(), column.tolist(), row.tolist(), strict=True):
                self._cells.setdefault((i, j), []).append(s)
        return self._cells


def _cut(intervals: Intervals, low: Floats, high: Floats) -> Intervals:
    """Take the open interval (low, high) out of each interval."""
    hit = (low < intervals.high) & (high > intervals.low) & (low < high)
    if not bool(np.any(hit)):
        return intervals
    before = np.flatnonzero(hit & (low >= intervals.low))
    after = np.flatnonzero(hit & (high <= intervals.high))
    kept = intervals.select(np.flatnonzero(~hit))
    lane = np.concatenate([kept.lane, intervals.lane[before], intervals.lane[after]])
    new_low = np.concatenate([kept.low, intervals.low[before], high[after]])
    new_high = np.concatenate([kept.high, low[before], intervals.high[after]])
    return Intervals(lane, new_low, new_high).select(np.lexsort((new_low, lane)))


def _subtract(intervals: Intervals, blocked: Intervals) -> Intervals:
    """Take all of `blocked` out of `intervals` at once: what is left are the gaps of all that is not free."""
    first = np.flatnonzero(np.diff(intervals.lane, prepend=-1))
    last = np.flatnonzero(np.diff(intervals.lane, append=-1))
    joints = np.flatnonzero(np.diff(intervals.lane, append=-1) == 0)
    taken = np.isin(blocked.lane, intervals.lane)
    lane = np.concatenate([blocked.lane[taken], intervals.lane[first], intervals.lane[last], intervals.lane[joints]])
    low = np.concatenate(
        [blocked.low[taken], np.full(len(first), -np.inf), intervals.high[last], intervals.high[joints]]
    )
    high = np.concatenate(
        [blocked.high[taken], intervals.low[first], np.full(len(last), np.inf), intervals.low[joints + 1]]
    )
    order = np.lexsort((low, lane))
    lane, low, high = lane[order], low[order], high[order]
    ranked = np.sort(high)
    rank = np.searchsorted(ranked, high)
    farthest = ranked[np.maximum.accumulate(lane * len(lane) + rank) % max(len(lane), 1)]
    gap = np.flatnonzero((lane[1:] == lane[:-1]) & (low[1:] > farthest[:-1]))
    return Intervals(lane[gap], farthest[gap], low[gap + 1])


class Wish(NamedTuple):
    """Where a car is to start: the pose, or None to draw it, the lanes it may be drawn on (None: all), and the
    field of the document that says so.
    """

    pose: Pose | None
    lanes: Collection[int] | None
    field: str


class Ground(NamedTuple):
    """What starts depend on: the roads, the car, the intersection radius R (metres), the obstacles."""

    network: RoadNetwork
    car: Car
    intersection_radius: float
    obstacles: tuple[Obstacle, ...]


class Areas(NamedTuple):
    """Where cars may stand: clear of obstacles, and of these places those outside the discs of intersections."""

    free: Places
    outside: Places


def areas_of(ground: Ground) -> Areas:
    """Return the areas of a ground."""
    free = Places(ground.network, ground.car.w)
    for obstacle in ground.obstacles:
        free.block_shape(obstacle_shape(obstacle), ground.car.body.reach)
    outside = free.copy()
    outside.block_intersections(ground.intersection_radius + ground.car.body.reach)
    return Areas(free, outside)


def gap_radius(car: Car, gap: float = ROOMY) -> float:
    """Return the least distance of the centres of two cars, metres, that leaves `gap` between their bodies."""
    return 2.0 * car.body.reach + gap * (car.w / 0.3)


class Lots(NamedTuple):
    """Where the cars of trials on one ground may stand.

    `line` (L, 4): start and direction of each lane's centre line; `lane`, `low`, `high` (K,): the free intervals of
    the lanes, in order, one area after another; `first` (A + 1,): where each area begins among these; `given` (G, 2):
    positions of the cars whose starts are given; `order` (D,): the others, in the order in which they are drawn;
    `allowed` (D, L): where each of these may be, or (0, 0) for all lanes; `radius`: how far centres are apart, metres.
    """

    line: Floats
    lane: Ints
    low: Floats
    high: Floats
    first: Ints
    given: Floats
    order: Ints
    allowed: npt.NDArray[np.bool_]
    radius: float


class Room(NamedTuple):
    """Scratch for one trial: for each area two lists of intervals that take turns.

    `lane` (A, 2, K) and `span` (A, 2, K, 2): lane and ends (m) of each interval; `counts` (A,): how many there are;
    `ends` (K,): what is free up to the end of each, m.
    """

    lane: Ints
    span: Floats
    counts: Ints
    ends: Floats


def lots(car: Car, areas: Sequence[Places], wishes: Sequence[Wish], gap: float = ROOMY) -> Lots:
    """Return where cars with `wishes` may stand: in the first of the `areas` that has room, `gap` metres apart."""
    free = [area.tables() for area in areas]
    line = free[0][0]
    given = [(wish.pose.x, wish.pose.y) for wish in wishes if wish.pose is not None]
    drawn = [n for n, wish in enumerate(wishes) if wish.pose is None]
    order = sorted(drawn, key=lambda n: wishes[n].lanes is None)
    choosy = any(wish.lanes is not None for wish in wishes)
    allowed = np.ones((len(order), len(line)) if choosy else (0, 0), dtype=np.bool_)
    for k, n in enumerate(order):
        lanes = wishes[n].lanes
        if lanes is not None:
            allowed[k] = False
            allowed[k, list(lanes)] = True
    lane, low, high = (np.concatenate(columns) for columns in zip(*(intervals for _, intervals in free), strict=True))
    first = np.cumsum([0, *(len(intervals.lane) for _, intervals in free)]).astype(np.int64)
    positions = np.array(given, dtype=np.float64).reshape(len(given), 2)
    radius = gap_radius(car, gap) + SLACK
    return Lots(line, lane, low, high, first, positions, np.array(order, dtype=np.int64), allowed, radius)


def draw_starts(areas: Areas, car: Car, wishes: Sequence[Wish], draws: Draws) -> list[Pose]:
    """Return the start poses of all cars.

    Starts that are not given are drawn uniformly over the right lanes' centre lines, headed with the lane, with bodies
    clear of obstacles, of all discs of intersections and, by a gap, of one another. If the cars don't fit so, they are
    packed; if they still don't, the gap is reduced, and then places inside discs are used.

    Raises
    ------
    InputError
        If the cars don't fit; says how many do.
    """
    poses = [wish.pose for wish in wishes if wish.pose is not None]
    if len(poses) == len(wishes):
        return poses
    free, outside = areas
    best = 0
    for some, gap in (((outside,), ROOMY), ((outside,), TIGHT), ((outside, free), TIGHT)):
        lots_here = lots(car, some, wishes, gap)
        count = len(lots_here.order)
        for packed in (False, True):
            ranks = np.array(draws.shuffled(len(lots_here.line)) if packed else (), dtype=np.int64)
            ahead = deepcopy(draws)
            shares = np.array([[0.0 if packed else ahead.uniform() for _ in range(count)]])
            rows, placed = _place(lots_here, shares, ranks)
            done = int(placed[0])
            if done == count:
                return _starts(lots_here, wishes, rows[0])
            for _ in range(0 if packed else done):
                draws.uniform()
            best = max(best, len(lots_here.given) + done)
    raise InputError(
        f"only {best} of {len(wishes)} cars fit on the road network",
        field="e-agents",
        value=len(wishes) - 1,
        expected=f"at most {max(best - 1, 0)} e-agents, or a larger network",
    )


def place_cars(
    lots: Lots, wishes: Sequence[Wish], seed: int, trials: Sequence[int], stream: int
) -> list[list[Pose] | None]:
    """Return the start poses that `draw_starts` draws for each trial; None where it has to try more than once."""
    shares = np.zeros((len(trials), len(lots.order)))
    draw_shares(np.uint64(seed), np.array(trials, dtype=np.int64), stream, shares)
    poses, placed = _place(lots, shares, np.zeros(0, dtype=np.int64))
    return [
        _starts(lots, wishes, rows) if done == len(lots.order) else None
        for rows, done in zip(poses, placed.tolist(), strict=True)
    ]


def _starts(lots: Lots, wishes: Sequence[Wish], rows: Floats) -> list[Pose]:
    """Return the poses of all cars: as given, and as drawn."""
    whole = [wish.pose for wish in wishes]
    for n, row in zip(lots.order.tolist(), rows.tolist(), strict=True):
        whole[n] = Pose._make(row)
    return [pose for pose in whole if pose is not None]


def _place(lots: Lots, shares: Floats, ranks: Ints) -> tuple[Floats, Ints]:
    """Return what `place_trials` writes; a trial alone gets the scratch that it needs, of many some may go without."""
    trials, cars = shares.shape
    poses, placed = np.zeros((trials, cars, 4)), np.zeros(trials, dtype=np.int64)
    areas, size = len(lots.first) - 1, len(lots.lane) + CUTS * (cars + len(lots.given))
    while True:
        lane, span = np.zeros((areas, 2, size), dtype=np.int64), np.zeros((areas, 2, size, 2))
        room = Room(lane, span, np.zeros(areas, dtype=np.int64), np.zeros(size))
        place_trials(lots, shares, ranks, room, poses, placed)
        if trials != 1 or placed[0] >= 0:
            return poses, placed
        size *= 2


@jit
def draw_shares(seed: np.uint64, trials: Ints, stream: int, shares: Floats) -> None:
    """Draw the random numbers of the cars of all trials, those with which a stream of `Draws` begins.

    Parameters
    ----------
    seed : uint64
        The seed of all random numbers.
    trials : (B,) int64
        Numbers of the trials.
    stream : int
        Number of the draw in the counter of random numbers.
    shares : (B, D) float64
        Set to a number in [0, 1) for each car that is drawn.
    """
    for b in range(trials.shape[0]):
        for k in range(shares.shape[1]):
            words = block(seed, trials[b], NO_CAR, k // 2, stream)
            first = words[0] if k % 2 == 0 else words[2]
            second = words[1] if k % 2 == 0 else words[3]
            shares[b, k] = np.float64((first << UP) | (second >> DOWN)) * GRID


@jit
def place_trials(lots: Lots, shares: Floats, ranks: Ints, room: Room, poses: Floats, placed: Ints) -> None:
    """Place the cars of all trials, one after another, each in the first area that has room, until one finds none.

    Parameters
    ----------
    lots : Lots
        What the trials have in common.
    shares : (B, D) float64
        Where a car is to stand, as a share of all that is free then, a number in [0, 1).
    ranks : (L,) int64, or empty
        Where given, cars are packed instead: each at the beginning of what is free, lanes taken by rank.
    room : Room
        Scratch for one trial.
    poses : (B, D, 4) float64
        Set to x, y (m), cos, sin of each car that is drawn.
    placed : (B,) int64
        Set to the number of cars that have found a place, -1 if the scratch is too small to tell.
    """
    cars = lots.order.shape[0]
    for b in range(shares.shape[0]):
        for a in range(room.counts.shape[0]):
            start = lots.first[a]
            room.counts[a] = lots.first[a + 1] - start
            for k in range(room.counts[a]):
                room.lane[a, 0, k] = lots.lane[start + k]
                room.span[a, 0, k, 0] = lots.low[start + k]
                room.span[a, 0, k, 1] = lots.high[start + k]
        side = 0
        done = 0
        for g in range(lots.given.shape[0]):
            if done == 0 and not _cut_out(lots, lots.given[g, 0], lots.given[g, 1], side, room):
                done = -1
            side = 1 - side
        placed[b] = done
        while 0 <= placed[b] < cars:
            car = placed[b]
            area, spot, along = -1, -1, 0.0
            while spot < 0 and area + 1 < room.counts.shape[0]:
                area += 1
                if ranks.shape[0] > 0:
                    spot, along = _first(lots, car, ranks, area, side, room)
                else:
                    spot, along = _choose(lots, car, shares[b, car], area, side, room)
            if spot < 0:
                break
            line, pose = lots.line[room.lane[area, side, spot]], poses[b, car]
            pose[0], pose[1] = line[0] + along * line[2], line[1] + along * line[3]
            pose[2], pose[3] = line[2], line[3]
            placed[b] = car + 1
            if car + 1 < cars and not _cut_out(lots, pose[0], pose[1], side, room):
                placed[b] = -1
            side = 1 - side


@jit
def _first(lots: Lots, car: int, ranks: Ints, area: int, side: int, room: Room) -> tuple[int, float]:
    """Return the first interval of the lane of lowest rank that a car may take, and its beginning; -1 if none is."""
    best = -1
    for k in range(room.counts[area]):
        lane = room.lane[area, side, k]
        if lots.allowed.shape[0] > 0 and not lots.allowed[car, lane]:
            continue
        if best < 0 or ranks[lane] < ranks[room.lane[area, side, best]]:
            best = k
    if best < 0:
        return -1, 0.0
    return best, room.span[area, side, best, 0]


@jit
def _choose(lots: Lots, car: int, share: float, area: int, side: int, room: Room) -> tuple[int, float]:
    """Return an interval and the metres along its lane at a share of all that is free; -1 if nothing is."""
    lane, span, ends = room.lane[area, side], room.span[area, side], room.ends
    total = 0.0
    last = -1
    for k in range(room.counts[area]):
        width = span[k, 1] - span[k, 0]
        if lots.allowed.shape[0] > 0 and not lots.allowed[car, lane[k]]:
            width = 0.0
        total += width
        ends[k] = total
        if width > 0.0:
            last = k
    if not total > 0.0:
        return -1, 0.0
    pick = total * share
    chosen = last
    for k in range(last):
        if ends[k] > pick:
            chosen = k
            break
    width = span[chosen, 1] - span[chosen, 0]
    if lots.allowed.shape[0] > 0 and not lots.allowed[car, lane[chosen]]:
        width = 0.0
    along = span[chosen, 0] + (pick - (ends[chosen] - width))
    return chosen, min(max(along, span[chosen, 0]), span[chosen, 1])


@jit
def _cut_out(lots: Lots, x: float, y: float, side: int, room: Room) -> bool:
    """Take a disc out of the intervals of all areas; return whether the scratch was large enough."""
    square = lots.radius * lots.radius
    for a in range(room.counts.shape[0]):
        lane, span = room.lane[a, side], room.span[a, side]
        new_lane, new_span = room.lane[a, 1 - side], room.span[a, 1 - side]
        total = 0
        for k in range(room.counts[a]):
            if total + 2 > new_lane.shape[0]:
                return False
            line = lots.line[lane[k]]
            rx = x - line[0]
            ry = y - line[1]
            along = rx * line[2] + ry * line[3]
            left = line[2] * ry - line[3] * rx
            rest = square - left * left
            half = sqrt(max(rest, 0.0))
            low = along - half
            high = along + half
            if rest > 0.0 and low < span[k, 1] and high > span[k, 0] and low < high:
                if low >= span[k, 0]:
                    new_lane[total] = lane[k]
                    new_span[total, 0] = span[k, 0]
                    new_span[total, 1] = low
                    total += 1
                if high <= span[k, 1]:
                    new_lane[total] = lane[k]
                    new_span[total, 0] = high
                    new_span[total, 1] = span[k, 1]
                    total += 1
            else:
                new_lane[total] = lane[k]
                new_span[total, 0] = span[k, 0]
                new_span[total, 1] = span[k, 1]
                total += 1
        room.counts[a] = total
    return True


def check_given(ground: Ground, names: Sequence[str], wishes: Sequence[Wish]) -> None:
    """Refuse given starts in which a body overlaps another or an obstacle."""
    obstacles = [obstacle_shape(obstacle) for obstacle in ground.obstacles]
    side = 2.0 * ground.car.body.reach * (1.0 + 1e-9)
    cells: dict[tuple[int, int], list[tuple[int, Shape]]] = {}
    for n, wish in enumerate(wishes):
        if wish.pose is None:
            continue
        shape = body_shape(ground.car.body, wish.pose)
        column, row = floor(wish.pose.x / side), floor(wish.pose.y / side)
        near = [cells.get((column + i, row + j), ()) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        for other, other_shape in sorted(chain.from_iterable(near)):
            if overlap(shape, other_shape):
                raise _overlap_error(names[n], wish, names[other])
        for number, obstacle in enumerate(obstacles):
            if overlap(shape, obstacle):
                raise _overlap_error(names[n], wish, f"obstacles[{number}]")
        cells.setdefault((column, row), []).append((n, shape))


def _overlap_error(name: str, wish: Wish, other: str) -> InputError:
    pose = wish.pose
    return InputError(
        f"{name} overlaps {other}",
        field=wish.field,
        value=[pose.x, pose.y, pose.theta] if pose else None,
        expected="a start clear of other cars and of obstacles",
    )
