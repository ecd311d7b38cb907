"""The inner fixpoints of GR(1), compiled: from where can the ego reach a goal, if it waits while the others owe moves.

Computed is, for one goal, mu Y . (target) or Cpre(Y) or OR_i nu X . (Cpre(Y or X) and debt_i), as in the algorithm of
Piterman, Pnueli and Sa'ar (VMCAI 2006, equation 2). Cpre(S) holds in a position if whatever the environment makes of
it, the ego can get into S.

Each position watches one of its moves from which the ego can't yet get into Y, and looks for another only when that
changes. So all steps Cpre(Y) together look at each move once. In the same way each debt watches the moves that end it:
while one of them leads astray, the position can't be in X, and need not be looked at.

The rank of a position is the step in which it came into Y. Ranks of one layer (`start`) belong to one X.

The graph of a game, and what is known on the way to a goal, are the tables that the kernels work on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_long
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.synthesis.board import BoardTables
from dubins_traffic.synthesis.moves import environment
from dubins_traffic.synthesis.positions import Bytes, Cells, Flags, Masks, Moves, Numbers, Work, unrank

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
    tables: BoardTables
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


class GoalSearch(NamedTuple):
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
    def of(cls, positions: int, debts: int, kinds: int) -> GoalSearch:
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
def assign_owners(owed_at: Ints, owner: Numbers) -> None:
    """Set `owner` (O,) to the position of each debt; those of position p begin at entry p of `owed_at` (N+1,)."""
    for position in range(owed_at.shape[0] - 1):
        for o in range(owed_at[position], owed_at[position + 1]):
            owner[o] = position


@jit
def _turns(g: Graph, position: int) -> tuple[int, int]:
    """Return where the moves of the environment from a position begin and end in `g.to`; of a lean game, now."""
    if not g.lean:
        return int(g.to_at[position]), int(g.to_at[position + 1])
    g.out.used[0].to = 0
    unrank(g.tables, position, g.work.scenes)
    environment(g.tables, g.work, g.out)
    return 0, int(g.out.used[0].to)


@jit_long
def forced(g: Graph, safe: Flags, ready: Bytes, result: Flags) -> None:
    """Set `result` (N,) to Cpre of `safe` (N,); `ready` (N+1,) is room."""
    count = safe.shape[0]
    ready[count] = 0
    for position in range(count):
        ready[position] = 0
        for e in range(g.ego_at[position], g.ego_at[position + 1]):
            if safe[g.ego_to[e]]:
                ready[position] = 1
                break
    for position in range(count):
        result[position] = True
        first, last = _turns(g, position)
        for e in range(first, last):
            if ready[g.to[e]] == 0:
                result[position] = False
                break


@jit
def _watch(g: Graph, s: GoalSearch, position: int) -> bool:
    """Let a position watch its next move that is not ready; true if there is none."""
    first, last = _turns(g, position)
    for e in range(first + s.seen[position], last):
        to = g.to[e]
        if s.ready[to] == 0:
            s.seen[position] = e - first
            s.next_watcher[position] = s.watchers[to]
            s.watchers[to] = position
            return False
    s.seen[position] = last - first
    return True


@jit
def _watch_owed(g: Graph, s: GoalSearch, o: int) -> None:
    """Let a debt watch the next of its ends that is not ready; if there is none it becomes a candidate."""
    position = g.owner[o]
    first, last = _turns(g, position)
    for e in range(first + s.owed_seen[o], last):
        to = g.to[e]
        if (g.moved[e] & g.owed_mask[o]) != 0 and s.ready[to] == 0:
            s.owed_seen[o] = e - first
            s.owed_next[o] = s.owed_watchers[to]
            s.owed_watchers[to] = o
            return
    s.next_candidate[o] = s.candidates[g.owed[o]]
    s.candidates[g.owed[o]] = o


@jit
def _rank(s: GoalSearch, position: int, rank: int) -> None:
    """Take a position into Y."""
    control = s.control[0]
    s.rank[position] = rank
    s.queue[control.queued] = position
    control.queued += 1
    control.ranked += 1


@jit
def _attract(g: Graph, s: GoalSearch) -> None:
    """Take into Y, again and again, what is in Cpre(Y)."""
    control = s.control[0]
    while control.taken < control.queued and control.stopped == 0:
        reached = s.queue[control.taken]
        control.taken += 1
        following = int(s.rank[reached]) + 1
        while following < control.next_rank and s.start[following] != following:
            following += 1
        for e in range(g.back_at[reached], g.back_at[reached + 1]):
            _make_ready(g, s, g.back[e], following)
    if control.queued > 0:
        last = int(s.rank[s.queue[control.queued - 1]])
        for rank in range(control.next_rank, last + 1):
            s.start[rank] = rank
            s.debt[rank] = NO_DEBT
        control.next_rank = max(control.next_rank, last + 1)


@jit
def _make_ready(g: Graph, s: GoalSearch, to: int, following: int) -> None:
    """The ego can get into Y from `to`: tell all who watch it."""
    if s.ready[to]:
        return
    s.ready[to] = 1
    position = int(s.watchers[to])
    while position != NOBODY:
        after = int(s.next_watcher[position])
        if s.rank[position] == UNRANKED and _watch(g, s, position):
            _rank(s, position, following)
        position = after
    o = int(s.owed_watchers[to])
    while o != NOBODY:
        after = int(s.owed_next[o])
        if s.rank[g.owner[o]] == UNRANKED:
            _watch_owed(g, s, o)
        o = after


@jit
def _stays(g: Graph, s: GoalSearch, position: int) -> bool:
    """Say whether the ego can get from a position into Y or the marked ones, whatever the environment does."""
    first, last = _turns(g, position)
    for e in range(first + s.seen[position], last):
        to = g.to[e]
        if s.ready[to]:
            continue
        if to >= s.mark.shape[0]:
            return False
        stays = False
        for k in range(g.ego_at[to], g.ego_at[to + 1]):
            if s.mark[g.ego_to[k]]:
                stays = True
                break
        if not stays:
            return False
    return True


@jit
def _gather(g: Graph, s: GoalSearch, kind: int) -> int:
    """Mark and list the candidates of a kind that are not in Y yet; return how many."""
    count = 0
    kept = NOBODY
    o = s.candidates[kind]
    while o != NOBODY:
        after = s.next_candidate[o]
        position = g.owner[o]
        if s.rank[position] == UNRANKED:
            s.next_candidate[o] = kept
            kept = o
            s.members[count] = position
            s.mark[position] = 1
            count += 1
        o = after
    s.candidates[kind] = kept
    return count


@jit
def _shrink(g: Graph, s: GoalSearch, count: int) -> int:
    """Unmark members until the ego can stay among those left; return how many are left, first in `members`."""
    before = count + 1
    while count < before:
        before = count
        count = 0
        for k in range(before):
            position = s.members[k]
            if _stays(g, s, position):
                s.members[count] = position
                count += 1
            else:
                s.mark[position] = 0
    return count


@jit
def _settle(s: GoalSearch, kind: int, count: int, layered: bool) -> bool:
    """Take the members into Y as one layer, ranked by their depth if `layered`; say whether there are any."""
    control = s.control[0]
    first = control.next_rank
    rank = first
    for k in range(count):
        position = s.members[k]
        s.mark[position] = 0
        if layered:
            rank = first + int(s.depth[position]) - 1
        _rank(s, position, rank)
    if count > 0:
        for filled in range(first, rank + 1):
            s.start[filled] = first
            s.debt[filled] = kind
        control.next_rank = rank + 1
    return count > 0


@jit
def _wait(g: Graph, s: GoalSearch, kind: int) -> bool:
    """Take into Y where the ego can wait until the environment pays a debt; say whether there is any such place."""
    return _settle(s, kind, _shrink(g, s, _gather(g, s, kind)), False)


@jit
def _wait_friendly(g: Graph, s: GoalSearch, kind: int) -> bool:
    """Do as `_wait`, but only where the environment can pay: some of its moves, answered by the ego, lead into Y.

    Who needs more moves gets a higher rank, so that the ego, which seeks low ranks, does answer so.
    """
    count = _shrink(g, s, _gather(g, s, kind))
    before = count + 1
    while 0 < count < before:
        before = count
        count = _possible(g, s, count)
        if count < before:
            s.control[0].unfriendly = 1
            count = _shrink(g, s, count)
    return _settle(s, kind, count, True)


@jit
def _possible(g: Graph, s: GoalSearch, count: int) -> int:
    """Keep the members from which the environment has a way into Y, sorted by its length; return how many."""
    for k in range(count):
        s.depth[s.members[k]] = 0
    kept = 0
    before = -1
    depth = 1
    while before < kept:
        before = kept
        for k in range(before, count):
            position = s.members[k]
            if _one_nearer(g, s, position, depth):
                s.depth[position] = depth
                s.members[k] = s.members[kept]
                s.members[kept] = position
                kept += 1
        depth += 1
    for k in range(kept, count):
        s.mark[s.members[k]] = 0
    return kept


@jit
def _one_nearer(g: Graph, s: GoalSearch, position: int, depth: int) -> bool:
    """Say whether some move of the environment, answered by the ego, leads into Y or to a member of less depth."""
    first, last = _turns(g, position)
    for e in range(first, last):
        to = g.to[e]
        if s.ready[to]:
            return True
        if to >= s.mark.shape[0]:
            continue
        for k in range(g.ego_at[to], g.ego_at[to + 1]):
            nearer = s.depth[g.ego_to[k]]
            if s.mark[g.ego_to[k]] and 0 < nearer < depth:
                return True
    return False


@jit_long
def reach(g: Graph, target: Flags, cells: int, friendly: bool, s: GoalSearch) -> None:
    """Rank all positions from which the ego can reach a target.

    Parameters
    ----------
    g : Graph
        The game.
    target : (N,) bool
        Where the goal has been reached.
    cells : int
        Debts below that number are ended by a move of one car.
    friendly : bool
        Whether the ego waits for a goal to be freed only where the environment can free it.
    s : GoalSearch
        Fresh room; the result.
    """
    for position in range(target.shape[0]):
        if target[position]:
            _rank(s, position, 0)
    for position in range(target.shape[0]):
        if not target[position]:
            _watch(g, s, position)
            for o in range(g.owed_at[position], g.owed_at[position + 1]):
                _watch_owed(g, s, o)
    _attract(g, s)
    more = True
    while more and s.control[0].stopped == 0:
        more = False
        for kind in range(s.candidates.shape[0]):
            if s.candidates[kind] == NOBODY or (kind >= cells and more):
                continue
            if _wait_friendly(g, s, kind) if friendly and kind >= cells else _wait(g, s, kind):
                more = True
                _attract(g, s)
