"""Strategies: a rank table for each goal, kept in a file, and asked for moves.

The ego moves to the position of lowest rank for the goal it seeks; having reached it, it seeks the next. A file is a
NumPy archive (`.npz`): `header`, JSON in UTF-8 bytes with the game and the version of the format, and for each goal k
the arrays `rank_k`, `start_k` and `debt_k` (`solver.Ranks`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.archive import Archive, save_arrays
from dubins_traffic.synthesis.arena import Arena
from dubins_traffic.synthesis.arrays import Numbers
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import MOST_OTHERS, Board
from dubins_traffic.synthesis.game import LARGEST_CHOICE, MOST_POSITIONS, room
from dubins_traffic.synthesis.moves import Work, list_moves
from dubins_traffic.synthesis.solver import Ranks, Solution

FORMAT: Final = "dubins-traffic strategy"
VERSION: Final = 2


@dataclass(frozen=True)
class Strategy:
    """How the ego wins.

    Attributes
    ----------
    board : Board
        What the numbers of positions mean.
    ranks : tuple of Ranks
        One table a goal, in the order of `Arena.goals`.
    """

    board: Board
    ranks: tuple[Ranks, ...]

    @classmethod
    def of(cls, solution: Solution) -> Strategy:
        """Return the strategy that was found with a solution."""
        return cls(solution.game.board, solution.ranks)

    def wins(self, position: int) -> bool:
        """Say whether the strategy wins from a position in which the environment is to move."""
        return 0 <= position < self.board.positions and all(own.rank[position] >= 0 for own in self.ranks)

    def first(self) -> int:
        """Return the first position from which the strategy wins.

        Raises
        ------
        InputError
            If there is none.
        """
        won = np.logical_and.reduce([own.rank >= 0 for own in self.ranks])
        if not won.any():
            raise InputError("a strategy that wins from nowhere", expected="some position")
        return int(np.argmax(won))

    def choose(self, position: int, goal: int) -> int:
        """Return the position to which the ego moves from `position`, or that itself if it stays.

        Raises
        ------
        InputError
            If the strategy does not win from there.
        """
        board = self.board
        out = room(board, 1, LARGEST_CHOICE)
        list_moves(board.tables, position, Work.of(board), out)
        options = out.ego_to[: out.used[0].ego_to]
        ranks = self.ranks[goal].rank[options]
        if (ranks < 0).all():
            raise InputError("the strategy does not win from there", field="position", value=position)
        return int(options[np.argmin(np.where(ranks < 0, np.iinfo(np.int32).max, ranks))])

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the strategy to a file, as `save_arrays` does."""
        arena = self.board.arena
        header = {
            "format": FORMAT,
            "version": VERSION,
            "network": arena.network.to_document(),
            "goals": [list(arena.network.intersections[goal]) for goal in arena.goals],
            "order_degree": arena.order_degree,
            "cars": self.board.others,
            "assume": list(self.board.assumption.words()),
        }
        arrays: dict[str, Any] = {
            **{f"rank_{k}": _narrow(own.rank) for k, own in enumerate(self.ranks)},
            **{f"start_{k}": own.start for k, own in enumerate(self.ranks)},
            **{f"debt_{k}": own.debt for k, own in enumerate(self.ranks)},
        }
        save_arrays(path, header, arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> Strategy:
        """Return the strategy in a file.

        Raises
        ------
        InputError
            If it can't be read, is no strategy, of an unknown version, or has no rank in any position for some goal.
            Whether it wins elsewhere is for `checker.check`.
        """
        with Archive(path, "strategy") as archive:
            try:
                found = _strategy(archive)
                found.first()
            except InputError as error:
                raise error if error.file else error.within(file=str(path)) from None
        return found


class _Header(BaseModel):
    """What the header of a file says of the game, as `Strategy.save` writes it."""

    model_config = ConfigDict(strict=True)

    network: dict[str, Any]
    goals: list[Annotated[list[int], Field(min_length=2, max_length=2)]]
    order_degree: Annotated[int, Field(ge=1)]
    cars: Annotated[int, Field(ge=1, le=MOST_OTHERS)]
    assume: list[str]


def _narrow(rank: Numbers) -> Any:
    """Return ranks in 16 bits where they fit."""
    return rank.astype(np.int16) if rank.max(initial=0) < 2**15 else rank


def _strategy(archive: Archive) -> Strategy:
    header = _header(archive)
    network = RoadNetwork.from_document(header.network)
    goals = [network.vertex((x, y)) for x, y in header.goals]
    arena = Arena.of(network, goals, header.order_degree)
    board = Board(arena, Assumption.parse(header.assume), header.cars)
    if not 0 < board.positions < MOST_POSITIONS:
        raise InputError("no game", field="header.cars", value=header.cars, expected="one that has positions")
    return Strategy(board, tuple(_ranks(archive, board, k) for k in range(len(arena.targets))))


def _ranks(archive: Archive, board: Board, target: int) -> Ranks:
    """Return the tables for one target; InputError if they are none of the game."""
    count, debts = board.positions, board.arena.cells + len(board.arena.goals)
    rank = archive.array(f"rank_{target}", np.int32, count, exactly=True)
    start = archive.array(f"start_{target}", np.int32, count + 1)
    debt = archive.array(f"debt_{target}", np.int16, len(start), exactly=True)
    tables = ((f"rank_{target}", rank, len(start)), (f"start_{target}", start, len(start)))
    for name, table, end in (*tables, (f"debt_{target}", debt, debts)):
        low = 0 if table is start else -1
        if table.min(initial=0) < low or table.max(initial=-1) >= end:
            raise InputError(
                "tables of another game", field=name, expected=f"numbers from {low} to {end - 1}"
            )
    return Ranks(rank.astype(np.int32), start.astype(np.int32), debt.astype(np.int16))


def _header(archive: Archive) -> _Header:
    header = archive.header()
    if header.get("format") != FORMAT:
        raise InputError("no strategy", field="format", value=header.get("format"), expected=FORMAT)
    if header.get("version") != VERSION:
        raise InputError(
            "of an unknown version", field="version", value=header.get("version"), expected=str(VERSION)
        )
    try:
        return _Header.model_validate(header)
    except ValidationError as error:
        (first, *_) = error.errors(include_url=False)
        place = ".".join(str(part) for part in first["loc"])
        raise InputError("not as in a strategy", field=f"header.{place}", expected=first["msg"]) from None
