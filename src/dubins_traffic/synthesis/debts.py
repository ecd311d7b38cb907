"""What the environment owes in a position, compiled: E3 to E6 as the game of cells has them.

The clauses are docs/rules.md#E3 to docs/rules.md#E6; docs/theory.md says what the game makes of them.
"""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit
from dubins_traffic.synthesis.board import Tables
from dubins_traffic.synthesis.positions import Moves, Work
from dubins_traffic.synthesis.queues import SLOTS, WHO


@jit
def _inside(t: Tables, work: Work, node: int) -> int:
    """Return who is in a node: 0 nobody or no such node, 1 an e-agent, 2 the ego."""
    return int(t.inside[t.base[node] + work.scenes[node]]) if node >= 0 else 0


@jit
def _in_lane(t: Tables, work: Work, lane: int) -> int:
    """Return who is in a lane: 0 nobody, 1 an e-agent, 2 the ego."""
    end = t.base[t.lane_node[lane]] + work.scenes[t.lane_node[lane]]
    if (t.taken[end] >> t.lane_slot[lane] & 1) == 0:
        return 0
    return 1 if t.others_slots[end] >> t.lane_slot[lane] & 1 else WHO.EGO + 1


@jit
def _ways_out(t: Tables, work: Work, node: int) -> tuple[bool, int]:
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
def _may_pass(t: Tables, work: Work, node: int) -> bool:
    """E5: say whether who waits before a bend or dead end that is clear has no excuse to wait there."""
    free, ego = _ways_out(t, work, node)
    opposite = _inside(t, work, t.opposite[node])
    if opposite == WHO.EGO + 1:
        return False
    if t.settings[0].moves_up:
        return free or ego != 2
    return free and not (t.settings[0].unmet and opposite)


@jit
def _may_leave(t: Tables, work: Work, node: int) -> bool:
    """E4: say whether who is in a node has no excuse to stay there."""
    free, _ = _ways_out(t, work, node)
    opposite = _inside(t, work, t.opposite[node])
    return free and opposite != WHO.EGO + 1 and not (t.settings[0].unmet and opposite)


@jit
def _to_free(t: Tables, work: Work, goal: int) -> int:
    """E6: return a node of a goal that an e-agent is in, or -1 if there is none or the ego keeps the goal closed."""
    found = -1
    free = False
    ego = False
    for v in range(t.base.shape[0]):
        if t.goal[v] == goal and _inside(t, work, v) == 1:
            found = v
            out, near = _ways_out(t, work, v)
            free = free or out
            ego = ego or near > 0 or _inside(t, work, t.opposite[v]) == WHO.EGO + 1
    return -1 if ego and not free else found


@jit
def owe(t: Tables, work: Work, out: Moves) -> bool:
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
