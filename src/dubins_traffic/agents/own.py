"""The user's own e-agents, classes of Python given as ``module:Class``; one object drives one car."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, cast

from dubins_traffic import outside
from dubins_traffic.cars.state import Labels, Observation, State
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.observations.senses import Senses
from dubins_traffic.outside import Seam
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import OWN
from dubins_traffic.protocols import Draws

FAULT: Final = "e-agent"
"""Kind of the event whose detail is what the class of an e-agent has raised."""
_SEAM = Seam(
    "e-agents",
    "driver of an e-agent",
    ("begin", "act"),
    "begin(instance, car, parameters) and act(observation) -> (speed, yaw rate)",
)


class OwnAgent(Protocol):
    """Drives one e-agent. The constructor takes no arguments; one object drives one car through one trial.

    In the same trial it must do the same again: random numbers must follow from ``instance.seed``, ``instance.trial``
    and `car`. A class attribute `parameters`, a mapping of defaults, names the parameters it takes. A fork of a trial
    goes on with a deep copy, whose method ``reseed(seed)``, if it has one, is called if the fork has another seed.
    """

    def begin(self, instance: Instance, car: int, parameters: Mapping[str, Any]) -> None:
        """Begin a trial, in which this object drives car number `car`; `parameters` has defaults filled in."""
        ...

    def act(self, observation: Observation) -> tuple[float, float]:
        """Return speed (m/s) and yaw rate (rad/s) for the coming tick; the observation is without noise."""
        ...


@dataclass(slots=True)
class _Driven:
    """An e-agent of a trial: number, name, driver object and senses; one whose driver has raised is not asked again."""

    car: int
    name: str
    driver: OwnAgent
    senses: Senses
    has_raised: bool = False


class OwnAgents:
    """Drives those e-agents of a trial that are classes of the user (a `protocols.Driver`).

    What a class raises ends the trial as a fault of that e-agent; an event tells what it was.
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:  # noqa: ARG002  # they sense for themselves
        """Make the driver objects of the only trial and begin them.

        Raises
        ------
        InputError
            If there are several trials, a class can't be found or made, or takes other parameters.
        """
        if len(instances) != 1:
            raise InputError("such e-agents are not batched", field="type", value=OWN, expected="one trial at a time")
        (instance,) = instances
        self._reports: list[tuple[str, str]] = []
        self._driven = [
            _begun(instance, car, agent) for car, agent in enumerate(instance.e_agents, start=1) if agent.kind == OWN
        ]

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of these cars for [t_k, t_k+1) into `commands` (1, N, 2)."""
        for driven in self._driven:
            commands[0, driven.car] = self._command(driven, driven.senses.observe(tick, state, labels))

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what drivers have raised since the last call."""
        reports, self._reports = self._reports, []
        return reports

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed, where a class has a method `reseed` for that."""
        for driven in self._driven:
            if isinstance(driven.driver, Draws):
                driven.driver.reseed(seed)

    def _command(self, driven: _Driven, observation: Observation) -> tuple[float, float]:
        if driven.has_raised:
            return math.nan, math.nan
        try:
            speed, yaw_rate = driven.driver.act(observation)
            return float(speed), float(yaw_rate)
        except Exception as error:
            driven.has_raised = True
            self._reports.append((FAULT, f"{driven.name} raised {outside.plainly(error)}"))
            return math.nan, math.nan


def _begun(instance: Instance, car: int, agent: EAgent) -> _Driven:
    driver = cast(OwnAgent, outside.make_strictly(outside.find(agent.type, _SEAM), agent.type, _SEAM))
    parameters = outside.parameters_of(driver, agent.parameters, f"e-agents[{car - 1}].parameters")
    try:
        driver.begin(instance, car, parameters)
    except Exception as error:
        problem = f"{agent.name} raised {outside.plainly(error)} in begin"
        raise _SEAM.refuse(problem, agent.type, "an e-agent that can begin") from error
    return _Driven(car, agent.name, driver, Senses(instance, car))
