"""Trials made up for the tests of records and scores: no simulator, just frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dubins_traffic.cars.body import Body, Car, Disc, Obstacle
from dubins_traffic.cars.state import Contact, Event, Frames, Pose
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.roads.network import RoadNetwork

REALS = ("x", "y", "c", "s", "speed", "yaw_rate", "command_speed", "command_yaw_rate")
WHOLE = ("segment", "at", "crosses", "lane")


def make_instance(
    *,
    goals: Sequence[tuple[int, int]] = ((0, 0), (2, 1)),
    names: Sequence[str] = ("agent0", "agent1"),
    ticks: int = 90,
    rate: float = 30.0,
    body: Body | None = None,
    obstacles: Sequence[Obstacle] = (),
    network: RoadNetwork | None = None,
) -> Instance:
    """An instance on the 3x4 grid, cars in a row along the lowest road."""
    problem = Problem(
        network=network or RoadNetwork.grid(3, 4),
        goals=tuple(goals),
        intersection_radius=1.0,
        car=Car(body=body or Disc()),
        rate=rate,
        sensing_radius=5.0,
        laser=None,
        obstacles=tuple(obstacles),
        e_agents=tuple(names),
        rules={},
    )
    starts = tuple(Pose(1.5 + n, -0.3, 1.0, 0.0) for n in range(len(names) + 1))
    agents = tuple(EAgent("wander", name, "wander/wander") for name in names)
    instance = Instance(problem, starts, ticks / rate, agents, seed=7, trial=3)
    return instance_from_document(instance_to_document(instance))


def make_frames(
    instance: Instance, ego: Sequence[tuple[float, float]], *others: Sequence[tuple[float, float]]
) -> Frames:
    """One block of a whole trial from the positions of each car; other cars stand where they start."""
    count = len(ego)
    cars = len(instance.names)
    x, y = np.zeros((count, cars)), np.zeros((count, cars))
    paths = [ego, *others]
    for n in range(cars):
        path = paths[n] if n < len(paths) else [(1000.0 + 10 * n, 1000.0)] * count
        x[:, n], y[:, n] = np.asarray(path, dtype=float).T
    reals = {name: np.zeros((count, cars)) for name in REALS} | {"x": x, "y": y, "c": np.ones((count, cars))}
    whole = {name: np.zeros((count, cars), dtype=np.int64) for name in WHOLE}
    return Frames(0, instance.problem.rate, **reals, **whole, bits=np.zeros((count, cars), dtype=np.uint32))


def random_frames(instance: Instance, seed: int, count: int, spread: float = 3.0) -> Frames:
    """One block of a whole trial in which everything varies: walks, labels, contacts, events."""
    draw = np.random.Generator(np.random.Philox(seed))
    cars = len(instance.names)
    frames = make_frames(instance, np.zeros((count, 2)))
    walk = np.cumsum(draw.normal(scale=0.2, size=(count, cars, 2)), axis=0)
    walk += draw.uniform(0.0, spread, size=(cars, 2))
    angle = draw.uniform(-np.pi, np.pi, size=(count, cars))
    reals = {name: draw.normal(size=(count, cars)) for name in REALS}
    reals |= {"x": walk[..., 0], "y": walk[..., 1], "c": np.cos(angle), "s": np.sin(angle)}
    reals["speed"][draw.random((count, cars)) < 0.3] = 0.0
    whole = {name: np.repeat(draw.integers(-1, 17, size=(count // 7 + 1, cars)), 7, axis=0)[:count] for name in WHOLE}
    bits = np.repeat(draw.integers(0, 2**32, size=(count // 5 + 1, cars), dtype=np.uint32), 5, axis=0)[:count]
    contacts: list[Contact] = []
    for tick in sorted(draw.integers(1, count, size=min(4, count - 1)).tolist()):
        car, other = (0, -1) if cars == 1 else sorted(draw.choice(cars, 2, replace=False).tolist())
        numbers = draw.normal(size=6)
        time = (tick - draw.random()) / instance.problem.rate
        flags = draw.random(4) < 0.5
        contacts.append(
            Contact(
                tick,
                float(time),
                int(car),
                int(other),
                *(float(number) for number in numbers[:4]),
                (float(numbers[4]), float(numbers[5])),
                (bool(flags[0]), bool(flags[1])),
                (bool(flags[2]), bool(flags[3])),
            )
        )
    events = (Event(count - 1, "note", -1, "näher als 1 m"), Event(count - 1, "gave_up", 0, ""))
    return replace(frames, **reals, **whole, bits=bits, contacts=tuple(contacts), events=events)


def blocks(frames: Frames, size: int) -> Iterator[Frames]:
    """Cut a block into blocks of `size` frames, each with the contacts and events of its ticks."""
    for first in range(0, len(frames), size):
        end = min(first + size, len(frames))
        columns = {name: getattr(frames, name)[first:end] for name in (*REALS, *WHOLE, "bits")}
        contacts = tuple(contact for contact in frames.contacts if first <= contact.tick < end)
        events = tuple(event for event in frames.events if first <= event.tick < end)
        yield Frames(first, frames.rate, **columns, contacts=contacts, events=events)


def feed(instance: Instance, frames: Frames, *sinks: Sink, ending: Ending | None = None) -> Ending:
    """Push a whole trial into `sinks` as a trial does, in blocks of a second."""
    ending = ending or Ending(End.DURATION, len(frames) - 1)
    for sink in sinks:
        sink.begin(instance)
    for block in blocks(frames, max(1, int(frames.rate))):
        for sink in sinks:
            sink.frames(block)
    for sink in sinks:
        sink.end(ending)
    return ending


def same(one: Frames, two: Frames) -> bool:
    """Whether two blocks are equal, bit for bit."""
    plain = (one.first, one.rate, one.contacts, one.events) == (two.first, two.rate, two.contacts, two.events)
    return plain and all(
        getattr(one, name).dtype == getattr(two, name).dtype
        and getattr(one, name).tobytes() == getattr(two, name).tobytes()
        and getattr(one, name).shape == getattr(two, name).shape
        for name in (*REALS, *WHOLE, "bits")
    )
