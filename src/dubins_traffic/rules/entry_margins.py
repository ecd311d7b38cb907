"""The margins by which the ego keeps or breaks rule 3 when it enters a crossing (compiled)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import INFINITE
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.rules.breach_log import EntryMargins, RefereeTables
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import distance2_to_body

LEAST = 1e-6
"""Least absolute value of the margin of clearance, metres.

That margin is measured one frame after the one that is judged, when its sign may have changed: the sign is taken from
the judgement, and the value is then this.
"""


@jit_rare
def measure_entry(b: int, tick: int, v: int, stopped: bool, count: int, tables: RefereeTables) -> None:
    """Lower the ego's least margins of rule 3 to those of its entry into crossing v of trial b in this frame.

    `stopped` (whether), `count` (number) and `tables` (all rows of the referee) are those of
    `rules.breaches.judge_entry`; the signs follow its judgement.
    """
    log = tables.log
    entry = log.entry[b]
    ego = log.car[b, EGO]
    if stopped:
        entry.stop = min(entry.stop, max(1.0, float(tick - ego.ticket)))
        lead = _lead(b, v, tables)
        entry.order = min(entry.order, min(lead, -1.0) if ego.bits & FLAG.AHEAD != 0 else max(lead, 1.0))
    else:
        run = tick - 1 - ego.approach_since if ego.approach_since >= 0 else 0
        entry.stop = min(entry.stop, -max(1.0, float(tables.rules[b].stop_ticks - run)))
    _measure_clearance(b, v, count, entry, tables)


@jit
def _lead(b: int, v: int, tables: RefereeTables) -> float:
    """Return how many ticks after the ego's ticket the next ticket at v was taken; negative: before it."""
    log, net = tables.log, tables.rules[b].net
    ticket = log.car[b, EGO].ticket
    lead = INFINITE
    for k in range(1, tables.state.count[b]):
        other = log.car[b, k]
        if other.bits & FLAG.STOPPED != 0 and other.lane >= 0 and lane_end(tables.roads, net, other.lane) == v:
            lead = min(lead, float(other.ticket - ticket))
    return lead


@jit
def _measure_clearance(b: int, v: int, count: int, margins: EntryMargins, tables: RefereeTables) -> None:
    log, state, roads, rules = tables.log, tables.state, tables.roads, tables.rules[b]
    vertex = roads.vertex[int(roads.vert_off[rules.net]) + v]
    broken = False
    nearest = INFINITE
    for i in range(count):
        k = tables.spacing.near[i]
        if k == EGO:
            continue
        broken = broken or log.car[b, k].crosses == v
        square = distance2_to_body(
            vertex.x, vertex.y, state.x[b, k], state.y[b, k], state.c[b, k], state.s[b, k],
            rules.half_length, rules.half_width,
        )  # fmt: skip
        nearest = min(nearest, sqrt(square) - rules.rounding - rules.radius)
    margins.clear = min(margins.clear, min(nearest, -LEAST) if broken else max(nearest, LEAST))
