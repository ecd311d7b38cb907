"""All e-agents of a batch as one driver: one compiled call per tick."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.agents.kernel import decide
from dubins_traffic.agents.own import OwnAgents
from dubins_traffic.agents.tables import (
    FOLLOW,
    KINDS,
    LOOP,
    PARKED,
    SCRIPTED,
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
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.kernels.trig import sincos
from dubins_traffic.problem.cycles import cycle_lanes
from dubins_traffic.problem.kinds import ALONE, COUNTER, KEEP_RULES, OWN, parameters_of
from dubins_traffic.roads.table import pack_distinct

if TYPE_CHECKING:
    from dubins_traffic.agents.counter import CounterTeam
    from dubins_traffic.agents.lawful import Lawful
    from dubins_traffic.problem.instance import EAgent, Instance

AS_FAR_AS_2016 = 3.5
"""Up to this far from its waypoint (metres, for w = 0.3 m) a car keeps the bearing tolerance of 2016."""
WIDEST = 1.5
"""Bearing tolerances above this count as this, rad."""
MARGIN = 0.05
"""A car that stops for others keeps at least this between the bodies, metres."""
EVERYWHERE = 1e150
NEVER = 2**62
REMEMBERED = 12.0
"""How much of the ego's path is remembered beside the gap, metres (for w = 0.3 m)."""
PAIRS = 64


class Fleet:
    """Drives the e-agents of every instance of a batch (a `protocols.Driver`).

    The commands are a function of the states since `reset`, the instances and their seeds, and of nothing else:
    trials of a batch do not touch each other. The ego's commands are left alone; those of remote cars are whatever.

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
        kinds = {agent.kind for instance in instances for agent in instance.e_agents}
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
        self._obstacles = pack_obstacles([instance.problem.obstacles for instance in instances])
        self._agents = pack_agents(instances, cars, net)
        self._work = workspace(cars, PAIRS, 2 * int(np.diff(self._roads.seg_off).max()))
        self._call = bound(decide)
        self._scene = Scene(state, self._roads, self._obstacles, self._agents, self._work)

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of the e-agents for [t_k, t_k+1) into `commands` (B, N, 2)."""
        if self._others:
            self._decide_others(tick, state, commands)
        if self._lawful is not None:
            self._lawful.decide(tick, state, labels, commands)
        if self._counter is not None:
            self._counter.decide(tick, state, labels, commands)
        if self._own is not None:
            self._own.decide(tick, state, labels, commands)

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what the cars that play a counterstrategy and the user's own have to say."""
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
    """Return the e-agents of a batch with `cars` places a trial, but for those that keep the rules.

    `net` holds the number of each trial's road network.
    """
    agents = table(Agent, (len(instances), cars))
    cycle: list[int] = []
    script: list[tuple[float, float, float]] = []
    elsewhere = KEEP_RULES | ALONE
    fleets, whose = distinct([id(instance.e_agents) for instance in instances])
    kinds = [{agent.kind for agent in instances[b].e_agents} for b in fleets]
    driven = np.array([not own <= elsewhere for own in kinds])[whose]
    for b in np.flatnonzero(driven).tolist():
        instance = instances[b]
        for n, agent in enumerate(instance.e_agents, start=1):
            if agent.kind in elsewhere:
                continue
            given = _parameters(agent)
            _habits(instance, agent.kind, given, agents[b, n])
            _plan(instance, given, agents[b, n], agent.kind, cycle, script)
    steps = table(Stretch, len(script))
    for step, (end, speed, yaw_rate) in zip(range(len(script)), script, strict=True):
        steps[step].end, steps[step].speed, steps[step].yaw_rate = end, speed, yaw_rate
    trail, point = _trails(agents, min(instance.problem.car.w for instance in instances))
    return Agents(
        team=_teams(instances, agents, net),
        agent=agents,
        cycle=np.array(cycle, dtype=np.int64),
        script=steps,
        trail=trail,
        point=point,
    )


