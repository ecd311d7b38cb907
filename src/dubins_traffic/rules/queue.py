"""The order of arrival at crossings (docs/rules.md#queue): approach, stops, tickets, groups, forfeits."""

from __future__ import annotations

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.lookup import lane_direction
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.tables import (
    CROSS2,
    FIRST_SINCE,
    FORFEIT_TICKS,
    FORFEITS,
    GAP2,
    GROUP,
    GROUP_TICKS,
    LANE,
    MEMBER,
    NEXT_IN_LANE,
    NEXT_IN_QUEUE,
    PROGRESS,
    RANK,
    TICKET,
    Memory,
    RuleTable,
)

RIGHT: float = 1e-9
"""Sine of the angle from which an arm counts as to the right: arms in one line are not, whatever the rounding."""


@jit
def foremost(rules: RuleTable, memory: Memory, b: int, n: int, lane: int) -> bool:
    """Tell whether no car of `lane` with larger progress than car n has its body outside the disc ahead."""
    measure = memory.measure[b]
    own = measure[n, PROGRESS]
    other = memory.head[b, lane, LANE]
    while other >= 0:
        if measure[other, PROGRESS] > own and measure[other, GAP2] >= rules.real[b, CROSS2]:
            return False
        other = memory.link[b, other, NEXT_IN_LANE]
    return True


@jit
def on_the_right(t: RoadTable, net: int, lane: int, other: int) -> bool:
    """Tell whether a car that comes by the lane `other` is on the right of one that comes by `lane`.

    Their arms are (0, 180) degrees apart counter-clockwise, both arms pointing away from the vertex.
    """
    ax, ay = lane_direction(t, net, lane)
    bx, by = lane_direction(t, net, other)
    return ax * by - ay * bx > RIGHT


@jit
def gather(memory: Memory, b: int, first: int) -> int:
    """List the cars of the queue that begins with car `first` in `link[b, :, MEMBER]`, lowest index first.

    Returns how many there are.
    """
    link = memory.link[b]
    count = 0
    n = first
    while n >= 0:
        k = count
        while k > 0 and link[k - 1, MEMBER] > n:
            link[k, MEMBER] = link[k - 1, MEMBER]
            k -= 1
        link[k, MEMBER] = n
        count += 1
        n = link[n, NEXT_IN_QUEUE]
    return count


@jit
def rank_queue(
    t: RoadTable, net: int, lanes: Ints, memory: Memory, b: int, count: int, group_ticks: int
) -> int:
    """Write the places of the first `count` members of a queue into `mark[b, :, RANK]`; return who is first.

    Parameters
    ----------
    t, net
        The roads.
    lanes : (B, N)
        Lane states; those of the members end at one crossing.
    memory, b, count
        Tickets, and the members listed by `gather`, of trial b.
    group_ticks
        How much later than the first of a group its last may come.
    """
    link = memory.link[b]
    mark = memory.mark
    if count == 1:
        mark[b, link[0, MEMBER], RANK] = 0
        return link[0, MEMBER]
    for k in range(count):
        mark[b, link[k, MEMBER], RANK] = -1
        link[k, GROUP] = 0
    front = -1
    waiting = 0
    for place in range(count):
        if waiting == 0:
            waiting = _open_group(memory, b, count, group_ticks)
        chosen = -1
        for k in range(count):
            n = link[k, MEMBER]
            if link[k, GROUP] == 0 or mark[b, n, RANK] >= 0:
                continue
            if chosen < 0:
                chosen = n
            if not _yields(t, net, lanes, memory, b, count, n):
                chosen = n
                break
        mark[b, chosen, RANK] = place
        waiting -= 1
        if place == 0:
            front = chosen
    return front


@jit
def _open_group(memory: Memory, b: int, count: int, group_ticks: int) -> int:
    """Put the unplaced member with the earliest ticket, and all just after, into a group; return its size."""
    earliest = -1
    for k in range(count):
        n = memory.link[b, k, MEMBER]
        if memory.mark[b, n, RANK] < 0 and (earliest < 0 or memory.mark[b, n, TICKET] < earliest):
            earliest = memory.mark[b, n, TICKET]
    size = 0
    for k in range(count):
        n = memory.link[b, k, MEMBER]
        if memory.mark[b, n, RANK] < 0 and memory.mark[b, n, TICKET] <= earliest + group_ticks:
            memory.link[b, k, GROUP] = 1
            size += 1
    return size


@jit
def _yields(t: RoadTable, net: int, lanes: Ints, memory: Memory, b: int, count: int, n: int) -> bool:
    """Tell whether a member of the present group, not placed yet, is on the right of member n."""
    for k in range(count):
        other = memory.link[b, k, MEMBER]
        if other == n or memory.link[b, k, GROUP] == 0 or memory.mark[b, other, RANK] >= 0:
            continue
        if on_the_right(t, net, lanes[b, n], lanes[b, other]):
            return True
    return False


@jit
def keep_order(
    t: RoadTable,
    rules: RuleTable,
    lanes: Ints,
    memory: Memory,
    b: int,
    net: int,
    first: int,
    clear: bool,
    tick: int,
) -> None:
    """Bring the queue that begins with car `first` into order; who forfeits gets the present tick as ticket.

    `clear` tells whether nobody crosses the vertex.
    """
    mark = memory.mark
    group = rules.whole[b, GROUP_TICKS]
    count = gather(memory, b, first)
    front = rank_queue(t, net, lanes, memory, b, count, group)
    since = mark[b, front, FIRST_SINCE]
    if clear and since >= 0 and tick - since >= rules.whole[b, FORFEIT_TICKS]:
        mark[b, front, TICKET] = tick
        mark[b, front, FORFEITS] += 1
        mark[b, front, FIRST_SINCE] = -1
        front = rank_queue(t, net, lanes, memory, b, count, group)
    for k in range(count):
        n = memory.link[b, k, MEMBER]
        if n != front or not clear:
            mark[b, n, FIRST_SINCE] = -1
        elif mark[b, n, FIRST_SINCE] < 0:
            mark[b, n, FIRST_SINCE] = tick
