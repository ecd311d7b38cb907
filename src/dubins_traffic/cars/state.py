"""Values that rooms hand to each other in every tick: poses, commands, observations, states, labels, frames.

Small values are named tuples, since thousands of them are made per second of wall clock; arrays over a batch have
the shape (trials B, cars N), float64, C order. Car 0 of every trial is the ego.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple, overload

import numpy as np

from dubins_traffic.cars.body import Body
from dubins_traffic.cars.propositions import FLAG, names
from dubins_traffic.kernels.angles import angles
from dubins_traffic.kernels.arrays import Bits, Floats, Ints
from dubins_traffic.kernels.tables import Tables

EGO = 0
NONE = -1


class Pose(NamedTuple):
    """Position in metres and heading as a unit vector, world frame."""

    x: float
    y: float
    c: float
    s: float

    @property
    def theta(self) -> float:
        """Heading in radians, counter-clockwise from the x axis, in (-pi, pi]."""
        return math.atan2(self.s, self.c)


class Twist(NamedTuple):
    """Speed along the heading in m/s and yaw rate in rad/s."""

    speed: float
    yaw_rate: float


class Command(NamedTuple):
    """What a driver asks for in one tick: speed in m/s and yaw rate in rad/s."""

    speed: float
    yaw_rate: float


class _Holds:
    """A proposition of `Propositions` that is true or false: whether its flag is among the bits."""

    def __init__(self, flag: int) -> None:
        self._flag = flag

    @overload
    def __get__(self, propositions: None, kind: type) -> _Holds: ...

    @overload
    def __get__(self, propositions: Propositions, kind: type) -> bool: ...

    def __get__(self, propositions: Propositions | None, kind: type) -> bool | _Holds:
        """Return whether it is true of `propositions`."""
        return self if propositions is None else propositions.bits & self._flag != 0


class Propositions(NamedTuple):
    """The discrete state of one car at one frame (docs/rules.md#propositions).

    `segment` is the nearest segment; `at` the intersection whose disc holds the centre and `crosses` the one whose
    disc the body meets (-1: none); `lane` the lane state, 2 * segment + direction (-1: none); `bits` a union of
    the flags in `dubins_traffic.rules.propositions`. Each of these flags has a name here too. The flags of the queue
    are about the crossing at the end of the lane.

    Attributes
    ----------
    on_road : bool
        The centre is on a road.
    approach, stopped : bool
        It is foremost before the crossing and near its disc; it has stopped there and holds a ticket.
    clear : bool
        No other car crosses the crossing ahead; in a crossing: that one.
    ahead, first : bool
        It has stopped, and another car is before it in the order of arrival; or none is.
    forfeited : bool
        It has stopped, and got a new ticket in this wait.
    blocked : bool
        Something that stands ahead leaves too little of the right lane.
    left, overtaking, hemmed : bool
        It reaches over the centre line; it may, since something blocked its lane; it may have no way back yet.
    still, stands, excused, lingers : bool
        It has not moved; it stands in the way of others; it waits, so it does not; it has hardly got on for long.
    in_crossing, entered : bool
        The body meets the disc of a crossing; it came into a disc in this frame.
    turned, breach3 : bool
        It turned round outside discs in this frame; it is in a crossing that it entered against rule 3.
    """

    segment: int
    at: int
    crosses: int
    lane: int
    bits: int

    on_road = _Holds(FLAG.ON_ROAD)
    still = _Holds(FLAG.STILL)
    stands = _Holds(FLAG.STANDS)
    left = _Holds(FLAG.LEFT)
    overtaking = _Holds(FLAG.OVERTAKING)
    blocked = _Holds(FLAG.BLOCKED)
    approach = _Holds(FLAG.APPROACH)
    stopped = _Holds(FLAG.STOPPED)
    clear = _Holds(FLAG.CLEAR)
    ahead = _Holds(FLAG.AHEAD)
    in_crossing = _Holds(FLAG.IN_CROSSING)
    breach3 = _Holds(FLAG.BREACH3)
    first = _Holds(FLAG.FIRST)
    forfeited = _Holds(FLAG.FORFEITED)
    excused = _Holds(FLAG.EXCUSED)
    turned = _Holds(FLAG.TURNED)
    entered = _Holds(FLAG.ENTERED)
    lingers = _Holds(FLAG.LINGERS)
    hemmed = _Holds(FLAG.HEMMED)

    def __repr__(self) -> str:
        words = ", ".join(names(self.bits)) or "none"
        places = f"segment={self.segment}, at={self.at}, crosses={self.crosses}, lane={self.lane}"
        return f"<Propositions: {places}; {words}>"


class SensedCar(NamedTuple):
    """Another car as a driver senses it.

    Norm: docs/rules.md#observations.
    """

    name: str
    index: int  # pyright: ignore[reportIncompatibleMethodOverride]  # no tuple is searched here
    pose: Pose
    twist: Twist
    body: Body
    propositions: Propositions


class Observation(NamedTuple):
    """What a driver knows at the beginning of a tick.

    `time` is tick / rate, seconds. `others` are the cars within the sensing radius, by index. `scan` holds laser
    ranges in metres, (rays,) from right to left, or None. `pose` may be noisy if the instance says so.
    """

    tick: int
    time: float
    pose: Pose
    twist: Twist
    propositions: Propositions
    others: tuple[SensedCar, ...]
    scan: Floats | None


class State(Tables):
    """State of a batch after a tick. All arrays (B, N) float64, except `count` (B,) int64: cars in each trial.

    `x`, `y` are centres (m), `c`, `s` headings (unit vectors). `speed` (m/s) and `yaw_rate` (rad/s) are those in force
    when the frame was reached: 0 for a car that a contact had fixed.
    """

    x: Floats
    y: Floats
    c: Floats
    s: Floats
    speed: Floats
    yaw_rate: Floats
    count: Ints

    @staticmethod
    def zeros(trials: int, cars: int) -> State:
        """Return a state of standing cars at the origin."""
        x, y, s, speed, yaw_rate = (np.zeros((trials, cars)) for _ in range(5))
        return State(x, y, np.ones((trials, cars)), s, speed, yaw_rate, np.full(trials, cars, dtype=np.int64))


class Labels(Tables):
    """Propositions of a batch: int64 arrays (B, N) as in `Propositions`, and flags `bits` (B, N) uint32."""

    segment: Ints
    at: Ints
    crosses: Ints
    lane: Ints
    bits: Bits

    @staticmethod
    def zeros(trials: int, cars: int) -> Labels:
        """Return labels of which no proposition holds."""
        segment = np.zeros((trials, cars), dtype=np.int64)
        at, crosses, lane = (np.full((trials, cars), NONE, dtype=np.int64) for _ in range(3))
        return Labels(segment, at, crosses, lane, np.zeros((trials, cars), dtype=np.uint32))


def put_observed(state: State, labels: Labels, observation: Observation) -> None:
    """Write an ego's observation into trial 0 of `state` and `labels` (1, N): the ego first, then the others."""
    others = observation.others
    state.count[0] = 1 + len(others)
    x, y, c, s, speed, yaw_rate = state[:6]
    segment, at, crosses, lane, bits = labels
    for n, seen in enumerate((observation, *others)):
        x[0, n], y[0, n], c[0, n], s[0, n] = seen.pose
        speed[0, n], yaw_rate[0, n] = seen.twist
        segment[0, n], at[0, n], crosses[0, n], lane[0, n], bits[0, n] = seen.propositions


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact of `car` and `other`, at `time` seconds, in the tick that ends in frame `tick`.

    `other` is a car's index, or -1 - k for obstacle k. (x, y) is the point of contact and (nx, ny) the unit normal
    from `car` toward `other`. The pairs are of `car` and of `other`: `closing`, the speed of its touching point toward
    the other body (m/s); `moved`, whether it moved, or as a rectangle turned, in that tick before the contact;
    `at_fault`, whether it is at fault, which the labeller fills in.
    """

    tick: int
    time: float
    car: int
    other: int
    x: float
    y: float
    nx: float
    ny: float
    closing: tuple[float, float]
    moved: tuple[bool, bool]
    at_fault: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, slots=True)
class Event:
    """Something at a tick worth recording that is neither a frame nor a contact: its kind, car and detail."""

    tick: int
    kind: str
    car: int = NONE
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Frames:
    """A block of consecutive frames of one trial, with all contacts and events of their ticks.

    Frame f of the block is frame ``first + f`` of the trial, at time ``(first + f) / rate``. Arrays are (F, N).
    `command_speed` and `command_yaw_rate` are the clipped commands held during the tick that ended in the frame
    (0 in frame 0). The integer arrays are those of `Labels`.
    """

    first: int
    rate: float
    x: Floats
    y: Floats
    c: Floats
    s: Floats
    speed: Floats
    yaw_rate: Floats
    command_speed: Floats
    command_yaw_rate: Floats
    segment: Ints
    at: Ints
    crosses: Ints
    lane: Ints
    bits: Bits
    contacts: tuple[Contact, ...] = field(default=())
    events: tuple[Event, ...] = field(default=())

    def __repr__(self) -> str:
        last = self.first + len(self) - 1
        cars = self.x.shape[1]
        counts = f"{len(self.contacts)} contacts, {len(self.events)} events"
        return f"<Frames {self.first} to {last} of {cars} cars at {self.rate:g} Hz, {counts}>"

    def __len__(self) -> int:
        return int(self.x.shape[0])

    @property
    def states(self) -> tuple[State, Labels]:
        """The frames as a batch, (F, N), that kernels take."""
        reals: list[Any] = [getattr(self, name) for name in State.field_names[:6]]
        labels: list[Any] = [getattr(self, name) for name in Labels.field_names]
        count: Any = np.full(len(self), self.x.shape[1], dtype=np.int64)
        return State(*map(np.ascontiguousarray, reals), count=count), Labels(*map(np.ascontiguousarray, labels))

    @property
    def time(self) -> Floats:
        """Times of the frames, seconds, (F,)."""
        return (self.first + np.arange(len(self))) / self.rate

    @property
    def theta(self) -> Floats:
        """Headings in radians, (F, N)."""
        return np.copysign(angles(np.abs(self.s), self.c), self.s)
