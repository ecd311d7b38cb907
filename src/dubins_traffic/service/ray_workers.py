"""Workers of a service on a Ray cluster (optional extra ``ray``): so many actors, each with leases of its own.

Ray only carries them: what they work on, and what becomes of work whose actor or node is lost, is the service's queue.
"""

from __future__ import annotations

import signal
import socket
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import structlog

from dubins_traffic.campaign.ray_crew import check_address
from dubins_traffic.campaign.ray_driver import PACKAGE, join
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service import logs
from dubins_traffic.service.client import Connection
from dubins_traffic.service.worker import Worker, default_folder

LOOK_S = 1.0
FAREWELL_S = 300.0
"""How long actors are waited for that have been told to end; on a busy node one may take minutes."""
log = structlog.get_logger("dubins_traffic.worker")


@dataclass(frozen=True)
class Task:
    """What each actor is to do."""

    url: str
    token: str
    """`url`, `token`: the service, and the token of its workers."""
    name: str
    """What the service calls them; a number is added."""
    folder: str | None = None
    """For submissions, on each node; None: in the cache folder there."""
    trust: bool = False
    """As of `Worker`."""
    version: str = version(PACKAGE)
    """The version of this package that nodes must have."""


class Carried:
    """An actor: a worker on a node of the cluster."""

    def __init__(self, task: Task, number: int) -> None:
        installed = version(PACKAGE)
        if installed != task.version:
            raise DubinsTrafficError(f"{socket.gethostname()} has {PACKAGE} {installed}, not {task.version}")
        logs.to_stderr()
        folder = default_folder() if task.folder is None else Path(task.folder)
        name = f"{task.name[:50]} {number}"
        self._worker = Worker(Connection(task.url, task.token), name, folder, trust=task.trust)

    def work(self) -> None:
        """Work until `stop`."""
        self._worker.work()

    def stop(self) -> None:
        """Let the work on lease be given back, and `work` end."""
        self._worker.stop()


class Carrier:
    """Keeps workers alive on a cluster; one whose process or node is lost is replaced.

    Parameters
    ----------
    address : str
        ``local``: a cluster of this machine that ends with this process; ``auto``, ``host:port``, ``ray://host:port``.
    task : Task
        What the workers are to do.
    count : int or None
        How many; None: one for each processor that the cluster has now.

    Raises
    ------
    MissingExtraError
        Without the extra `ray`.
    InputError
        If nobody listens at the address.
    """

    def __init__(self, address: str, task: Task, count: int | None = None) -> None:
        check_address(address)
        self._ray: Any = import_module("ray")
        join(self._ray, address, count)
        self._task = task
        self._count = count or max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        self._actor = self._ray.remote(num_cpus=1, max_restarts=0, max_concurrency=2)(Carried)
        self._leaving = False
        self._actors: dict[int, Any] = {}
        self._work: dict[Any, int] = {}

    def carry(self) -> None:
        """Carry the workers until this process is told to end; what they have on lease is given back then.

        DubinsTrafficError if a node is not fit for this work: it can't hold strangers' programs, or has another
        version.
        """
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._leave)
        try:
            for number in range(self._count):
                self._launch(number)
            while not self._leaving:
                self._look(LOOK_S)
            self._say_goodbye()
        finally:
            self._ray.shutdown()

    def _leave(self, _number: int, _frame: object) -> None:
        self._leaving = True

    def _launch(self, number: int) -> None:
        actor = self._actor.remote(self._task, number)
        self._actors[number] = actor
        self._work[actor.work.remote()] = number

    def _look(self, seconds: float) -> None:
        """Wait for workers that end; each is replaced."""
        ended, _ = self._ray.wait(list(self._work), num_returns=1, timeout=seconds)
        for work in ended:
            number = self._work.pop(work)
            self._settle(work, number)
            if not self._leaving:
                self._launch(number)

    def _settle(self, work: Any, number: int) -> None:
        errors = self._ray.exceptions
        try:
            self._ray.get(work)
        except errors.RayTaskError as error:
            cause = getattr(error, "cause", None)
            raise cause if isinstance(cause, DubinsTrafficError) else DubinsTrafficError(str(error)) from None
        except errors.RayError as error:
            log.warning("a worker is lost", worker=number, error=str(error).partition("\n")[0])

    def _say_goodbye(self) -> None:
        """Tell all workers to end and wait until they have given back what they have on lease."""
        for actor in self._actors.values():
            actor.stop.remote()
        self._ray.wait(list(self._work), num_returns=len(self._work), timeout=FAREWELL_S)
