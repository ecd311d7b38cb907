"""The e-agents `lawful`, `nemesis` and `chosen`, which the law of the road (`policies.rules.policy`) drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dubins_traffic.agents.choices import cut, empty, from_rows
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import Rows, numbers, stack, table
from dubins_traffic.policies.rules.fitness import check_fit, check_foresight, check_speeds
from dubins_traffic.policies.rules.kept import KeptPath, kept_commands
from dubins_traffic.policies.rules.policy import decide
from dubins_traffic.policies.rules.tables import (
    GOES,
    KIND,
    Driver,
    Drivers,
    Leg,
    Traffic,
    scratch,
    vehicles_of,
)
from dubins_traffic.problem.draw import cycle_lanes
from dubins_traffic.problem.kinds import FREE, KEEP_RULES, parameters_of
from dubins_traffic.roads.packing import pack_distinct

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem


class Lawful:
    """Drives the e-agents of a batch that keep the rules (a `protocols.Driver`); all others are left alone."""

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a batch whose first frame is `state`; InputError if its cars can't keep the rules."""
        cars = state.x.shape[1]
        for instance in instances:
            if any(agent.driver.kind in KEEP_RULES for agent in instance.e_agents):
                check_fit(instance.problem, owes=True)
                check_speeds(instance)
        roads, net = pack_distinct(
            [instance.problem.network for instance in instances],
            [instance.problem.car.lane_width for instance in instances],
        )
        drivers = pack_drivers(instances, cars, net)
        for b, instance in enumerate(instances):
            if instance.disturbances.reach_e_agents:
                check_foresight(instance, drivers.vehicle[b])
        self._decide = bound(decide)
        bodies = pack_obstacles([instance.problem.obstacles for instance in instances])
        self._traffic = Traffic(
            state,
            Labels.zeros(*state.x.shape),
            roads,
            bodies,
            drivers,
            scratch(cars, int(np.diff(roads.seg_off).max()), bodies),
        )

    @property
    def drivers(self) -> Drivers:
        """What the law knows of the cars."""
        return self._traffic.drivers

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed."""
        self._traffic.drivers.seed[:] = seed

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of these cars for [t_k, t_k+1) into `commands` (B, N, 2)."""
        if state is not self._traffic.state or labels is not self._traffic.labels:
            self._traffic = self._traffic.replace(state=state, labels=labels)
        self._decide(tick, commands, self._traffic)


def pack_drivers(
    instances: Sequence[Instance], cars: int, net: Ints, rounds: Sequence[tuple[Ints, Floats]] = ()
) -> Drivers:
    """Return the cars of a batch with `cars` places a trial that keep the rules.

    Parameters
    ----------
    instances
        One per trial.
    cars
        Places for cars in a trial.
    net : (B,)
        Number of each trial's road network.
    rounds
        What `routing.rounds.stages` returns for each trial whose ego keeps the rules; by default no ego does.
    """
    fleets, whose = distinct([(id(instance.e_agents), id(instance.problem.car)) for instance in instances])
    rows = [_fleet(instances[b], cars) for b in fleets]
    drivers: Rows[Driver] = stack([row.cars for row in rows])[whose]
    first = 0
    for b, (stages, _) in enumerate(rounds):
        if len(stages):
            ego = drivers[b, EGO]
            ego.kind, ego.first, ego.last = KIND.ROUND, first, first + len(stages)
            ego.speed = instances[b].problem.car.bounds.speed
            first += len(stages)
    stage: list[int] = []
    for stages, _ in rounds:
        stage += stages.tolist()
    distance = _one_below_another([far for _, far in rounds])
    _add_stages([instance.problem for instance in instances], rows, whose, drivers, stage)
    numbers: list[int] = whose.tolist()
    choice = _add_choices([rows[number].choice for number in numbers], drivers)
    return drivers_of(instances, net, drivers, np.array(stage, dtype=np.int64), distance, choice)


def _add_choices(tables: Sequence[Mapping[int, Floats]], drivers: Rows[Driver]) -> Rows[Leg]:
    """Return the choices of all cars of all trials as one table; fill in which rows are whose."""
    chosen: list[Floats] = [empty(0)]
    first = 0
    for b, choices in enumerate(tables):
        for n, rows in choices.items():
            drivers[b, n].choice = first
            first += len(rows)
            chosen.append(rows)
    legs = np.concatenate(chosen)
    rows = table(Leg, len(legs))
    if len(legs):
        numbers(rows, np.float64)[:] = legs
    return rows


