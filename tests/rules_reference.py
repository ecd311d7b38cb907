"""The propositions of docs/rules.md once more, slowly: plain Python over whole histories, to compare kernels with."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

from dubins_traffic.cars.body import Disc, DiscObstacle
from tests.chain_reference import Track


@dataclass
class Car:
    """One car: its past positions and what it carries from frame to frame."""

    number: int
    places: list[tuple[float, float]] = field(default_factory=list)
    lanes: list[tuple[int, int] | None] = field(default_factory=list)
    """Lane state at each frame, and `ways`: progress in it."""
    ways: list[float] = field(default_factory=list)
    pose: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 0.0)
    lane: tuple[int, int] | None = None
    backs_from: float = 0.0
    """Progress from which backing is measured."""
    at: int = -1
    crosses: int = -1
    approaches: list[int] = field(default_factory=list)
    ticket: int | None = None
    forfeits: int = 0
    waits: int = 0
    """How often it has stopped in the present wait; `renewals`: forfeits in it."""
    renewals: int = 0
    first_clear: list[bool] = field(default_factory=list)
    left: bool = False
    moved: set[int] = field(default_factory=set)
    """Numbers of the cars that have not been still in some frame since it became left."""
    overtaking: bool = False
    breach3: bool = False
    facts: dict[str, Any] = field(default_factory=dict)


class Reference:
    """Judges one trial frame by frame; `car.facts` holds the propositions of the present frame by name."""

    def __init__(self, problem: Any, cars: int) -> None:
        self.problem = problem
        self.net = problem.network
        self.points = [tuple(point) for point in self.net.points.tolist()]
        self.ends = [tuple(ends) for ends in self.net.ends.tolist()]
        self.tracks = {s: Track(self.net, s) for s, bent in enumerate(self.net.bent) if bent}
        self.w2 = 2 * problem.car.w
        self.rules = {
            "crossing_degree": 3, "turn_back": 0.3, "left_set": 0.05, "left_release": 0.0,
            "approach_distance": 0.5, "stop_time": 0.5, "queue_distance": 0.5, "group_time": 0.1,
            "forfeit_time": 3.0, "stand_time": 1.0, "excuse_distance": 1.0, "blocked_ahead": 1.5,
            "blocked_gap": 0.1, "overtaking_behind": 0.8, "overtaking_ahead": 1.5, "still_speed": 0.05,
            "linger_distance": 0.5, "linger_time": 10.0,
        }  # fmt: skip
        self.rules.update(problem.rules)
        self.cars = [Car(n) for n in range(cars)]
        self.tick = -1

    def ticks(self, duration: float) -> int:
        return math.ceil(duration * self.problem.rate - 1e-9)

    # geometry

    def line(self, segment: int) -> tuple[float, float, float, float, float]:
        (ax, ay), (bx, by) = (self.points[v] for v in self.ends[segment])
        length = math.hypot(bx - ax, by - ay)
        return ax, ay, (bx - ax) / length, (by - ay) / length, length

    def length(self, segment: int) -> float:
        return self.tracks[segment].length if segment in self.tracks else self.line(segment)[4]

    def off(self, segment: int, x: float, y: float) -> float:
        if segment in self.tracks:
            return self.tracks[segment].foot(x, y).off
        ax, ay, tx, ty, length = self.line(segment)
        along = min(max((x - ax) * tx + (y - ay) * ty, 0.0), length)
        return math.hypot(x - ax - along * tx, y - ay - along * ty)

    def direction(self, lane: tuple[int, int], x: float, y: float) -> tuple[float, float]:
        _, _, tx, ty, _ = self.line(lane[0])
        if lane[0] in self.tracks:
            way = self.tracks[lane[0]].foot(x, y).way
            tx, ty = way.real, way.imag
        return (tx, ty) if lane[1] == 0 else (-tx, -ty)

    def end_direction(self, lane: tuple[int, int]) -> tuple[float, float]:
        return self.direction(lane, *self.points[self.toward(lane)])

    def toward(self, lane: tuple[int, int]) -> int:
        return self.ends[lane[0]][1 - lane[1]]

    def coordinates(self, lane: tuple[int, int], x: float, y: float) -> tuple[float, float]:
        if lane[0] in self.tracks:
            track = self.tracks[lane[0]]
            foot = track.foot(x, y)
            return (foot.along, foot.left) if lane[1] == 0 else (track.length - foot.along, -foot.left)
        ax, ay, tx, ty, length = self.line(lane[0])
        s, lateral = (x - ax) * tx + (y - ay) * ty, (y - ay) * tx - (x - ax) * ty
        return (s, lateral) if lane[1] == 0 else (length - s, -lateral)

    def corners(self, car: Car) -> list[tuple[float, float]]:
        x, y, c, s = car.pose
        body = self.problem.car.body
        a, b = 0.5 * body.length, 0.5 * body.width
        return [(x + p * c - q * s, y + p * s + q * c) for p, q in ((a, b), (-a, b), (-a, -b), (a, -b))]

    def lateral_range(self, lane: tuple[int, int], car: Car) -> tuple[float, float]:
        body = self.problem.car.body
        if isinstance(body, Disc):
            lateral = self.coordinates(lane, *car.pose[:2])[1]
            return lateral - body.radius, lateral + body.radius
        x, y = car.pose[:2]
        lateral, (tx, ty) = self.coordinates(lane, x, y)[1], self.direction(lane, x, y)
        values = [lateral + (q - y) * tx - (p - x) * ty for p, q in self.corners(car)]
        return min(values), max(values)

    def gap(self, car: Car, v: int) -> float:
        """Distance of the body from the disc of v, negative where they meet."""
        x, y, c, s = car.pose
        px, py = self.points[v]
        body = self.problem.car.body
        if isinstance(body, Disc):
            return math.hypot(px - x, py - y) - body.radius - self.problem.intersection_radius
        u, q = (px - x) * c + (py - y) * s, (py - y) * c - (px - x) * s
        du, dq = max(abs(u) - 0.5 * body.length, 0.0), max(abs(q) - 0.5 * body.width, 0.0)
        return math.hypot(du, dq) - self.problem.intersection_radius

    def crossing(self, v: int) -> bool:
        return sum(v in ends for ends in self.ends) >= self.rules["crossing_degree"]

    # one frame

    def frame(self, poses: list[tuple[float, float, float, float]]) -> None:
        self.tick += 1
        for car, pose in zip(self.cars, poses, strict=True):
            before = car.facts
            car.pose = pose
            car.places.append(pose[:2])
            car.facts = {}
            self.locate(car, before)
        for car in self.cars:
            self.stop(car)
        for v in range(len(self.points)):
            self.order(v)
        self.excuse()
        for car in self.cars:
            car.lanes.append(car.lane)
            car.ways.append(0.0 if car.lane is None else self.s(car))
            self.stand(car)
        for car in self.cars:
            self.overtake(car)
        for car in self.cars:
            self.hem_in(car)

    def by_heading(self, segment: int, car: Car) -> tuple[int, int]:
        tx, ty = self.direction((segment, 0), *car.pose[:2])
        return (segment, 0 if car.pose[2] * tx + car.pose[3] * ty >= 0 else 1)

    def locate(self, car: Car, before: dict[str, Any]) -> None:
        x, y = car.pose[:2]
        offs = [self.off(s, x, y) for s in range(len(self.ends))]
        nearest = min(range(len(offs)), key=lambda s: (round(offs[s], 9), s))
        away = [math.hypot(px - x, py - y) for px, py in self.points]
        v = min(range(len(away)), key=lambda k: (away[k], k))
        at_before, crossed, lane_before = car.at, car.crosses, car.lane
        car.at = v if away[v] < self.problem.intersection_radius else -1
        car.crosses = v if self.gap(car, v) < 0 else -1
        turned = False
        if car.at >= 0:
            car.lane = None
        else:
            new = None
            if at_before >= 0:
                roads = [s for s, ends in enumerate(self.ends) if at_before in ends]
                segment = min(roads, key=lambda s: (round(offs[s], 9), s))
                new = (segment, self.ends[segment].index(at_before))
            elif car.lane is None or (offs[car.lane[0]] > self.w2 >= offs[nearest]):
                new = self.by_heading(nearest, car)
            if new is not None:
                car.lane, car.backs_from = new, -math.inf
            s, _ = self.coordinates(car.lane, x, y)
            if new is not None or not before.get("overtaking"):
                car.backs_from = max(car.backs_from, s)
            if car.backs_from - s >= self.rules["turn_back"]:
                car.lane, turned = (car.lane[0], 1 - car.lane[1]), True
                car.backs_from = self.coordinates(car.lane, x, y)[0]
        entered = self.tick > 0 and car.crosses >= 0 and car.crosses != crossed
        if car.crosses < 0 or car.crosses != crossed:
            car.breach3 = False
        if entered and self.crossing(car.crosses) and self.problem.rules:
            fine = before["stopped"] and not before["ahead"] and before["clear"]
            car.breach3 = not (fine and self.toward(lane_before) == car.crosses)
        if car.lane != lane_before:
            car.ticket, car.approaches = None, []
            car.waits, car.renewals = 0, 0
        car.facts.update(
            segment=nearest, at=car.at, crosses=car.crosses, on_road=offs[nearest] <= self.w2,
            turned=turned, entered=entered, breach3=car.breach3,
            in_crossing=car.crosses >= 0 and self.crossing(car.crosses),
            lane=-1 if car.lane is None else 2 * car.lane[0] + car.lane[1],
        )  # fmt: skip
        car.facts["still"] = self.still(car, self.rules["stand_time"])

    def still(self, car: Car, duration: float) -> bool:
        ago = self.ticks(duration)
        if self.tick < ago:
            return False
        (x, y), (px, py) = car.places[-1], car.places[-1 - ago]
        return math.hypot(x - px, y - py) <= self.rules["still_speed"] * duration + 1e-9

    def clear(self, car: Car | None, v: int) -> bool:
        return not any(other is not car and other.crosses == v for other in self.cars)

    def s(self, car: Car) -> float:
        return self.coordinates(car.lane, *car.pose[:2])[0]

    def stop(self, car: Car) -> None:
        facts = car.facts
        facts.update(approach=False, stopped=False, ahead=False, first=False, forfeited=False, clear=False)
        v = -1 if car.lane is None else self.toward(car.lane)
        if v < 0 or not self.crossing(v):
            car.ticket = None
            if facts["in_crossing"]:
                facts["clear"] = self.clear(car, car.crosses)
            return
        facts["clear"] = self.clear(car, v)
        gap = self.gap(car, v)
        if gap < 0:
            car.waits, car.renewals = 0, 0
        before_me = [
            other for other in self.cars
            if other.lane == car.lane and self.s(other) > self.s(car) and self.gap(other, v) >= 0
        ]  # fmt: skip
        facts["approach"] = 0 <= gap <= self.rules["approach_distance"] and not before_me
        car.approaches = [*car.approaches, self.tick] if facts["approach"] else []
        if car.ticket is not None and (gap < 0 or gap > self.rules["queue_distance"]):
            car.ticket = None
        long = len(car.approaches) > self.ticks(self.rules["stop_time"])
        if car.ticket is None and long and self.still(car, self.rules["stop_time"]):
            car.ticket, car.first_clear = self.tick, []
            car.waits += 1
            car.forfeits = car.waits - 1 + car.renewals
        facts["stopped"] = car.ticket is not None

    def sequence(self, queue: list[Car]) -> list[Car]:
        result: list[Car] = []
        rest = list(queue)
        while rest:
            begin = min(car.ticket for car in rest)
            group = [car for car in rest if car.ticket <= begin + self.ticks(self.rules["group_time"])]
            rest = [car for car in rest if car not in group]
            while group:
                free = [car for car in group if not any(self.right(car, other) for other in group)]
                chosen = min(free or group, key=lambda car: car.number)
                group.remove(chosen)
                result.append(chosen)
        return result

    def right(self, car: Car, other: Car) -> bool:
        (ax, ay), (bx, by) = self.end_direction(car.lane), self.end_direction(other.lane)
        angle = (math.atan2(-by, -bx) - math.atan2(-ay, -ax)) % (2 * math.pi)
        return 1e-6 < angle < math.pi - 1e-6

    def order(self, v: int) -> None:
        queue = [car for car in self.cars if car.facts["stopped"] and self.toward(car.lane) == v]
        if not queue:
            return
        clear = self.clear(None, v)
        first = self.sequence(queue)[0]
        wait = self.ticks(self.rules["forfeit_time"])
        if clear and len(first.first_clear) >= wait and all(first.first_clear[-wait:]):
            first.ticket, first.first_clear = self.tick, []
            first.renewals += 1
            first.forfeits = first.waits - 1 + first.renewals
        ordered = self.sequence(queue)
        for place, car in enumerate(ordered):
            car.first_clear.append(place == 0 and clear)
            car.facts.update(first=place == 0, ahead=place > 0, forfeited=car.forfeits > 0)

    def excuse(self) -> None:
        for car in self.cars:
            car.facts["excused"] = car.facts["stopped"] and car.forfeits == 0
        for _ in self.cars:
            for car in self.cars:
                for other in self.cars:
                    if car.lane is not None and car.lane == other.lane and other.facts["excused"]:
                        ahead = self.s(other) - self.s(car)
                        if 0 < ahead <= self.rules["excuse_distance"]:
                            car.facts["excused"] = True

    def stand(self, car: Car) -> None:
        car.facts["lingers"] = self.lingers(car)
        car.facts["stands"] = (car.facts["still"] or car.facts["lingers"]) and not car.facts["excused"]

    def lingers(self, car: Car) -> bool:
        """Whether the greatest progress since the lane state was set is about what it was, from the whole history."""
        if car.lane is None:
            return False
        begun = next((k + 1 for k in range(self.tick, -1, -1) if car.lanes[k] != car.lane), 0)
        ago = self.tick - self.ticks(self.rules["linger_time"])
        if ago < begun:
            return False
        grown = max(car.ways[begun:]) - max(car.ways[begun : ago + 1])
        return grown < self.rules["linger_distance"] - 1e-9

    def narrows(self, low: float, high: float) -> bool:
        if high <= -self.w2 or low >= 0:
            return False
        car = self.problem.car
        turn = 0.0 if isinstance(car.body, Disc) else car.bounds.yaw_rate * car.body.reach
        travel = (max(abs(car.bounds.speed_low), abs(car.bounds.speed)) + turn) / self.problem.rate
        return max(low + self.w2, -high) < car.body.width + max(self.rules["blocked_gap"], travel + 0.02)

    def obstacle_range(self, lane: tuple[int, int], obstacle: Any, low: float, high: float) -> Any:
        """Lateral range of an obstacle where its progress is in [low, high] on the segment, by sampling."""
        low, high = max(low, 0.0), min(high, self.length(lane[0]))
        if low > high:
            return None
        if isinstance(obstacle, DiscObstacle):
            s, lateral = self.coordinates(lane, obstacle.x, obstacle.y)
            if s + obstacle.radius < low or s - obstacle.radius > high:
                return None
            return lateral - obstacle.radius, lateral + obstacle.radius
        found = []
        for (s0, l0), (s1, l1) in self.outline(lane, obstacle.vertices):
            cuts = [0.0, 1.0]
            if s0 != s1:
                cuts += [(low - s0) / (s1 - s0), (high - s0) / (s1 - s0)]
            for u in cuts:
                s = s0 + u * (s1 - s0)
                if 0 <= u <= 1 and low - 1e-9 <= s <= high + 1e-9:
                    found.append(l0 + u * (l1 - l0))
        return (min(found), max(found)) if found else None

    def outline(self, lane: tuple[int, int], vertices: Any) -> Any:
        """The outline of an obstacle in coordinates of a lane; on curves by points, cut at the edges of the road."""
        corners = list(zip(vertices, [*vertices[1:], vertices[0]], strict=True))
        if lane[0] not in self.tracks:
            return [tuple(self.coordinates(lane, *corner) for corner in pair) for pair in corners]
        found = []
        for one, other in corners:
            count = max(1, math.ceil(math.dist(one, other) / 0.05 - 1e-9))
            spots = []
            for k in range(count + 1):
                u = k / count
                at = tuple(a + u * (b - a) for a, b in zip(one, other, strict=True))
                s, lateral = self.coordinates(lane, *at)
                spots.append((s, min(max(lateral, -self.w2), self.w2)))
            found += [
                (a, b)
                for a, b in itertools.pairwise(spots)
                if abs(a[0] - b[0]) <= 0.5 or min(abs(a[1]), abs(b[1])) < self.w2
            ]
        return found

    def overtake(self, car: Car) -> None:
        facts = car.facts
        facts.update(blocked=False)
        if car.lane is None:
            car.left = car.overtaking = facts["left"] = facts["overtaking"] = False
            return
        rules = self.rules
        near = False
        for other in self.cars:
            if other is car or not other.facts["stands"] or other.facts["segment"] != car.lane[0]:
                continue
            if self.narrows(*self.lateral_range(car.lane, other)):
                ahead = self.coordinates(car.lane, *other.pose[:2])[0] - self.s(car)
                facts["blocked"] |= 0 < ahead <= rules["blocked_ahead"]
                near |= -rules["overtaking_behind"] <= ahead <= rules["overtaking_ahead"]
        for obstacle in self.problem.obstacles:
            s = self.s(car)
            reach = self.obstacle_range(car.lane, obstacle, s, s + rules["blocked_ahead"])
            facts["blocked"] |= reach is not None and self.narrows(*reach)
            window = (s - rules["overtaking_behind"], s + rules["overtaking_ahead"])
            reach = self.obstacle_range(car.lane, obstacle, *window)
            near |= reach is not None and self.narrows(*reach)
        reach, was_left = self.lateral_range(car.lane, car)[1], car.left
        if reach > rules["left_set"]:
            if not car.left:
                car.moved = set()
            car.left = True
        elif reach < rules["left_release"]:
            car.left = False
        if facts["blocked"]:
            car.overtaking = True
        elif not near and not was_left and not car.left:
            car.overtaking = False
        if facts["entered"] or car.crosses == self.toward(car.lane):
            car.overtaking = False
        facts.update(left=car.left, overtaking=car.overtaking)

    def hem_in(self, car: Car) -> None:
        car.moved |= {other.number for other in self.cars if not other.facts["still"]}
        far = 2.0 * self.problem.car.body.reach + self.rules["overtaking_behind"]
        near = {
            other.number for other in self.cars if other is not car and math.dist(car.pose[:2], other.pose[:2]) <= far
        }
        car.facts["hemmed"] = car.left and car.overtaking and bool(near & car.moved)
