"""The controller `rules`: the shortest round through the goals under all the rules of the road."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Labels, Observation, State, put_observed
from dubins_traffic.cars.tables import ObstacleTable, pack_obstacles
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.policies.in_flight import InFlight
from dubins_traffic.policies.rules.fitness import check_fit
from dubins_traffic.policies.rules.kept import KeptPath, kept_commands
from dubins_traffic.policies.rules.policy import decide
from dubins_traffic.policies.rules.tables import (
    KIND,
    Driver,
    Drivers,
    Leg,
    Scratch,
    Traffic,
    scratch,
    vehicles_of,
)
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.packing import pack
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.routing.rounds import stages


class Rules:
    """Drives round the goals in the right lane, stops, waits its turn, and passes what stands.

    Notes
    -----
    The goals are visited in the order of the shortest closed route along lanes (`routing.tours.find_round`), each by
    the lane that this route takes; from wherever the car is, it goes the shortest way there. It enters a crossing when
    it is its turn and there is room behind it; in time it takes another exit if there is none. A last look before
    every tick rules out all motions that could bring about a contact. Without goals that can be reached it stands.
    """

    def __init__(self) -> None:
        self._drivers: Drivers | None = None
        self._traffic: Traffic | None = None
        self._decide = bound(decide)

    def start(self, problem: Problem) -> None:
        """Find the round through the goals; InputError if the car can't keep the rules."""
        check_fit(problem, owes=False)
        self._in_flight = InFlight(problem)
        cars = 1 + len(problem.e_agents)
        stage, distance = stages(problem.network, problem.goal_vertices)
        self._state = State.zeros(1, cars)
        self._labels = Labels.zeros(1, cars)
        self._command = np.zeros((1, cars, 2))
        self._roads: RoadTable = pack([problem.network], [problem.car.lane_width])
        self._obstacles: ObstacleTable = pack_obstacles([problem.obstacles])
        self._scratch: Scratch = scratch(cars, len(problem.network.segments), self._obstacles)
        if not len(stage):
            return
        rows = table(Driver, (1, cars))
        ego = rows[0, EGO]
        ego.kind, ego.first, ego.last = KIND.ROUND, 0, len(stage)
        ego.speed = problem.car.bounds.speed
        self._drivers = Drivers(
            active=np.ones(1, dtype=np.int64),
            net=np.zeros(1, dtype=np.int64),
            seed=np.zeros(1, dtype=np.uint64),
            trial=np.zeros(1, dtype=np.int64),
            vehicle=vehicles_of([problem], [True]),
            car=rows,
            way=table(KeptPath, (1, cars)),
            command=kept_commands(1, cars),
            stage=stage,
            distance=distance,
            choice=table(Leg, 0),
        )

    def act(self, observation: Observation) -> Command:
        """Return the command of the law of the road."""
        drivers = self._drivers
        if drivers is None:
            return Command(0.0, 0.0)
        observation = self._in_flight.ahead(observation)
        put_observed(self._state, self._labels, observation)
        ego = drivers.car[0, EGO]
        if ego.place < 0:
            seen = observation.propositions
            ego.place = nearest_stage(drivers.distance, 0, len(drivers.stage), seen.lane, seen.segment)
        traffic = self._traffic
        if traffic is None or traffic.drivers is not drivers:
            tables = (self._state, self._labels, self._roads, self._obstacles, drivers, self._scratch)
            traffic = self._traffic = Traffic(*tables)
        self._decide(observation.tick, self._command, traffic)
        speed, yaw_rate = self._command[0, EGO].tolist()
        return self._in_flight.sent(Command(speed, yaw_rate))
