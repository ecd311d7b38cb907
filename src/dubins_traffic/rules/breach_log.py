"""The referee's tables: parameters of each trial, memory of cars and goals, and the breaches found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from dubins_traffic.cars.near import Spacing
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Grid, Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.tables import GRAIN, Memory, TrialRules, ticks

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters


class _Rule(NamedTuple):
    """The rules by number; `RULES` has their names. `ROAD`, and rules 2 and 3, of an e-agent are E1."""

    COLLISION: int = 0
    ROAD: int = 1
    LEFT_UNBLOCKED: int = 2
    RETURN: int = 3
    TURN: int = 4
    STOP: int = 5
    ORDER: int = 6
    CLEARANCE: int = 7
    FAULT: int = 8
    ENTER: int = 9
    TICKETS: int = 10
    EXIT: int = 11
    JOURNEY: int = 12
    GOAL: int = 13


RULE: Final = _Rule()

RULES: Final[tuple[str, ...]] = (
    "1.collision", "1.road", "2.left", "2.return", "2.turn", "3.stop", "3.order", "3.clear",
    "E2", "E3.enter", "E3.tickets", "E4", "E5", "E6",
)  # fmt: skip
"""Names of the rules, by number."""

PENDING: Final = (("2.return", "free_since"), ("E3.enter", "first_since"), ("E4", "exit_counts"))
"""Rules that a car breaks if nothing changes for long enough, and the field of `JudgedCar` whose run tells so."""

MOST: Final = len(RULES)
"""Most breaches that one car can begin in one frame: one of each rule."""

NEVER: Final = -2
"""In `JudgedCar.off_road`: the car has never been on the road."""

NEVER_DUE: Final = 1 << 62
"""A tick that never comes."""


@record
class RefereeParameters:
    """The parameters by which one trial is judged: metres and ticks.

    Limits in metres are eased by GRAIN in favour of the car that would be in breach.
    """

    exit2: float
    """Squared distance of a centre from a vertex up to which it is in the way of cars that leave, square metres."""
    lone: float
    """Distance from a vertex beyond which a car neither meets the disc nor is in the way of a car that leaves it."""
    way: float
    """E5's way ahead."""
    exit_room: float
    """E4's length of an exit that no obstacle narrows."""
    goal_gap: float
    """E6's distance of the ego from an exit."""
    lane_middle: float
    """Distance of the right lane's middle from the centre line."""
    judged: int
    """Whether the trial is judged at all."""
    return_ticks: int
    enter_ticks: int
    exit_ticks: int
    journey_ticks: int
    """E5's longest journey."""
    start_ticks: int
    """So many ticks count at the start of each journey."""
    goal_ticks: int
    shared_ticks: int
    excused_ticks: int
    """E5's most ticks of a journey for which a car ahead of a full bend, or left before the ego, owes nothing."""
    most_tickets: int
    """E3's most new tickets in one wait."""
    goals_begin: int
    goals_end: int
    """The trial's goals are rows goals_begin to goals_end - 1 of `BreachLog.goal`."""


@record
class JudgedCar:
    """What the referee remembers of one car. A run is consecutive frames in which something holds.

    Of each run the first tick is remembered, -1 if there is none. Times are in ticks; nothing is in metres.
    """

    number: int
    """The car's index in its trial."""
    bits: int = 0
    lane: int = -1
    crosses: int = -1
    at: int = -1
    """Flags, lane state, disc that the body meets and disc that holds the centre, of the frame before."""
    due: int = 0
    """Tick in which the car has to be judged again even if its labels stay the same and no car comes near."""
    off_road: int = NEVER
    """Run of being off the road; `NEVER` before the car has been on one."""
    left_since: int = -1
    free_since: int = -1
    """Run of being left and not hemmed in."""
    unblocked_since: int = -1
    """Run of being left and not overtaking."""
    first_since: int = -1
    """Run of being first at a clear crossing."""
    exit_since: int = -1
    """Run of being in a disc with a free exit."""
    exit_paused: int = 0
    """Number of ticks of that run that do not count."""
    exit_spent: int = 0
    """Number of ticks that count of the earlier such runs in this stay."""
    exit_counts: int = -1
    """That run's first tick while its ticks count, else -1."""
    exit_over: int = 0
    """Whether E4 has been broken in this stay."""
    journey_since: int = 0
    """Tick in which the present journey began (E5)."""
    journey_spent: int = 0
    """Number of ticks of it that count, those at its start apart."""
    journey_excused: int = 0
    """Number of ticks of it in which the ego near it while left, or a full bend, was its only excuse."""
    journey_over: int = 0
    """Whether E5 has been broken in this journey."""
    last_disc: int = -1
    """The disc that the body met last, -1 for none so far."""
    at_since: int = -1
    """Run of being where its centre is: at a vertex or none."""
    in_since: int = -1
    """Run of being in the disc that its body meets."""
    waits: int = 0
    """Whether the car waits for the ego, 0 or 1, in the frame in which a goal was last asked for it."""
    came_by: int = -1
    """The lane by which the car came into the disc that its body meets, -1 if it started there."""
    been_out: int = 0
    """Whether, in this stay, its centre has been outside that disc on a lane out of it."""
    ticket: int = -1
    """Tick of the car's ticket, as of the frame before."""
    approach_since: int = -1
    """Run of approaching a crossing, as of the frame before."""


