"""The shield's tables over a batch: parameters and memory; and the reasons for which it steps in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

import numpy as np

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.kept import KeptPath, kept_commands
from dubins_traffic.policies.rules.tables import KIND, Driver, Drivers, Leg, Traffic, vehicles_of
from dubins_traffic.routing.rounds import stages
from dubins_traffic.rules.obstacles import ObstacleLanes, place_obstacles
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class _Reason(NamedTuple):
    """Why a command was not let through: the rule that it would have broken; `REASONS` has the names."""

    NOTHING: int = 0
    NUMBER: int = 1
    CONTACT: int = 2
    ROAD: int = 3
    TURN: int = 4
    LANE: int = 5
    RETURN: int = 6
    STOP: int = 7
    ORDER: int = 8
    CLEARANCE: int = 9


REASON: Final = _Reason()
REASONS: Final = (
    "",
    "not finite numbers",
    "1.collision",
    "1.road",
    "2.turn",
    "2.left",
    "2.return",
    "3.stop",
    "3.order",
    "3.clear",
)
"""Names of the reasons, by number: the rule that the command would have broken, as the referee calls it. `2.turn` is
turning round outside a disc."""

Overtakes = Literal["sure", "law", "never"]
"""When the ego may cross the centre line: if its return is sure, whenever the law of the road would, or never."""


class _Mode(NamedTuple):
    """The values of `Overtakes` as numbers for kernels, in the same order."""

    SURE: int = 0
    LAW: int = 1
    NEVER: int = 2


MODE: Final = _Mode()


@record
class Ego:
    """The shield's parameters and memory of the ego of a trial."""

    mode: int
    """When the ego may cross the centre line: `MODE`."""
    cars: int
    """How many cars there are in the trial."""
    left_release: float
    """A car that is left is so until its body is below this, metres."""
    turn_back: float
    """Progress lost that makes a turn, metres."""
    left_time: float
    """For how long an ego may be left, seconds."""
    sight2: float
    """Square of the sensing radius, metres squared."""
    blocked_ahead: float
    """How far ahead what stands blocks the lane, metres."""
    top: float
    """Greatest progress of the ego since its lane state was set, metres."""
    last_tick: int = -2
    """When the ego was last looked at, -2 before the first time."""
    last_lane: int
    """Its lane state then."""
    last_at: int
    """Its disc then."""
    strayed: int
    """1 if the ego has not done as the law since the law began to pass something."""
    aimed: int
    """1 once the law knows its first goal."""
    reason: int
    """Why the shield stepped in in this tick: `REASON`."""
    kept: int
    """1 if the ego, while it is left, does what has been rehearsed."""


class Alone(Tables):
    """The tables by which the law drives an ego that sees no other car: one car per trial, with a memory of its own."""

    traffic: Traffic
    commands: Floats


class ShieldTables(Tables):
    """All tables of the shield: `ego` (B,), the `obstacles` in lanes, and the tables of the ego `alone`."""

    ego: Rows[Ego]
    obstacles: ObstacleLanes
    alone: Alone


def check_overtakes(value: object) -> Overtakes:
    """Return `value` if it is one of `Overtakes`; else raise InputError."""
    for known in get_args(Overtakes):
        if value == known:
            return known
    raise InputError("not a way to overtake", field="overtakes", value=value, expected=", ".join(get_args(Overtakes)))


def shield_tables(problems: Sequence[Problem], traffic: Traffic, *, overtakes: Overtakes = "sure") -> ShieldTables:
    """Return the shield's tables for trials before their first frame.

    Parameters
    ----------
    problems
        One per trial.
    traffic
        The trials, with the drivers of `egos`.
    overtakes
        When they may cross the centre line.
    """
    trials = len(problems)
    known = table(Ego, trials)
    for b, problem in enumerate(problems):
        row, rules = known[b], RuleParameters.from_mapping(problem.rules)
        row.mode = get_args(Overtakes).index(overtakes)
        row.cars = 1 + len(problem.e_agents)
        row.left_release = rules.left_release
        row.turn_back = rules.turn_back
        row.left_time = rules.left_time
        row.sight2 = problem.sensing_radius**2
        row.blocked_ahead = rules.blocked_ahead
    drivers = traffic.drivers
    parts = pack_obstacles([problem.obstacles for problem in problems])
    obstacles = place_obstacles(parts, traffic.roads, drivers.net)
    unseen = traffic.replace(
        state=State.zeros(trials, 1),
        labels=Labels.zeros(trials, 1),
        drivers=drivers.replace(
            car=table(Driver, (trials, 1)), way=table(KeptPath, (trials, 1)), command=kept_commands(trials, 1)
        ),
    )
    alone = Alone(unseen, np.zeros((trials, 1, 2)))
    return ShieldTables(known, obstacles, alone)


def egos(problems: Sequence[Problem], cars: int, net: Ints) -> Drivers:
    """Return drivers' tables by which the law drives only the egos, round their goals.

    Parameters
    ----------
    problems
        One per trial.
    cars
        Places for cars in a trial.
    net : (B,)
        Number of each trial's road network.
    """
    trials = len(problems)
    rows = table(Driver, (trials, cars))
    rounds = [stages(problem.network, problem.goal_vertices) for problem in problems]
    lanes = max((far.shape[1] for _, far in rounds), default=0)
    stage: list[int] = []
    distance = np.full((sum(len(stages) for stages, _ in rounds), lanes), np.inf)
    for b, ((ways, far), problem) in enumerate(zip(rounds, problems, strict=True)):
        ego = rows[b, EGO]
        ego.kind, ego.first, ego.last = KIND.ROUND, len(stage), len(stage) + len(ways)
        ego.speed = problem.car.bounds.speed
        distance[len(stage) : len(stage) + len(ways), : far.shape[1]] = far
        stage += ways.tolist()
    return Drivers(
        active=np.ones(trials, dtype=np.int64),
        net=net,
        seed=np.zeros(trials, dtype=np.uint64),
        trial=np.zeros(trials, dtype=np.int64),
        vehicle=vehicles_of(problems, [True] * len(problems)),
        car=rows,
        way=table(KeptPath, (trials, cars)),
        command=kept_commands(trials, cars),
        stage=np.array(stage, dtype=np.int64),
        distance=distance,
        choice=table(Leg, 0),
    )
