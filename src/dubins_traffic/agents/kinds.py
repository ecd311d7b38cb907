"""The kinds of e-agents that run compiled: how each fills a car's row from its parameters, and how it drives.

A kind consists of its parameters in `problem.kinds` and, here, of a function that fills the row of a car and, if it
drives unlike the others, of a branch of `act`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

from dubins_traffic.agents.driving import drive, pose_of
from dubins_traffic.agents.script import play, script_rows
from dubins_traffic.agents.tables import HELD, Agent, Scene
from dubins_traffic.agents.trail import follow
from dubins_traffic.cars.state import EGO
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import sincos
from dubins_traffic.problem.draw import cycle_lanes
from dubins_traffic.problem.kinds import parameters_of

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import EAgent, Instance


class _Does(NamedTuple):
    """What a car does, `Agent.does`."""

    DRIVES: int = 0
    """On lanes."""
    FOLLOWS: int = 1
    """The ego while that leads it."""
    PLAYS: int = 2
    """A script."""


DOES: Final = _Does()
AS_FAR_AS_2016 = 3.5
"""Within this distance of its waypoint (metres, for w = 0.3 m) a car has the bearing tolerance of 2016."""
WIDEST = 1.5
"""Largest bearing tolerance, rad."""
MARGIN = 0.05
"""Least gap between the bodies that a car which stops for others keeps, metres."""
NEVER = 2**62


@jit
def act(b: int, n: int, tick: int, held: int, scene: Scene) -> tuple[float, float]:
    """Return speed and yaw rate that an e-agent asks for; `held` (bits of `tables.HELD`) says what holds it."""
    agent = scene.agents.agent[b, n]
    free, seen = tick >= agent.begin and held & HELD.SEES == 0, False
    if agent.does == DOES.PLAYS:
        return play(tick, agent, scene.agents.script)
    pose = pose_of(scene.state, b, n)
    if agent.does == DOES.FOLLOWS:
        ego = pose_of(scene.state, b, EGO)
        seen, free, speed, yaw_rate = follow(tick, b, n, pose, ego, free, scene.agents)
        if not free:
            return speed, yaw_rate
    return drive(b, n, tick, pose, seen, held & HELD.WEARY != 0, scene) if free else (0.0, 0.0)


@dataclass
class Lists:
    """What the cars of a batch drive along, one car's rows after another's: lanes of cycles, steps of scripts."""

    cycle: list[int] = field(default_factory=list[int])
    script: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])


Parameters: TypeAlias = Mapping[str, Any]
Pack: TypeAlias = "Callable[[Instance, Parameters, Agent, Lists], None]"
"""Completes the row of a car of one kind, in which `fill` has set all that is common to the kinds."""


def _wander(instance: Instance, given: Parameters, agent: Agent, lists: Lists) -> None:  # noqa: ARG001
    agent.berth = given["ego_range"]


def _loop(instance: Instance, given: Parameters, agent: Agent, lists: Lists) -> None:
    agent.first = len(lists.cycle)
    lists.cycle += cycle_lanes(instance.problem.network, given["cycle"])
    agent.last = len(lists.cycle)


def _follow(instance: Instance, given: Parameters, agent: Agent, lists: Lists) -> None:  # noqa: ARG001
    agent.does, agent.trail, agent.gap = DOES.FOLLOWS, 0, given["gap"]
    if given["sensing_only"]:
        agent.sight = instance.problem.sensing_radius


def _parked(instance: Instance, given: Parameters, agent: Agent, lists: Lists) -> None:
    _wander(instance, given, agent, lists)
    after = given["vacates_after"]
    agent.begin = NEVER if after is None else math.ceil(after * instance.problem.rate - 1e-9)


def _scripted(instance: Instance, given: Parameters, agent: Agent, lists: Lists) -> None:
    agent.does, agent.stop = DOES.PLAYS, 0.0
    agent.first = len(lists.script)
    lists.script += script_rows(given["commands"], instance.problem.rate)
    agent.last = len(lists.script)
    agent.repeat = given["repeat"]


PACKS: dict[str, Pack] = {
    "wander": _wander,
    "loop": _loop,
    "follow": _follow,
    "parked": _parked,
    "scripted": _scripted,
}
"""The function that completes the row of a car, by kind."""


def fill(instance: Instance, planned: EAgent, agent: Agent, lists: Lists) -> None:
    """Fill the row of an e-agent: how it drives, turns and keeps away from others, and what its kind says.

    Raises
    ------
    InputError
        If there is no such kind here.
    """
    if planned.kind not in PACKS:
        raise InputError("unknown kind of e-agent", field="kind", value=planned.kind, expected=" or ".join(PACKS))
    given = {**_defaults("wander"), **_defaults(planned.kind), **planned.parameters}
    car, rate, patience = instance.problem.car, instance.problem.rate, given["patience"]
    speed = max(min(given["speed"], car.bounds.speed), car.bounds.speed_low)
    cosine, sine = sincos(min(given["bearing_tolerance"], WIDEST))
    stop = given["stop_range"]
    if stop > 0.0:
        stop = max(stop, car.body.reach + speed * instance.problem.period + MARGIN)
    agent.does = DOES.DRIVES
    agent.patience = -1 if patience is None else math.ceil(patience * rate - 1e-9)
    agent.offset = given["offset"] * car.lane_width
    agent.reached = given["waypoint_radius"]
    agent.tangent = sine / cosine
    agent.miss = agent.tangent * AS_FAR_AS_2016 * car.w / 0.3
    agent.stop = stop
    agent.speed = speed
    agent.yaw_rate = min(given["yaw_rate"], car.bounds.yaw_rate)
    PACKS[planned.kind](instance, given, agent, lists)


@cache
def _defaults(kind: str) -> Parameters:
    return parameters_of(kind, {"commands": []} if kind == "scripted" else {})
