"""The e-agents of a batch as arrays for kernels: what they are, what they remember, room to work in.

Arrays over cars are (B, N), the ego's entries unused.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints

WANDER, LOOP, FOLLOW, PARKED, SCRIPTED = range(5)
KINDS = {"wander": WANDER, "loop": LOOP, "follow": FOLLOW, "parked": PARKED, "scripted": SCRIPTED}

STEP = 0.1
"""Metres between two remembered points of the ego's path (for w = 0.3 m)."""


class Law(NamedTuple):
    """How one e-agent drives: metres, m/s, rad/s.

    `offset`: how far right of the centre line; `reached`: when a waypoint counts as reached; `tangent` and `miss`:
    the bearing tolerance (see `driving.waypoint`); `stop`: it stands while a surface in sight is nearer; `berth`:
    it does not drive while the ego's centre is within; `speed`, `yaw_rate`: how fast it drives and turns.
    """

    offset: float
    reached: float
    tangent: float
    miss: float
    stop: float
    berth: float
    speed: float
    yaw_rate: float


class Build(NamedTuple):
    """What the cars of one trial are, and its tick: metres, m/s, seconds.

    `span`: no two bodies matter to each other whose centres are farther apart; `period`: of a tick; `slowest`:
    smallest speed; `radius`: of the tightest turn; `curves`: 1 if the cars can't turn in place, else 0; `w`; the
    body as a rounded box.
    """

    span: float
    period: float
    slowest: float
    radius: float
    curves: float
    w: float
    half_length: float
    half_width: float
    rounding: float


OFFSET, REACHED, TANGENT, MISS, STOP, BERTH, SPEED, YAW_RATE = range(len(Law._fields))
SPAN, PERIOD, SLOWEST, RADIUS, CURVES, W, HALF_LENGTH, HALF_WIDTH, ROUNDING = range(len(Build._fields))


class Cast(NamedTuple):
    """What the e-agents of a batch are. Nothing in it changes during a batch.

    `net` (B,): number of the road network; `seed` (B,) uint64 and `trial` (B,): of the random numbers; `build`
    (B, 9) and `law` (B, N, 8): rows of `Build` and `Law`; `kind` (B, N): -1 for no e-agent; `begin` (B, N): tick
    at which the car begins to drive; `plan` (B, N, 3): first and last + 1 row of its part of `cycle` or `script`,
    and 1 if it repeats; `gap` and `sight` (B, N): metres kept behind the ego, and from which the ego is seen;
    `cycle` (M,): lanes in order; `script` (M, 3): tick of the plan at which the step ends, speed, yaw rate.
    """

    net: Ints
    seed: npt.NDArray[np.uint64]
    trial: Ints
    build: Floats
    law: Floats
    kind: Ints
    begin: Ints
    plan: Ints
    gap: Floats
    sight: Floats
    cycle: Ints
    script: Floats


class Memory(NamedTuple):
    """What the e-agents of a batch remember from tick to tick.

    `lane` (B, N): the lane driven, -1 before the first; `leg` (B, N): for cars that turn in place, 0 toward the
    lane's start and 1 toward its end, for others the lane to come (-1: not chosen); `place` (B, N): row of the
    plan, -1 when not on it; `goal` (B, N, 2): the waypoint. Of the ego's path, per car that follows (`trail` (B, N)
    is its row, -1 for none): `path` (F, M, 3) a ring of x, y and distance driven; `mark` (F, 2): points written,
    and the point being driven to (-1: not on the path); `last` (F, 3): the ego's position when last seen and the
    distance driven to it.
    """

    lane: Ints
    leg: Ints
    place: Ints
    goal: Floats
    trail: Ints
    path: Floats
    mark: Ints
    last: Floats


class Workspace(NamedTuple):
    """Scratch of the kernels: pairs of neighbours and their cells (see `cars.near`), flags, a queue of lanes."""

    pair: Ints
    head: Ints
    link: Ints
    cell: Ints
    held: Ints
    hops: Ints
    queue: Ints


def workspace(cars: int, pairs: int, lanes: int) -> Workspace:
    """Return scratch for trials of up to `cars` cars, `pairs` pairs of neighbours and `lanes` lanes."""
    size = 1
    while size < 2 * cars:
        size *= 2
    return Workspace(
        pair=np.zeros((pairs, 2), dtype=np.int64),
        head=np.zeros(size, dtype=np.int64),
        link=np.zeros(cars, dtype=np.int64),
        cell=np.zeros((cars, 2), dtype=np.int64),
        held=np.zeros(cars, dtype=np.int64),
        hops=np.zeros(lanes, dtype=np.int64),
        queue=np.zeros(lanes, dtype=np.int64),
    )
