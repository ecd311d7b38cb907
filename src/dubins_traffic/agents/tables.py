"""The e-agents of a batch as arrays for kernels: what they are, what they remember, room to work in.

A call that takes many arrays costs more to compile and to make than what happens in it, so that the numbers of one
car stand together in a row, and functions take rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints

WANDER, LOOP, FOLLOW, PARKED, SCRIPTED = range(5)
KINDS = {"wander": WANDER, "loop": LOOP, "follow": FOLLOW, "parked": PARKED, "scripted": SCRIPTED}
NOBODY = -1

KIND, BEGIN, FIRST, LAST, REPEAT, PATIENCE, TRAIL, LANE, LEG, PLACE, SINCE = range(11)
INTS = 11
"""Columns of `Agents.ints`.

KIND: NOBODY where there's no e-agent. BEGIN: the tick at which the car begins to drive. FIRST, LAST: its rows of
`cycle` or `script` are FIRST to LAST - 1. REPEAT: 1 if its script repeats. PATIENCE: ticks that it stands for others
before it looks only at the way ahead; negative: for ever. TRAIL: its row of `path`, `mark` and
`last`, or -1. It remembers LANE: the lane driven, -1 before the first; LEG: for cars that turn in place 0 toward
the start of the lane and 1 toward its end, for others the lane to come, -1 until it is chosen; PLACE: the row of its
cycle or script, -1 when not on it; SINCE: the tick since which it must stand, -1 if it need not.
"""

OFFSET, REACHED, TANGENT, MISS, STOP, BERTH, SPEED, YAW_RATE, GAP, SIGHT, GOAL_X, GOAL_Y = range(12)
FLOATS = 12
"""Columns of `Agents.floats`: metres, m/s, rad/s.

OFFSET: how far right of the centre line it drives. REACHED: when a waypoint counts as reached. TANGENT and MISS: the
bearing tolerance (see `policies.waypoint`). STOP: it stands while a surface in sight is nearer. BERTH: it does not
drive while the ego's centre is within; negative: never mind. SPEED, YAW_RATE: how fast it drives and turns. GAP:
kept behind the ego. SIGHT: from where the ego is seen. It remembers GOAL_X, GOAL_Y: the waypoint.
"""

SPAN, PERIOD, SLOWEST, RADIUS, CURVES, W, HALF_LENGTH, HALF_WIDTH, ROUNDING = range(9)
"""Columns of `Agents.build`: metres, seconds, m/s.

SPAN: no two bodies matter to each other whose centres are farther apart. PERIOD: of a tick. SLOWEST: smallest
speed. RADIUS: of the tightest turn. CURVES: 1 if the cars can't turn in place, else 0. W. Then the body as a rounded
box.
"""

SEES, BARRED, TIGHT, WEARY = 1, 2, 4, 8
"""What holds a car, bits of `Workspace.held`: something is nearer than the car stops at; in its way; too near to turn
in place. BARRED and TIGHT are looked at only for cars whose patience can end; WEARY: it ended, and the car is barred.
"""

WRITTEN, AIMED, SEEN = range(3)
"""Columns of `Agents.mark`: points of the ego's path written so far, the one driven to (-1: not on the path), and the
tick at which the ego was last seen."""

STEP = 0.1
"""Metres between two remembered points of the ego's path (for w = 0.3 m)."""


class Agents(NamedTuple):
    """The e-agents of a batch.

    `net` (B,): number of the road network; `seed` (B,) uint64 and `trial` (B,): of the random numbers; `build`
    (B, 9), `ints` (B, N, 11) and `floats` (B, N, 12): columns as above; `cycle` (M,): lanes in order; `script`
    (M, 3): tick of the script at which the step ends, speed, yaw rate. Of the ego's path, for every car that
    follows: `path` (F, M, 3), a ring of x, y and distance driven; `mark` (F, 3): columns as above; `last` (F, 3):
    the ego's position when last seen and the distance driven to there.
    """

    net: Ints
    seed: npt.NDArray[np.uint64]
    trial: Ints
    build: Floats
    ints: Ints
    floats: Floats
    cycle: Ints
    script: Floats
    path: Floats
    mark: Ints
    last: Floats


class Workspace(NamedTuple):
    """Scratch of the kernels: pairs of neighbours and their cells (see `cars.near`), why cars must stand, lanes."""

    pair: Ints
    head: Ints
    link: Ints
    cell: Ints
    held: Ints
    hops: Ints
    queue: Ints


def workspace(cars: int, pairs: int, lanes: int) -> Workspace:
    """Return scratch for trials of up to `cars` cars, `pairs` pairs of neighbours and `lanes` lanes."""
    buckets = 64
    while buckets < 2 * cars:
        buckets *= 2
    return Workspace(
        pair=np.zeros((pairs, 2), dtype=np.int64),
        head=np.zeros(buckets, dtype=np.int64),
        link=np.zeros(cars, dtype=np.int64),
        cell=np.zeros((cars, 2), dtype=np.int64),
        held=np.zeros(cars, dtype=np.int64),
        hops=np.zeros(lanes, dtype=np.int64),
        queue=np.zeros(lanes, dtype=np.int64),
    )
