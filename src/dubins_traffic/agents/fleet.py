"""All e-agents of a batch as one driver: one compiled call per tick."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from dubins_traffic.above import ABOVE
from dubins_traffic.agents.kernel import decide
from dubins_traffic.agents.kinds import Lists, fill
from dubins_traffic.agents.nudge import nudge
from dubins_traffic.agents.own import OwnAgents
from dubins_traffic.agents.tables import (
    STEP,
    Agent,
    Agents,
    Point,
    Scene,
    Stretch,
    Team,
    Trail,
    wider,
    workspace,
)
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.problem.kinds import ALONE, COUNTER, FREE, KEEP_RULES, NUDGED, OWN
from dubins_traffic.protocols import Draws, Driver, Reports
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.roads.table import RoadTable

if TYPE_CHECKING:
    from dubins_traffic.agents.free import FreeCars
    from dubins_traffic.agents.lawful import Lawful
    from dubins_traffic.problem.instance import Instance

REMEMBERED = 12.0
"""Length of the ego's path that is remembered in addition to the gap, metres (for w = 0.3 m)."""
PAIRS = 64


class Playing(Driver, Draws, Reports, Protocol):
    """Drives the e-agents of kind `counter`, all of a trial as one team."""


class Fleet:
    """Drives the e-agents of every instance of a batch (a `protocols.Driver`).

    The commands depend on the states since `reset`, the instances and their seeds alone, so trials of a batch do not
    influence each other. The ego's commands are not written; those written for remote cars mean nothing.

    Notes
    -----
    `wander` is the reference behaviour of 2016: it begins toward the end of the lane it stands in, drives straight
    to the far end of the right lane of each segment it picks, and at a dead end first crosses to the start of the
    lane back. Two things differ where 2016 does not reach: no motion overshoots within a tick, so that it works at
    any control rate; and toward waypoints more than 3.5 m away the bearing tolerance shrinks, so that it stays on
    the road. Cars that can't turn in place pursue the lane's line on arcs instead; a turning radius above the
    lane's offset takes them off the road where a road ends. Cars with a smallest speed can't stop for anything.
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a batch, of one control rate, whose first frame is `state`."""
        cars = state.x.shape[1]
        kinds = {agent.driver.kind for instance in instances for agent in instance.e_agents}
        self._lawful = _lawful() if kinds & KEEP_RULES else None
        if self._lawful is not None:
            self._lawful.reset(instances, state)
        self._counter = _counter() if COUNTER in kinds else None
        if self._counter is not None:
            self._counter.reset(instances, state)
        self._own = OwnAgents() if OWN in kinds else None
        if self._own is not None:
            self._own.reset(instances, state)
        self._others = not kinds <= KEEP_RULES | ALONE
        self._roads, net = pack_distinct(
            [instance.problem.network for instance in instances],
            [instance.problem.car.lane_width for instance in instances],
        )
        free = any(agent.kind == FREE for instance in instances for agent in instance.e_agents)
        self._free = _free(instances, cars, self._roads, net) if free else None
        self._obstacles = pack_obstacles([instance.problem.obstacles for instance in instances])
        self._agents = pack_agents(instances, cars, net)
        self._work = workspace(cars, PAIRS, 2 * int(np.diff(self._roads.seg_off).max()))
        self._call = bound(decide)
        self._nudge = bound(nudge)
        self._scene = Scene(state, self._roads, self._obstacles, self._agents, self._work)

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of the e-agents for [t_k, t_k+1) into `commands` (B, N, 2)."""
        if self._others:
            self._decide_others(tick, state, commands)
        if self._lawful is not None:
            self._lawful.decide(tick, state, labels, commands)
            if self._free is not None:
                self._free.decide(tick, state, self._lawful.drivers, commands)
        if self._counter is not None:
            self._counter.decide(tick, state, labels, commands)
        if self._own is not None:
            self._own.decide(tick, state, labels, commands)
        if len(self._agents.recalled):
            self._nudge(tick, commands, self._agents)

    def report(self) -> Sequence[tuple[str, str]]:
        """Return the reports of the team of kind `counter` and of the user's own e-agents."""
        told = () if self._counter is None else self._counter.report()
        return told if self._own is None else (*told, *self._own.report())

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed."""
        self._agents.team["seed"] = seed
        for team in (self._lawful, self._counter, self._own):
            if team is not None:
                team.reseed(seed)

    def _decide_others(self, tick: int, state: State, commands: Floats) -> None:
        if state is not self._scene.state:
            self._scene = self._scene.replace(state=state)
        done = 0
        while done < commands.shape[0]:
            reached = self._call(tick, done, commands, self._scene)
            done = reached
            if reached < 0:
                done = -1 - reached
                self._work = wider(self._work)
                self._scene = self._scene.replace(space=self._work)


def pack_agents(instances: Sequence[Instance], cars: int, net: Ints) -> Agents:
    """Return the tables of the e-agents of a batch, (B, cars), except those driven by other classes.

    `net` (B,) holds the number of each trial's road network.
    """
    agents = table(Agent, (len(instances), cars))
    lists = Lists()
    elsewhere = KEEP_RULES | ALONE
    fleets, whose = distinct([id(instance.e_agents) for instance in instances])
    kinds = [{agent.driver.kind for agent in instances[b].e_agents} for b in fleets]
    driven = np.array([not kind <= elsewhere for kind in kinds])[whose]
    for b in np.flatnonzero(driven).tolist():
        instance = instances[b]
        for n, agent in enumerate(instance.e_agents, start=1):
            if agent.driver.kind not in elsewhere:
                fill(instance, agent.driver, agents[b, n], lists)
    steps = table(Stretch, len(lists.script))
    for step, (end, speed, yaw_rate) in enumerate(lists.script):
        steps[step].end, steps[step].speed, steps[step].yaw_rate = end, speed, yaw_rate
    recalled = _recalled(instances, agents)
    trail, point = _trails(agents, min(instance.problem.car.w for instance in instances))
    return Agents(
        team=_teams(instances, agents, net),
        agent=agents,
        cycle=np.array(lists.cycle, dtype=np.int64),
        script=steps,
        trail=trail,
        point=point,
        recalled=recalled,
    )


def _lawful() -> Lawful:
    """Return the driver of the cars that keep the rules; its kernels are imported only if there are such cars."""
    from dubins_traffic.agents.lawful import Lawful

    return Lawful()


def _counter() -> Playing:
    """Return the driver of the cars that play a counterstrategy, which a room above has."""
    return ABOVE.parts("e-agents")[COUNTER]()()


def _free(instances: Sequence[Instance], cars: int, roads: RoadTable, net: Ints) -> FreeCars:
    """Return what lets cars do anything within E1 to E6; its kernels are imported only if there are such cars."""
    from dubins_traffic.agents.free import FreeCars

    return FreeCars(instances, cars, roads, net)


def _teams(instances: Sequence[Instance], agents: Rows[Agent], net: Ints) -> Rows[Team]:
    """Return `Agents.team`."""
    cars = pack_cars([instance.problem.car for instance in instances])
    slowest = np.maximum(cars.speed_low, 0.0)
    yaw_rates = agents["yaw_rate"]
    turns = np.where(yaw_rates > 0.0, yaw_rates, np.inf).min(axis=1)
    teams = table(Team, len(instances))
    teams["seed"] = [instance.seed for instance in instances]
    teams["trial"] = [instance.trial for instance in instances]
    teams["net"] = net
    teams["curves"] = (cars.turning_radius > 0.0) | (slowest > 0.0)
    teams["span"] = agents["stop"].max(axis=1) + cars.reach
    teams["period"] = [instance.problem.period for instance in instances]
    teams["slowest"] = slowest
    teams["radius"] = np.maximum(cars.turning_radius, slowest / turns)
    for name in ("w", "half_length", "half_width", "rounding"):
        teams[name] = getattr(cars, name)
    return teams


def _recalled(instances: Sequence[Instance], agents: Rows[Agent]) -> Floats:
    """Fill in delay and noise of the cars that are nudged; return `Agents.recalled`."""
    count = longest = 0
    for b, instance in enumerate(instances):
        for n, e_agent in enumerate(instance.e_agents, start=1):
            if e_agent.kind == NUDGED:
                agent = agents[b, n]
                agent.recall, agent.delay = count, e_agent.parameters["delay"]
                agent.noise, agent.fastest = (
                    e_agent.parameters["speed_noise"],
                    instance.problem.car.bounds.speed,
                )
                count, longest = count + 1, max(longest, agent.delay)
    return np.zeros((count, longest + 1, 2))


def _trails(agents: Rows[Agent], w: float) -> tuple[Rows[Trail], Rows[Point]]:
    """Give every car that follows the ego a ring buffer of its path; return `Agents.trail` and `Agents.point`."""
    follows = agents["trail"] == 0
    followers = int(follows.sum())
    agents["trail"][follows] = np.arange(followers)
    points = math.ceil((float(agents["gap"].max()) + REMEMBERED) / (STEP * w / 0.3)) + 2
    return table(Trail, followers), table(Point, (followers, points))
