"""Scripted motions for tests of the rules: poses frame by frame, without a simulator."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Labels, Pose, State
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.propositions import names

Frame = list[tuple[float, float, float, float]]

STAR = RoadNetwork(((0, 1, 1, 1), (1, 0, 1, 1), (1, 1, 2, 1), (1, 2, 1, 1)), 4.0, (0.0, 0.0, 0.0), (3, 3))
TURNED_STAR = RoadNetwork(STAR.segments, 4.0, (3.0, -7.0, 0.7), (3, 3))
KITE = RoadNetwork(
    ((0, 0, 2, 1), (2, 1, 4, 0), (2, 1, 2, 3), (2, 3, 0, 4), (0, 0, 0, 4), (2, 3, 5, 4)),
    2.2, (40.0, -12.0, 0.5), (5, 6),
)  # fmt: skip


def instance(
    network: RoadNetwork,
    cars: int,
    *,
    rate: float = 10.0,
    car: Car | None = None,
    obstacles: Sequence[Obstacle] = (),
    rules: Mapping[str, Any] | None = None,
) -> Instance:
    """Return an instance whose rules are judged unless `rules` is empty."""
    problem = Problem(
        network=network, goals=(), intersection_radius=1.0, car=car or Car(), rate=rate, sensing_radius=5.0,
        laser=None, obstacles=tuple(obstacles), e_agents=(),
        rules={"crossing_degree": 3} if rules is None else rules,
    )  # fmt: skip
    starts = tuple(Pose(0.0, 0.0, 1.0, 0.0) for _ in range(cars))
    return Instance(problem, starts, 60.0, (), 1, 0)


def fill(state: State, b: int, frame: Frame) -> None:
    """Write the poses of one frame into row b."""
    for n, (x, y, c, s) in enumerate(frame):
        state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n] = x, y, c, s


def label(instances: Sequence[Instance], scripts: Sequence[Sequence[Frame]]) -> list[Labels]:
    """Return copies of the labels of every frame of a batch of scripts of equal length."""
    cars = [len(script[0]) for script in scripts]
    state = State.zeros(len(scripts), max(cars))
    state.count[:] = cars
    labeller = Labeller(instances)
    found: list[Labels] = []
    for k in range(len(scripts[0])):
        for b, script in enumerate(scripts):
            fill(state, b, script[k])
        if k == 0:
            labels = labeller.reset(state)
        else:
            labeller.update(k, state, [()] * len(scripts))
        found.append(Labels(*(array.copy() for array in labels)))
    return found


def flags(found: Sequence[Labels], n: int, b: int = 0) -> list[set[str]]:
    """Return the names of a car's flags, frame by frame."""
    return [set(names(int(labels.bits[b, n]))) for labels in found]


def on_lane(network: RoadNetwork, lane: int, s: float, lateral: float, back: bool = False) -> tuple[float, ...]:
    """Return the pose at (s, lateral) of a lane, headed along it, or against it."""
    segment, direction = divmod(lane, 2)
    sign = -1.0 if back else 1.0
    if network.bent[segment]:
        (start,), ((tx, ty),) = network.lane_places(lane, np.array([s]))
        s = 0.0
    else:
        a, b = (network.points[v] for v in network.ends[segment])
        start, (tx, ty) = (a, network.tangents[segment]) if direction == 0 else (b, -network.tangents[segment])
    x, y = start[0] + s * tx - lateral * ty, start[1] + s * ty + lateral * tx
    return float(x), float(y), float(sign * tx), float(sign * ty)


def wander(
    network: RoadNetwork, cars: int, frames: int, seed: int, rate: float = 10.0, odd: bool = False
) -> list[Frame]:
    """Return a script of cars that drive, halt, reverse, overtake, cut corners and leave the road now and then.

    With `odd` they also swing to and fro, stand in discs and just behind them, and back up before crossings.
    """
    dice = random.Random(seed)
    tracks = [_track(network, dice, frames, rate, odd) for _ in range(cars)]
    return [[track[k] for track in tracks] for k in range(frames)]


