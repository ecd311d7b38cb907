"""Games on grids, solved, for several tests."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
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
