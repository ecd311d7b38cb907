"""What the solver works on: the graph of a game, and what is known on the way to a goal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit_long
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.synthesis.arrays import Bytes, Cells, Masks, Numbers
from dubins_traffic.synthesis.board import Tables
from dubins_traffic.synthesis.positions import Moves, Work

UNRANKED = -1
NOBODY = -1
NO_DEBT = -1


@record
class Control:
    """How far the search for a goal is."""

    stopped: int
    """1 to stop as soon as possible."""
    ranked: int
    """How many positions are ranked."""
    next_rank: int
    """The next rank."""
    queued: int
    """Length of the queue."""
    taken: int
    """How much of it has been taken."""
    unfriendly: int
    """1 if something was not ranked because the environment could not keep its assumption there."""


class Graph(NamedTuple):
    """The game (`game.Game`, whose fields have the same shapes here), and the moves of the ego backwards.

    Those into position p are ``back[back_at[p]:back_at[p + 1]]``: `back_at` (N+1,) int64, `back` (F,) int32. `owner`
    (O,) int32 is the position of each debt.

    Of a lean game `to` and `moved` are room for the moves of one position, and `work` and `out` serve to work them
    out; so each thread needs a graph of its own.
    """

    lean: bool
    tables: Tables
    work: Work
    out: Moves
    to_at: Ints
    to: Numbers
    moved: Masks
    ego_at: Ints
    ego_to: Numbers
    back_at: Ints
    back: Numbers
    owed_at: Ints
    owed: Cells
    owed_mask: Masks
    owner: Numbers


class Search(NamedTuple):
    """What is known on the way to one goal: N positions, O debts of D kinds.

    Attributes
    ----------
    rank : (N,) int32
        When each position came into Y, or UNRANKED.
    ready : (N+1,) uint8
        Whether the ego, when it is to move there, can get into Y.
    seen : (N,) int32
        How many of its moves each position has found ready.
    watchers : (N+1,) int32, next_watcher : (N,) int32
        Lists of the positions that watch a move to a position.
    owed_seen : (O,) int32, owed_watchers : (N+1,) int32, owed_next : (O,) int32
        The same for debts.
    candidates : (D,) int32, next_candidate : (O,) int32
        Lists of debts, by kind, all of whose ends are ready.
    mark : (N,) uint8
        Whether a position is in X while that is found.
    depth : (N,) int32
        How many moves a position in X is from Y, if the environment helps.
    members, queue : (N,) int32
        The positions that may be in X; all positions ranked, in order.
    start : (R,) int32
        First rank of the layer of each rank.
    debt : (R,) int16
        What the environment owes in a layer, or NO_DEBT.
    control : (1,)
        How far it is.
    """

    rank: Numbers
    ready: Bytes
    seen: Numbers
    watchers: Numbers
    next_watcher: Numbers
    owed_seen: Numbers
    owed_watchers: Numbers
    owed_next: Numbers
    candidates: Numbers
    next_candidate: Numbers
    mark: Bytes
    depth: Numbers
    members: Numbers
    queue: Numbers
    start: Numbers
    debt: Cells
    control: Rows[Control]

    @classmethod
    def of(cls, positions: int, debts: int, kinds: int) -> Search:
        """Return room for a game of that size, nothing known yet."""

        def numbers(count: int, value: int) -> Numbers:
            return np.full(count, value, dtype=np.int32)

        return cls(
            numbers(positions, UNRANKED),
            np.zeros(positions + 1, dtype=np.uint8),
            numbers(positions, 0),
            numbers(positions + 1, NOBODY),
            numbers(positions, NOBODY),
            numbers(debts, 0),
            numbers(positions + 1, NOBODY),
            numbers(debts, NOBODY),
            numbers(kinds, NOBODY),
            numbers(debts, NOBODY),
            np.zeros(positions, dtype=np.uint8),
            numbers(positions, 0),
            numbers(positions, 0),
            numbers(positions, 0),
            numbers(positions + 1, 0),
            np.full(positions + 1, NO_DEBT, dtype=np.int16),
            table(Control, 1),
        )


@jit_long
def reverse(at: Ints, to: Numbers, back_at: Ints, back: Numbers) -> None:
    """Turn moves round.

    Parameters
    ----------
    at, to : (N+1,) int64, (F,) int32
        The moves from each position.
    back_at, back : (N+1,) int64, (F,) int32
        Set: whence a move leads to each position. `back_at` must be 0 before.
    """
    count = at.shape[0] - 1
    for e in range(to.shape[0]):
        back_at[to[e]] += 1
    total = 0
    for position in range(count + 1):
        total += back_at[position]
        back_at[position] = total
    for position in range(count - 1, -1, -1):
        for e in range(at[position], at[position + 1]):
            back_at[to[e]] -= 1
            back[back_at[to[e]]] = position


@jit_long
def own(owed_at: Ints, owner: Numbers) -> None:
    """Set `owner` (O,) to the position of each debt; those of position p begin at entry p of `owed_at` (N+1,)."""
    for position in range(owed_at.shape[0] - 1):
        for o in range(owed_at[position], owed_at[position + 1]):
            owner[o] = position