@record
class EntryMargins:
    """The least margins of rule 3 over the ego's entries: negative once it is broken, infinite without an entry."""

    stop: float = np.inf
    """Ticks for which it had stopped, or, negative, that it still lacked for a stop."""
    order: float = np.inf
    """Ticks from its ticket to the next one."""
    clear: float = np.inf
    """Metres between the disc and the nearest body of another car."""


@record
class JudgedGoal:
    """A goal of one trial, once however often it is listed there."""

    vertex: int
    since: int = -1
    """First tick of the present run of being taken; -1 while it is free."""
    paused: int = 0
    """How many ticks of that run do not count."""


@record
class FoundBreach:
    """A breach that has been found; `rule` is a number in `RULES`, `lane` and `vertex` are -1 for none."""

    trial: int
    rule: int
    car: int
    tick: int
    since: int
    vertex: int
    lane: int


class BreachLog(Tables):
    """The referee's memory, and the breaches it has found.

    Attributes
    ----------
    car : (B, N) JudgedCar
        The memory of each car.
    goal : (G,) JudgedGoal
        The goals of one trial after the other.
    entry : (B,) EntryMargins
        The least margins by which the ego has kept rule 3.
    goal_due : (B,) int64
        Tick in which the goals have to be judged again even if no car comes or goes.
    look : (N,) int64
        Scratch: the cars to be judged in this frame.
    row : (K,) FoundBreach
        Breaches found.
    filled : (1,) int64
        Number of rows that are filled.
    """

    car: Grid[JudgedCar]
    goal: Rows[JudgedGoal]
    entry: Rows[EntryMargins]
    goal_due: Ints
    look: Ints
    row: Rows[FoundBreach]
    filled: Ints

    @staticmethod
    def empty(trials: int, cars: int, goals: Ints, frames: int = 1) -> BreachLog:
        """Return the log of `trials` x `cars` cars before the first frame, with rows for breaches in `frames` frames.

        `goals` (G,) are the vertices of the goals, of one trial after the other (`rules.referee.terms_of`).
        """
        known: Any = table(JudgedCar, (trials, cars))
        known["number"] = np.arange(cars)
        taken: Any = table(JudgedGoal, len(goals))
        taken["vertex"] = goals
        return BreachLog(
            car=known,
            goal=taken,
            entry=table(EntryMargins, trials),
            goal_due=np.zeros(trials, dtype=np.int64),
            look=np.zeros(cars, dtype=np.int64),
            row=table(FoundBreach, (MOST * trials * cars + len(goals)) * frames),
            filled=np.zeros(1, dtype=np.int64),
        )

    @property
    def room_of_a_frame(self) -> int:
        """The most rows that one frame can fill."""
        trials, cars = self.car.shape
        return MOST * trials * cars + len(self.goal)

    def found(self) -> Rows[FoundBreach]:
        """Return the breaches found; they are overwritten when the next frame is judged."""
        return self.row[: int(self.filled[0])]


class RefereeTables(Tables):
    """All tables by which the frames of a batch are judged (`rules.referee_kernel.judge_frame`)."""

    state: State
    roads: RoadTable
    obstacles: ObstacleLanes
    rules: Rows[TrialRules]
    terms: Rows[RefereeParameters]
    labels: Labels
    memory: Memory
    log: BreachLog
    spacing: Spacing


def pack_terms(
    parameters: Sequence[RuleParameters],
    judged: Sequence[bool],
    radii: Sequence[float],
    rates: Sequence[float],
    cars: CarTable,
) -> Rows[RefereeParameters]:
    """Return the parameters by which each trial is judged; those that depend on roads and goals are left to fill in.

    Parameters
    ----------
    parameters, judged
        The parameters of the rules, and whether the trial is judged by them.
    radii, rates
        Intersection radius R (m) and control rate (Hz).
    cars
        The car of each trial.
    """
    terms = table(RefereeParameters, len(parameters))
    for b, (given, radius, rate) in enumerate(zip(parameters, radii, rates, strict=True)):
        row = terms[b]
        reach = float(cars.reach[b])
        far = radius + given.room_beyond(reach, 3) + GRAIN
        row.exit2 = far * far
        row.lone = far + 2.0 * reach
        row.way = given.way_distance + GRAIN
        row.exit_room = given.room_beyond(reach, 2) + GRAIN
        row.goal_gap = given.goal_gap + GRAIN
        row.lane_middle = float(cars.w[b])
        row.judged = int(judged[b])
        row.return_ticks = ticks(given.left_time, rate)
        row.enter_ticks = ticks(given.enter_time, rate)
        row.exit_ticks = ticks(given.exit_time, rate)
        row.start_ticks = ticks(given.journey_start_time, rate)
        row.goal_ticks = ticks(given.goal_time, rate)
        row.shared_ticks = ticks(given.shared_time, rate)
        row.excused_ticks = ticks(given.rest_time, rate)
        row.most_tickets = given.tickets
    return terms
