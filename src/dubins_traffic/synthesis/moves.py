"""The moves of the game, compiled: what the environment may make of a position, and then the ego.

A turn of the environment moves any of its cars at once: each that may goes on by one cell. First all leave their
cells, then they arrive, so a lane may be entered in the turn in which it is left. Cars that come to one crossing in
one turn take their places in an order that the environment chooses.

What the environment owes in a position stands here too: its clauses are docs/rules.md#E3 to docs/rules.md#E6;
docs/theory.md says what the game makes of them.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_long
from dubins_traffic.synthesis.board import BoardTables
from dubins_traffic.synthesis.positions import MOST_CHOICES, Moves, Work, rank, unrank
from dubins_traffic.synthesis.queues import IMPOSSIBLE, SLOTS, WHO


@jit
def _inside(t: BoardTables, work: Work, node: int) -> int:
    """Return who is in a node: 0 nobody or no such node, 1 an e-agent, 2 the ego."""
    return int(t.inside[t.base[node] + work.scenes[node]]) if node >= 0 else 0


@jit
def _in_lane(t: BoardTables, work: Work, lane: int) -> int:
    """Return who is in a lane: 0 nobody, 1 an e-agent, 2 the ego."""
    end = t.base[t.lane_node[lane]] + work.scenes[t.lane_node[lane]]
    if (t.taken[end] >> t.lane_slot[lane] & 1) == 0:
        return 0
    return 1 if t.others_slots[end] >> t.lane_slot[lane] & 1 else WHO.EGO + 1


@jit
def _ways_out(t: BoardTables, work: Work, node: int) -> tuple[bool, int]:
    """Say whether an exit of a node is free; and whether the ego is in one (2), in the lane beside one (1) or not (0).

    Away from crossings the way back is no exit. In a node of several exits nobody knows who came by which, so there
    two must be free.
    """
    count = t.exit_at[node + 1] - t.exit_at[node]
    left = 2 if count > 1 and t.crossing[node] == 0 else 1
    ego = 0
    for k in range(t.exit_at[node], t.exit_at[node + 1]):
        lane = t.exits[k]
        inside = _in_lane(t, work, lane)
        left -= 1 if inside == 0 else 0
        if inside == WHO.EGO + 1:
            ego = 2
        elif _in_lane(t, work, lane ^ 1) == WHO.EGO + 1:
            ego = max(ego, 1)
    return left <= 0, ego


@jit
def _may_pass(t: BoardTables, work: Work, node: int) -> bool:
    """E5: say whether who waits before a bend or dead end that is clear has no excuse to wait there."""
    free, ego = _ways_out(t, work, node)
    opposite = _inside(t, work, t.opposite[node])
    if opposite == WHO.EGO + 1:
        return False
    if t.settings[0].moves_up:
        return free or ego != 2
    return free and not (t.settings[0].unmet and opposite)


@jit
def _may_leave(t: BoardTables, work: Work, node: int) -> bool:
    """E4: say whether who is in a node has no excuse to stay there."""
    free, _ = _ways_out(t, work, node)
    opposite = _inside(t, work, t.opposite[node])
    return free and opposite != WHO.EGO + 1 and not (t.settings[0].unmet and opposite)


@jit
def _to_free(t: BoardTables, work: Work, goal: int) -> int:
    """E6: return a node of a goal that an e-agent is in, or -1 if there is none or the ego keeps the goal closed."""
    node_to_free = -1
    free = False
    ego = False
    for v in range(t.base.shape[0]):
        if t.goal[v] == goal and _inside(t, work, v) == 1:
            node_to_free = v
            out, near = _ways_out(t, work, v)
            free = free or out
            ego = ego or near > 0 or _inside(t, work, t.opposite[v]) == WHO.EGO + 1
    return -1 if ego and not free else node_to_free


@jit
def owe(t: BoardTables, work: Work, out: Moves) -> bool:
    """Write what the environment owes in `work.scenes`; false if there is no room."""
    used = out.used[0].owed
    if used + 2 * t.settings[0].others + t.goal_nodes.shape[0] > out.owed.shape[0]:
        return False
    for v in range(t.base.shape[0]):
        scene = t.base[v] + work.scenes[v]
        if t.owing[scene] and (t.crossing[v] or _may_pass(t, work, v)):
            for slot in range(SLOTS):
                if t.owing[scene] >> slot & 1:
                    out.owed[used] = t.base.shape[0] + t.inbound[v, slot]
                    out.owed_mask[used] = _bits(work, v)
                    used += 1
        if t.inside[scene] == 1 and t.settings[0].leaves and _may_leave(t, work, v):
            out.owed[used] = v
            out.owed_mask[used] = _bits(work, v)
            used += 1
    if t.settings[0].frees:
        for goal in range(t.goal_nodes.shape[0]):
            v = _to_free(t, work, goal)
            if v >= 0:
                out.owed[used] = t.settings[0].cells + goal
                out.owed_mask[used] = _bits(work, v) if t.goal_nodes[goal] == 1 else 0
                used += 1
    out.used[0].owed = used
    return True


@jit
def _bits(work: Work, node: int) -> int:
    """Return the bits of the e-agents that may move at a node."""
    bits = 0
    for u in range(work.total[0].units):
        if work.node[u] == node:
            bits |= 1 << u
    return bits


class _Choice(NamedTuple):
    """Choices of an e-agent; what is not negative is the lane into which it leaves."""

    STAY: int = -1
    RENEW: int = -2
    ENTER: int = -3


CHOICE: Final = _Choice()
INSIDE = -1
"""The slot of a car in a node."""


@jit
def _units(t: BoardTables, work: Work) -> None:
    """List the e-agents that may move and their choices; note whether one may ram the ego."""
    count = 0
    work.total[0].rammed = 0
    for v in range(t.base.shape[0]):
        scene = t.base[v] + work.scenes[v]
        if t.inside[scene] == 1:
            choices = 1
            for k in range(t.exit_at[v], t.exit_at[v + 1]):
                lane = t.exits[k]
                end = t.base[t.lane_node[lane]] + work.scenes[t.lane_node[lane]]
                bit = 1 << t.lane_slot[lane]
                if (t.taken[end] & bit) == 0 or (t.open[end] & bit) != 0:
                    work.choice[count, choices] = lane
                    choices += 1
                elif (t.others_slots[end] & bit) == 0 and t.settings[0].yields == 0:
                    work.total[0].rammed = 1
            count = _unit(work, count, v, INSIDE, choices)
        movable = t.open[scene] | t.may_forfeit[scene] | t.parked[scene]
        for slot in range(SLOTS):
            bit = 1 << slot
            if movable & bit:
                choices = 1
                if t.open[scene] & bit:
                    work.choice[count, choices] = CHOICE.ENTER
                    choices += 1
                if (t.may_forfeit[scene] | t.parked[scene]) & bit:
                    work.choice[count, choices] = CHOICE.RENEW
                    choices += 1
                count = _unit(work, count, v, slot, choices)
    work.total[0].units = count


@jit
def _unit(work: Work, count: int, node: int, slot: int, choices: int) -> int:
    """Note an e-agent with more choices than to stay; return how many there are."""
    work.choice[count, 0] = CHOICE.STAY
    work.node[count] = node
    work.slot[count] = slot
    work.choices[count] = choices
    work.chosen[count] = 0
    return count + 1


@jit
def _next_choice(work: Work) -> bool:
    """Go on to the next joint choice; false after the last."""
    for u in range(work.total[0].units):
        work.chosen[u] += 1
        if work.chosen[u] < work.choices[u]:
            return True
        work.chosen[u] = 0
    return False


@jit
def _depart(t: BoardTables, work: Work) -> int:
    """Take all that move from their cells and list who arrives; return the bits of `Moves.moved`, or -1."""
    moved = 0
    arrivals = 0
    for v in range(t.base.shape[0]):
        work.moved_scenes[v] = work.scenes[v]
    for u in range(work.total[0].units):
        choice = work.choice[u, work.chosen[u]]
        if choice == CHOICE.STAY:
            continue
        v = work.node[u]
        scene = t.base[v] + work.moved_scenes[v]
        if choice == CHOICE.ENTER:
            work.moved_scenes[v] = t.entered[scene, work.slot[u]]
            moved |= 1 << u
        elif choice == CHOICE.RENEW:
            work.moved_scenes[v] = t.removed[scene, work.slot[u]]
            arrivals = _arrival(work, arrivals, v, work.slot[u], int(t.renewed[v]))
        else:
            work.moved_scenes[v] = t.left[scene]
            moved |= 1 << u
            to = int(t.lane_node[choice])
            arrivals = _arrival(work, arrivals, to, int(t.lane_slot[choice]), int(t.newcomer[to]))
        if work.moved_scenes[v] == IMPOSSIBLE:
            return -1
    work.total[0].arrivals = arrivals
    return moved


@jit
def _arrival(work: Work, arrivals: int, node: int, slot: int, who: int) -> int:
    """Put a car among those who arrive, by node; return how many there are."""
    place = arrivals
    while place > 0 and work.to_node[place - 1] > node:
        work.to_node[place] = work.to_node[place - 1]
        work.to_slot[place] = work.to_slot[place - 1]
        work.to_who[place] = work.to_who[place - 1]
        place -= 1
    work.to_node[place] = node
    work.to_slot[place] = slot
    work.to_who[place] = who
    return arrivals + 1


@jit
def _arrive(t: BoardTables, work: Work) -> bool:
    """Let all arrive in the order of `turn`; false if a lane is taken."""
    for v in range(t.base.shape[0]):
        work.arrived_scenes[v] = work.moved_scenes[v]
    for place in range(work.total[0].arrivals):
        k = work.turn[place]
        v = work.to_node[k]
        scene = t.base[v] + work.arrived_scenes[v]
        work.arrived_scenes[v] = t.arrived[scene, work.to_slot[k], work.to_who[k]]
        if work.arrived_scenes[v] == IMPOSSIBLE:
            return False
    return True


@jit
def _next_turn(work: Work, sorts: Ints) -> bool:
    """Go on to the next order of arrival, node by node; false after the last.

    Only nodes with an order (`sorts`) have more than one.
    """
    high = work.total[0].arrivals
    while high > 0:
        low = high - 1
        while low > 0 and work.to_node[low - 1] == work.to_node[high - 1]:
            low -= 1
        if sorts[work.to_node[low]] and _permute(work.turn, low, high):
            return True
        high = low
    return False


@jit
def _permute(turn: Ints, low: int, high: int) -> bool:
    """Make turn[low:high] the next permutation in lexicographic order; after the last, the first, and false."""
    pivot = high - 2
    while pivot >= low and turn[pivot] > turn[pivot + 1]:
        pivot -= 1
    has_next = pivot >= low
    if has_next:
        other = high - 1
        while turn[other] < turn[pivot]:
            other -= 1
        turn[pivot], turn[other] = turn[other], turn[pivot]
    left = pivot + 1
    right = high - 1
    while left < right:
        turn[left], turn[right] = turn[right], turn[left]
        left += 1
        right -= 1
    return has_next


@jit
def environment(t: BoardTables, work: Work, out: Moves) -> bool:
    """Write the moves of the environment from `work.scenes`; false if there is no room.

    The number of positions stands for one in which the ego has been rammed.
    """
    _units(t, work)
    used = out.used[0].to
    if work.total[0].rammed:
        if used >= out.to.shape[0]:
            return False
        out.to[used] = t.settings[0].positions
        out.moved[used] = 0
        used += 1
    more = True
    while more:
        moved = _depart(t, work)
        turns = moved >= 0
        for k in range(work.total[0].arrivals):
            work.turn[k] = k
        while turns:
            if not _arrive(t, work):
                break
            if used >= out.to.shape[0]:
                return False
            out.to[used] = rank(t, work.arrived_scenes)
            out.moved[used] = moved
            used += 1
            turns = _next_turn(work, t.sorts)
        more = _next_choice(work)
    out.used[0].to = used
    return True


@jit
def _ego(t: BoardTables, position: int, work: Work, out: Moves) -> int:
    """Write the moves of the ego from `work.scenes`; return its cell, or -1 if there is no room."""
    used = out.used[0].ego_to
    if used + MOST_CHOICES > out.ego_to.shape[0]:
        return -1
    out.ego_to[used] = position
    used += 1
    cell = -1
    for v in range(t.base.shape[0]):
        scene = t.base[v] + work.scenes[v]
        if t.egos[scene] == 0:
            continue
        old = work.scenes[v]
        if t.inside[scene] == WHO.EGO + 1:
            cell = v
            work.scenes[v] = t.left[scene]
            for k in range(t.exit_at[v], t.exit_at[v + 1]):
                to = t.lane_node[t.exits[k]]
                before = work.scenes[to]
                after = t.arrived[t.base[to] + before, t.lane_slot[t.exits[k]], WHO.EGO]
                if after != IMPOSSIBLE:
                    work.scenes[to] = after
                    out.ego_to[used] = rank(t, work.scenes)
                    used += 1
                    work.scenes[to] = before
        else:
            places = t.taken[scene] & ~t.others_slots[scene]
            for slot in range(SLOTS):
                if places >> slot & 1:
                    cell = t.base.shape[0] + t.inbound[v, slot]
            if t.ego_entered[scene] != IMPOSSIBLE:
                work.scenes[v] = t.ego_entered[scene]
                out.ego_to[used] = rank(t, work.scenes)
                used += 1
        work.scenes[v] = old
        break
    out.used[0].ego_to = used
    return cell


@jit_long
def expand(t: BoardTables, first: int, last: int, work: Work, out: Moves, begun: int) -> int:
    """Write the moves of the positions from `first` to before `last`; return the first that found no room.

    Parameters
    ----------
    t : BoardTables
        The board.
    first, last : int
        Numbers of the positions.
    work : Work
        Room.
    out : Moves
        Filled from `out.used` on, and from row `first - begun` on.
    begun : int
        The position of row 0.
    """
    for position in range(first, last):
        row = position - begun
        used = out.used[0]
        before, ego_before, owed_before = used.to, used.ego_to, used.owed
        unrank(t, position, work.scenes)
        room = environment(t, work, out)
        room = room and owe(t, work, out)
        cell = -1
        if room:
            cell = _ego(t, position, work, out)
        if cell < 0:
            used.to, used.ego_to, used.owed = before, ego_before, owed_before
            return position
        out.ego_cell[row] = cell
        out.many[row] = used.to - before
        out.ego_many[row] = used.ego_to - ego_before
        out.owed_many[row] = used.owed - owed_before
    return last


@jit_long
def list_moves(t: BoardTables, position: int, work: Work, out: Moves) -> None:
    """Write the moves of both sides from one position, the one as if the environment were to move, the other the ego.

    Parameters
    ----------
    t, work
        Board and room, as for `expand`.
    position : int
        The position.
    out : Moves
        Its rows 0 are set; it must have room enough (`game.room`).
    """
    used = out.used[0]
    used.to, used.ego_to, used.owed = 0, 0, 0
    expand(t, position, position + 1, work, out, position)
