"""The stages of `tests.contract_scenes`: roads, cars, and where things stand on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from random import Random
from typing import Any, Final

import numpy as np

from dubins_traffic.cars.body import Body, Car, Disc, DiscObstacle, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.protocols import Controller
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import RuleParameters

RADIUS: Final = 1.0
BODIES: Final[tuple[Body, ...]] = (Disc(0.177), Rectangle(0.4, 0.25), Rectangle(0.62, 0.28))
SOON: Final[Mapping[str, float]] = {
    "rest_time": 10.0, "journey_start_time": 5.0, "goal_time": 20.0, "shared_time": 10.0
}  # fmt: skip
"""Limits by which a blocker is named soon; only where no car is `lawful`, which may need longer."""
ELBOW: Final = ((0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 2, 1))
RING: Final = ((0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 0, 1), (0, 1, 0, 0))
TEE: Final = ((0, 0, 1, 0), (1, 0, 2, 0), (1, 0, 1, 1))


class Stage:
    """A network, cars and a random choice of distances, on which scenes place what they are about."""

    def __init__(
        self,
        number: int,
        segments: tuple[tuple[int, int, int, int], ...] | None = None,
        *,
        fixed: bool = False,
        body: Body | None = None,
    ) -> None:
        self.dice = dice = Random(number)
        self.rate = (10.0, 30.0)[number % 2]
        self.body: Body = body or BODIES[number // 2 % len(BODIES)]
        length = dice.choice((3.3, 4.0, 5.0))
        move = (dice.uniform(-9.0, 9.0), dice.uniform(-9.0, 9.0), dice.uniform(-3.0, 3.0))
        if number % 5 == 4 and not fixed:
            self.network = _drawn(number, self.body)
        elif segments is None:
            rows, columns = dice.choice(((2, 2), (2, 3), (3, 3)))
            self.network = RoadNetwork.grid(rows, columns, length, move)
        else:
            extent = (1 + max(max(s[1::2]) for s in segments), 1 + max(max(s[::2]) for s in segments))
            self.network = RoadNetwork(segments, length, move, extent)
        self.obstacles: list[DiscObstacle] = []

    def length(self, lane: int) -> float:
        """Return the length of a lane, metres."""
        return float(self.network.lengths[lane >> 1])

    @property
    def reach(self) -> float:
        """The farthest point of a body, metres."""
        return self.body.reach

    def pose(self, lane: int, s: float, lateral: float = -0.3, turn: float = 0.0) -> Pose:
        """Return the pose at progress `s` (m) of a lane, `turn` radians left of along it."""
        if self.network.bent[lane >> 1]:
            way = self.length(lane) - s if lane & 1 else s
            (point,), (along,) = self.network.chains.places(lane >> 1, np.array([way]))
            x, y = point
            angle = math.atan2(along[1], along[0]) + math.pi * (lane & 1)
            x, y = float(x - lateral * math.sin(angle)), float(y + lateral * math.cos(angle))
        else:
            (x0, y0), (x1, y1) = self.network.lane_line(lane, lateral)
            angle = math.atan2(y1 - y0, x1 - x0)
            x, y = x0 + s * math.cos(angle), y0 + s * math.sin(angle)
        return Pose(x, y, math.cos(angle + turn), math.sin(angle + turn))

    def lane_into(self, degree: int) -> int:
        """Return a lane that ends where as many roads meet."""
        lanes = [
            lane ^ 1
            for v in range(len(self.network.intersections))
            for lane in self.network.arms(v)
            if min(len(self.network.arms(v)), 3) == degree
        ]
        return self.dice.choice(lanes or list(range(self.network.lanes)))

    def end(self, lane: int) -> int:
        """Return the intersection at a lane's end."""
        return next(v for v in range(len(self.network.intersections)) if lane ^ 1 in self.network.arms(v))

    def exit_of(self, lane: int) -> int:
        """Return a lane out of the disc at a lane's end, not the way back where there is another."""
        arms = [out for out in self.network.arms(self.end(lane)) if out != lane ^ 1]
        return self.dice.choice(arms) if arms else lane ^ 1

    def block(self, lane: int, s: float, lateral: float = -0.3, radius: float = 0.15) -> None:
        """Put an obstacle into a lane."""
        place = self.pose(lane, s, lateral)
        self.obstacles.append(DiscObstacle(place.x, place.y, radius))

    def instance(
        self,
        ego: Pose,
        agents: Sequence[tuple[str, Mapping[str, Any], Pose]],
        goals: Sequence[int],
        seconds: float,
        rules: Mapping[str, float],
    ) -> Instance:
        """Return the instance of e-agents, each of a kind or of a class of `contract_drivers`."""
        made: list[EAgent] = []
        for n, (kind, given, _) in enumerate(agents):
            if kind == "lawful":
                made.append(EAgent(kind, f"car{n}", kind, parameters_of(kind, given)))
            else:
                own = f"tests.contract_drivers:{kind}"
                made.append(EAgent("own", f"car{n}", own, dict(given)))
        places = self.network.intersections
        problem = Problem(
            self.network, tuple(places[v] for v in goals), RADIUS, Car(0.3, self.body), self.rate, 5.0, None,
            tuple(self.obstacles), tuple(agent.name for agent in made), RuleParameters.from_mapping(rules).to_mapping(),
        )  # fmt: skip
        starts = (ego, *(pose for _, _, pose in agents))
        return Instance(problem, starts, seconds, tuple(made), 5, 0)


def _drawn(number: int, body: Body) -> RoadNetwork:
    """Return a random network of which some roads bend."""
    roads = {"random": {"intersections": 6, "segments": 6 + number % 2, "bent": 0.4 * (number % 3)}}
    own = {"disc": {"radius": body.radius}} if isinstance(body, Disc) else {"rectangle": asdict(body)}
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "network": roads, "rules": True, "car": {"body": own},
        "number_trials": 1, "number_goals_bounds": [1, 1], "duration_bounds": [1, 1],
    }  # fmt: skip
    return draw(load_config(document), 7, number).problem.network


Made = tuple[Instance, "str | Controller"]
Scene = Callable[[int], Made]
Placed = list[tuple[str, Mapping[str, Any], Pose]]
