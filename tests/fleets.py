"""Trials of e-agents without trials: instances by hand, the fleet and the embedded simulator in a small loop."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dubins_traffic.agents.fleet import Fleet
from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Contact, Labels, Pose, State
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.simulators.embedded import Embedded

AWAY = Pose(1000.0, 1000.0, 1.0, 0.0)
GRID = RoadNetwork.grid(3, 4)

Kinds = Sequence[tuple[str, Mapping[str, Any]]]


class Moment(NamedTuple):
    """What stands when the e-agents have chosen their commands for a tick."""

    tick: int
    state: State
    commands: np.ndarray
    fleet: Fleet

    @property
    def lanes(self) -> np.ndarray:
        """The lanes that the cars drive, (B, N)."""
        return self.fleet._agents.agent["lane"]


Each = Callable[[Moment], None]


def in_lane(network: RoadNetwork, lane: int, share: float = 0.5, offset: float = -0.42) -> Pose:
    """Return the pose in a lane, headed with it, after `share` of its length."""
    (x0, y0), (x1, y1) = network.lane_line(lane, offset)
    length = float(np.hypot(x1 - x0, y1 - y0))
    return Pose(x0 + share * (x1 - x0), y0 + share * (y1 - y0), (x1 - x0) / length, (y1 - y0) / length)


def instance(
    kinds: Kinds,
    starts: Sequence[Pose],
    network: RoadNetwork = GRID,
    car: Car | None = None,
    rate: float = 30.0,
    obstacles: Sequence[Obstacle] = (),
    seed: int = 0,
    trial: int = 0,
) -> Instance:
    """Return an instance of these e-agents; the first start is the ego's."""
    names = tuple(f"agent{n}" for n in range(len(kinds)))
    agents = tuple(EAgent(kind, name, kind, given) for (kind, given), name in zip(kinds, names, strict=True))
    problem = Problem(network, ((0, 0),), 1.0, car or Car(), rate, 5.0, None, tuple(obstacles), names, {})
    return Instance(problem, tuple(starts), 60.0, agents, seed, trial)


def crowd(kinds: Kinds, network: RoadNetwork = GRID, seed: int = 0, trial: int = 0, **more: Any) -> Instance:
    """Return an instance with the e-agents in the middles of different lanes, far from the ego."""
    chosen = np.random.default_rng((seed, trial)).permutation(network.lanes)[: len(kinds)]
    starts = [AWAY, *(in_lane(network, int(lane)) for lane in chosen)]
    return instance(kinds, starts, network, seed=seed, trial=trial, **more)


def run(
    instances: Sequence[Instance],
    ticks: int,
    each: Each | None = None,
    ego: Sequence[tuple[float, float]] = (),
) -> tuple[State, list[Contact]]:
    """Drive a batch; the ego holds the commands of `ego`, one per tick, then stands."""
    simulator, fleet = Embedded(), Fleet()
    state = simulator.reset(instances)
    fleet.reset(instances, state)
    commands = np.zeros((*state.x.shape, 2))
    labels = Labels.zeros(*state.x.shape)
    contacts: list[Contact] = []
    for tick in range(ticks):
        commands[:, 0] = ego[tick] if tick < len(ego) else (0.0, 0.0)
        fleet.decide(tick, state, labels, commands)
        if each:
            each(Moment(tick, state, commands, fleet))
        for found in simulator.step(commands):
            contacts += found
    return state, contacts


def first_commands(given: Instance, tick: int = 0) -> list[tuple[float, float]]:
    """Return what the e-agents do in their first tick."""
    simulator, fleet = Embedded(), Fleet()
    state = simulator.reset([given])
    fleet.reset([given], state)
    commands = np.zeros((*state.x.shape, 2))
    fleet.decide(tick, state, Labels.zeros(*state.x.shape), commands)
    return [(float(u), float(w)) for u, w in commands[0, 1:]]


def medley(trial: int) -> Instance:
    """Return an instance with an e-agent of every kind."""
    kinds = [
        ("wander", {}),
        ("wander", {"patience": 1.0}),
        ("loop", {"cycle": [[0, 0], [1, 0], [1, 1], [0, 1]]}),
        ("follow", {"gap": 0.8}),
        ("follow", {"sensing_only": True}),
        ("parked", {"vacates_after": 2.0}),
        ("scripted", {"commands": [[1.0, 0.3, 0.1], [0.5, 0.0, -1.0]], "repeat": True}),
    ]
    network = (GRID, RoadNetwork.grid(2, 3, 4.0, (1.0, -2.0, 0.4)))[trial % 2]
    given = crowd(kinds, network, trial=trial)
    chosen = np.random.default_rng(trial).permutation(network.lanes)
    ego = in_lane(network, int(chosen[0]), 0.3)
    return instance(kinds, [ego, *given.starts[1:]], network, seed=5, trial=trial)


def digest(ticks: int) -> str:
    """Return a hash of all states of a medley of trials."""
    total = hashlib.sha256()

    def each(now: Moment) -> None:
        for array in (*now.state, now.commands):
            total.update(array.tobytes())

    run([medley(trial) for trial in range(3)], ticks, each, [(0.4, 0.0)] * 90 + [(0.3, 0.6)] * 60)
    return total.hexdigest()


if __name__ == "__main__":
    sys.stdout.write(digest(int(sys.argv[1])))