def _one_below_another(tables: Sequence[Floats]) -> Floats:
    """Return the rows of all tables as one; narrower tables are padded with infinities."""
    widest = max((rows.shape[1] for rows in tables), default=0)
    whole = [np.zeros((0, widest))]
    for rows in tables:
        short = widest - rows.shape[1]
        whole.append(np.pad(rows, ((0, 0), (0, short)), constant_values=np.inf) if short else rows)
    return np.concatenate(whole)


def drivers_of(
    instances: Sequence[Instance],
    net: Ints,
    cars: Rows[Driver],
    stage: Ints,
    distance: Floats,
    choice: Rows[Leg] | None = None,
) -> Drivers:
    """Return the drivers of a batch, `cars` (B, N), before the first tick."""
    return Drivers(
        active=(cars["kind"] != KIND.ABSENT).any(axis=1).astype(np.int64),
        net=net,
        seed=np.array([instance.seed for instance in instances], dtype=np.uint64),
        trial=np.array([instance.trial for instance in instances], dtype=np.int64),
        vehicle=vehicles_of(
            [instance.problem for instance in instances],
            [instance.disturbances.reach_e_agents for instance in instances],
        ),
        car=cars,
        way=table(KeptPath, cars.shape),
        command=kept_commands(*cars.shape),
        stage=stage,
        distance=distance,
        choice=table(Leg, 0) if choice is None else choice,
    )


class _Fleet(NamedTuple):
    """The cars of a trial that keep the rules: their rows, which of them go to goals, the cycles of the others, and
    what is chosen for them.
    """

    cars: Rows[Driver]
    goers: list[int]
    loops: list[tuple[int, Sequence[Sequence[int]]]]
    choice: dict[int, Floats]


def _fleet(instance: Instance, cars: int) -> _Fleet:
    fleet = _Fleet(table(Driver, cars), [], [], {})
    for n, given_agent in enumerate(instance.e_agents, start=1):
        agent = given_agent.driver
        if agent.kind in KEEP_RULES:
            given = {**_defaults(agent.kind), **agent.parameters}
            _describe(agent.kind, given, instance.problem.car.bounds.speed, fleet.cars[n])
            fleet.cars[n].whims = given_agent.kind == FREE
            rows = given.get("choices", ())
            if rows:
                fleet.choice[n] = cut(from_rows(rows), fleet.cars[n].speed, instance.problem)
                fleet.cars[n].choices = len(fleet.choice[n])
            if fleet.cars[n].kind == KIND.LOOP:
                fleet.loops.append((n, given["cycle"]))
            else:
                fleet.goers.append(n)
    return fleet


@cache
def _defaults(kind: str) -> Mapping[str, Any]:
    return parameters_of(kind, {})


def _describe(kind: str, given: Mapping[str, Any], fastest: float, car: Driver) -> None:
    """Fill the row of a car but for its stages."""
    car.speed = car.usual_speed = min(given["speed"], fastest)
    car.kind = KIND.NEMESIS if kind == "nemesis" else GOES[given["goes"]]
    if kind == "lawful":
        car.departs = given["departs_after"]
        car.rolls, car.lefts, car.blocks = given["rolls"], given["left"], given["blocks"]
        car.tailgates, car.parks, car.park_time = given["tailgates"], given["parks"], given["parks_for"]
    elif kind == "chosen":
        car.departs = given["departs_after"]


def _add_stages(
    problems: Sequence[Problem], fleets: Sequence[_Fleet], whose: Ints, cars: Rows[Driver], stage: list[int]
) -> None:
    """Append each trial's goals, at which cars may park, and the lanes of its loops to `stage`.

    Trial b has the cars of fleets[whose[b]], which are described by cars[b].
    """
    numbers: list[int] = whose.tolist()
    begin, end = cars["first"], cars["last"]
    goals: list[tuple[int, int]] = []
    for b, (problem, number) in enumerate(zip(problems, numbers, strict=True)):
        fleet, first = fleets[number], len(stage)
        if fleet.goers or fleet.loops:
            stage += dict.fromkeys(problem.goal_vertices)
        goals.append((first, len(stage)))
        for n, cycle in fleet.loops:
            begin[b, n] = len(stage)
            stage += cycle_lanes(problem.network, cycle)
            end[b, n] = len(stage)
    spans = np.array(goals, dtype=np.int64)
    for number, fleet in enumerate(fleets):
        trials = np.flatnonzero(whose == number)[:, None]
        bound_by_e6 = [*fleet.goers, *(n for n, _ in fleet.loops)]
        for k, (first, own_goals) in enumerate((("first", "goal_first"), ("last", "goal_last"))):
            cars[first][trials, fleet.goers] = spans[trials, k]
            cars[own_goals][trials, bound_by_e6] = spans[trials, k]
