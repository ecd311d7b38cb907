"""The game as an explicit graph: every position, every move of both sides, and what is owed where.

For other people's tools it is saved as a NumPy archive (`.npz`): `header`, JSON in UTF-8 bytes, and the arrays of
`Game` with those that say what the numbers of positions mean. `docs/theory.md` documents it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import table
from dubins_traffic.synthesis.archive import save_arrays
from dubins_traffic.synthesis.board import MOST_OTHERS, Board
from dubins_traffic.synthesis.moves import expand, list_moves
from dubins_traffic.synthesis.positions import Cells, Filled, Flags, Masks, Moves, Numbers, Work, list_scenes
from dubins_traffic.synthesis.queues import WHO

Progress: TypeAlias = Callable[[str, float], object]
"""Told what is being done, and which share of it."""

MOST_POSITIONS: Final = 2**31 - 1
"""Positions are numbered in 32 bits, one number more than there are."""
BLOCK: Final = 8192
SAMPLE: Final = 512
PROGRAM: Final = 160 << 20
"""Bytes that the program takes without any game, about."""
SPARE: Final = 1.2
"""What the allocator does not give back, as a factor."""
LARGEST_CHOICE: Final = 1 << 18
"""Moves that the environment may have in one position."""
WORKERS: Final = min(2, os.cpu_count() or 1)


@dataclass(frozen=True, slots=True)
class Estimate:
    """How large a game will be."""

    positions: int
    """Exact."""
    moves: int
    """Of the environment, about."""
    bytes: int
    """Memory at the peak, about."""
    lean_bytes: int
    """The same for a lean game."""


class Turns(NamedTuple):
    """Moves of the environment from the positions `first` to before ``first + len(at) - 1``.

    Those from position ``first + k`` lead to ``to[at[k]:at[k + 1]]``.
    """

    first: int
    at: Ints
    to: Numbers


@dataclass(frozen=True)
class Game:
    """The game: N positions, E moves of the environment, F of the ego, O debts.

    Position N is none: it stands for the ego having been rammed. A *lean* game does not keep the moves of the
    environment, most of what a game consists of; they are worked out anew each time.
    """

    board: Board
    """What the numbers of positions mean."""
    moves: int
    most_moves: int
    """`moves`, `most_moves`: e, and the most from one position."""
    to_at: Ints
    """Shape (N+1,). Where the moves of the environment from each position begin in `to`. This and the next two are
    empty in a lean game.
    """
    to: Numbers
    """Shape (E,). The positions to which they lead; there the ego moves."""
    moved: Masks
    """Shape (E,). Which of the e-agents that may move entered or left a node, as bits."""
    ego_at: Ints
    """Shape (N+1,). Where the moves of the ego from each position begin in `ego_to`."""
    ego_to: Numbers
    """Shape (F,). The positions to which they lead; there the environment moves."""
    owed_at: Ints
    """Shape (N+1,). Where the debts of each position begin."""
    owed: Cells
    """Shape (O,). A cell: the assumption that whoever is there goes on some time. Number of cells + k: that goal k
    is freed.
    """
    owed_mask: Masks
    """Shape (O,). The bits of `moved` that end the debt; others may."""
    ego_cell: Cells
    """Shape (N,). Cell of the ego."""

    @property
    def positions(self) -> int:
        """N."""
        return self.ego_cell.shape[0]

    @property
    def lean(self) -> bool:
        """Whether the moves of the environment are not kept."""
        return self.to_at.shape[0] == 0

    @property
    def debts(self) -> int:
        """How many kinds of debts there may be: one a cell and one a goal."""
        return self.board.road_cells.cells + len(self.board.road_cells.goals)

    def at_target(self, target: int) -> Flags:
        """Return where (N,) the ego is at one of `RoadCells.targets`."""
        return np.isin(self.ego_cell, np.array(self.board.road_cells.targets[target], dtype=np.int16))

    def turns(self) -> Iterator[Turns]:
        """Yield the moves of the environment from all positions, in order, some positions at a time."""
        if not self.lean:
            yield Turns(0, self.to_at, self.to)
            return
        first = 0
        for pieces in _expanded(self.board, max(64, 4 * self.moves // self.positions), WORKERS):
            for part in pieces:
                yield Turns(first, _starts([part.many]), part.to)
                first += part.many.shape[0]

    def turns_of(self, position: int) -> Numbers:
        """Return the positions to which the environment may bring one."""
        if not self.lean:
            return self.to[self.to_at[position] : self.to_at[position + 1]]
        out = room(self.board, 1, self.most_moves)
        list_moves(self.board.tables, position, Work.of(self.board), out)
        return out.to[: int(out.used[0].to)]

    @cached_property
    def bytes(self) -> int:
        """Memory that the arrays take."""
        arrays = (self.to_at, self.to, self.moved, self.ego_at, self.ego_to, self.owed_at, self.owed)
        return sum(array.nbytes for array in (*arrays, self.owed_mask, self.ego_cell))


def estimate(board: Board) -> Estimate:
    """Return how large the game on a board will be, from a sample of its positions.

    Raises
    ------
    InputError
        If there are too many e-agents, or more positions than can be numbered; or fewer cells than cars.
    """
    if not 1 <= board.others <= MOST_OTHERS:
        raise InputError(
            "not a number of e-agents of the game", field="--cars", value=board.others, expected=f"1 to {MOST_OTHERS}"
        )  # fmt: skip
    count = board.positions
    if count == 0:
        raise InputError("more cars than cells", value=board.others + 1, expected=f"at most {board.road_cells.cells}")
    if count >= MOST_POSITIONS:
        raise InputError("too large a game", value=f"{count} positions", expected=f"less than {MOST_POSITIONS}")
    sizes = np.zeros(3)
    picked = np.unique(np.linspace(0, count - 1, min(SAMPLE, count)).astype(np.int64))
    work, out = Work.of(board), room(board, 1, LARGEST_CHOICE)
    for position in picked.tolist():
        list_moves(board.tables, position, work, out)
        used = out.used[0]
        sizes += (used.to, used.ego_to, used.owed)
    moves, ego_moves, debts = (count * sizes / len(picked)).tolist()
    goals = len(board.road_cells.targets)
    mask = np.dtype(mask_type(board.others)).itemsize
    building = 2 * (4 * ego_moves + (2 + mask) * debts) + 26 * count
    solving = 8 * ego_moves + (6 + mask) * debts + 26 * count
    a_goal, a_way = 46 * count + 12 * debts, 5 * count
    kept = (4 + mask) * moves
    whole = max(building + 2 * kept, solving + kept + goals * a_goal)
    lean = max(building, solving + a_goal + goals * a_way)
    return Estimate(count, int(moves), int(PROGRAM + SPARE * whole), int(PROGRAM + SPARE * lean))


def build(board: Board, *, limit: int | None = None, progress: Progress | None = None, workers: int = WORKERS) -> Game:
    """Return the game on a board.

    Parameters
    ----------
    limit : int, optional
        Bytes of memory that may be used; half of what the machine has, if not given. A game that would take more is
        built lean.

    Raises
    ------
    InputError
        If even lean the game would take more memory than `limit`, and as `estimate`.
    """
    expected = estimate(board)
    allowed = memory() // 2 if limit is None else limit
    lean = expected.bytes > allowed
    size = expected.lean_bytes if lean else expected.bytes
    if size > allowed:
        raise InputError(
            "too large a game",
            value=f"{expected.positions} positions, about {size / 2**20:.0f} MiB",
            expected=f"at most {allowed / 2**20:.0f} MiB (--memory), so fewer cars or a smaller network",
        )
    kept = ", moves not kept" if lean else ""
    what = f"build {expected.positions:,} positions, about {size / 2**20:.0f} MiB{kept}"
    each = max(64, 4 * expected.moves // expected.positions)
    pieces: list[Moves] = []
    for piece in _expanded(board, each, workers):
        pieces += [_without_turns(part) if lean else part for part in piece]
        if progress:
            progress(what, sum(part.many.shape[0] for part in pieces) / expected.positions)
    many = [part.many for part in pieces]
    return Game(
        board,
        sum(int(part.sum()) for part in many),
        max(int(part.max()) for part in many),
        np.empty(0, dtype=np.int64) if lean else _starts(many),
        np.concatenate([part.to for part in pieces]),
        np.concatenate([part.moved for part in pieces]),
        _starts([part.ego_many for part in pieces]),
        np.concatenate([part.ego_to for part in pieces]),
        _starts([part.owed_many for part in pieces]),
        np.concatenate([part.owed for part in pieces]),
        np.concatenate([part.owed_mask for part in pieces]),
        np.concatenate([part.ego_cell for part in pieces]),
    )


def memory() -> int:
    """Return how many bytes of memory the machine has."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _expanded(board: Board, each: int, workers: int) -> Iterator[list[Moves]]:
    """Yield the moves of all positions, in order."""
    count = board.positions
    blocks = iter(range(0, count, BLOCK))
    with ThreadPoolExecutor(workers) as pool:
        running: list[Future[list[Moves]]] = []
        try:
            for first in blocks:
                running.append(pool.submit(_block, board, first, min(first + BLOCK, count), each))
                if len(running) > 2 * workers:
                    yield running.pop(0).result()
            while running:
                yield running.pop(0).result()
        finally:
            for future in running:
                future.cancel()


