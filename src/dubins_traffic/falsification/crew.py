"""Who runs the trials of a search: this process, several of this machine, or a Ray cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from dubins_traffic.campaign.chunks import fitting
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import InputError, WorkerLostError
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.trying import TrialRunner, Tried, in_order
from dubins_traffic.runs.crew import Cancelled, carry_out
from dubins_traffic.runs.crew import Crew as Workers
from dubins_traffic.runs.ray_crew import check_address, crew_at

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

LOT: Final = 32
"""Most trials that a worker is handed at a time."""


class Crew(Protocol):
    """Runs the trials of a search.

    Attributes
    ----------
    make : callable or Remote
        Makes the controller, or drives trials elsewhere.
    name : str
        What records and cases call it.
    """

    make: Maker | Remote
    name: str

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances; yield what came of some, by their places in `instances`, as they end.

        What comes of them does not depend on who runs them.
        """
        ...


class Here:
    """Runs all trials in this process."""

    def __init__(self, controller: str | Maker | Remote, name: str) -> None:
        self.make = driver_of(controller)
        self.name = name
        self._runner = TrialRunner(controller)

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances, and yield what came of some as soon as they have ended."""
        return self._runner.attempt(instances)


@dataclass(frozen=True, slots=True)
class Lot:
    """Some trials of a search, for a worker; `first` is the place of the first among those that are run."""

    number: int
    controller: str
    first: int
    instances: tuple[Instance, ...]

    def run(self, cancelled: Cancelled) -> tuple[list[Tried], float | None]:
        """Run the trials; return what came of them, and how long their controller takes for an answer."""
        if self.controller not in _runners:
            _runners[self.controller] = TrialRunner(self.controller)
        runner = _runners[self.controller]
        runner.cancelled = cancelled
        return in_order(runner.attempt(self.instances)), runner.answer_s


_runners: dict[str, TrialRunner] = {}


class Elsewhere:
    """Hands lots of trials to workers."""

    def __init__(self, controller: str, workers: Workers) -> None:
        controllers.load(controller)
        self.make: Maker | Remote = maker(controller)
        self.name = controller
        self._workers = workers
        self._number = 0
        self._answer_s: float | None = None

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances, lots of them at a time; a lot whose worker ends is run again, a few times."""
        for lot, found in carry_out(self._workers, self._lots(instances)):
            if found is None:
                raise WorkerLostError(f"workers end in the middle of trials: {self.name} may end its process")
            tried: list[Tried] = found[0]
            self._answer_s = found[1]
            yield dict(enumerate(tried, lot.first))

    def _lots(self, instances: Sequence[Instance]) -> Iterator[Lot]:
        """Yield lots of the trials of instances, of what their controller does in about a second."""
        first = 0
        while first < len(instances):
            rest = instances[first : first + LOT]
            some = rest[: fitting(self._answer_s, max(own.ticks for own in rest), len(rest))]
            yield Lot(self._number, self.name, first, tuple(some))
            self._number += 1
            first += len(some)


def maker(controller: str | Maker) -> Maker:
    """Return what makes a controller that is given by name, or by what makes it."""
    return (lambda: controllers.load(controller)) if isinstance(controller, str) else controller


def driver_of(controller: str | Maker | Remote) -> Maker | Remote:
    """Return what makes a controller, or what drives trials elsewhere."""
    return controller if isinstance(controller, Remote) else maker(controller)


def name_of(controller: str | Maker | Remote) -> str:
    """Return what records and cases call a controller."""
    if isinstance(controller, str):
        return controller
    return (
        controller.name if isinstance(controller, Remote) else getattr(controller, "__name__", "controller")
    )


@contextlib.contextmanager
def crew_of(controller: str | Maker | Remote, name: str, workers: int, ray: str | None) -> Generator[Crew]:
    """Yield who runs the trials of a search with a controller: `workers` processes, or a Ray cluster at an address.

    Raises
    ------
    InputError
        If the controller is not given by name where others are to make it, or there is no such cluster.
    """
    if workers == 1 and ray is None:
        yield Here(controller, name)
        return
    if not isinstance(controller, str):
        expected = "a controller given by name, not one elsewhere"
        raise InputError(
            "can't be made by other processes", field="controller", value=name, expected=expected
        )
    if ray is not None:
        check_address(ray)
    with contextlib.closing(crew_at(ray, workers)) as crew:
        yield Elsewhere(controller, crew)
