"""Who waits for the ego, at the end of a queue that begins at it (docs/rules.md#waits), compiled."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.near import list_near
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.roads.lookup import lane_end, lane_length
from dubins_traffic.rules.breach_log import RefereeTables
from dubins_traffic.rules.exits import find_exit, is_exit, lane_taken, taken_exits, way_back
from dubins_traffic.rules.propositions import FLAG


@jit_rare
def find_waiting(b: int, tick: int, tables: RefereeTables) -> None:
    """Set `JudgedCar.waits` of the cars of trial b: the ego, and who waits for one that waits, and so on.

    Norm: docs/rules.md#waits.
    """
    cars, log = tables.state.count[b], tables.log
    for n in range(cars):
        log.car[b, n].waits = 1 if n == EGO else 0
    grows = True
    while grows:
        grows = False
        for n in range(EGO + 1, cars):
            if log.car[b, n].waits == 0 and (_waits_in_lane(b, n, tables) or _waits_in_disc(b, n, tick, tables)):
                log.car[b, n].waits = 1
                grows = True


@jit
def _waits_in_lane(b: int, n: int, tables: RefereeTables) -> bool:
    """Tell whether one that waits for the ego is ahead of car n, in the disc ahead of it, or beside what blocks it."""
    labels, roads, row, net = tables.labels, tables.roads, tables.memory.car[b], tables.rules[b].net
    lane, far = labels.lane[b, n], tables.terms[b].way
    if lane < 0:
        return False
    here, v = row[n].progress, lane_end(roads, net, lane)
    blocked = np.int64(labels.bits[b, n]) & FLAG.BLOCKED != 0
    arrives = lane_length(roads, net, lane) - tables.rules[b].radius - here <= far
    for k in range(tables.state.count[b]):
        if k == n or tables.log.car[b, k].waits == 0:
            continue
        ahead = labels.lane[b, k] == lane and 0.0 < row[k].progress - here <= far
        if ahead or (arrives and labels.crosses[b, k] == v) or (blocked and labels.segment[b, k] == lane // 2):
            return True
    return False


@jit
def _waits_in_disc(b: int, n: int, tick: int, tables: RefereeTables) -> bool:
    """Tell whether car n is in a disc without a free exit, and a car that waits for the ego is there or takes one."""
    labels, roads, rules = tables.labels, tables.roads, tables.rules[b]
    v: int = labels.crosses[b, n]
    if v < 0:
        return False
    back = way_back(v, tables.log.car[b, n].came_by, roads, rules)
    row = int(roads.vert_off[rules.net]) + v
    only = lane_taken(b, n, v, tables)
    exits = 0
    for arm in range(roads.degree[row]):
        exits |= 1 << arm if is_exit(int(roads.arms[row, arm]), only, back) else 0
    held = False
    for k in range(tables.state.count[b]):
        if k != n and tables.log.car[b, k].waits != 0 and not held:
            held = labels.crosses[b, k] == v or taken_exits(b, n, k, v, back, tables) & exits != 0
    if not held:
        return False
    x, y = roads.vertex[row].x, roads.vertex[row].y
    count = list_near(tables.state, b, tick, x, y, tables.terms[b].lone, tables.spacing)
    return not find_exit(b, n, v, back, count, tables)
