"""All e-agents of a batch as one driver: one compiled call per tick."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.agents.kernel import decide
from dubins_traffic.agents.plans import cycle_lanes, script_rows
from dubins_traffic.agents.tables import (
    FOLLOW,
    KINDS,
    LOOP,
    SCRIPTED,
    STEP,
    Build,
    Cast,
    Law,
    Memory,
    workspace,
)
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.trig import sincos
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.roads.table import RoadTable, pack

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import EAgent, Instance

AS_FAR_AS_2016 = 3.5
"""Up to this far from its waypoint (metres, for w = 0.3 m) a car keeps the bearing tolerance of 2016."""
WIDEST = 1.5
"""Bearing tolerances above this count as this, rad."""
MARGIN = 0.05
"""A car that stops for others keeps at least this between the bodies, metres."""
ANYWHERE = 1e150
TRAIL = 12.0
"""How much of the ego's path is remembered beside the gap, metres (for w = 0.3 m)."""
PAIRS = 64


class Fleet:
    """Drives the e-agents of every instance of a batch (a `protocols.Driver`).

    The commands are a function of the states since `reset`, the instances and their seeds, and of nothing else:
    trials of a batch do not touch each other. The ego's commands are left alone.

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
        trials, cars = state.x.shape
        self._roads, net = _pack_roads(instances)
        self._obstacles = pack_obstacles([instance.problem.obstacles for instance in instances])
        law = np.zeros((trials, cars, len(Law._fields)))
        kind = np.full((trials, cars), -1, dtype=np.int64)
        begin = np.zeros((trials, cars), dtype=np.int64)
        plan = np.zeros((trials, cars, 3), dtype=np.int64)
        gap = np.zeros((trials, cars))
        sight = np.full((trials, cars), ANYWHERE)
        cycle: list[int] = []
        script: list[tuple[float, float, float]] = []
        for b, instance in enumerate(instances):
            for n, agent in enumerate(instance.e_agents, start=1):
                given = _parameters(agent)
                kind[b, n] = KINDS[agent.kind]
                law[b, n] = _law(instance, agent.kind, given)
                if kind[b, n] == LOOP:
                    lanes = cycle_lanes(instance.problem.network, given["cycle"])
                    plan[b, n] = (len(cycle), len(cycle) + len(lanes), 1)
                    cycle += lanes
                elif kind[b, n] == SCRIPTED:
                    rows = script_rows(given["commands"], instance.problem.rate)
                    plan[b, n] = (len(script), len(script) + len(rows), int(given["repeat"]))
                    script += rows
                elif kind[b, n] == FOLLOW:
                    gap[b, n] = given["gap"]
                    if given["sensing_only"]:
                        sight[b, n] = instance.problem.sensing_radius
                elif agent.kind == "parked":
                    begin[b, n] = _vacates(given["vacates_after"], instance)
        self._cast = Cast(
            net=net,
            seed=np.array([instance.seed for instance in instances], dtype=np.uint64),
            trial=np.array([instance.trial for instance in instances], dtype=np.int64),
            build=_builds(instances, law),
            law=law,
            kind=kind,
            begin=begin,
            plan=plan,
            gap=gap,
            sight=sight,
            cycle=np.array(cycle, dtype=np.int64),
            script=np.array(script, dtype=np.float64).reshape(len(script), 3),
        )
        self._memory = _memory(kind, gap, min(instance.problem.car.w for instance in instances))
        self._work = workspace(cars, PAIRS, 2 * int(np.diff(self._roads.seg_off).max()))

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:  # noqa: ARG002
        """Write the commands of the e-agents for [t_k, t_k+1) into `commands` (B, N, 2)."""
        done = 0
        while done < commands.shape[0]:
            reached = decide(
                tick,
                done,
                state,
                self._roads,
                self._obstacles,
                self._cast,
                self._memory,
                self._work,
                commands,
            )
            done = reached
            if reached < 0:
                done = -1 - reached
                pairs = 4 * len(self._work.pair)
                self._work = self._work._replace(pair=np.zeros((pairs, 2), dtype=np.int64))


@cache
def _defaults(kind: str) -> Mapping[str, Any]:
    return parameters_of(kind, {"commands": []} if kind == "scripted" else {})


def _parameters(agent: EAgent) -> Mapping[str, Any]:
    if agent.kind not in KINDS:
        raise InputError(
            "unknown kind of e-agent", field="kind", value=agent.kind, expected=" or ".join(KINDS)
        )
    return {**_defaults("wander"), **_defaults(agent.kind), **agent.parameters}


def _vacates(after: float | None, instance: Instance) -> int:
    ticks = 2**62 if after is None else math.ceil(after * instance.problem.rate - 1e-9)
    return max(ticks, 0)


def _pack_roads(instances: Sequence[Instance]) -> tuple[RoadTable, np.ndarray[Any, np.dtype[np.int64]]]:
    numbers: dict[tuple[int, float], int] = {}
    networks = []
    widths: list[float] = []
    net = np.zeros(len(instances), dtype=np.int64)
    for b, instance in enumerate(instances):
        key = (id(instance.problem.network), instance.problem.car.w)
        if key not in numbers:
            numbers[key] = len(networks)
            networks.append(instance.problem.network)
            widths.append(2.0 * instance.problem.car.w)
        net[b] = numbers[key]
    return pack(networks, widths), net


def _law(instance: Instance, kind: str, given: Mapping[str, Any]) -> Law:
    car = instance.problem.car
    slowest = max(car.bounds.speed_low, 0.0)
    speed = max(min(given["speed"], car.bounds.speed), slowest)
    cosine, sine = sincos(min(given["bearing_tolerance"], WIDEST))
    stop = given["stop_range"]
    if stop > 0.0:
        stop = max(stop, car.body.reach + speed * instance.problem.period + MARGIN)
    return Law(
        offset=given["offset"] * car.lane_width,
        reached=given["waypoint_radius"],
        tangent=sine / cosine,
        miss=sine / cosine * AS_FAR_AS_2016 * car.w / 0.3,
        stop=0.0 if kind == "scripted" else stop,
        berth=given["ego_range"] if kind in ("wander", "parked") else -1.0,
        speed=speed,
        yaw_rate=min(given["yaw_rate"], car.bounds.yaw_rate),
    )


def _builds(instances: Sequence[Instance], law: Floats) -> Floats:
    cars = pack_cars([instance.problem.car for instance in instances])
    span = law[:, :, Law._fields.index("stop")].max(axis=1) + cars.reach
    slowest = np.maximum(cars.speed_low, 0.0)
    columns = Build(
        span=span,  # pyright: ignore[reportArgumentType]
        period=np.array([instance.problem.period for instance in instances]),  # pyright: ignore[reportArgumentType]
        slowest=slowest,  # pyright: ignore[reportArgumentType]
        radius=np.maximum(cars.turning_radius, slowest / cars.yaw_rate),  # pyright: ignore[reportArgumentType]
        curves=((cars.turning_radius > 0.0) | (slowest > 0.0)).astype(np.float64),  # pyright: ignore[reportArgumentType]
        w=cars.w,  # pyright: ignore[reportArgumentType]
        half_length=cars.half_length,  # pyright: ignore[reportArgumentType]
        half_width=cars.half_width,  # pyright: ignore[reportArgumentType]
        rounding=cars.rounding,  # pyright: ignore[reportArgumentType]
    )
    return np.ascontiguousarray(np.stack(list(columns), axis=1))


def _memory(kind: np.ndarray[Any, np.dtype[np.int64]], gap: Floats, w: float) -> Memory:
    follows = kind == FOLLOW
    followers = int(follows.sum())
    trail = np.full(kind.shape, -1, dtype=np.int64)
    trail[follows] = np.arange(followers)
    points = math.ceil((float(gap.max()) + TRAIL) / (STEP * w / 0.3)) + 2
    return Memory(
        lane=np.full(kind.shape, -1, dtype=np.int64),
        leg=np.zeros(kind.shape, dtype=np.int64),
        place=np.full(kind.shape, -1, dtype=np.int64),
        goal=np.zeros((*kind.shape, 2)),
        trail=trail,
        path=np.zeros((followers, points, 3)),
        mark=np.full((followers, 3), 0, dtype=np.int64) - np.array([0, 1, 0]),
        last=np.zeros((followers, 3)),
    )
