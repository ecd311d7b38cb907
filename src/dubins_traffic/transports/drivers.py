"""Remote cars as what a trial knows: the ego's Controller and the e-agents' Driver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Self

from dubins_traffic.cars.state import Command, Labels, Observation, State
from dubins_traffic.errors import InputError, PeerError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import Closes, Controller, End, Reports
from dubins_traffic.transports.link import EGO_NAME, Link

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem


class RemoteController:
    """The ego's driver, elsewhere (a `protocols.Controller`)."""

    def __init__(self, link: Link) -> None:
        self._link = link

    def start(self, problem: Problem) -> None:  # noqa: ARG002  # the link has the whole instance
        """Announce the problem and wait for the first command: the time to begin."""
        self._link.announce()

    def act(self, observation: Observation) -> Command:
        """Return the command that answers the frame just shown."""
        return Command(*self._link.command(EGO_NAME, observation.tick))


class LocalController:
    """A controller in this process of a trial that others see or drive in: its link learns when the trial begins."""

    def __init__(self, link: Link, controller: Controller) -> None:
        self._link, self._controller = link, controller
        self.act = controller.act

    def start(self, problem: Problem) -> None:
        """Start the controller, then the trial."""
        self._controller.start(problem)
        self._link.announce()

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what the controller has to say."""
        return self._controller.report() if isinstance(self._controller, Reports) else ()

    def close(self) -> None:
        """Close the controller if it wants to be closed."""
        if isinstance(self._controller, Closes):
            self._controller.close()


class RemoteAgents:
    """The e-agents of kind `remote`, elsewhere (a `protocols.Driver`).

    Whatever a peer does wrong is an `agent_fault` that begins with the car's name and the name of the fault.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    def __deepcopy__(self, memo: object) -> Self:
        """Refuse: a program elsewhere drives in one trial at a time."""
        raise InputError(
            "a program elsewhere can't go on in two trials",
            field="e-agents",
            value=[name for _, name in self._cars],
            expected="e-agents of types of ours, to fork a trial",
        )

    def reset(self, instances: Sequence[Instance], state: State) -> None:  # noqa: ARG002  # nothing to begin with
        """Note which cars these are; a link drives one trial at a time."""
        (instance,) = instances
        self._cars = [
            (n, agent.name) for n, agent in enumerate(instance.e_agents, start=1) if agent.kind == REMOTE
        ]

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:  # noqa: ARG002
        """Write the commands of the remote e-agents."""
        self._link.announce()
        for n, car in self._cars:
            try:
                commands[0, n] = self._link.command(car, tick)
            except PeerError as error:
                if error.reason in _OF_ALL:
                    raise
                raise PeerError(End.AGENT_FAULT.value, f"{car}: {error.reason}: {error.detail}") from error


_OF_ALL = frozenset({End.RESET, End.TRANSPORT_LOST, End.WORLD_LOST, End.INTERRUPTED})
