"""Playing a strategy against environments that keep the assumption, compiled: turn by turn, with the tables alone."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_long
from dubins_traffic.kernels.random import DRAW, below
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.synthesis.board import BoardTables
from dubins_traffic.synthesis.game import LARGEST_CHOICE, room
from dubins_traffic.synthesis.moves import list_moves
from dubins_traffic.synthesis.positions import Moves, Numbers, Work
from dubins_traffic.synthesis.strategy import Strategy


class Environment(IntEnum):
    """How the environment plays."""

    RANDOM = 0
    """Any of its moves, each as likely."""
    GREEDY = 1
    """What leaves the ego at the highest rank; what it has owed for `PATIENCE` turns it pays."""


GREEDY: Final = int(Environment.GREEDY)
PATIENCE: Final = 24


@record
class Now:
    """Where a play is."""

    seed: np.uint64
    """Of what the environment draws."""
    environment: int
    """How it plays: the number of an `Environment`."""
    position: int
    """The position; the environment is to move."""
    goal: int
    """The goal of the ego."""
    turn: int
    """Turns played."""
    astray: int
    """How often the ego found no ranked move."""


class Table(NamedTuple):
    """A play: where it is, and what has been seen.

    Attributes
    ----------
    ranks : (G, N) int32
        The strategy.
    now : (1,)
        Where it is.
    age : (D,) int64
        For how many turns each debt has been owed.
    visited, visits, gap : (G,) int64
        Turn of the last visit of each goal, number of visits, longest time without one.
    """

    ranks: Numbers
    now: Rows[Now]
    age: Ints
    visited: Ints
    visits: Ints
    gap: Ints


class Room(NamedTuple):
    """Room for the moves of the environment from one position, and of the ego from the next."""

    work: Work
    others: Moves
    ego: Moves


@dataclass(frozen=True, slots=True)
class Played:
    """What came of a play.

    Attributes
    ----------
    turns : int
        How many were played.
    astray : int
        How often the ego found no ranked move, which ends the play: 0 if the strategy is right.
    visits : tuple of int
        How often each goal was visited.
    gaps : tuple of int
        The most turns between two visits of each goal.
    """

    turns: int
    astray: int
    visits: tuple[int, ...]
    gaps: tuple[int, ...]


def play(
    strategy: Strategy, turns: int, environment: Environment, *, seed: int = 0, position: int | None = None
) -> Played:
    """Return what comes of playing a strategy.

    Parameters
    ----------
    strategy : Strategy
        The ego's.
    turns : int
        Of each side.
    environment : Environment
        How the others play.
    seed : int
        Of what they draw.
    position : int, optional
        Where to begin; the first that the strategy wins, if not given.

    Raises
    ------
    InputError
        If the strategy does not win from `position`, or from anywhere.
    """
    board = strategy.board
    first = strategy.first() if position is None else position
    if not strategy.wins(first):
        raise InputError("the strategy does not win from there", field="position", value=first)
    targets = len(board.road_cells.targets)
    started = table(Now, 1)
    now = started[0]
    now.seed, now.environment, now.position = np.uint64(seed), int(environment), first
    state = Table(
        np.stack([own.rank for own in strategy.ranks]),
        started,
        np.zeros(board.road_cells.cells + len(board.road_cells.goals), dtype=np.int64),
        *(np.zeros(targets, dtype=np.int64) for _ in range(3)),
    )
    moves = Room(Work.of(board), room(board, 1, LARGEST_CHOICE), room(board, 1, LARGEST_CHOICE))
    play_turns(board.tables, turns, moves, state)
    return Played(int(now.turn), int(now.astray), tuple(state.visits.tolist()), tuple(state.gap.tolist()))


@jit
def _visited(table: Table) -> int:
    """Note that the ego is at its goal, if it is; return the goal to seek now."""
    now = table.now[0]
    goal, turn = now.goal, now.turn
    if table.ranks[goal, now.position] == 0:
        table.gap[goal] = max(table.gap[goal], turn - table.visited[goal])
        table.visited[goal] = turn
        table.visits[goal] += 1
        goal = goal + 1 if goal + 1 < table.ranks.shape[0] else 0
        now.goal = goal
    return goal


@jit
def _grow(out: Moves, table: Table) -> int:
    """Note for how long each debt has been owed; return which of `out.owed` is the oldest, or -1."""
    for kind in range(table.age.shape[0]):
        table.age[kind] = -table.age[kind]
    oldest = -1
    for o in range(out.used[0].owed):
        kind = out.owed[o]
        if table.age[kind] <= 0:
            table.age[kind] = 1 - table.age[kind]
        if out.owed_mask[o] and (oldest < 0 or table.age[kind] > table.age[out.owed[oldest]]):
            oldest = o
    for kind in range(table.age.shape[0]):
        table.age[kind] = max(table.age[kind], 0)
    return oldest


@jit
def _answer(ranks: Numbers, goal: int, out: Moves) -> int:
    """Return which of the ego's moves leads to the lowest rank, or -1 if none has a rank."""
    best = -1
    for k in range(out.used[0].ego_to):
        rank = ranks[goal, out.ego_to[k]]
        if rank >= 0 and (best < 0 or rank < ranks[goal, out.ego_to[best]]):
            best = k
    return best


@jit
def _worst(t: BoardTables, ranks: Numbers, goal: int, must: int, room: Room, first: int) -> int:
    """Return the move of the environment that leaves the ego the highest rank.

    Of equals the first from `first` on; only moves in which a car of the bits `must` goes, if any.
    """
    out = room.others
    count = out.used[0].to
    picked = first
    highest = -1
    for k in range(count):
        e = first + k if first + k < count else first + k - count
        if must and (out.moved[e] & must) == 0:
            continue
        list_moves(t, out.to[e], room.work, room.ego)
        best = _answer(ranks, goal, room.ego)
        rank = ranks[goal, room.ego.ego_to[best]] if best >= 0 else t.settings[0].positions
        if rank > highest:
            highest = rank
            picked = e
    return picked


@jit_long
def play_turns(t: BoardTables, turns: int, room: Room, table: Table) -> None:
    """Play turns; stop where a position has no rank.

    Parameters
    ----------
    t
        The board.
    turns : int
        Number of turns.
    room
        Room for the moves of a position.
    table : Table
        Updated.
    """
    now, ranks = table.now[0], table.ranks
    for _ in range(turns):
        list_moves(t, now.position, room.work, room.others)
        goal = _visited(table)
        oldest = _grow(room.others, table)
        picked = below(now.seed, 0, 0, now.turn, DRAW.PLAY, room.others.used[0].to)
        if now.environment == GREEDY:
            must = 0
            if oldest >= 0 and table.age[room.others.owed[oldest]] > PATIENCE:
                must = room.others.owed_mask[oldest]
            picked = _worst(t, ranks, goal, must, room, picked)
        list_moves(t, room.others.to[picked], room.work, room.ego)
        best = _answer(ranks, goal, room.ego)
        if best < 0:
            now.astray += 1
            return
        now.position = room.ego.ego_to[best]
        now.turn += 1
