"""The shield of one ego, tick by tick: takes observations and commands, returns commands that break no rule."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Labels, Observation, State, put_observed
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.calls import bound
from dubins_traffic.policies.in_flight import InFlight
from dubins_traffic.policies.rules.fitness import check_fit
from dubins_traffic.policies.rules.tables import Traffic, scratch
from dubins_traffic.roads.packing import pack
from dubins_traffic.shield.checks import bounded
from dubins_traffic.shield.nearest_command import shield
from dubins_traffic.shield.tables import (
    REASONS,
    Overtakes,
    ShieldTables,
    check_overtakes,
    egos,
    shield_tables,
)

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class Intervention(NamedTuple):
    """A tick in which the shield stepped in: the command given, the command done, and the rule at stake."""

    tick: int
    asked: tuple[float, float]
    given: Command
    reason: str


class ShieldFilter:
    """Keeps an ego within rules 1 to 3, whatever commands it is given (`shield.nearest_command`, docs/shield.md).

    Parameters
    ----------
    overtakes : {"sure", "law", "never"}
        When the ego may cross the centre line to pass what stands: only where it is sure to be back in time whatever
        the others do, by default; wherever the law of the road would, as the controller `rules` does; or never.

    Examples
    --------
    >>> shield_filter = ShieldFilter()                                              # doctest: +SKIP
    >>> shield_filter.start(problem)                                         # doctest: +SKIP
    >>> command = shield_filter.filter(observation, (0.5, 0.0))              # doctest: +SKIP

    Attributes
    ----------
    intervention : Intervention or None
        That of the last tick; None if its command was let through.
    count : int
        Number of ticks in which the shield has stepped in.
    in_flight : InFlight
        The commands that have not taken effect yet.
    """

    def __init__(self, *, overtakes: Overtakes = "sure") -> None:
        self._overtakes: Overtakes = check_overtakes(overtakes)
        self.intervention: Intervention | None = None
        self.count = 0

    def start(self, problem: Problem) -> None:
        """Prepare for a trial; InputError if the car can't keep the rules (`policies.rules.fitness`)."""
        check_fit(problem, owes=False)
        self.in_flight = InFlight(problem)
        cars = 1 + len(problem.e_agents)
        self.intervention = None
        self.count = 0
        self._state = State.zeros(1, cars)
        self._labels = Labels.zeros(1, cars)
        self._command = np.zeros((1, cars, 2))
        bodies = pack_obstacles([problem.obstacles])
        self._traffic = Traffic(
            self._state,
            self._labels,
            pack([problem.network], [problem.car.lane_width]),
            bodies,
            egos([problem], cars, np.zeros(1, dtype=np.int64)),
            scratch(cars, len(problem.network.segments), bodies),
        )
        self._shields: ShieldTables = shield_tables([problem], self._traffic, overtakes=self._overtakes)
        self._tick = np.full(1, -1)
        self._bound = bound(shield)
        self._shield()  # called once so that kernels are compiled before the first tick

    def filter(self, observation: Observation, command: tuple[float, float]) -> Command:
        """Return `command`, or the nearest one found with which the ego breaks nothing.

        Parameters
        ----------
        observation : Observation
            Of every tick, from the first on. After a gap the ego does not back up until it has driven on.
        command : tuple of float
            Speed, m/s, and yaw rate, rad/s. Out of bounds it means what the simulator makes of it; numbers that are
            not finite mean (0, 0).
        """
        put_observed(self._state, self._labels, self.in_flight.ahead(observation))
        self._tick[0] = observation.tick
        asked = (float(command[0]), float(command[1]))
        self._command[0, EGO] = asked
        self._shield()
        reason = int(self._shields.ego[0].reason)
        given = Command(*self._command[0, EGO].tolist())
        self.in_flight.sent(bounded(*given, self._traffic.drivers.vehicle[0]))
        self.intervention = None
        if reason:
            self.count += 1
            self.intervention = Intervention(observation.tick, asked, given, REASONS[reason])
        return given

    def _shield(self) -> None:
        self._bound(self._tick, True, self._traffic, self._shields, self._command)
