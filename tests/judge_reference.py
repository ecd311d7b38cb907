"""The rules once more, slowly: every breach of a script from the whole history of the reference's propositions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from dubins_traffic.cars.body import Rectangle
from dubins_traffic.problem.instance import Instance
from dubins_traffic.rules.parameters import RuleParameters
from tests.rules_reference import Car, Reference
from tests.rules_scripts import Frame

Found = set[tuple[str, int, int, int]]


class Judge:
    """Steps a reference through a script, then looks for the breaches (rule, car, tick, since)."""

    def __init__(self, instance: Instance, script: Sequence[Frame]) -> None:
        self.problem = instance.problem
        self.rules = RuleParameters.from_mapping(self.problem.rules)
        self.reference = Reference(self.problem, len(script[0]))
        self.cars = range(len(script[0]))
        self.past: list[list[dict[str, Any]]] = []
        self.fired: Counter[str] = Counter()
        for frame in script:
            self.reference.frame(frame)
            self.past.append([self.note(car) for car in self.reference.cars])
        for k, frame in enumerate(self.past):
            for n, facts in enumerate(frame):
                facts["leaves"], facts["shared"] = self.may_leave(k, n), self.shared(k, n)
                facts["exit"] = facts["leaves"] and not facts["shared"]
                facts["way"] = self.way(k, n)
        self.owed = {n: self.stays_of(n) | self.journeys_of(n) for n in self.cars}

    def note(self, car: Car) -> dict[str, Any]:
        toward = -1 if car.lane is None else self.reference.toward(car.lane)
        return {
            **car.facts, "toward": toward, "ticket": car.ticket, "forfeits": car.forfeits,
            "spot": car.pose[:2], "sides": self.sides(car),
            "progress": 0.0 if car.lane is None else self.reference.s(car),
            "left_by": self.reference.lateral_range(car.lane, car)[1] if car.lane else 0.0,
        }  # fmt: skip

    def sides(self, car: Car) -> dict[tuple[int, int], tuple[float, float]]:
        """Between which laterals a body is, in the lanes of the segment nearest to it, and out of the disc it is in."""
        segment, v = car.facts["segment"], car.facts["at"]
        lanes = {(segment, 0), (segment, 1), *(self.arms(v) if v >= 0 else ())}
        return {lane: self.reference.lateral_range(lane, car) for lane in lanes}

    def stays_of(self, n: int) -> Found:
        """E4: the breaches of a car, at most one a stay; also note the frames in which it has stayed for too long."""
        found: Found = set()
        wait = self.ticks(self.rules.exit_time)
        for v in range(len(self.reference.points)):
            for stay in self.runs(lambda k, v=v: self.past[k][n]["crosses"] == v):
                spent, over, pauses = 0, False, False
                for k in stay:
                    facts = self.past[k][n]
                    goes_on = k > stay.start and facts["leaves"] and self.past[k - 1][n]["leaves"]
                    spent += goes_on and not facts["shared"]
                    pauses |= k > stay.start and spent > 0 and not facts["leaves"]
                    self.fired["E4 paused"] += facts["leaves"] and facts["shared"]
                    if facts["leaves"] and spent >= wait and not over:
                        over = True
                        found.add(("E4", n, k, stay.start))
                        self.fired["E4 added up"] += pauses
                    facts["stays"] = over
        return found

    def journeys_of(self, n: int) -> Found:
        """E5: the breaches of a car, at most one a journey; also note the frames in which it is overdue."""
        found: Found = set()
        rules, last, begun, spent, excused, over = self.rules, -1, 0, 0, 0, False
        way = rules.journey_lengths * max(map(self.reference.length, range(len(self.reference.ends))))
        limit = self.ticks(rules.rest_time + way / self.problem.car.bounds.speed)
        for k in range(len(self.past)):
            facts = self.past[k][n]
            v = facts["crosses"]
            facts["goes"] = self.goes(facts["way"], 0)
            if v not in (-1, last):
                last, begun, spent, excused, over = v, k, 0, 0, False
            elif k > begun:
                starts = k - begun <= min(self.ticks(rules.journey_start_time), limit)
                excused += v < 0 and not starts and facts["way"] == "for a while"
                facts["goes"] = self.goes(facts["way"], excused if n else 0)
                self.fired["E5 excused for long"] += v < 0 and facts["goes"] and facts["way"] != "free"
                spent += starts or facts["goes" if v < 0 else "exit"]
            if spent >= limit and not over:
                over = True
                found.add(("E5", n, k, begun))
            facts["overdue"] = over
        return found

    def goes(self, way: str, excused: int) -> bool:
        """E5: whether the way is free, or is not only for a while, of which `excused` ticks have passed."""
        return way == "free" or (way == "for a while" and excused > self.ticks(self.rules.rest_time))

    def arms(self, v: int) -> list[tuple[int, int]]:
        return [(s, ends.index(v)) for s, ends in enumerate(self.reference.ends) if v in ends]

    def since(self, k: int, n: int) -> int:
        """The first frame of the stay in the disc that the body meets in frame k."""
        v = self.past[k][n]["crosses"]
        return next((m + 1 for m in range(k, -1, -1) if self.past[m][n]["crosses"] != v), 0)

    def came_by(self, k: int, n: int) -> int:
        """The lane, -1: none, by which it came there."""
        begun = self.since(k, n)
        return self.past[begun - 1][n]["lane"] if begun > 0 else -1

    def exits(self, v: int, came: int) -> list[tuple[int, int]]:
        """The lanes out of v for a car that came by the lane `came`: at a bend not the way back."""
        return [arm for arm in self.arms(v) if not (self.bend(v) and came >= 0 and arm[0] == came // 2)]

    def exits_of(self, k: int, n: int, v: int) -> list[tuple[int, int]]:
        """The lanes out of v for a car whose body meets its disc: one that its centre is on already, or all exits."""
        return [self.gone(k, n, v)] if self.gone(k, n, v) else self.exits(v, self.came_by(k, n))

    def gone(self, k: int, n: int, v: int) -> tuple[int, int] | None:
        """The lane out of v on which the centre of a car is, outside the disc, if it is on one that is not barred."""
        lane = divmod(self.past[k][n]["lane"], 2)
        if self.past[k][n]["lane"] < 0 or lane not in self.arms(v):
            return None
        barred = self.barred(lane)
        self.fired["out before an obstacle"] += barred
        return None if barred else lane

    def bend(self, v: int) -> bool:
        return len(self.arms(v)) >= 2 and not self.reference.crossing(v)

    def contends(self, k: int, other: int, v: int, came: int, arm: tuple[int, int]) -> bool:
        """Whether who is in the disc of v is in the way of a car that came by `came`, being nearer to an exit.

        At a bend only who started there or came by the same segment, and the ego where its body narrows that lane.
        """
        its = self.came_by(k, other)
        if its < 0 or not self.bend(v) or (came >= 0 and its // 2 == came // 2):
            return True
        self.fired["passes by"] += 1
        return other == 0 and self.reference.narrows(*self.past[k][other]["sides"][arm])

    def mouth(self, arm: tuple[int, int], spot: tuple[float, float]) -> float:
        s, lateral = self.reference.coordinates(arm, *spot)
        return math.hypot(s - self.problem.intersection_radius, lateral + self.problem.car.w)

    def takes(self, k: int, other: int, v: int, arm: tuple[int, int]) -> bool:
        """Whether who is outside the disc of v, but near it, is in a lane out of it: no car has room between."""
        facts = self.past[k][other]
        s, lateral = self.reference.coordinates(arm, *facts["spot"])
        far = math.dist(facts["spot"], self.reference.points[v]) - self.problem.intersection_radius
        room = max(self.rules.exit_gap, 3 * self.problem.car.body.reach + self.rules.exit_gap / 4)
        if facts["at"] == v or s <= 0 or facts["segment"] != arm[0] or far > room:
            return False
        if self.reference.narrows(*facts["sides"][arm]):
            self.fired["narrowed exit"] += not -self.reference.w2 <= lateral <= 0
            return True
        if facts["lane"] == 2 * arm[0] + 1 - arm[1]:
            self.fired["comes beside"] += bool(-self.reference.w2 <= lateral <= 0)
            return False
        return -self.reference.w2 <= lateral <= 0

    def free(self, k: int, n: int, v: int, arm: tuple[int, int], came: int) -> bool:
        """Whether a lane out of v is free for n, which came there by the lane `came` or is to."""
        facts = self.past[k]
        own = self.mouth(arm, facts[n]["spot"])
        for other in self.cars:
            if other == n:
                continue
            nearer = facts[other]["at"] == v and self.mouth(arm, facts[other]["spot"]) < own
            if nearer and self.contends(k, other, v, came, arm):
                self.fired["nearer"] += 1
                return False
            if self.takes(k, other, v, arm):
                return False
        barred = self.barred(arm)
        self.fired["narrow exit"] += barred
        return not barred

    def barred(self, arm: tuple[int, int]) -> bool:
        """Whether an obstacle narrows a lane out of a disc, next to that."""
        radius, gap = self.problem.intersection_radius, self.rules.exit_gap
        end = radius + max(gap, 2 * self.problem.car.body.reach + gap / 4)
        for obstacle in self.problem.obstacles:
            reach = self.reference.obstacle_range(arm, obstacle, radius, end)
            if reach is not None and self.reference.narrows(*reach):
                return True
        return False

    def may_leave(self, k: int, n: int) -> bool:
        """E4: whether some exit is free of the disc that the body meets."""
        v = self.past[k][n]["crosses"]
        if v < 0:
            return False
        came = self.came_by(k, n)
        found = any(self.free(k, n, v, arm, came) for arm in self.exits_of(k, n, v))
        if self.gone(k, n, v):
            self.fired["gone out"] += not found
        elif not found and any(self.free(k, n, v, arm, came) for arm in self.arms(v)):
            self.fired["way back"] += 1
        return found

    def shared(self, k: int, n: int) -> bool:
        """E4: whether the tick that ends in frame k does not count for a car in a disc."""
        v = self.past[k][n]["crosses"]
        if v < 0 or self.past[k][0]["crosses"] != v:
            return False
        ego, own = self.since(k, 0), self.since(k, n)
        if any(self.gone(m, n, v) for m in range(own, k + 1)):
            self.fired["out before the ego"] += ego >= own
            return False
        lately = k - ego <= self.ticks(self.rules.shared_time)
        if ego >= own:
            self.fired["same tick" if ego == own else "later"] += lately
        return ego >= own and lately

    def way(self, k: int, n: int) -> str:
        """E5: whether the way of a car is "free", or it is excused "for a while", or while it is so (empty)."""
        facts, ego = self.past[k][n], self.past[k][0]
        if facts["lane"] < 0 or (facts["stopped"] and not (facts["first"] and facts["clear"])):
            return ""
        lane = divmod(facts["lane"], 2)
        if facts["left"]:
            hems = 2.0 * self.problem.car.body.reach + self.rules.overtaking_behind
            near = n != 0 and math.dist(facts["spot"], ego["spot"]) <= hems
            self.fired["left by the ego"] += near
            return "for a while" if near else "free"
        if self.narrow_ahead(k, n, lane) or self.lacks_room(k, n, lane):
            return ""
        v = self.reference.toward(lane)
        begins = self.reference.length(lane[0]) - self.problem.intersection_radius
        if self.reference.crossing(v) or begins - facts["progress"] > self.rules.way_distance:
            return "free"
        return self.may_enter(k, n, v, facts["lane"])

    def narrow_ahead(self, k: int, n: int, lane: tuple[int, int]) -> bool:
        """E5: whether a body narrows the lane of a car before it."""
        here, reach = self.past[k][n]["progress"], self.rules.way_distance
        for other in self.cars:
            its = self.past[k][other]
            if other == n or its["segment"] != lane[0]:
                continue
            ahead = self.reference.coordinates(lane, *its["spot"])[0] - here
            if 0 < ahead <= reach and self.reference.narrows(*its["sides"][lane]):
                return True
        return False

    def shut(self, lane: tuple[int, int], begin: float, end: float) -> bool:
        """Whether an obstacle narrows a lane between two places."""
        sides = [self.reference.obstacle_range(lane, one, begin, end) for one in self.problem.obstacles]
        return any(side is not None and self.reference.narrows(*side) for side in sides)

    def lacks_room(self, k: int, n: int, lane: tuple[int, int]) -> bool:
        """E5: whether an obstacle narrows the lane of a car before it, and the car may not be able to pass it now."""
        facts, reach = self.past[k][n], self.rules.way_distance
        here, length = facts["progress"], self.reference.length(lane[0])
        if not self.shut(lane, here, here + reach):
            return False
        body = self.problem.car.body
        long = body.length if isinstance(body, Rectangle) else 0.0
        room = (1.5 if self.problem.network.bent[lane[0]] else 1.0) * (long + 0.85 * self.rules.overtaking_behind)
        returns = length - self.problem.intersection_radius - room
        if self.shut(lane, max(here, returns), here + reach):
            self.fired["obstacle by the disc"] += 1
            return True
        if self.shut((lane[0], 1 - lane[1]), length - here - 2.0 * reach, length - here):
            self.fired["obstacles on both sides"] += 1
            return True
        for other in self.cars:
            its = self.past[k][other]
            follows = other == 0 and not its["stands"]
            along = self.reference.coordinates(lane, *its["spot"])[0]
            in_disc_behind = its["at"] == self.reference.toward((lane[0], 1 - lane[1]))
            same = in_disc_behind or (its["lane"] == facts["lane"] and not its["left"])
            self.fired["the ego stands behind"] += (
                other == 0 and same and here - reach <= along < here and its["stands"]
            )
            self.fired["one in the disc behind an obstacle"] += in_disc_behind and its["segment"] == lane[0]
            rear = here - reach if follows else here
            behind = same and along < rear
            there = its["segment"] == lane[0] and not behind
            if other != n and (there or its["crosses"] == facts["toward"]):
                self.fired["not alone at an obstacle"] += 1
                return True
        self.fired["alone at an obstacle"] += 1
        return False

    def may_enter(self, k: int, n: int, v: int, lane: int) -> str:
        """E5: whether an exit of a bend or dead end is "free", and neither the ego nor one of the same lane is in it.

        If only no exit is free, and it is no goal, the car is excused "for a while".
        """
        for other in self.cars:
            if other == n or self.past[k][other]["crosses"] != v:
                continue
            if other == 0:
                self.fired["ego in the bend"] += 1
                return ""
            if self.came_by(k, other) == lane:
                self.fired["one in the bend"] += 1
                return ""
        found = any(self.free(k, n, v, arm, lane) for arm in self.exits(v, lane))
        self.fired["full bend"] += not found
        goal = self.reference.points[v] in [self.reference.points[g] for g in self.problem.goal_vertices]
        return "free" if found else "" if goal or len(self.arms(v)) > 2 else "for a while"

    def held(self, k: int, v: int) -> bool:
        """E6: whether the tick that ends in frame k does not count for the goal v."""
        there = [n for n in self.cars if n and self.past[k][n]["at"] == v]
        ego = self.past[k][0]["spot"]
        for n in there:
            came = self.came_by(k, n)
            if any(self.free(k, n, v, arm, came) for arm in self.exits_of(k, n, v)):
                return False
        for n in there:
            for arm in self.exits_of(k, n, v):
                if self.mouth(arm, ego) <= self.rules.goal_gap:
                    return True
        waiting = {0}
        while more := {n for n in self.cars if n not in waiting and self.waits(k, n, waiting)}:
            waiting |= more
        self.fired["E6 waits"] += bool(waiting & set(there))
        return bool(waiting & set(there))

    def waits(self, k: int, n: int, waiting: set[int]) -> bool:
        """E6: whether a car waits for one of those that wait for the ego."""
        facts, reach = self.past[k][n], self.rules.way_distance
        lane, v = facts["lane"], facts["crosses"]
        for other in waiting:
            its = self.past[k][other]
            if lane >= 0:
                ahead = its["lane"] == lane and 0 < its["progress"] - facts["progress"] <= reach
                begins = self.reference.length(lane // 2) - self.problem.intersection_radius
                arrives = begins - facts["progress"] <= reach and its["crosses"] == facts["toward"]
                if ahead or arrives or (facts["blocked"] and its["segment"] == lane // 2):
                    return True
            if v >= 0 and not facts["leaves"]:
                exits = self.exits_of(k, n, v)
                if its["crosses"] == v or any(self.fills(k, n, other, v, arm) for arm in exits):
                    return True
        return False

    def fills(self, k: int, n: int, other: int, v: int, arm: tuple[int, int]) -> bool:
        """Whether a car is why a lane out of v is not free for car n."""
        came = self.came_by(k, n)
        nearer = self.mouth(arm, self.past[k][other]["spot"]) < self.mouth(arm, self.past[k][n]["spot"])
        within = self.past[k][other]["at"] == v and nearer and self.contends(k, other, v, came)
        return within or self.takes(k, other, v, arm)

    def ticks(self, duration: float) -> int:
        return self.reference.ticks(duration)

    def runs(self, holds: Callable[[int], bool]) -> list[range]:
        """Return the runs of frames in which `holds`."""
        found: list[range] = []
        for k in range(len(self.past)):
            if holds(k):
                begin = found.pop().start if found and found[-1].stop == k else k
                found.append(range(begin, k + 1))
        return found

    def breaches(self) -> Found:
        found: Found = set()
        for n in self.cars:
            found |= self.road(n) | self.lane(n) | self.entries(n)
            found |= self.assumption(n) if n else set()
        return found | self.goals()

    def long(self, rule: str, n: int, duration: float, holds: Callable[[int], bool]) -> Found:
        wait = self.ticks(duration)
        return {(rule, n, run.start + wait, run.start) for run in self.runs(holds) if len(run) > wait}

    def road(self, n: int) -> Found:
        on = [facts[n]["on_road"] for facts in self.past]
        return {("1.road", n, k, k) for k in range(1, len(on)) if on[k - 1] and not on[k]}

    def lane(self, n: int) -> Found:
        past = self.past
        left = self.runs(lambda k: past[k][n]["left"])
        alone = self.runs(lambda k: past[k][n]["left"] and not past[k][n]["overtaking"])
        since = {run.start: next(long.start for long in left if run.start in long) for run in alone}
        found = {("2.left", n, tick, begin) for tick, begin in since.items()}
        found |= {("2.turn", n, k, k) for k, frame in enumerate(past) if frame[n]["turned"]}
        return found | self.long(
            "2.return",
            n,
            self.rules.left_time,
            lambda k: past[k][n]["left"] and not past[k][n]["hemmed"],
        )

    def entries(self, n: int) -> Found:
        found: Found = set()
        for k in range(1, len(self.past)):
            facts, before = self.past[k][n], self.past[k - 1]
            if not (facts["entered"] and facts["in_crossing"]):
                continue
            v = facts["crosses"]
            if not (before[n]["stopped"] and before[n]["toward"] == v):
                found.add(("3.stop", n, k, k))
            elif before[n]["ahead"]:
                found.add(("3.order", n, k, k))
            if any(before[other]["crosses"] == v for other in self.cars if other != n):
                found.add(("3.clear", n, k, k))
        return found

    def assumption(self, n: int) -> Found:
        past, rules = self.past, self.rules
        found = self.long("E3.enter", n, rules.enter_time, lambda k: past[k][n]["first"] and past[k][n]["clear"])
        found |= self.tickets(n)
        return found | self.owed[n]

    def tickets(self, n: int) -> Found:
        """E3: by waits, which begin with a stop and end where the body meets the disc or with the lane state."""
        found: Found = set()
        begun, taken = -1, 0
        for k in range(len(self.past)):
            facts, before = self.past[k][n], self.past[k - 1][n] if k else None
            meets = facts["crosses"] >= 0 and facts["crosses"] == facts["toward"]
            if begun >= 0 and (meets or facts["lane"] != before["lane"]):
                begun = -1
            if not facts["stopped"] or facts["ticket"] != k:
                continue
            if begun < 0:
                begun, taken = k, 0
                continue
            taken += 1
            self.fired["stopped again"] += not before["stopped"]
            if taken == self.rules.tickets + 1:
                found.add(("E3.tickets", n, k, begun))
        return found

    def counted(
        self,
        who: tuple[str, int],
        duration: float,
        holds: Callable[[int], bool],
        counts: Callable[[int], bool],
    ) -> Found:
        """Return the breach of each run of frames in which `holds` for so many ticks that end where they `count`."""
        found: Found = set()
        for run in self.runs(holds):
            spent = [k for k in run[1:] if counts(k)]
            wait = self.ticks(duration)
            if len(spent) < len(run) - 1:
                self.fired[f"{who[0]} paused"] += 1
            if wait == 0:
                found.add((*who, run.start, run.start))
            elif len(spent) >= wait:
                found.add((*who, spent[wait - 1], run.start))
        return found

    def goals(self) -> Found:
        found: Found = set()
        for v in set(self.problem.goal_vertices):
            at = [[n for n in self.cars if n and facts[n]["at"] == v] for facts in self.past]
            for _, _, tick, begin in self.counted(
                ("E6", 0), self.rules.goal_time, lambda k, at=at: bool(at[k]),
                lambda k, v=v: not self.held(k, v),
            ):  # fmt: skip
                began = {n: max((k for k in range(tick) if n not in at[k]), default=-1) for n in at[tick]}
                found.add(("E6", min(at[tick], key=lambda n, began=began: (began[n], n)), tick, begin))
        return found
