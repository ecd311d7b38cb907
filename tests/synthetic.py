"""Trials made by simple formulas, for tests of what is drawn of a trial."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from dubins_traffic.cars.body import Bounds, Car, Disc, DiscObstacle, Obstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Contact, Event, Frames, Pose
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.scoring.verdict import Excuse, Place, Ruling, Verdict, Violation

SPEED = 0.5
ROUGH = RoadNetwork(
    segments=(
        (0, 0, 2, 1), (2, 1, 4, 0), (2, 1, 2, 3), (2, 3, 0, 4), (0, 0, 0, 4), (2, 3, 5, 4), (4, 0, 6, 2),
        (6, 2, 5, 4), (5, 4, 4, 6), (2, 3, 1, 6), (6, 2, 8, 2), (4, 6, 7, 6), (1, 6, 4, 6),
    ),
    length=2.2,
    transform=(40.0, -12.0, 0.5),
    shape=(7, 9),
)  # fmt: skip


def instance(
    network: RoadNetwork,
    cars: int = 4,
    seconds: float = 20.0,
    *,
    rectangles: bool = False,
    names: tuple[str, ...] | None = None,
    obstacles: tuple[Obstacle, ...] = (),
    goals: int = 3,
) -> Instance:
    """Return an instance of `cars` cars whose starts are not yet on the road."""
    body = Rectangle(0.5, 0.26) if rectangles else Disc()
    names = names or tuple(f"agent{number}" for number in range(cars - 1))
    stride = max(1, len(network.intersections) // goals)
    problem = Problem(
        network=network,
        goals=tuple(network.intersections[stride // 2 :: stride][:goals]),
        intersection_radius=1.0,
        car=Car(body=body, bounds=Bounds()),
        rate=30.0,
        sensing_radius=5.0,
        laser=None,
        obstacles=obstacles,
        e_agents=names,
        rules={},
    )
    agents = tuple(EAgent("wander", name, "wander/wander") for name in names)
    starts = tuple(Pose(0.0, 0.0, 1.0, 0.0) for _ in range(cars))
    return Instance(problem, starts, seconds, agents, seed=7, trial=2)


def driven(instance: Instance) -> tuple[Instance, Frames]:
    """Return the instance with starts, and frames in which every car wanders along right lanes, through others."""
    network, count = instance.problem.network, len(instance.names)
    frames = instance.ticks + 1
    tracks = np.stack([_track(network, car, frames, instance.problem.rate) for car in range(count)], axis=1)
    x, y, theta = np.moveaxis(tracks, 2, 0)
    places = np.stack([x, y], axis=-1)
    vertex, distance = network.nearest_intersection(places)
    segment, off = network.nearest_segment(places)
    at = np.where(distance < instance.problem.intersection_radius, vertex, -1)
    zero = np.zeros((frames, count))
    block = Frames(
        first=0,
        rate=instance.problem.rate,
        x=x,
        y=y,
        c=np.cos(theta),
        s=np.sin(theta),
        speed=np.full((frames, count), SPEED),
        yaw_rate=zero,
        command_speed=np.full((frames, count), SPEED),
        command_yaw_rate=zero,
        segment=segment,
        at=at,
        crosses=at,
        lane=2 * segment,
        bits=(off <= 0.5 * instance.problem.car.road_width).astype(np.uint32),
        contacts=_contacts(places, instance.problem.rate),
        events=(Event(frames // 3, "command_lost", 0), Event(frames // 2, "note", detail="half of the time")),
    )
    starts = tuple(Pose(*(float(a[0, car]) for a in (block.x, block.y, block.c, block.s))) for car in range(count))
    fields = {name: getattr(instance, name) for name in Instance.__slots__} | {"starts": starts}
    return Instance(**fields), block


def obstacles_beside(network: RoadNetwork) -> tuple[Obstacle, ...]:
    """Return a disc and a polygon that is not convex, on two roads."""
    first, second = (
        network.points[network.ends[0]].mean(axis=0),
        network.points[network.ends[-1]].mean(axis=0),
    )
    shape = np.array([[0.0, 0.0], [0.7, 0.1], [0.3, 0.3], [0.6, 0.7], [0.0, 0.5]])
    polygon = tuple((float(x), float(y)) for x, y in shape + second)
    return DiscObstacle(float(first[0]), float(first[1]) + 0.3, 0.22), PolygonObstacle(polygon)


def _track(network: RoadNetwork, car: int, frames: int, rate: float) -> np.ndarray:
    """Return (F, 3): x, y, theta of a car that takes one lane after the other, corners rounded."""
    chance = np.random.default_rng(car)
    lane = int(chance.integers(network.lanes))
    corners: list[tuple[float, float]] = []
    length = 0.0
    while length < 1.5 * SPEED * frames / rate + 10.0:
        (x0, y0), (x1, y1) = network.lane_line(lane, -0.3)
        across = min(0.6, 0.3 * float(network.lengths[lane >> 1])) / float(network.lengths[lane >> 1])
        for part in (across, 1.0 - across):
            corners.append((x0 + part * (x1 - x0), y0 + part * (y1 - y0)))
        length += float(network.lengths[lane >> 1])
        lane = int(chance.choice(network.successors(lane)))
    way = np.array(corners)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    s = np.arange(frames) * SPEED / rate + 0.6
    x, y = (np.mean([np.interp(s + d, along, w) for d in np.linspace(-0.25, 0.25, 11)], axis=0) for w in way.T)
    theta = np.arctan2(np.gradient(y), np.gradient(x)) if frames > 1 else np.zeros(1)
    return np.stack([x, y, theta], axis=1)


def _contacts(places: np.ndarray, rate: float) -> tuple[Contact, ...]:
    """Return a contact wherever two cars have just come closer than 0.354 m."""
    found: list[Contact] = []
    for car in range(places.shape[1]):
        for other in range(car + 1, places.shape[1]):
            near = np.hypot(*(places[:, car] - places[:, other]).T) < 0.354
            for frame in np.flatnonzero(near[1:] & ~near[:-1]) + 1:
                x, y = places[frame, [car, other]].mean(axis=0)
                sides = ((0.5, 0.5), (True, True), (car == 0, True))
                found.append(Contact(int(frame), frame / rate, car, other, float(x), float(y), 1.0, 0.0, *sides))
    return tuple(sorted(found, key=lambda contact: contact.time))


def verdict(instance: Instance, breaches: list[tuple[float, str, str]], excuse: int | None = None) -> Verdict:
    """Return a verdict with breaches of (time, car, rule), `excuse` is the number of one of them."""
    violations = tuple(
        Violation(rule, car, time, round(time * 30), time, Place(1.0 + 0.5 * number, 2.0, (1, 1), None))
        for number, (time, car, rule) in enumerate(breaches)
    )
    clean = all(car != "ego" for _, car, _ in breaches)
    fault = Ruling.VIOLATED if excuse is None else Ruling.EXCUSED
    ruling = Ruling.SATISFIED if clean else fault
    why = None if excuse is None else Excuse("E1", violations[excuse], sensed=True)
    assert all(car in instance.names for _, car, _ in breaches)
    found: dict[str, Any] = dict.fromkeys((own.name for own in fields(Verdict)), None)
    found |= {"verdict": ruling, "clean": clean, "excuse": why, "violations": violations, "collisions": ()}
    return Verdict(
        **found
        | {"rounds": 2, "longest_gap_s": 10.0, "gap_limit_s": 100.0, "recurrent": True, "formulas": {}}
        | {"robustness": {}}
    )
