"""The order of arrival at crossings (docs/rules.md#queue): approach, stops, tickets, groups, forfeits."""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.records import Rows
from dubins_traffic.roads.lookup import lane_end_direction
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.tables import CarMemory, TrialRules

RIGHT: float = 1e-9
"""Least sine of the angle at which an arm counts as to the right, so that rounding never makes opposite arms count."""


@jit
def foremost(n: int, first: int, cars: Rows[CarMemory], rules: TrialRules) -> bool:
    """Tell whether car n is foremost: no car of its lane with larger progress has its body outside the disc ahead.

    `cars` (N,) are those of the trial; the list of those in the lane begins with car `first` (index, -1: none).
    """
    progress = cars[n].progress
    k = first
    while k >= 0:
        other = cars[k]
        if other.progress > progress and other.gap2 >= rules.cross2:
            return False
        k = other.next_in_lane
    return True


@jit
def on_the_right(t: RoadTable, net: int, lane: int, other: int) -> bool:
    """Tell whether a car that comes by the lane `other` (lane) is on the right of one that comes by `lane`.

    Their arms are (0, 180) degrees apart counter-clockwise, both arms pointing away from the vertex.
    """
    ax, ay = lane_end_direction(t, net, lane)
    bx, by = lane_end_direction(t, net, other)
    return ax * by - ay * bx > RIGHT


@jit
def gather(first: int, cars: Rows[CarMemory], members: Ints) -> int:
    """List the cars of the queue that begins with car `first` (index) in `members` (N,), lowest index first.

    `cars` (N,) are those of the trial. Returns how many are listed.
    """
    count = 0
    n = first
    while n >= 0:
        k = count
        while k > 0 and members[k - 1] > n:
            members[k] = members[k - 1]
            k -= 1
        members[k] = n
        count += 1
        n = cars[n].next_in_queue
    return count


class Queue(NamedTuple):
    """A queue before a crossing, while it is put in order.

    `cars` (N,): the memory of the cars of the trial. `lanes` (N,): their lane states; those of the members end at the
    crossing. `members` (N,): indices of the `count` members, lowest first.
    """

    cars: Rows[CarMemory]
    lanes: Ints
    members: Ints
    count: int  # pyright: ignore[reportIncompatibleMethodOverride]  # no tuple is searched here


@jit
def rank_queue(t: RoadTable, net: int, queue: Queue, group_ticks: int) -> int:
    """Write the places of the members of a queue into their `rank`; return the index of the first car.

    Norm: docs/rules.md#queue.

    Parameters
    ----------
    t, net
        The roads.
    queue
        The queue.
    group_ticks
        Most ticks between the first and the last ticket of a group.
    """
    cars, members, count = queue.cars, queue.members, queue.count
    front: int = members[0]
    if count == 1:
        cars[front].rank = 0
        return front
    for k in range(count):
        n: int = members[k]
        car = cars[n]
        car.rank = -1
        car.in_group = 0
    waiting = 0
    for place in range(count):
        if waiting == 0:
            waiting = _open_group(queue, group_ticks)
        chosen = -1
        for k in range(count):
            n = members[k]
            if cars[n].in_group == 0 or cars[n].rank >= 0:
                continue
            if chosen < 0:
                chosen = n
            if not _yields(t, net, queue, n):
                chosen = n
                break
        cars[chosen].rank = place
        waiting -= 1
        if place == 0:
            front = chosen
    return front


@jit_rare
def _open_group(queue: Queue, group_ticks: int) -> int:
    """Group the unplaced member of the earliest ticket with all up to `group_ticks` later; return how many."""
    earliest = -1
    for k in range(queue.count):
        n: int = queue.members[k]
        car = queue.cars[n]
        if car.rank < 0 and (earliest < 0 or car.ticket < earliest):
            earliest = car.ticket
    size = 0
    for k in range(queue.count):
        n = queue.members[k]
        car = queue.cars[n]
        if car.rank < 0 and car.ticket <= earliest + group_ticks:
            car.in_group = 1
            size += 1
    return size


@jit
def _yields(t: RoadTable, net: int, queue: Queue, n: int) -> bool:
    """Tell whether an unplaced member of the present group is on the right of member n."""
    for k in range(queue.count):
        other: int = queue.members[k]
        if other == n or queue.cars[other].in_group == 0 or queue.cars[other].rank >= 0:
            continue
        if on_the_right(t, net, queue.lanes[n], queue.lanes[other]):
            return True
    return False


@jit
def keep_order(t: RoadTable, rules: TrialRules, queue: Queue, clear: bool, tick: int) -> None:
    """Order a queue; a member that forfeits its place gets the present tick as its new ticket.

    `clear` (bool) tells whether no car crosses the vertex.

    Norm: docs/rules.md#forfeit.
    """
    cars = queue.cars
    front = rank_queue(t, rules.net, queue, rules.group_ticks)
    first = cars[front]
    since = first.first_since
    if clear and since >= 0 and tick - since >= rules.forfeit_ticks:
        first.ticket = tick
        first.forfeits += 1
        first.first_since = -1
        front = rank_queue(t, rules.net, queue, rules.group_ticks)
    for k in range(queue.count):
        n: int = queue.members[k]
        if n != front or not clear:
            cars[n].first_since = -1
        elif cars[n].first_since < 0:
            cars[n].first_since = tick
