"""The e-agents of a batch as tables for kernels: parameters, memory and scratch."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.cars.near import Search, search_tables, widened_search
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable

NOBODY: Final = -1


class _Held(NamedTuple):
    """What holds a car, bits of `Workspace.held`; a car whose patience never ends has SEES alone."""

    SEES: int = 1
    """A body in sight is nearer than `Agent.stop`."""
    BARRED: int = 2
    """A body is in its way."""
    TIGHT: int = 4
    """A body is too near to turn in place."""
    WEARY: int = 8
    """Its patience has ended, and it is barred."""


HELD: Final = _Held()

STEP: Final = 0.1
"""Metres between two remembered points of the ego's path (for w = 0.3 m)."""


@record
class Agent:
    """An e-agent: its parameters and its memory."""

    does: int = NOBODY
    """How it drives (`agents.kinds.DOES`); NOBODY in places without an e-agent."""
    begin: int
    """The tick at which the car begins to drive."""
    first: int
    """Its first row of `Agents.cycle` or `Agents.script`."""
    last: int
    """The row after its last one."""
    repeat: int
    """1 if its script repeats."""
    patience: int = -1
    """Ticks for which it stands for others before it minds only its way ahead; negative: for ever."""
    trail: int = -1
    """Its row of `Agents.trail` and `Agents.point`, or -1."""
    offset: float
    """How far right of the centre line it drives, metres."""
    reached: float
    """Distance from which a waypoint counts as reached, metres."""
    tangent: float
    """Tangent of the bearing error beyond which it turns (`policies.waypoint`)."""
    miss: float
    """Largest lateral distance of the waypoint from the line ahead that is left alone, metres."""
    stop: float
    """It stands while a body in sight is nearer than this, metres."""
    berth: float = -1.0
    """It has no speed while the ego's centre is within this distance, metres; negative: the ego does not matter."""
    speed: float
    """How fast it drives, m/s."""
    yaw_rate: float
    """How fast it turns, rad/s."""
    gap: float
    """The gap that it keeps behind the ego, metres."""
    sight: float = 1e150
    """Distance up to which it sees the ego, metres."""
    lane: int = -1
    """The lane driven, -1 before the first."""
    leg: int
    """For cars that turn in place 0 toward the start of the lane and 1 toward its end, for others the lane to come, -1
    until it is chosen."""
    place: int = -1
    """The row of its cycle or script, -1 when not on it."""
    since: int = -1
    """The tick since which it must stand, -1 if it need not."""
    recall: int = -1
    """Its row of `Agents.recalled` if it is nudged, or -1."""
    delay: int
    """How many ticks late a nudged car does what it asks for."""
    noise: float
    """Largest deviation of its speed, as a share."""
    fastest: float
    """Its largest speed, m/s."""
    goal_x: float
    """The waypoint, metres."""
    goal_y: float
    """The waypoint, metres."""


@record
class Team:
    """What the e-agents of a trial have in common."""

    seed: np.uint64
    """Seed of the random numbers."""
    trial: int
    """Number of the trial by which random numbers are drawn."""
    net: int
    """Number of the road network."""
    curves: int
    """1 if the cars can't turn in place."""
    span: float
    """Two bodies whose centres are farther apart than this don't matter to each other, metres."""
    period: float
    """Seconds of a tick."""
    slowest: float
    """Smallest speed, m/s."""
    radius: float
    """Radius of the tightest turn, metres."""
    w: float
    """Nominal width of the cars, metres; a lane is twice as wide."""
    half_length: float
    """Half the length of the body's core, a rounded box, metres."""
    half_width: float
    """Half the width of the body's core, metres."""
    rounding: float
    """Rounding of the body, metres."""


@record
class Stretch:
    """A step of a script."""

    end: float
    """The tick of the script at which it ends."""
    speed: float
    """m/s."""
    yaw_rate: float
    """rad/s."""


@record
class Point:
    """A point of the ego's path."""

    x: float
    """Metres."""
    y: float
    """Metres."""
    driven: float
    """How far the ego had driven, metres."""


@record
class Trail:
    """What a car that follows the ego remembers of it, beside the points of its path."""

    written: int
    """Points written so far."""
    aimed: int = -1
    """The point driven to, -1: not on the path."""
    seen: int
    """The tick at which the ego was last seen."""
    x: float
    """Where, metres."""
    y: float
    """Where, metres."""
    driven: float
    """How far the ego had driven, metres."""


class Agents(Tables):
    """The e-agents of a batch.

    `team` (B,) and `agent` (B, N). `cycle` (M,): the lanes of all cycles in order. `script` (M,): the steps of all
    scripts. For each of the F cars that follow the ego: `trail` (F,), and `point` (F, M), a ring buffer of its path.
    For each of the R cars that are nudged: `recalled` (R, D, 2), a ring buffer of its latest commands, m/s and rad/s.
    """

    team: Rows[Team]
    agent: Rows[Agent]
    cycle: Ints
    script: Rows[Stretch]
    trail: Rows[Trail]
    point: Rows[Point]
    recalled: Floats


class Workspace(Tables):
    """Scratch of the kernels: pairs of near bodies and their cells (`cars.near`), what holds each car, lanes."""

    search: Search
    held: Ints
    hops: Ints
    queue: Ints


class Scene(Tables):
    """All tables that the e-agents of a batch decide by."""

    state: State
    roads: RoadTable
    obstacles: ObstacleTable
    agents: Agents
    space: Workspace


def wider(space: Workspace) -> Workspace:
    """Return scratch with a buffer for four times as many pairs."""
    return space.replace(search=widened_search(space.search))


def workspace(cars: int, pairs: int, lanes: int) -> Workspace:
    """Return scratch for trials of up to `cars` cars, `pairs` pairs of neighbours and `lanes` lanes."""
    return Workspace(
        search=search_tables(cars, pairs),
        held=np.zeros(cars, dtype=np.int64),
        hops=np.zeros(lanes, dtype=np.int64),
        queue=np.zeros(lanes, dtype=np.int64),
    )
