"""The rules once more, slowly: every breach of a script from the whole history of the reference's propositions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from dubins_traffic.problem.instance import Instance
from dubins_traffic.spec.parameters import RuleParameters
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
        for frame in script:
            self.reference.frame(frame)
            self.past.append([self.note(car) for car in self.reference.cars])

    def note(self, car: Car) -> dict[str, Any]:
        toward = -1 if car.lane is None else self.reference.toward(car.lane)
        return {
            **car.facts, "toward": toward, "ticket": car.ticket, "forfeits": car.forfeits,
            "exit": car.crosses >= 0 and any(self.free(car, arm) for arm in self.arms(car.crosses)),
            "way": self.way(car),
        }  # fmt: skip

    def arms(self, v: int) -> list[tuple[int, int]]:
        return [(s, ends.index(v)) for s, ends in enumerate(self.reference.ends) if v in ends]

    def free(self, car: Car, arm: tuple[int, int]) -> bool:
        radius, gap, v = self.problem.intersection_radius, self.rules.exit_gap, car.crosses

        def way_out(who: Car) -> float:
            s, lateral = self.reference.coordinates(arm, *who.pose[:2])
            return math.hypot(s - radius, lateral + self.problem.car.w)

        for other in self.reference.cars:
            if other is car or self.reference.gap(other, v) > gap:
                continue
            if other.at == v:
                if way_out(other) < way_out(car):
                    return False
                continue
            reach = self.reference.lateral_range(arm, other)[0]
            if other.facts["segment"] == arm[0] and reach < -self.rules.left_set:
                return False
        for obstacle in self.problem.obstacles:
            reach = self.reference.obstacle_range(arm, obstacle, radius, radius + gap)
            if reach is not None and self.reference.narrows(*reach):
                return False
        return True

    def way(self, car: Car) -> bool:
        facts = car.facts
        if car.lane is None or not facts["stands"] or facts["blocked"] or facts["stopped"]:
            return False
        return not any(
            0 < self.reference.s(other) - self.reference.s(car) <= self.rules.way_distance
            and (other.facts["stands"] or other.facts["excused"] or other.facts["stopped"])
            for other in self.reference.cars
            if other.lane == car.lane
        )

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
            found |= self.lane(n) | self.entries(n)
            found |= self.road() if n == 0 else self.assumption(n)
        return found | self.goals()

    def long(self, rule: str, n: int, duration: float, holds: Callable[[int], bool]) -> Found:
        wait = self.ticks(duration)
        return {(rule, n, run.start + wait, run.start) for run in self.runs(holds) if len(run) > wait}

    def road(self) -> Found:
        on = [facts[0]["on_road"] for facts in self.past]
        return {("1.road", 0, k, k) for k in range(1, len(on)) if on[k - 1] and not on[k]}

    def lane(self, n: int) -> Found:
        past = self.past
        left = self.runs(lambda k: past[k][n]["left"])
        alone = self.runs(lambda k: past[k][n]["left"] and not past[k][n]["overtaking"])
        since = {run.start: next(long.start for long in left if run.start in long) for run in alone}
        found = {("2.left", n, tick, begin) for tick, begin in since.items()}
        return found | self.long("2.return", n, self.rules.left_time, lambda k: past[k][n]["left"])

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
        found = self.long(
            "E3.enter", n, rules.enter_time, lambda k: past[k][n]["first"] and past[k][n]["clear"]
        )
        for wait in self.runs(lambda k: past[k][n]["stopped"]):
            over = [k for k in wait if past[k][n]["forfeits"] > rules.tickets]
            found |= {("E3.tickets", n, k, wait.start) for k in over[:1]}
        for v in range(len(self.reference.points)):
            found |= self.long(
                "E4", n, rules.exit_time, lambda k, v=v: past[k][n]["exit"] and past[k][n]["crosses"] == v
            )
        return found | self.long("E5", n, rules.rest_time, lambda k: past[k][n]["way"])

    def goals(self) -> Found:
        found: Found = set()
        for v in set(self.problem.goal_vertices):
            at = [[n for n in self.cars if n and facts[n]["at"] == v] for facts in self.past]
            for run in self.runs(lambda k, at=at: bool(at[k])):
                tick = run.start + self.ticks(self.rules.goal_time)
                if tick in run:
                    began = {n: max((k for k in range(tick) if n not in at[k]), default=-1) for n in at[tick]}
                    found.add(
                        ("E6", min(at[tick], key=lambda n, began=began: (began[n], n)), tick, run.start)
                    )
        return found