def _block(board: Board, first: int, last: int, each: int) -> list[Moves]:
    """Return the moves of some positions; `each` guesses how many moves the environment has in one."""
    pieces: list[Moves] = []
    work = Work.of(board)
    while first < last:
        out = room(board, last - first, each)
        done = expand(board.tables, first, last, work, out, first)
        if done == first:
            each *= 2
            continue
        pieces.append(_trimmed(out, done - first))
        first = done
    return pieces


def room(board: Board, rows: int, each: int) -> Moves:
    """Return room for the moves of `rows` positions, about `each` of the environment from one."""
    margin = 64
    turns, debts = rows * each + margin, 2 * rows * board.others + margin + len(board.road_cells.goals)
    masks = mask_type(board.others)
    return Moves(
        np.empty(turns, dtype=np.int32),
        np.empty(turns, dtype=masks),
        np.empty(rows * 5 + margin, dtype=np.int32),
        np.empty(debts, dtype=np.int16),
        np.empty(debts, dtype=masks),
        np.empty(rows, dtype=np.int16),
        np.empty(rows, dtype=np.int32),
        np.empty(rows, dtype=np.int32),
        np.empty(rows, dtype=np.int32),
        table(Filled, 1),
    )


def mask_type(others: int) -> type[np.uint8] | type[np.int64]:
    """Return what holds a bit for each of so many e-agents."""
    return np.uint8 if others <= 8 else np.int64


