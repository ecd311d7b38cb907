"""The solver against the textbook: the same positions, and the same winners, on labelled states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dubins_traffic.roads.formats.rnd import extent
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Leaving, Order
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.solver import Solution, solve
from tests.game_reference import Arrays, Reference

SQUARE = ((0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 1, 1), (0, 1, 1, 1))
TEE = ((0, 0, 1, 0), (1, 0, 2, 0), (1, 0, 1, 1))
KITE = ((0, 0, 1, 0), (0, 0, 1, 1), (1, 0, 1, 1), (1, 1, 2, 1))

GAMES: list[tuple[Any, int, dict[str, Any]]] = [
    (SQUARE, 1, {}),
    (SQUARE, 2, {}),
    (SQUARE, 2, {"order": "none"}),
    (SQUARE, 2, {"order": "ignored"}),
    (SQUARE, 2, {"forfeits": "once"}),
    (SQUARE, 2, {"forfeits": "always"}),
    (SQUARE, 1, {"enters": False}),
    (SQUARE, 1, {"leaves": "never"}),
    (SQUARE, 1, {"arrives": "never"}),
    (SQUARE, 2, {"arrives": "never"}),
    (SQUARE, 1, {"enters": False, "leaves": "never", "arrives": "never"}),
    (SQUARE, 2, {"frees": False}),
    (SQUARE, 2, {"order_degree": 3}),
    (SQUARE, 2, {"order_degree": 3, "arrives": "never"}),
    (SQUARE, 2, {"order_degree": 3, "leaves": "unmet"}),
    (SQUARE, 3, {"order_degree": 3, "leaves": "unmet", "arrives": "moves_up"}),
    (SQUARE, 3, {"order_degree": 3}),
    (SQUARE, 3, {"order_degree": 3, "arrives": "moves_up"}),
    (SQUARE, 2, {"order_degree": 3, "goals": 1}),
    (SQUARE, 2, {"goals": 1}),
    (SQUARE, 3, {}),
    (SQUARE, 3, {"order": "none"}),
    (TEE, 2, {}),
    (TEE, 2, {"order_degree": 3}),
    (TEE, 2, {"leaves": "never", "frees": False}),
    (TEE, 2, {"order_degree": 3, "frees": False}),
    (TEE, 2, {"order_degree": 3, "arrives": "moves_up", "frees": False}),
    (TEE, 2, {"order_degree": 3, "goals": 1}),
    (TEE, 3, {"order_degree": 2}),
    (KITE, 2, {}),
    (KITE, 2, {"order_degree": 3}),
    (KITE, 2, {"order": "ignored"}),
    (KITE, 2, {"order_degree": 3, "leaves": "unmet"}),
    (KITE, 2, {"order_degree": 3, "leaves": "unmet", "arrives": "moves_up"}),
    (KITE, 2, {"order_degree": 4}),
    (KITE, 2, {"order_degree": 4, "arrives": "moves_up"}),
    (KITE, 1, {"arrives": "never", "forfeits": "once"}),
    (KITE, 2, {"forfeits": "once", "order_degree": 2, "goals": 1}),
]


def solved(segments: Any, others: int, assumed: dict[str, Any]) -> Solution:
    network = RoadNetwork(segments, 3.0, (0.0, 0.0, 0.0), extent(segments))
    words = dict(assumed)
    degree = words.pop("order_degree", 1)
    words["order"] = Order(words.get("order", "kept"))
    words["forfeits"] = Forfeits(words.get("forfeits", "never"))
    words["leaves"] = Leaving(words.get("leaves", "owed"))
    words["arrives"] = Arriving(words.get("arrives", "owed"))
    road_cells = RoadCells.of(network, goals(network)[: words.pop("goals", 2)], degree)
    return solve(build(Board(road_cells, Assumption(**words), others)))


def goals(network: RoadNetwork) -> list[int]:
    return [0, len(network.intersections) - 1]


def reference(segments: Any, others: int, assumed: dict[str, Any]) -> Reference:
    roads = tuple(((a, b), (c, d)) for a, b, c, d in segments)
    points = sorted({point for road in roads for point in road})
    words = dict(assumed)
    return Reference(roads, (points[0], points[-1])[: words.pop("goals", 2)], others, **words)


def position(board: Board, game: Reference, state: Any) -> int:
    """Return the number of a labelled state."""
    cells, orders, renewed = state
    network = board.road_cells.network
    scenes: list[Scene] = []
    for node in board.road_cells.nodes:
        point = network.intersections[node.vertex]
        starts = [network.intersections[network.lane_ends(lane)[0]] for lane in node.inbound]
        inside: int | None = None
        slots: dict[int, int] = {}
        for car, cell in enumerate(cells):
            if cell[0] == "node" and cell[1] == point and (len(cell) == 2 or cell[2] == starts[0]):
                inside = WHO.OTHER if car else WHO.EGO
            if cell[0] == "lane" and cell[2] == point and cell[1] in starts:
                slots[car] = starts.index(cell[1])
        order = list(dict(orders).get(point, ())) if game.crossing(point) else sorted(slots)
        kinds = {car: WHO.RENEWED if car in renewed else WHO.OTHER if car else WHO.EGO for car in order}
        queue = [(slots[car], kinds[car]) for car in order if car in slots]
        ordered = node.crossing and game.order != "none"
        parked = tuple(sorted(slot for car, slot in slots.items() if car not in order))
        scenes.append(Scene(inside, tuple(queue if ordered else sorted(queue)), parked))
    return board.number(scenes)


@pytest.mark.parametrize(("segments", "others", "assumed"), GAMES)
def test_winners_are_those_of_the_textbook(segments: Any, others: int, assumed: dict[str, Any]) -> None:
    solution = solved(segments, others, assumed)
    game = reference(segments, others, assumed)
    board = solution.game.board
    arrays = Arrays(game)
    numbers = np.array([position(board, game, state) for state in arrays.states])
    assert sorted(set(numbers.tolist())) == list(range(board.positions))
    assert (arrays.winning() == solution.winning[numbers]).all()


def test_moves_are_those_of_the_textbook() -> None:
    for assumed in ({}, {"forfeits": "once"}, {"arrives": "never"}, {"order_degree": 3}):
        solution = solved(KITE, 2, assumed)
        game = reference(KITE, 2, assumed)
        graph, board = solution.game, solution.game.board
        for state in game.states():
            here = position(board, game, state)
            turns = {position(board, game, after) for after in game.turns(state)}
            assert turns == set(graph.to[graph.to_at[here] : graph.to_at[here + 1]].tolist())
            answers = {position(board, game, after) for after in game.answers(state)}
            assert answers == set(graph.ego_to[graph.ego_at[here] : graph.ego_at[here + 1]].tolist())
