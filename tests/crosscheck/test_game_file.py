"""The winners of games written as explicit graphs, as a program finds them that reads nothing but the file."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build, save_game
from dubins_traffic.synthesis.solver import solve
from tests.games import ALL, board, pan

PROGRAM = Path(__file__).parents[2] / "examples" / "solve_game.py"


@pytest.mark.parametrize(
    "some",
    [
        board(2, 2, 2),
        board(2, 2, 2, ALL, 3),
        board(2, 2, 10),
        board(2, 2, 2, "E1,E2,E3,E4:unmet,E5,E6", 3),
        board(2, 2, 3, ALL, 3),
        board(2, 2, 3, "E1,E2,E3,E4,E5:moves-up,E6", 3),
        pan(2, (4,)),
        board(2, 2, 3, "E1:any-order,E2,E3,E4,E5,E6"),
        board(2, 2, 2, "E1,E3,E4,E5,E6"),
        board(2, 2, 2, "E1,E2,E3:one-forfeit,E4,E5,E6", 3),
        board(2, 2, 2, "E1,E2,E3:forfeits,E4,E5,E6"),
        board(2, 2, 1, "E1,E2,E3,E4,E6"),
        pan(1, (0, 3), "E1,E2,E3,E5,E6"),
        pan(2, (0, 2), "E1,E2,E3,E5"),
        pan(3, (0, 4), "E1,E2,E3,E4,E5"),
    ],
    ids=lambda some: f"{some.positions} positions, {some.assumption}",
)
def test_winners_are_those_of_a_program_that_reads_the_file(some: Board, tmp_path: Path) -> None:
    game = build(some)
    winners = solve(game).winning
    save_game(game, tmp_path / "game.npz")
    winning = runpy.run_path(str(PROGRAM))["winning"]
    with np.load(tmp_path / "game.npz", allow_pickle=False) as archive:
        assert np.array_equal(winning(dict(archive)), winners)


def test_the_program_prints_what_it_finds(tmp_path: Path) -> None:
    game = build(board(2, 2, 1))
    save_game(game, tmp_path / "game.npz")
    ran = subprocess.run(
        [sys.executable, PROGRAM, "game.npz"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert json.loads(ran.stdout) == {"states": game.positions, "winning": game.positions}