def _lawful() -> Lawful:
    """Return the driver of the cars that keep the rules; what it needs is compiled only where there are such cars."""
    from dubins_traffic.agents.lawful import Lawful

    return Lawful()


def _counter() -> CounterTeam:
    """Return the driver of the cars that play a counterstrategy."""
    from dubins_traffic.agents.counter import CounterTeam

    return CounterTeam()


@cache
def _defaults(kind: str) -> Mapping[str, Any]:
    return parameters_of(kind, {"commands": []} if kind == "scripted" else {})


def _parameters(agent: EAgent) -> Mapping[str, Any]:
    if agent.kind not in KINDS:
        raise InputError(
            "unknown kind of e-agent", field="kind", value=agent.kind, expected=" or ".join(KINDS)
        )
    return {**_defaults("wander"), **_defaults(agent.kind), **agent.parameters}


def _plan(
    instance: Instance,
    given: Mapping[str, Any],
    agent: Agent,
    kind: str,
    cycle: list[int],
    script: list[tuple[float, float, float]],
) -> None:
    agent.kind = KINDS[kind]
    patience = given["patience"]
    agent.patience = -1 if patience is None else math.ceil(patience * instance.problem.rate - 1e-9)
    if agent.kind == LOOP:
        agent.first = len(cycle)
        cycle += cycle_lanes(instance.problem.network, given["cycle"])
        agent.last = len(cycle)
    elif agent.kind == SCRIPTED:
        agent.first = len(script)
        script += script_rows(given["commands"], instance.problem.rate)
        agent.last = len(script)
        agent.repeat = given["repeat"]
    elif agent.kind == PARKED:
        after = given["vacates_after"]
        agent.begin = NEVER if after is None else math.ceil(after * instance.problem.rate - 1e-9)


def _habits(instance: Instance, kind: str, given: Mapping[str, Any], agent: Agent) -> None:
    """Say how an e-agent drives, turns and keeps away from others."""
    car = instance.problem.car
    speed = max(min(given["speed"], car.bounds.speed), car.bounds.speed_low)
    cosine, sine = sincos(min(given["bearing_tolerance"], WIDEST))
    tangent = sine / cosine
    stop = given["stop_range"]
    if stop > 0.0:
        stop = max(stop, car.body.reach + speed * instance.problem.period + MARGIN)
    sensing = kind == "follow" and given["sensing_only"]
    agent.offset = given["offset"] * car.lane_width
    agent.reached = given["waypoint_radius"]
    agent.tangent = tangent
    agent.miss = tangent * AS_FAR_AS_2016 * car.w / 0.3
    agent.stop = 0.0 if kind == "scripted" else stop
    agent.berth = given["ego_range"] if kind in ("wander", "parked") else -1.0
    agent.speed = speed
    agent.yaw_rate = min(given["yaw_rate"], car.bounds.yaw_rate)
    agent.gap = given.get("gap", 0.0)
    agent.sight = instance.problem.sensing_radius if sensing else EVERYWHERE


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


def _trails(agents: Rows[Agent], w: float) -> tuple[Rows[Trail], Rows[Point]]:
    """Give every car that follows a ring for the ego's path; return `Agents.trail` and `Agents.point`."""
    follows = agents["kind"] == FOLLOW
    followers = int(follows.sum())
    agents["trail"][follows] = np.arange(followers)
    points = math.ceil((float(agents["gap"].max()) + REMEMBERED) / (STEP * w / 0.3)) + 2
    return table(Trail, followers), table(Point, (followers, points))


def script_rows(commands: Sequence[Sequence[float]], rate: float) -> list[tuple[float, float, float]]:
    """Return (tick at which it ends, speed, yaw rate) of commands given as [seconds, speed, yaw rate].

    A time t, counted from the beginning of the script, is reached with tick ceil(t * rate - 1e-9).
    """
    rows: list[tuple[float, float, float]] = []
    time = 0.0
    for seconds, speed, yaw_rate in commands:
        time += seconds
        rows.append((float(math.ceil(time * rate - 1e-9)), float(speed), float(yaw_rate)))
    return rows
