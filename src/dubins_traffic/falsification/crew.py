"""Who runs the trials of a search: this process, several of this machine, or a Ray cluster."""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from dubins_traffic.campaign.engines import Engine
from dubins_traffic.campaign.pool import Pool
from dubins_traffic.campaign.ray_engine import RayEngine, check_address
from dubins_traffic.campaign.worker import Surroundings
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import InputError, WorkerLostError
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.trying import Findings, Laboratory

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

LOT: Final = 32
"""Trials that a worker is handed at a time."""
LOSSES: Final = 3
"""A lot whose worker ends so often is given up."""


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

    def run(self, instances: Sequence[Instance]) -> Findings:
        """Run the trials of instances; what comes of them does not depend on who runs them."""
        ...


class Here:
    """Runs all trials in this process."""

    def __init__(self, controller: str | Maker | Remote, name: str) -> None:
        self.make = driver_of(controller)
        self.name = name
        self._laboratory = Laboratory(controller)

    def run(self, instances: Sequence[Instance]) -> Findings:
        """Run the trials of instances, in order."""
        return self._laboratory.attempt(instances)


@dataclass(frozen=True, slots=True)
class Lot:
    """Some trials of a search, for a worker."""

    number: int
    controller: str
    instances: tuple[Instance, ...]

    def run(self, cancelled: Callable[[], bool]) -> bytes:
        """Run the trials and return what came of them, pickled."""
        if self.controller not in _laboratories:
            _laboratories[self.controller] = Laboratory(self.controller)
        laboratory = _laboratories[self.controller]
        laboratory.cancelled = cancelled
        return pickle.dumps(laboratory.attempt(self.instances))


_laboratories: dict[str, Laboratory] = {}


class Elsewhere:
    """Hands lots of trials to the engine of a campaign."""

    def __init__(self, controller: str, engine: Engine[Lot]) -> None:
        controllers.load(controller)
        self.make: Maker | Remote = maker(controller)
        self.name = controller
        self._engine = engine
        self._number = 0

    def run(self, instances: Sequence[Instance]) -> Findings:
        """Run the trials of instances, lots of them at a time."""
        lots: list[Lot] = []
        for first in range(0, len(instances), LOT):
            lots.append(Lot(self._number, self.name, tuple(instances[first : first + LOT])))
            self._number += 1
        parts = self._done(lots)
        whole = Findings([])
        for lot in lots:
            found: Findings = pickle.loads(parts[lot.number])
            whole.tried += found.tried
            whole.exercised += found.exercised
        return whole

    def _done(self, lots: Sequence[Lot]) -> dict[int, bytes]:
        """Return what came of lots; one whose worker ends is run again, a few times."""
        waiting, losses = list(reversed(lots)), dict.fromkeys([lot.number for lot in lots], 0)
        parts: dict[int, bytes] = {}
        under_way = 0
        while len(parts) < len(lots):
            while waiting and under_way < self._engine.capacity:
                self._engine.submit(waiting.pop())
                under_way += 1
            for outcome in self._engine.wait():
                under_way -= 1
                lot = outcome.chunk
                if outcome.part is not None:
                    parts[lot.number] = outcome.part
                    continue
                losses[lot.number] += 1
                if losses[lot.number] == LOSSES:
                    raise WorkerLostError(
                        f"workers end in the middle of trials: {self.name} may end its process"
                    )
                waiting.append(lot)
        return parts


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
    around = Surroundings.here()
    engine: Engine[Lot] = Pool(workers, around) if ray is None else RayEngine(ray, workers, around)
    with contextlib.closing(engine):
        yield Elsewhere(controller, engine)
