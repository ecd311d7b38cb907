"""What the shield (`driving.shield`) reads and remembers, as arrays over a batch, and why it steps in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from dubins_traffic.driving.law_tables import (
    FIRST,
    KIND,
    LAST,
    PLACE,
    ROUND,
    SPEED,
    Drivers,
    blank,
    build_of,
    no_ways,
)
from dubins_traffic.driving.rounds import stages
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.spec.parameters import RuleParameters

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

LAST_TICK, LAST_LANE, LAST_AT, STRAYED, AIMED, REASON = range(6)
MARKS: Final = 6
"""Columns of `Guards.mark`. LAST_TICK, LAST_LANE, LAST_AT: tick, lane state and disc of the ego when it was last
looked at, LAST_TICK -2 before the first time. STRAYED: 1 if the ego has not done as the law since the law began to pass
something. AIMED: 1 once the law knows its first goal. REASON: why the shield stepped in in this tick, NOTHING if it did
not."""

LEFT_RELEASE, TURN_BACK, LEFT_TIME, SIGHT2 = range(4)
LIMITS: Final = 4
"""Columns of `Guards.limit`: a car that is left is so until its body is below this, metres; progress lost that makes a
turn, metres; for how long an ego may be left, s, 0 if it shall not overtake; square of the sensing radius, metres
squared."""


class Guards(NamedTuple):
    """What the shield knows of each trial, `limit` (B, LIMITS); what it remembers, `memory` and `mark` (B, MARKS)."""

    limit: Floats
    memory: Floats
    mark: Ints


def guards(problems: Sequence[Problem], *, overtakes: bool = True) -> Guards:
    """Return what the shield knows of trials that have not begun; whether their egos may overtake."""
    rules = [RuleParameters.from_mapping(problem.rules) for problem in problems]
    limit = [
        (own.left_release, own.turn_back, own.left_time if overtakes else 0.0, problem.sensing_radius**2)
        for own, problem in zip(rules, problems, strict=True)
    ]
    mark = np.zeros((len(problems), MARKS), dtype=np.int64)
    mark[:, LAST_TICK] = -2
    return Guards(np.array(limit), np.zeros((len(problems), MEMORY)), mark)


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
