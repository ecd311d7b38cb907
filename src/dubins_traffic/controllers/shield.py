"""The shield as a controller that wraps another controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers import named
from dubins_traffic.protocols import Closes, Controller, Reports
from dubins_traffic.record.sink import SHIELD
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.shield.tables import Overtakes

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class Shield:
    """Wraps a controller and changes its commands as little as needed so that the ego breaks none of rules 1 to 3.

    Parameters
    ----------
    controller : Controller or str
        The controller that drives; by name as `controllers.named.load` takes it, without a shield.
    overtakes : {"sure", "law", "never"}
        When the ego may cross the centre line to pass what stands: only where it is sure to be back in time whatever
        the others do, by default; wherever the law of the road would, as the controller `rules` does; or never.

    Raises
    ------
    InputError
        If there is no such controller, or `overtakes` is something else.

    Attributes
    ----------
    shield_filter : ShieldFilter
        Changes the commands, and counts how often it does.

    Notes
    -----
    Where commands take effect late, the wrapped controller is told that they do not, and sees the ego where it will be.
    If the wrapped controller raises or gives up, the trial ends as it would without a shield. Numbers that are not
    finite count as (0, 0). Every tick in which the shield steps in becomes an event `shield`.

    Examples
    --------
    >>> import dubins_traffic as dt
    >>> instance = dt.draw(dt.load_config("town"), seed=1, trial=0)
    >>> dt.run_trial(instance, dt.Shield("simple")).score.verdict.clean
    True
    """

    def __init__(self, controller: Controller | str, *, overtakes: Overtakes = "sure") -> None:
        self._controller = named.load(controller) if isinstance(controller, str) else controller
        self.shield_filter = ShieldFilter(overtakes=overtakes)
        self._events: list[tuple[str, str]] = []
        self._reports = isinstance(self._controller, Reports)

    def start(self, problem: Problem) -> None:
        """Start the other controller; InputError if the car can't keep the rules."""
        self.shield_filter.start(problem)
        self._events = []
        self._controller.start(replace(problem, command_delay=0))

    def act(self, observation: Observation) -> Command | None:
        """Return the wrapped controller's command if it breaks no rule, else the nearest one found that breaks none."""
        asked = self._controller.act(self.shield_filter.in_flight.ahead(observation))
        if asked is None:
            return None
        given = self.shield_filter.filter(observation, asked)
        intervention = self.shield_filter.intervention
        if intervention is not None:
            self._events.append((SHIELD, override_text(intervention.asked, intervention.given, intervention.reason)))
        return given

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what has happened since the last call: kind and detail of each event."""
        events, self._events = self._events, []
        inner = cast(Reports, self._controller).report() if self._reports else ()
        return [*inner, *events]

    def close(self) -> None:
        """Close the wrapped controller if it has a method `close`."""
        if isinstance(self._controller, Closes):
            self._controller.close()


def override_text(asked: tuple[float, float], given: tuple[float, float], reason: str) -> str:
    """Return the detail of an event: asked and given commands in m/s and rad/s, and the rule at stake."""
    numbers = [f"({speed:.6g}, {yaw_rate:.6g})" for speed, yaw_rate in (asked, given)]
    return f"{reason}: asked {numbers[0]}, given {numbers[1]}"
