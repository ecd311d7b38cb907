"""What the controller `lanes` knows and remembers, as arrays over a batch, and its constants."""

from __future__ import annotations

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables

# These numbers are compiled into functions with @jit: the mark puts this file into the fingerprint of their cache.
HALF_LENGTH, HALF_WIDTH, ROUNDING, REACH, SLOWEST, FASTEST, YAW_MOST, RADIUS, DISC, PERIOD, FOLLOW = range(11)
CAR_FIELDS = 11

SIGMA, ODO, LEFT, BEGIN, AIM, FROM, RAMP, UNTIL, WAITED, BACKING, TRIED, SHUFFLED, STUCK, MARK = range(14)
MEMORY_FIELDS = 14

NEAR = 1.06
"""Within this of the ego, centre to centre, a cautious car does not move, metres."""
CLEAR = 1.2
"""So far the ego backs up from it."""
GAIN = 2.0
"""Speed falls by this much per metre of missing gap, 1/s."""
BACK_SPEED = 0.3
"""Speed backwards, m/s; PASSING_SPEED is that past what stands."""
PASSING_SPEED = 0.45
STANDS = 1.0
"""A car counts as standing when it has neither moved nor turned for so long, seconds."""
PATIENCE = 2.5
"""Seconds to wait before passing what stands."""
RETRY = 0.5
"""Seconds between two looks for a way past."""
DESPAIR = 5.0
"""Seconds to wait before asking for another route."""
SIDESTEP = 0.1
"""Offsets are tried in steps of this, metres."""
STILL_MARGIN = 0.05
PASSING_MARGIN = 0.09
MOVING_MARGIN = 0.1
WARY_MARGIN = 0.5
"""Gaps kept: from what stands, the same when a way past is chosen, from what moves, and the same when passing."""
PROGRESS = 0.3
"""Metres that the car must get on for its waits to be forgotten."""
TURN_SHARE = 0.1
"""Seconds of standing that a radian of turning in place counts."""
HELD_UP = 0.4
"""Seconds without leave to move after which the car looks for another way."""
BARRED = -1.0
"""The car has backed up, or tried to, and moves on first."""
MOVES, TURNS = 0.02, 0.05
SHUTTLE = 10
"""Ticks of each stroke of a car that has to shuttle to turn round."""


class Knowledge(Tables):
    """What the law knows and remembers of each trial of a batch.

    `path` (rows, paths.FIELDS): all trials' paths; `span` (B, 3): first row, end, and number of the row after the
    last; `row` (B,): the row a car is on. `memory` (B, MEMORY_FIELDS), `ego` (B, 4): pose; `others`
    (B, N, gaps.OTHER_FIELDS); `car` (B, CAR_FIELDS): body, bounds, radius of discs, period, gap to follow at.
    `part` and `part_off`: obstacles as in `cars.tables`. `net` (B,): number of the network in
    the table of roads. `sample`: a workspace. `command` (B, 2): the answer.
    `blocker` (B,): who has kept the car waiting for too long (a car, -1 - part, or NOBODY): a new path is asked for.
    """

    path: Floats
    span: Ints
    row: Ints
    memory: Floats
    ego: Floats
    others: Floats
    car: Floats
    part: Floats
    part_off: Ints
    net: Ints
    sample: Floats
    command: Floats
    blocker: Ints
