"""Strategies: a rank table for each goal, kept in a file, and asked for moves.

The ego moves to the position of lowest rank for the goal it seeks; having reached it, it seeks the next. A file is a
NumPy archive (`.npz`): `header`, JSON in UTF-8 bytes with the game and the version of the format, and for each goal k
the arrays `rank_k`, `start_k` and `debt_k` (`solver.Ranks`).
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from dubins_traffic import files
from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.arena import Arena
from dubins_traffic.synthesis.arrays import Numbers
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import LARGEST_CHOICE, room
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

    def goal_after(self, position: int, goal: int) -> int:
        """Return the goal to seek in a position, when `goal` has been sought: the next if it has been reached."""
        return (goal + 1) % len(self.ranks) if self.ranks[goal].rank[position] == 0 else goal

    def choose(self, position: int, goal: int) -> int:
        """Return the position to which the ego moves from `position`, or that itself if it stays.

        Raises
        ------
        InputError
            If the strategy does not win from there.
        """
        board = self.board
        out = room(board, 1, LARGEST_CHOICE)
        list_moves(board.tables, board.others, board.positions, position, Work.of(board), out)
        options = out.ego_to[: out.used[1]]
        ranks = self.ranks[goal].rank[options]
        if (ranks < 0).all():
            raise InputError("the strategy does not win from there", field="position", value=position)
        return int(options[np.argmin(np.where(ranks < 0, np.iinfo(np.int32).max, ranks))])

    def save(self, path: str | Path) -> None:
        """Write the strategy to a file, whole or not at all; InputError if that can't be done."""
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
            "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
            **{f"rank_{k}": _narrow(own.rank) for k, own in enumerate(self.ranks)},
            **{f"start_{k}": own.start for k, own in enumerate(self.ranks)},
            **{f"debt_{k}": own.debt for k, own in enumerate(self.ranks)},
        }

        def write(neighbour: Path) -> None:
            with neighbour.open("wb") as stream:
                np.savez_compressed(stream, **arrays)

        files.replace_file(Path(path), write)

    @classmethod
    def load(cls, path: str | Path) -> Strategy:
        """Return the strategy in a file.

        Raises
        ------
        InputError
            If it can't be read, is no strategy, or of an unknown version. Whether it wins is for `checker.check`.
        """
        try:
            with Path(path).open("rb") as stream:
                if not zipfile.is_zipfile(stream):
                    raise zipfile.BadZipFile("no NumPy archive, or only a part of one")
                with np.load(stream, allow_pickle=False) as archive:
                    arrays = {name: archive[name] for name in archive.files}
        except FileNotFoundError:
            raise InputError("no such file", file=str(path)) from None
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
            raise InputError(f"can't be read as a strategy ({error})", file=str(path)) from None
        try:
            return _strategy(arrays)
        except InputError as error:
            raise error.within(file=str(path)) from None


def _narrow(rank: Numbers) -> Any:
    """Return ranks in 16 bits where they fit."""
    return rank.astype(np.int16) if rank.max(initial=0) < 2**15 else rank


def _strategy(arrays: dict[str, Any]) -> Strategy:
    header = _header(arrays)
    network = RoadNetwork.from_document(header["network"])
    goals = [network.vertex(tuple(goal)) for goal in header["goals"]]
    arena = Arena.of(network, goals, header["order_degree"])
    board = Board(arena, Assumption.parse(header["assume"]), header["cars"])
    ranks: list[Ranks] = []
    for k in range(len(arena.targets)):
        names = [f"{name}_{k}" for name in ("rank", "start", "debt")]
        missing = [name for name in names if name not in arrays or arrays[name].ndim != 1]
        if missing:
            raise InputError("a table is missing", field=missing[0], expected="one a goal")
        rank, start, debt = (arrays[name] for name in names)
        if rank.shape != (board.positions,) or rank.max(initial=-1) >= len(start) or len(start) != len(debt):
            raise InputError("tables of another game", field=f"rank_{k}", value=rank.shape)
        ranks.append(Ranks(rank.astype(np.int32), start.astype(np.int32), debt.astype(np.int16)))
    return Strategy(board, tuple(ranks))


def _header(arrays: dict[str, Any]) -> dict[str, Any]:
    try:
        header: dict[str, Any] = json.loads(arrays["header"].tobytes().decode())
    except (KeyError, ValueError):
        raise InputError("no strategy", field="header", expected="the header of a strategy") from None
    if header.get("format") != FORMAT:
        raise InputError("no strategy", field="format", value=header.get("format"), expected=FORMAT)
    if header.get("version") != VERSION:
        raise InputError(
            "of an unknown version", field="version", value=header.get("version"), expected=str(VERSION)
        )
    for name in ("network", "goals", "order_degree", "cars", "assume"):
        if name not in header:
            raise InputError("missing", field=f"header.{name}")
    return header
