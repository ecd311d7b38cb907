"""Small drivers that block or provoke, as e-agents (``tests.contract_drivers:Swings``) and, by `AsEgo`, as egos."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any, ClassVar

from dubins_traffic.cars.state import Command, Observation, Pose
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.rules.propositions import FLAG

SLACK = 0.03
"""A point is reached within this distance, metres."""


class Driver:
    """The base of all: stands."""

    parameters: ClassVar[Mapping[str, Any]] = {}

    def begin(self, instance: Instance, car: int, parameters: Mapping[str, Any]) -> None:  # noqa: ARG002  # as all e-agents
        """Begin as e-agent number `car`."""
        self.prepare(instance.problem, parameters)

    def prepare(self, problem: Problem, parameters: Mapping[str, Any]) -> None:
        """Take the problem and the parameters; defaults are filled in."""
        self.problem, self.own = problem, parameters
        self.start: Pose | None = None

    def act(self, seen: Observation) -> tuple[float, float]:
        """Choose speed and yaw rate."""
        if self.start is None:
            self.start = seen.pose
        return self.drive(seen)

    def drive(self, seen: Observation) -> tuple[float, float]:  # noqa: ARG002  # others look
        """Choose speed and yaw rate; by default it stands."""
        return 0.0, 0.0

    def gone(self, seen: Observation) -> float:
        """Return how far it is from where it started, along the way it looked then, metres."""
        assert self.start is not None
        x, y = seen.pose.x - self.start.x, seen.pose.y - self.start.y
        return x * self.start.c + y * self.start.s

    def turn_to(self, seen: Observation, x: float, y: float) -> float:
        """Return how far left of its heading a place is that lies `x`, `y` metres from it, radians."""
        return math.atan2(y * seen.pose.c - x * seen.pose.s, x * seen.pose.c + y * seen.pose.s)

    def spin(self, turn: float) -> tuple[float, float]:
        """Return speed and yaw rate of turning on the spot by so many radians, as far as a tick allows."""
        most = self.problem.car.bounds.yaw_rate
        return 0.0, max(-most, min(most, turn * self.problem.rate))

    def bend_at(self, pose: Pose, beyond: float = 0.0) -> int:
        """Return the bend in whose disc a place is, or at most `beyond` metres from it, -1 for none."""
        nearest, far = self.problem.network.nearest_intersection(pose[:2])
        inside = float(far) < self.problem.intersection_radius + beyond
        return int(nearest) if inside and self.problem.network.degrees[nearest] == 2 else -1

    def speed_to(self, far: float) -> float:
        """Return the speed that goes as far in a tick, m/s."""
        most = self.problem.car.bounds.speed
        return max(-most, min(most, far * self.problem.rate))


class Stands(Driver):
    """Stands where it starts."""


class Swings(Driver):
    """Goes to and fro along its way: `back` metres behind its start in the first half of each period, then returns.

    It waits `after` seconds before the first time; a negative `back` begins ahead. It moves toward nobody who is close.
    """

    parameters: ClassVar = {"back": 0.31, "period": 8.0, "after": 0.0, "speed": 0.3}

    def drive(self, seen: Observation) -> tuple[float, float]:
        time = seen.time - self.own["after"]
        there = time >= 0.0 and time % self.own["period"] < 0.5 * self.own["period"]
        speed = self.speed_to((-self.own["back"] if there else 0.0) - self.gone(seen))
        speed = max(-self.own["speed"], min(self.own["speed"], speed))
        return 0.0 if self._is_toward(seen, speed) else speed, 0.0

    def _is_toward(self, seen: Observation, speed: float) -> bool:
        """Tell whether a speed brings it closer to a car that is close, as far as these may come in a tick."""
        reach = 2.0 * self.problem.car.body.reach + 2.0 * self.problem.car.bounds.speed / self.problem.rate
        for other in seen.others:
            x, y = other.pose.x - seen.pose.x, other.pose.y - seen.pose.y
            if math.hypot(x, y) < reach and (x * seen.pose.c + y * seen.pose.s) * speed > 0.0:
                return True
        return False


class Crawls(Driver):
    """Drives straight on at a speed for a distance, then stands."""

    parameters: ClassVar = {"speed": 0.06, "far": 1.0}

    def drive(self, seen: Observation) -> tuple[float, float]:
        return min(self.own["speed"], self.speed_to(max(self.own["far"] - self.gone(seen), 0.0))), 0.0


class Spins(Driver):
    """Turns on the spot, to and fro by `angle` radians at `rate` rad/s."""

    parameters: ClassVar = {"angle": 1.0, "rate": 1.0}

    def drive(self, seen: Observation) -> tuple[float, float]:
        half = self.own["angle"] / self.own["rate"]
        return 0.0, self.own["rate"] if seen.time % (2.0 * half) < half else -self.own["rate"]


class Tours(Driver):
    """Goes from point to point for ever, turning on the spot, and waits at each for as long as its third number says.

    It does not move while a car is close before it, unless it is `rude`.
    """

    parameters: ClassVar = {"points": (), "speed": 0.7, "gap": 0.5, "rude": False}

    def prepare(self, problem: Problem, parameters: Mapping[str, Any]) -> None:
        super().prepare(problem, parameters)
        self.next, self.until = 0, -1.0

    def drive(self, seen: Observation) -> tuple[float, float]:
        points: Sequence[Sequence[float]] = self.own["points"]
        x, y, wait = points[self.next]
        dx, dy = x - seen.pose.x, y - seen.pose.y
        far = math.hypot(dx, dy)
        if far < SLACK:
            self.until = seen.time + wait if self.until < 0.0 else self.until
            if seen.time >= self.until:
                self.next, self.until = (self.next + 1) % len(points), -1.0
            return 0.0, 0.0
        turn = self.turn_to(seen, dx, dy)
        if abs(turn) > 0.02:
            return self.spin(turn)
        if not self.own["rude"] and self._is_barred(seen):
            return 0.0, 0.0
        return min(self.own["speed"], self.speed_to(far)), 0.0

    def _is_barred(self, seen: Observation) -> bool:
        for other in seen.others:
            x, y = other.pose.x - seen.pose.x, other.pose.y - seen.pose.y
            along, across = x * seen.pose.c + y * seen.pose.s, y * seen.pose.c - x * seen.pose.s
            if 0.0 < along < self.own["gap"] + 0.62 and abs(across) < 0.4:
                return True
        return False


class Presses(Driver):
    """Drives up close beside whoever is in a bend, `side` radians left of the way that he looks, and stays there."""

    parameters: ClassVar = {"side": 2.0, "gap": 0.02}

    def drive(self, seen: Observation) -> tuple[float, float]:
        poses = [other.pose for other in seen.others if self.bend_at(other.pose) >= 0]
        found = [(math.dist(pose[:2], seen.pose[:2]), pose) for pose in poses]
        if not found:
            return 0.0, 0.0
        far, its = min(found)
        away = 2.0 * self.problem.car.body.reach + self.own["gap"]
        angle = math.atan2(its.s, its.c) + self.own["side"]
        x, y = its.x + away * math.cos(angle) - seen.pose.x, its.y + away * math.sin(angle) - seen.pose.y
        if far > 2.5 or math.hypot(x, y) < 0.01:
            return 0.0, 0.0
        turn = self.turn_to(seen, x, y)
        if abs(turn) > 0.2:
            return self.spin(turn)
        return self.speed_to(math.hypot(x, y)), turn


class Faces(Driver):
    """Stands; drives straight up to a car ahead that is near, until a gap is left.

    Only the ego counts, or only who is left of the centre line if it `minds` that.
    """

    parameters: ClassVar = {"near": 3.0, "gap": 0.1, "speed": 0.3, "minds": False}

    def drive(self, seen: Observation) -> tuple[float, float]:
        body, most = self.problem.car.body, self.problem.car.bounds.speed
        far = math.inf
        for other in seen.others:
            x, y = other.pose.x - seen.pose.x, other.pose.y - seen.pose.y
            wanted = other.propositions.bits & FLAG.LEFT if self.own["minds"] else other.index == 0
            if wanted and x * seen.pose.c + y * seen.pose.s > 0.0:
                far = min(far, math.hypot(x, y) - 2.0 * body.reach)
        # It may not close in on who comes as fast as it can.
        if far > self.own["near"] or far < self.own["gap"] + 2.0 * most / self.problem.rate:
            return 0.0, 0.0
        return min(self.own["speed"], self.speed_to(far - self.own["gap"])), 0.0


class Lawful(Driver):
    """Drives as the controller `rules` does round the goals of the ego; the base of those with a habit."""

    def prepare(self, problem: Problem, parameters: Mapping[str, Any]) -> None:
        super().prepare(problem, parameters)
        self.rules = Rules()
        self.rules.start(problem)

    def drive(self, seen: Observation) -> tuple[float, float]:
        law = self.rules.act(seen)
        return self.habit(seen, law)

    def habit(self, seen: Observation, law: Command) -> tuple[float, float]:  # noqa: ARG002  # others look
        """Choose speed and yaw rate, knowing what the law would do."""
        return law


class Holds(Lawful):
    """Keeps the law, but holds at every crossing for `hold` seconds of its turn."""

    parameters: ClassVar = {"hold": 9.0}
    GOES = FLAG.STOPPED | FLAG.FIRST | FLAG.CLEAR

    def habit(self, seen: Observation, law: Command) -> tuple[float, float]:
        first = seen.propositions.bits & self.GOES == self.GOES
        self.since: float = getattr(self, "since", -1.0) if first else -1.0
        if first and self.since < 0.0:
            self.since = seen.time
        return (0.0, 0.0) if first and seen.time - self.since < self.own["hold"] else law


class Slow(Lawful):
    """Keeps the law at a crawl."""

    parameters: ClassVar = {"speed": 0.06}

    def habit(self, seen: Observation, law: Command) -> tuple[float, float]:  # noqa: ARG002  # others look
        share = min(1.0, self.own["speed"] / max(abs(law.speed), 1e-9))
        return law.speed * share, law.yaw_rate * share


class Bars(Lawful):
    """Keeps the law, but bars the ego's way in a bend that is no goal, once the ego has come in after it.

    It drives up before the ego if it `cuts`; then, or else at once, it stands.
    """

    parameters: ClassVar = {"speed": 0.5, "cuts": False}
    NEARLY = 0.6

    def habit(self, seen: Observation, law: Command) -> tuple[float, float]:
        here = self._bend(seen.pose)
        ego = next((other.pose for other in seen.others if other.index == 0), None)
        before = here == getattr(self, "here", -1)
        self.here = here
        self.first: bool = here >= 0 and (self.first if before else ego is None or self._bend(ego) != here)
        if not self.first or ego is None or self._bend(ego) != here:
            share = min(1.0, self.own["speed"] / max(abs(law.speed), 1e-9))
            return law.speed * share, law.yaw_rate * share
        return self._before(seen, ego, here) if self.own["cuts"] else (0.0, 0.0)

    def _bend(self, pose: Pose) -> int:
        """Return the bend that a body at a pose meets and that is no goal, -1 for none."""
        bend = self.bend_at(pose, self.problem.car.body.reach)
        return -1 if bend in self.problem.goal_vertices else bend

    def _before(self, seen: Observation, ego: Pose, bend: int) -> tuple[float, float]:
        """Drive toward where the ego will be, and stand as soon as that is close."""
        x, y = ego.x + self.NEARLY * ego.c - seen.pose.x, ego.y + self.NEARLY * ego.s - seen.pose.y
        reach = 2.0 * self.problem.car.body.reach + 3.0 * self.problem.car.bounds.speed / self.problem.rate
        close = math.hypot(ego.x - seen.pose.x, ego.y - seen.pose.y) < reach
        there = self.problem.network.points[bend]
        inside = math.dist((seen.pose.x, seen.pose.y), there) < 0.9 * self.problem.intersection_radius
        if close or not inside or math.hypot(x, y) < SLACK:
            return 0.0, 0.0
        turn = self.turn_to(seen, x, y)
        return self.spin(turn) if abs(turn) > 0.2 else (self.own["speed"], turn)


class Whims(Lawful):
    """Does as the law says, or anything, for a second or so at a time; meant for the shield."""

    parameters: ClassVar = {"seed": 0, "share": 0.6}

    def habit(self, seen: Observation, law: Command) -> tuple[float, float]:
        if seen.tick == 0:
            self.dice, self.until, self.obeys = Random(self.own["seed"]), 0.0, True
        if seen.time >= self.until:
            self.until = seen.time + self.dice.uniform(0.2, 3.0)
            self.obeys = self.dice.random() > self.own["share"]
            bounds = self.problem.car.bounds
            self.whim = (
                self.dice.choice((-1.0, 0.0, 0.1, 1.0)) * bounds.speed * self.dice.random(),
                self.dice.choice((-1.0, 0.0, 1.0)) * bounds.yaw_rate * self.dice.random(),
            )
        return law if self.obeys else self.whim


class AsEgo:
    """A driver as the controller of an ego."""

    def __init__(self, driver: Driver, **parameters: Any) -> None:
        self._driver, self._parameters = driver, {**driver.parameters, **parameters}

    def start(self, problem: Problem) -> None:
        """Begin a trial."""
        self._driver.prepare(problem, self._parameters)

    def act(self, observation: Observation) -> Command:
        """Do as the driver does."""
        return Command(*self._driver.act(observation))
