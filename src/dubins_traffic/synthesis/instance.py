"""A problem as a game: its roads and goals, what it assumes, and where the cars of an instance start."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.road_cells import RoadCells

PARTS = ("E1", "E2", "E3", "E4", "E5", "E6")


def cells_of(problem: Problem, order_degree: int | None = None) -> RoadCells:
    """Return the cells of a problem.

    Parameters
    ----------
    order_degree : int, optional
        Least degree of a crossing; that of the problem's rules, if not given.

    Raises
    ------
    InputError
        As `RoadCells.of`.
    """
    rules = RuleParameters.from_mapping(problem.rules)
    degree = rules.crossing_degree if order_degree is None else order_degree
    return RoadCells.of(problem.network, problem.goal_vertices, degree)


def assumption_of(problem: Problem) -> Assumption:
    """Return what a problem assumes of its e-agents. Places in the order are never given up."""
    rules = RuleParameters.from_mapping(problem.rules)
    return Assumption.parse(part for part in PARTS if getattr(rules, f"assume_{part.lower()}"))


def board_of(problem: Problem) -> Board:
    """Return the board of a problem's game; InputError as `RoadCells.of`."""
    return Board(cells_of(problem), assumption_of(problem), len(problem.e_agents))


def start_positions(board: Board, instance: Instance) -> list[int]:
    """Return the positions in which an instance may start; none if two cars start in one cell, or others play.

    Cars that start in lanes to one crossing may be in any order there.
    """
    if len(instance.starts) != board.others + 1:
        return []
    cells = [cell_of(board.road_cells, instance.problem, pose) for pose in instance.starts]
    if len(set(cells)) < len(cells):
        return []
    choices = [list(_scenes(board, node, cells)) for node in range(len(board.road_cells.nodes))]
    return sorted({board.number(scenes) for scenes in product(*choices)})


def start_cells(board: Board, instance: Instance) -> list[int]:
    """Return the cells in which the cars of an instance start, the ego first.

    InputError if others play, or two cars start in one cell.
    """
    if len(instance.starts) != board.others + 1:
        raise InputError(
            "other cars than those of the game",
            field="starts",
            value=len(instance.starts),
            expected=f"{board.others + 1}",
        )
    cells = [cell_of(board.road_cells, instance.problem, pose) for pose in instance.starts]
    for k, cell in enumerate(cells):
        if cell in cells[:k]:
            name = board.road_cells.name(cell)
            raise InputError("two cars start in one cell", field="starts", value=name, expected="one car a cell")
    return cells


def cell_of(road_cells: RoadCells, problem: Problem, pose: Pose) -> int:
    """Return the cell in which a pose lies: the node whose disc holds the centre, else the lane by heading."""
    network = road_cells.network
    place = np.array([[pose.x, pose.y]])
    vertices, distances = network.nearest_intersection(place)
    heading = np.array([np.cos(pose.theta), np.sin(pose.theta)])
    if distances.item() < problem.intersection_radius:
        nodes = road_cells.nodes_of(int(vertices.item()))
        return max(nodes, key=lambda n: max(_along(road_cells, lane, heading) for lane in road_cells.nodes[n].exits))
    segment = int(network.nearest_segment(place)[0].item())
    lanes = (2 * segment, 2 * segment + 1)
    gone = {lane: float(network.lane_coordinates(lane, place)[0].item()) for lane in lanes}
    return len(road_cells.nodes) + max(lanes, key=lambda lane: _along(road_cells, lane, heading, gone[lane]))


def _along(road_cells: RoadCells, lane: int, heading: Floats, gone: float = 0.0) -> float:
    """Return how far one gets along a lane by a step of the heading, `gone` metres from where it begins."""
    _, way = road_cells.network.lane_places(lane, np.array([gone]))
    return float(heading @ way[0])


def _scenes(board: Board, node: int, cells: list[int]) -> Iterator[Scene]:
    """Yield the scenes that a node may have with the cars in these cells, the ego's first."""
    road_cells = board.road_cells
    kind = board.scenery(node).kind
    inside = (WHO.EGO if cells[0] == node else WHO.OTHER) if node in cells else None
    waiting = [
        (slot, WHO.EGO if cells[0] == len(road_cells.nodes) + lane else WHO.OTHER)
        for slot, lane in enumerate(road_cells.nodes[node].inbound)
        if len(road_cells.nodes) + lane in cells
    ]
    parked: tuple[int, ...] = ()
    if kind.parks:
        parked = tuple(slot for slot, who in waiting if who == WHO.OTHER)
        waiting = [(slot, who) for slot, who in waiting if who == WHO.EGO]
    for queue in permutations(waiting) if kind.ordered else (tuple(sorted(waiting)),):
        yield Scene(inside, queue, parked)
