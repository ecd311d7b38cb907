"""The winners of games of cells, as omega finds them with dd's BDDs, from formulas written apart from ours."""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial
from pathlib import Path

import numpy as np
import pytest
from experiments.synthesis import request

from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.solver import solve
from tests.games import ALL, board, pan
from tests.tools import Solvers, solvers

pytestmark = pytest.mark.tools

SCRIPT = Path(__file__).with_name("omega_game.py")
KEEP_MOVING = "E1:any-order,E2,E3,E4,E5,E6"


@pytest.fixture(scope="module")
def omega() -> Iterator[Solvers]:
    with solvers() as made:
        yield made


def number(some: Board, cells: list[int], before: set[tuple[int, int]]) -> int:
    """Return the position of labelled cars, of which some are before others in one crossing."""
    count = len(some.road_cells.nodes)
    scenes: list[Scene] = []
    for n, node in enumerate(some.road_cells.nodes):
        inside = (WHO.OTHER if cells.index(n) else WHO.EGO) if n in cells else None
        lanes = [count + lane for lane in node.inbound]
        waiting = [car for car, cell in enumerate(cells) if cell in lanes]
        if some.scenery(n).kind.ordered:
            waiting = sorted(waiting, key=lambda car: sum((other, car) in before for other in waiting))
        queue = [(lanes.index(cells[car]), WHO.OTHER if car else WHO.EGO) for car in waiting]
        scenes.append(Scene(inside, tuple(queue if some.scenery(n).kind.ordered else sorted(queue))))
    return some.number(scenes)


@pytest.mark.parametrize(
    "some",
    [
        board(2, 2, 1),
        board(2, 2, 1, "E1,E2,E3,E5,E6"),
        board(2, 2, 2),
        board(2, 2, 2, KEEP_MOVING),
        board(2, 2, 2, "E1,E2,E4,E5,E6"),
        board(2, 2, 2, ALL, 3),
        board(2, 2, 2, "E1,E2,E3,E4:unmet,E5,E6", 3),
        pan(2, (0, 4), ALL, 3),
        pan(2, (0, 4), "E1,E2,E3,E4,E5:moves-up,E6", 3),
        board(3, 4, 1),
        board(3, 4, 1, "E1,E2,E4,E5,E6", 3),
        pan(1, (0, 4), "E1,E2,E3,E5,E6"),
        pan(1, (0, 3), "E1,E2,E3,E5,E6"),
        pan(2, (0, 4), "E1,E2,E3,E5,E6"),
        pan(2, (0, 2), "E1,E2,E3,E5"),
        pan(2, (4,), ALL),
    ],
    ids=lambda some: f"{some.road_cells.cells} cells, {some.others} cars, {some.assumption}",
)
def test_winners_are_those_of_omega(some: Board, omega: Solvers) -> None:
    solution = solve(build(some))
    found = omega.ask("omega", SCRIPT, request(some, lost=True))
    labels = factorial(some.others)
    assert found["valid"] == labels * some.positions
    assert found["winning"] == labels * int(solution.winning.sum())
    lost = {number(some, cells, {(i, j) for i, j in before}) for cells, before in found["lost"]}
    assert lost == set(np.flatnonzero(~solution.winning).tolist())
