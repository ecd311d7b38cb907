"""What the shield (`shield.nearest_command`) reads and remembers, as arrays over a batch, and why it steps in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.tables import (
    FIRST,
    FLOATS,
    INTS,
    KIND,
    LAST,
    PLACE,
    ROUND,
    SPEED,
    WAYS,
    Drivers,
    blank,
    build_of,
    no_ways,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.rounds import stages
from dubins_traffic.rules.obstacles import ObstacleLanes, place_obstacles
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

EGO: Final = 0

NOTHING, NUMBER, CONTACT, ROAD, TURN, LANE, RETURN, STOP, ORDER, CLEARANCE = range(10)
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
"""Why a command was not let through, by number: what it would have broken, in the names of the referee; `2.turn` is
turning round outside a disc."""

TOP: Final = 0
MEMORY: Final = 1
"""Columns of `Guards.memory`. TOP: greatest progress of the ego since its lane state was set, metres."""

LAST_TICK, LAST_LANE, LAST_AT, STRAYED, AIMED, REASON, KEPT = range(7)
MARKS: Final = 7
"""Columns of `Guards.mark`. LAST_TICK, LAST_LANE, LAST_AT: tick, lane state and disc of the ego when it was last
looked at, LAST_TICK -2 before the first time. STRAYED: 1 if the ego has not done as the law since the law began to pass
something. AIMED: 1 once the law knows its first goal. REASON: why the shield stepped in in this tick, NOTHING if it did
not. KEPT: 1 if the ego, while it is left, does what has been rehearsed.
"""

LEFT_RELEASE, TURN_BACK, LEFT_TIME, SIGHT2, BLOCKED_AHEAD = range(5)
LIMITS: Final = 5
"""Columns of `Guards.limit`: a car that is left is so until its body is below this, metres; progress lost that makes a
turn, metres; for how long an ego may be left, s; square of the sensing radius, metres squared; how far ahead what
stands blocks the lane, metres."""

Overtakes = Literal["sure", "law", "never"]
"""When the ego may cross the centre line: where its return is sure, where the law of the road would, or never."""
SURE, LAW, NEVER = range(3)
MODE, CARS = range(2)
SETTINGS: Final = 2
"""Columns of `Guards.setting`: SURE, LAW or NEVER; how many cars there are."""


class Alone(Tables):
    """An ego that sees no other car: tables of one car per trial, and what the law that drives it remembers."""

    state: State
    labels: Labels
    ints: Ints
    floats: Floats
    way: Floats
    commands: Floats


class Guards(Tables):
    """What the shield knows of each trial, `limit` (B, LIMITS), `setting` (B, SETTINGS) and the `obstacles` in lanes.

    What it remembers, `memory` and `mark` (B, MARKS); and the ego as it would drive `alone`.
    """

    limit: Floats
    setting: Ints
    obstacles: ObstacleLanes
    memory: Floats
    mark: Ints
    alone: Alone


def check_overtakes(value: object) -> Overtakes:
    """Return when the ego may cross the centre line; InputError if it is no such value."""
    for known in get_args(Overtakes):
        if value == known:
            return known
    raise InputError(
        "not a way to overtake", field="overtakes", value=value, expected=", ".join(get_args(Overtakes))
    )


def guards(
    problems: Sequence[Problem], roads: RoadTable, net: Ints, *, overtakes: Overtakes = "sure"
) -> Guards:
    """Return what the shield knows of trials that have not begun.

    Parameters
    ----------
    problems
        One per trial.
    roads, net : (B,)
        The road networks, and the number of each trial's.
    overtakes
        When their egos may cross the centre line.
    """
    trials = len(problems)
    rules = [RuleParameters.from_mapping(problem.rules) for problem in problems]
    limit = [
        (own.left_release, own.turn_back, own.left_time, problem.sensing_radius**2, own.blocked_ahead)
        for own, problem in zip(rules, problems, strict=True)
    ]
    mode = get_args(Overtakes).index(overtakes)
    setting = np.array([(mode, 1 + len(problem.e_agents)) for problem in problems], dtype=np.int64)
    mark = np.zeros((trials, MARKS), dtype=np.int64)
    mark[:, LAST_TICK] = -2
    obstacles = place_obstacles(pack_obstacles([problem.obstacles for problem in problems]), roads, net)
    alone = Alone(
        State.zeros(trials, 1),
        Labels.zeros(trials, 1),
        np.zeros((trials, 1, INTS), dtype=np.int64),
        np.zeros((trials, 1, FLOATS)),
        np.zeros((trials, 1, WAYS)),
        np.zeros((trials, 1, 2)),
    )
    return Guards(np.array(limit), setting, obstacles, np.zeros((trials, MEMORY)), mark, alone)


def egos(problems: Sequence[Problem], cars: int, net: Ints) -> Drivers:
    """Return drivers of which the law drives the egos only, round their goals.

    Parameters
    ----------
    problems
        One per trial.
    cars
        Places for cars in a trial.
    net : (B,)
        Number of each trial's road network.
    """
    whole, real = blank(cars)
    trials = len(problems)
    ints, floats = np.repeat(whole[None], trials, axis=0), np.repeat(real[None], trials, axis=0)
    rounds = [stages(problem) for problem in problems]
    lanes = max((far.shape[1] for _, far in rounds), default=0)
    stage: list[int] = []
    distance = np.full((sum(len(own) for own, _ in rounds), lanes), np.inf)
    for b, ((own, far), problem) in enumerate(zip(rounds, problems, strict=True)):
        ints[b, EGO, [KIND, FIRST, LAST]] = ROUND, len(stage), len(stage) + len(own)
        ints[b, EGO, PLACE] = -1
        floats[b, EGO, SPEED] = problem.car.bounds.speed
        distance[len(stage) : len(stage) + len(own), : far.shape[1]] = far
        stage += own.tolist()
    return Drivers(
        active=np.ones(trials, dtype=np.int64),
        net=net,
        seed=np.zeros(trials, dtype=np.uint64),
        trial=np.zeros(trials, dtype=np.int64),
        build=build_of(problems),
        ints=ints,
        floats=floats,
        way=no_ways(trials, cars),
        stage=np.array(stage, dtype=np.int64),
        distance=distance,
    )
