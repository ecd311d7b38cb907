"""Scripted motions before the referee: frames by hand, judged both in one block and tick by tick."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Contact, Frames, State
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.referee import Breach, Referee
from tests.rules_scripts import KITE, Frame, fill, on_lane
from tests.rules_scripts import instance as bare_instance

RHO = 0.177
REACH = 1.0 + RHO
GRID = RoadNetwork.grid(3, 3, 5.0)
ROADS = {"grid": GRID, "kite": KITE}
CROSSINGS = {id(GRID): GRID.vertex((1, 1)), id(KITE): KITE.vertex((2, 1))}
EPS = 1e-6
EASED = 5e-10
"""Metres by which a limit may be missed."""


def lanes_in(roads: RoadNetwork) -> list[int]:
    """Return the lanes into the crossing under test: each has the next on its right, by less than 180 degrees."""
    return [lane ^ 1 for lane in roads.arms(CROSSINGS[id(roads)])]


def lanes_out(roads: RoadNetwork) -> list[int]:
    return list(roads.arms(CROSSINGS[id(roads)]))


def before(roads: RoadNetwork, lane: int, gap: float, lateral: float = -0.3) -> tuple[float, ...]:
    """Return the pose on a lane at which a disc's body is `gap` from the disc at the lane's end."""
    length = float(roads.lengths[lane // 2])
    return on_lane(roads, lane, length - math.sqrt((REACH + gap) ** 2 - lateral**2), lateral)


def after(roads: RoadNetwork, lane: int, gap: float, lateral: float = -0.3) -> tuple[float, ...]:
    """Return the pose on a lane at which a disc's body is `gap` beyond the disc at the lane's start."""
    return on_lane(roads, lane, math.sqrt((REACH + gap) ** 2 - lateral**2), lateral)


def case(
    roads: RoadNetwork, cars: int, goals: Sequence[tuple[int, int]] = (), rate: float = 10.0, **rules: float
) -> Instance:
    """Return an instance that is judged."""
    bare = bare_instance(roads, cars, rate=rate, rules={"crossing_degree": 3, **rules})
    names = tuple(f"agent{n}" for n in range(cars - 1))
    problem = replace(bare.problem, goals=tuple(goals), e_agents=names)
    agents = tuple(EAgent("scripted", name, "scripted", {}) for name in names)
    return replace(bare, problem=problem, e_agents=agents)


def frames_of(script: Sequence[Frame], rate: float = 10.0, contacts: Sequence[Contact] = ()) -> Frames:
    """Return a script as frames without labels: the referee finds them."""
    poses = np.array(script)
    shape = poses.shape[:2]
    zeros = [np.zeros(shape)] * 4
    none = [np.full(shape, -1, dtype=np.int64)] * 4
    columns = [np.ascontiguousarray(poses[:, :, k]) for k in range(4)]
    return Frames(0, rate, *columns, *zeros, *none, bits=np.zeros(shape, dtype=np.uint32), contacts=tuple(contacts))


def judged(instance: Instance, script: Sequence[Frame], contacts: Sequence[Contact] = ()) -> list[Breach]:
    """Return all breaches of a script; they are the same in a block and tick by tick."""
    found, _ = Referee([instance]).judge(frames_of(script, instance.problem.rate, contacts))
    referee, state, live = Referee([instance]), State.zeros(1, len(script[0])), list[Breach]()
    for tick, frame in enumerate(script):
        fill(state, 0, frame)
        own = [contact for contact in contacts if contact.tick == tick]
        live += (referee.update(tick, state, [own]) if tick else referee.reset(state))[0]
    assert live == found
    return found


def said(breaches: Sequence[Breach]) -> list[tuple[Any, ...]]:
    """Return (rule, car, tick, since) of each breach."""
    return [(breach.rule, breach.car, breach.tick, breach.since) for breach in breaches]


def hold(*cars: tuple[float, ...], frames: int) -> list[Frame]:
    """Return a script in which nobody moves."""
    return [list(cars) for _ in range(frames)]


def away(roads: RoadNetwork) -> tuple[float, ...]:
    """Return a place in a dead end's or bend's lane where a car is in nobody's way, too short-lived for E5."""
    return on_lane(roads, lanes_out(roads)[0], 2.0, -0.3)


def pair(roads: RoadNetwork, who: int, places: list[tuple[float, ...]]) -> list[Frame]:
    """Return a script in which one car takes `places` and the other is out of the way."""
    other = away(roads)
    return [[place, other] if who == 0 else [other, place] for place in places]


def entering(roads: RoadNetwork, stop: int, gap: float = 0.3) -> list[tuple[float, ...]]:
    """Return a car that stands before the crossing for `stop` frames and is in it two frames later."""
    lane = lanes_in(roads)[0]
    return [before(roads, lane, gap)] * stop + [before(roads, lane, EPS), before(roads, lane, -EPS)]
