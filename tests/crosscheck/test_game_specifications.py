"""Games of cells as specifications: others find the winners that we find, start by start.

TuLiP reads its own form; what is written for slugs and for tools of SYNTCOMP is solved with omega and dd.
`acacia_winners.py` asks Acacia-Bonsai, too.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.specification import specification_text
from tests.games import ALL, board, pan, positions
from tests.tools import Solvers, solvers

pytestmark = pytest.mark.tools


GAMES = [
    (board(2, 2, 1), 4),
    (board(2, 2, 1, "E1,E2,E3,E5,E6"), 6),
    (board(2, 2, 1, ALL, 3), 4),
    (board(2, 2, 1, "E1,E2,E4,E5,E6", 3), 4),
    (pan(1, (0, 4), "E1,E2,E3,E5,E6"), 4),
    (pan(1, (0, 3), ALL, 3), 4),
    (pan(1, (4,), ALL), 3),
    (board(2, 2, 2), 2),
    (board(2, 2, 2, "E1,E2,E3,E4:unmet,E5,E6", 3), 2),
    (pan(2, (0, 4), ALL, 3), 1),
    (pan(2, (0, 4), "E1,E2,E3,E4,E5:moves-up,E6", 3), 1),
]


FULL = os.environ.get("DUBINS_TRAFFIC_SPECIFICATIONS") == "full"
"""Whether the largest games are solved in all forms, as `make test-all` does."""


def called(some: Board) -> str:
    return f"{some.road_cells.cells} cells, {some.others} cars, {some.assumption}"


@pytest.fixture(scope="module")
def others() -> Iterator[Solvers]:
    with solvers() as made:
        yield made


LEFT_OUT = {} if FULL else {len(GAMES) - 2: ".tlsf", len(GAMES) - 1: ".structuredslugs"}
"""Omega takes longest for the last two games, in either form: each of them is solved in the other."""
EACH = [
    pytest.param(some, count, ending, id=f"{ending}-{called(some)}")
    for number, (some, count) in enumerate(GAMES)
    for ending in (".py", ".structuredslugs", ".tlsf")
    if LEFT_OUT.get(number) != ending
]


@pytest.mark.parametrize(("some", "count", "ending"), EACH)
def test_winners_are_those_of_other_solvers(some: Board, count: int, ending: str, others: Solvers) -> None:
    winning = solve(build(some)).winning
    starts = list(positions(some, count))
    texts = [specification_text(some, cells, ending) for cells, _ in starts]
    tool, script = ("tulip", "tulip_realizable.py") if ending == ".py" else ("omega", "written_game.py")
    found = others.ask(tool, Path(__file__).with_name(script), texts)
    assert found == [bool(winning[position]) for _, position in starts]
