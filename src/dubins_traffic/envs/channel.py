"""One trial of a group, as its environment sees it.

Between an environment and its ego stands what `run_trial` puts between a controller and its car, in the same order
(docs/semantics.md), made of the same parts: so an episode stays the trial that it cites. Formulas, which are not part
of an instance, are judged on its frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Frames, Observation
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.observations.senses import Senses
from dubins_traffic.scoring.formulas import FormulaVerdicts, Status
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.trial.disturbance import CommandLine
from dubins_traffic.verification.worlds import with_formulas

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from dubins_traffic.engine.group import Group
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.shield.tables import Overtakes


class TrialView:
    """Shows one trial of a group as if it ran by itself.

    It keeps no view of the group's arrays: in a copy that would show arrays of its own.
    """

    def __init__(self, group: Group, row: int) -> None:
        self._group, self._row = group, row
        self.instance: Instance = group.instances[row]

    @cached_property
    def _senses(self) -> Senses:
        return Senses(self.instance)

    @property
    def tick(self) -> int:
        """The number of the present frame."""
        return int(self._group.ticks[self._row])

    def observe(self) -> Observation:
        """Return what a controller would be told in the present frame."""
        return self._senses.observe(self.tick, *self._group.of_trial(self._row))

    def frame(self, known: int) -> Frames:
        """Return the present frame, with the contacts of the trial so far but for the first `known` ones."""
        b, cars, rate = self._row, len(self.instance.starts), self.instance.problem.rate
        asked = [self._group.commands[b : b + 1, :cars, k] for k in (0, 1)]
        contacts = tuple(self._group.contacts[b][known:])
        state, labels = self._group.of_trial(b)
        return Frames(self.tick, rate, *state[:6], *asked, *labels, contacts=contacts)


class EgoChannel:
    """Applies disturbances and a shield between an environment and the ego of a trial, which is in its first frame.

    Parameters
    ----------
    shown : int
        Other cars that a flat observation shows, at most.
    shield : {"sure", "law", "never"}, optional
        When the ego may cross the centre line under its shield; by default it has none.

    Attributes
    ----------
    given : list of (float, float)
        Speed and yaw rate that have been passed on in each tick so far, before any came late or was lost.
    """

    def __init__(self, trial: TrialView, shown: int, shield: Overtakes | None) -> None:
        self._trial, instance = trial, trial.instance
        self._line = CommandLine(instance)
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
        if self._seen is None or self._seen.tick != self._trial.tick:
            self._seen = self._trial.observe()
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


class FormulaWatch:
    """Judges formulas, texts by name, frame by frame on a trial, which is in its first frame.

    Attributes
    ----------
    states : dict
        What is said of each formula after the frames looked at: ``true``, ``presumably true``, ``presumably false`` or
        ``false``.
    """

    def __init__(self, trial: TrialView, formulas: Mapping[str, str]) -> None:
        self._trial = trial
        self._verdicts = FormulaVerdicts()
        self._verdicts.begin(with_formulas(trial.instance, formulas))
        self._tick, self._contacts = -1, 0
        self.states: dict[str, Status] = {}
        self.look()

    def look(self) -> None:
        """Judge the present frame, unless it has been judged before."""
        if self._trial.tick == self._tick:
            return
        frame = self._trial.frame(self._contacts)
        self._verdicts.frames(frame)
        self._tick, self._contacts = self._trial.tick, self._contacts + len(frame.contacts)
        self.states = {one.name: one.verdict for one in self._verdicts.result()}
