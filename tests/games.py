"""Games on grids, solved, for several tests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import permutations
from random import Random

from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.solver import Solution, solve

ALL = "E1,E2,E3,E4,E5,E6"


def board(rows: int, columns: int, others: int, assumed: str = ALL, order_degree: int = 1) -> Board:
    """Return the positions on a grid with goals at two opposite corners."""
    network = RoadNetwork.grid(rows, columns)
    road_cells = RoadCells.of(network, [0, len(network.intersections) - 1], order_degree)
    return Board(road_cells, Assumption.parse(word for word in assumed.split(",") if word), others)


PAN = ((0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 1, 1), (0, 1, 1, 1), (1, 1, 2, 1))
"""A square with a handle."""


def pan(others: int, goals: Sequence[int], assumed: str = ALL, order_degree: int = 1) -> Board:
    """Return the positions on a square with a handle, whose end is node 4."""
    network = RoadNetwork(PAN, 3.0, (0.0, 0.0, 0.0), (2, 3))
    return Board(RoadCells.of(network, goals, order_degree), Assumption.parse(assumed.split(",")), others)


@cache
def solved(rows: int, columns: int, others: int, assumed: str = ALL, order_degree: int = 1) -> Solution:
    """Return who wins."""
    return solve(build(board(rows, columns, others, assumed, order_degree)))


def positions(some: Board, count: int) -> Iterator[tuple[list[int], int]]:
    """Yield cells of the cars and the position that they make, no two cars before one crossing."""
    road_cells = some.road_cells
    cells = list(permutations(range(road_cells.cells), some.others + 1))
    Random(2016).shuffle(cells)
    nodes = len(road_cells.nodes)
    for own in cells:
        ends = [road_cells.lane_end[cell - nodes][0] for cell in own if cell >= nodes]
        if len(set(ends)) == len(ends) and count:
            count -= 1
            yield list(own), some.number([_scene(some, node, own) for node in range(nodes)])


def _scene(some: Board, node: int, cells: tuple[int, ...]) -> Scene:
    nodes = len(some.road_cells.nodes)
    who = [WHO.EGO if car == 0 else WHO.OTHER for car in range(len(cells))]
    inside = who[cells.index(node)] if node in cells else None
    lanes = [nodes + lane for lane in some.road_cells.nodes[node].inbound]
    return Scene(inside, tuple((lanes.index(cell), who[k]) for k, cell in enumerate(cells) if cell in lanes))