def _track(network: RoadNetwork, dice: random.Random, frames: int, rate: float, odd: bool) -> Frame:
    lane = dice.randrange(2 * len(network.segments))
    length = float(network.lengths[lane // 2])
    lateral = dice.uniform(-0.35, -0.25)
    x, y, c, s = on_lane(network, lane, dice.uniform(0.0, length), lateral, dice.random() < 0.2)
    track: Frame = [(x, y, c, s)]
    while len(track) < frames:
        length = float(network.lengths[lane // 2])
        for at in sorted(dice.uniform(1.0, length - 1.2) for _ in range(dice.choice((0, 1, 3)))):
            lateral = dice.choice((-0.3, -0.42, -0.3, 0.1, 0.3, -0.2, 0.7))
            _drive(track, dice, on_lane(network, lane, at, lateral)[:2], rate, dice.random() < 0.15)
            if dice.random() < 0.3:
                _halt(track, dice.choice((3, 12, 25)))
        stop = length - 1.177 - dice.choice((0.1, 0.2, 0.3, 0.45, 0.55))
        _drive(track, dice, on_lane(network, lane, stop, -0.3)[:2], rate, False)
        _halt(track, dice.choice((0, 4, 6, 8, 15, 40, 75)))
        if odd and dice.random() < 0.3:
            for at in (stop - 0.27, stop):
                _drive(track, dice, on_lane(network, lane, at, -0.3)[:2], rate, at < stop)
                _halt(track, dice.choice((1, 7)))
        v = int(network.ends[lane // 2][1 - lane % 2])
        arms = list(network.arms(v))
        following = dice.choice(arms)
        if odd and dice.random() < 0.5:
            _dally(track, dice, network, lane, rate)
        if dice.random() < 0.3:
            _drive(track, dice, tuple(network.points[v]), rate, False)
        if odd and dice.random() < 0.5:
            _dally(track, dice, network, int(following) ^ 1, rate)
        lane = int(following)
        _drive(track, dice, on_lane(network, lane, 1.1, -0.3)[:2], rate, False)
    return track[:frames]


def _drive(track: Frame, dice: random.Random, goal: Sequence[float], rate: float, reverse: bool) -> None:
    x, y, _, _ = track[-1]
    dx, dy = goal[0] - x + dice.uniform(-0.01, 0.01), goal[1] - y + dice.uniform(-0.01, 0.01)
    way = math.hypot(dx, dy)
    if way < 1e-6:
        return
    speed = dice.choice((0.3, 0.5, 0.7))
    steps = max(1, math.ceil(way / speed * rate))
    tilt = dice.uniform(-0.2, 0.2) + (math.pi if reverse else 0.0)
    angle = math.atan2(dy, dx) + tilt
    for k in range(1, steps + 1):
        track.append((x + dx * k / steps, y + dy * k / steps, math.cos(angle), math.sin(angle)))


def _dally(track: Frame, dice: random.Random, network: RoadNetwork, lane: int, rate: float) -> None:
    """Swing or stand about the end of a lane: before the disc there, in it, or with the tail in it."""
    length = float(network.lengths[lane // 2])
    middle = length - dice.choice((1.9, 1.5, 1.3, 1.1, 0.9, 0.6, 0.3))
    swing, lateral = dice.choice((0.0, 0.03, 0.12, 0.25, 0.6)), dice.choice((-0.3, -0.3, 0.3, -0.1))
    for k in range(dice.choice((1, 3, 8))):
        at = middle + (swing if k % 2 else -swing)
        _drive(track, dice, on_lane(network, lane, at, lateral)[:2], rate, k % 2 == 0)
        _halt(track, dice.choice((0, 2, 6, 20)))


def _halt(track: Frame, ticks: int) -> None:
    track.extend([track[-1]] * ticks)


def moved(script: Sequence[Frame], tx: float, ty: float, angle: float) -> list[Frame]:
    """Return a script after a rigid motion."""
    c, s = math.cos(angle), math.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    result: list[Frame] = []
    for frame in script:
        rows = np.array(frame)
        places = rows[:, :2] @ rotation.T + (tx, ty)
        headings = rows[:, 2:] @ rotation.T
        result.append([tuple(row) for row in np.hstack([places, headings]).tolist()])
    return result
