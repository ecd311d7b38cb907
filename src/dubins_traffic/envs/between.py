"""Disturbances and shield between an environment and its ego: noise, and commands that are delayed, lost or changed.

It is what `run_trial` puts between a controller and its car, in the same order (docs/semantics.md), made of the same
parts: so an episode stays the trial that it cites.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Observation
from dubins_traffic.observations.flat import FlatObserver
from dubins_traffic.observations.senses import Senses
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.trial.disturbance import CommandLine

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from dubins_traffic.engine.group import Group
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.shield.tables import Overtakes


class Between:
    """Applies disturbances and a shield between an environment and the ego of one trial of a group.

    Parameters
    ----------
    group : Group
        The trials.
    row : int
        Which of them, in its first frame.
    shown : int
        Other cars that a flat observation shows, at most.
    shield : {"sure", "law", "never"}, optional
        When the ego may cross the centre line under its shield; by default it has none.

    Attributes
    ----------
    given : list of (float, float)
        Speed and yaw rate that have been passed on in each tick so far, before any came late or was lost.
    interventions : int
        In how many ticks the shield has changed the command.

    Raises
    ------
    InputError
        If the car can't keep the rules and is under a shield.
    """

    def __init__(self, group: Group, row: int, shown: int, shield: Overtakes | None) -> None:
        self._group, self._row = group, row
        instance = group.instances[row]
        self._state, self._labels = group.of_trial(row)
        self._senses, self._line = Senses(instance), CommandLine(instance)
        noise = instance.disturbances
        is_noisy = noise.position_noise > 0.0 or noise.heading_noise > 0.0
        self._observer = FlatObserver(instance.problem, shown) if is_noisy else None
        self._shield = None if shield is None else ShieldFilter(overtakes=shield)
        if self._shield is not None:
            self._shield.start(instance.problem)
        self.given: list[tuple[float, float]] = []
        self._asked = (0.0, 0.0)
        self._seen: Observation | None = None

    @property
    def interventions(self) -> int:
        """Number of ticks in which the shield has changed the command."""
        return 0 if self._shield is None else self._shield.count

    def look(self, flat: npt.NDArray[np.float32]) -> None:
        """Observe the present frame, once; if there is noise write the flat observation, (F,)."""
        tick = int(self._group.ticks[self._row])
        if self._seen is None or self._seen.tick != tick:
            self._seen = self._senses.observe(tick, self._state, self._labels)
            self._shows = None if self._observer is None else self._observer(self._seen)
        if self._shows is not None:
            flat[:] = self._shows

    def command(self, asked: Floats | None) -> tuple[float, float]:
        """Return the command that takes effect in the coming tick, m/s and rad/s.

        Parameters
        ----------
        asked : (2,), optional
            The speed, m/s, and yaw rate, rad/s, of the action that begins now; by default the one before goes on.
        """
        if asked is not None:
            self._asked = (float(asked[0]), float(asked[1]))
        seen = self._seen
        if seen is not None and seen.tick == len(self.given):
            command = self._asked
            if self._shield is not None:
                given = self._shield.filter(seen, command)
                command = (given.speed, given.yaw_rate)
            self.given.append(command)
            self._now = self._line.take(seen.tick, command)
        return self._now
