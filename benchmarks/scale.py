"""What a car costs in one large world: all `lawful`, on a grid with as many intersections as cars.

The cars stand on the grid's lanes, one on every second segment, so that nothing has to be drawn.
"""

from __future__ import annotations

from dataclasses import replace
from time import process_time

from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.cars.state import Pose
from dubins_traffic.engine.group import Group
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.roads.network import RoadNetwork

TICKS = 60


def crowd(side: int) -> Instance:
    """Return an instance of side * side cars on a grid of side x side intersections."""
    small = draw(load_config(configuration()), 1, 0)
    network = RoadNetwork.grid(side, side, 4.0)
    cars = side * side
    starts: list[Pose] = []
    for lane in range(0, 2 * cars):
        (x0, y0), (x1, y1) = network.lane_line(lane, -small.problem.car.w)
        length = float(network.lengths[lane >> 1])
        if lane % 4 in (0, 3) and len(starts) < cars:
            tx, ty = float(x1 - x0) / length, float(y1 - y0) / length
            starts.append(Pose(float(x0) + 2.0 * tx, float(y0) + 2.0 * ty, tx, ty))
    agent = small.e_agents[0]
    agents = tuple(EAgent("lawful", f"agent{n}", agent.type, agent.parameters) for n in range(len(starts) - 1))
    problem = replace(
        small.problem,
        network=network,
        goals=tuple(network.intersections[:2]),
        e_agents=tuple(own.name for own in agents),
    )
    return replace(small, problem=problem, starts=tuple(starts), e_agents=agents, duration=10.0)


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    costs = {side: _cost(side) for side in (10, 100)}
    ratio = costs[100] / costs[10]
    return [
        Row("100 cars, 100 intersections", f"{costs[10] * 1e9:.0f} ns a car and tick", "", True),
        Row(
            "10,000 cars, 10,000 intersections",
            f"{costs[100] * 1e9:.0f} ns a car and tick = {ratio:.2f} times",
            "<= 1.5 times",
            ratio <= 1.5,
        ),
    ]


def _cost(side: int) -> float:
    instance = crowd(side)
    group = Group([instance], keeps_rules=True)
    group.advance(2)
    began = process_time()
    group.advance(TICKS)
    return (process_time() - began) / (TICKS * len(instance.starts))
