"""Shields of any cars of batched trials: e-agents under one keep E1 and E2, egos rules 1 to 3.

A car's shield is that of the ego (`shield.nearest_command`, docs/shield.md), run on tables in which the car stands in
the ego's place. The argument for it does not depend on which car is the ego: a car under it breaks none of rules 2 and
3, stays on the road and is at fault in no collision, whatever all others do, and that is E1 and E2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.policies.rules.fitness import check_fit
from dubins_traffic.policies.rules.tables import Traffic, scratch
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.shield.nearest_command import shield
from dubins_traffic.shield.tables import REASON, REASONS, Overtakes, check_overtakes, egos, shield_tables

if TYPE_CHECKING:
    from dubins_traffic.observations.viewpoints import Viewpoints
    from dubins_traffic.problem.instance import Problem


class CarShields:
    """Keeps some cars of batched trials within the rules, whatever commands they are given.

    Parameters
    ----------
    problems : sequence of Problem
        One a trial, B.
    views : Viewpoints
        What the cars of these trials see.
    cars : (B, N) bool
        Which of the cars have a shield.
    overtakes : {"sure", "law", "never"}
        When they may cross the centre line, as for `ShieldFilter`.

    Raises
    ------
    InputError
        If the cars can't keep the rules, or `overtakes` is something else.
    """

    def __init__(
        self,
        problems: Sequence[Problem],
        views: Viewpoints,
        cars: npt.NDArray[np.bool_],
        *,
        overtakes: Overtakes = "sure",
    ) -> None:
        for problem in {id(problem): problem for problem in problems}.values():
            check_fit(problem, owes=False)
        self._views = views
        self._places = cars.shape[1]
        self._rows: Ints = np.flatnonzero(cars)
        each = [problem for problem in problems for _ in range(self._places)]
        self._traffic = _traffic_of(each, views.state, views.labels)
        self._shields = shield_tables(each, self._traffic, overtakes=check_overtakes(overtakes))
        self._tick: Ints = np.full(len(each), -1)
        self._commands = np.zeros((len(each), self._places, 2))
        self._shield = bound(shield)

    def filter(self, ticks: Ints, commands: Floats) -> Ints:
        """Replace the commands that would break a rule in the tick that begins with the frame last seen.

        Parameters
        ----------
        ticks : (B,)
            Number of the present frame of each trial, -1 for trials to leave alone; none may be left out.
        commands : (B, N, 2)
            Speed, m/s, and yaw rate, rad/s, of all cars; those of the cars with a shield are changed in place.

        Returns
        -------
        reasons : (B, N) int64
            Why each car's command was changed (a place in `shield.tables.REASONS`), 0 where it was not.
        """
        rows = self._rows
        self._tick[rows] = ticks[rows // self._places]
        flat = commands.reshape(-1, 2)
        self._commands[rows, EGO] = flat[rows]
        self._shield(self._tick, False, self._traffic, self._shields, self._commands)
        running = rows[self._tick[rows] >= 0]
        flat[running] = self._commands[running, EGO]
        reasons: Any = np.full(len(flat), REASON.NOTHING, dtype=np.int64)
        reasons[running] = self._shields.ego["reason"][running]
        return reasons.reshape(commands.shape[:2])

    @staticmethod
    def name(reason: int) -> str:
        """Return the rule that was at stake, for what `filter` returns."""
        return REASONS[reason]


class EgoShields:
    """Keeps the egos of trials that are stepped together within the rules, as a `ShieldFilter` each would.

    Parameters
    ----------
    problems : sequence of Problem
        One a trial, B, of cars that can keep the rules.
    state, labels : State, Labels
        The present frame of the trials, (B, N), as it is now and will be.
    overtakes : {"sure", "law", "never"}
        When they may cross the centre line, as for `ShieldFilter`.
    """

    def __init__(
        self, problems: Sequence[Problem], state: State, labels: Labels, *, overtakes: Overtakes = "sure"
    ) -> None:
        self._traffic = _traffic_of(problems, state, labels)
        self._shields = shield_tables(problems, self._traffic, overtakes=check_overtakes(overtakes))
        self._shield = bound(shield)

    def filter(self, ticks: Ints, commands: Floats) -> None:
        """Put what the egos do in place of what they are asked to do; arguments as for `CarShields.filter`."""
        self._shield(ticks, False, self._traffic, self._shields, commands)


def _traffic_of(problems: Sequence[Problem], state: State, labels: Labels) -> Traffic:
    """Return what the law knows of rows of cars, one problem a row, of which it drives the first."""
    places = state.x.shape[1]
    roads, net = pack_distinct(
        [problem.network for problem in problems], [problem.car.lane_width for problem in problems]
    )
    longest = max(len(problem.network.segments) for problem in problems)
    bodies = pack_obstacles([problem.obstacles for problem in problems])
    drivers = egos(problems, places, net)
    return Traffic(state, labels, roads, bodies, drivers, scratch(places, longest, bodies))