def _trimmed(out: Moves, rows: int) -> Moves:
    """Return a copy of what has been used."""
    used = out.used[0]
    return Moves(
        out.to[: used.to].copy(),
        out.moved[: used.to].copy(),
        out.ego_to[: used.ego_to].copy(),
        out.owed[: used.owed].copy(),
        out.owed_mask[: used.owed].copy(),
        out.ego_cell[:rows].copy(),
        out.many[:rows].copy(),
        out.ego_many[:rows].copy(),
        out.owed_many[:rows].copy(),
        out.used,
    )


def _without_turns(part: Moves) -> Moves:
    """Return the moves of a block without those of the environment, the numbers of which stay."""
    return part._replace(to=part.to[:0].copy(), moved=part.moved[:0].copy())


def _starts(counts: list[Numbers]) -> Ints:
    """Return where the entries of each position begin, and where the last end."""
    total = np.zeros(sum(part.shape[0] for part in counts) + 1, dtype=np.int64)
    np.cumsum(np.concatenate(counts), out=total[1:])
    return total


FORMAT: Final = "dubins-traffic game"
VERSION: Final = 2
WHO_NAMES: Final = ("e-agent", "ego", "e-agent that has forfeited")


def scene_numbers(board: Board) -> Numbers:
    """Return the scene (N, V) of each node in each position, numbered as in the header."""
    numbers = np.empty((board.positions, len(board.road_cells.nodes)), dtype=np.int32)
    room = np.empty(len(board.road_cells.nodes), dtype=np.int64)
    list_scenes(board.tables, room, numbers)
    return numbers


def header(board: Board) -> dict[str, Any]:
    """Return what the numbers in the file mean."""
    road_cells = board.road_cells
    kinds = list(board.sceneries)
    return {
        "format": FORMAT,
        "version": VERSION,
        "network": road_cells.network.to_document(),
        "goals": [list(road_cells.network.intersections[goal]) for goal in road_cells.goals],
        "order_degree": road_cells.order_degree,
        "cars": board.others,
        "assume": list(board.assumption.words()),
        "cells": [road_cells.name(cell) for cell in range(road_cells.cells)],
        "nodes": [
            {
                "inbound": [len(road_cells.nodes) + lane for lane in node.inbound],
                "exits": [len(road_cells.nodes) + lane for lane in node.exits],
                "kind": kinds.index(board.scenery(n).kind),
            }
            for n, node in enumerate(road_cells.nodes)
        ],
        "goal_nodes": [list(nodes) for nodes in road_cells.goal_nodes],
        "targets": [list(nodes) for nodes in road_cells.targets],
        "kinds": [
            [
                {
                    "inside": None if scene.inside is None else WHO_NAMES[scene.inside == WHO.EGO],
                    "queue": [[slot, WHO_NAMES[who]] for slot, who in scene.queue],
                    "parked": list(scene.parked),
                }
                for scene in board.sceneries[kind].scenes
            ]
            for kind in kinds
        ],
    }


def save_game(game: Game, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a game to a file, as `save_arrays` does; InputError also if the game is lean."""
    if game.lean:
        raise InputError(
            "too large a game to be written",
            file=str(path),
            value=f"{game.moves} moves of the environment",
            expected="memory for all of them (--memory)",
        )
    arrays = {
        "scene": scene_numbers(game.board),
        "ego_cell": game.ego_cell,
        "to_at": game.to_at,
        "to": game.to,
        "ego_at": game.ego_at,
        "ego_to": game.ego_to,
        "owed_at": game.owed_at,
        "owed": game.owed,
    }
    save_arrays(path, header(game.board), arrays, overwrite=overwrite)
