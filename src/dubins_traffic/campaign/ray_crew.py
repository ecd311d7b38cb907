"""A crew on a Ray cluster (optional extra ``ray``).

Ray is driven by a process of its own (`ray_driver`): where it loses its head node for good, Ray ends the process that
drives it. This side sees that process fall silent, and says what has happened.
"""

from __future__ import annotations

import multiprocessing
import pickle
import socket
import time
from collections.abc import Sequence
from importlib.util import find_spec

from dubins_traffic.campaign import ray_driver
from dubins_traffic.campaign.ray_driver import LOCAL
from dubins_traffic.errors import ClusterLostError, DubinsTrafficError, InputError, MissingExtraError
from dubins_traffic.runs.crew import Crew, Errand, Outcome, Processes, search_path
from dubins_traffic.runs.processes import deaf_to_interrupts

SILENCE = 20.0
"""Seconds without a sign of life after which a cluster is lost."""
START = 90.0
"""Seconds within which a cluster must have been joined."""
EMPTY = 300.0
"""Seconds for which a cluster may be without a single processor."""


class RayCrew:
    """A crew of all processors of a Ray cluster.

    Parameters
    ----------
    address : str
        ``local``: a cluster of this machine that ends with the crew; ``auto``, ``host:port`` or ``ray://host:port``.
    workers : int
        Processors of a local cluster.

    Raises
    ------
    DubinsTrafficError
        If the cluster can't be joined.
    """

    def __init__(self, address: str, workers: int) -> None:
        self._address = address
        self._under_way: dict[int, Errand] = {}
        self._processors = 0
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=ray_driver.drive, args=(theirs, address, workers, search_path()), daemon=False
        )
        with deaf_to_interrupts():
            self._process.start()
        theirs.close()
        self._heard = self._peopled = time.monotonic()
        try:
            while not self._processors:
                self._take(START)
        except BaseException:
            self.close()
            raise

    @property
    def capacity(self) -> int:
        """One errand in work and one in waiting for each processor of the cluster."""
        return 2 * max(1, self._processors)

    def submit(self, errand: Errand) -> None:
        """Take an errand to run."""
        self._under_way[errand.number] = errand
        try:
            self._pipe.send((errand.number, pickle.dumps(errand)))
        except OSError:
            raise self._lost("its driver ended") from None

    def wait(self) -> Sequence[Outcome]:
        """Return what has become of errands.

        Raises
        ------
        ClusterLostError
            If the cluster has not shown a sign of life for `SILENCE` seconds.
        """
        while True:
            answers = self._take(SILENCE)
            if answers is not None:
                return [answers]

    def close(self) -> None:
        """Leave the cluster, which stops what is under way; a local one ends."""
        self._pipe.close()
        self._process.join(10.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _take(self, patience: float) -> Outcome | None:
        """Take one message of the driver: an errand's outcome, or a sign of life."""
        try:
            if not self._pipe.poll(max(0.0, self._heard + patience - time.monotonic())):
                raise self._lost(f"no sign of life for {patience:g} s")
            kind, *rest = self._pipe.recv()
        except (EOFError, OSError):
            raise self._lost("its driver ended") from None
        if kind == ray_driver.FAILED:
            raise DubinsTrafficError(f"Ray at {self._address}: {rest[0]}")
        if kind == ray_driver.ALIVE:
            self._heard = time.monotonic()
            self._count(rest[0])
            return None
        return self._outcome(*rest)

    def _outcome(self, number: int, answer: bytes | None) -> Outcome:
        return Outcome(self._under_way.pop(number), None if answer is None else pickle.loads(answer))

    def _count(self, processors: int) -> None:
        self._processors = processors
        if processors:
            self._peopled = self._heard
        elif self._heard - self._peopled > EMPTY:
            raise self._lost(f"without a processor for {EMPTY:g} s")

    def _lost(self, why: str) -> ClusterLostError:
        return ClusterLostError(f"the Ray cluster at {self._address} is lost: {why}")


def check_address(address: str) -> None:
    """Refuse an address where nobody listens, before Ray tries for a minute.

    Raises
    ------
    MissingExtraError
        Without the extra `ray`.
    InputError
        If it is no address, or nobody listens there.
    """
    if find_spec("ray") is None:
        raise MissingExtraError("running on Ray", "ray")
    if address in (LOCAL, "auto"):
        return
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    expected = "local, auto, host:port or ray://host:port of a running cluster"
    if not (colon and host and port.isdecimal() and int(port) < 65536):
        raise InputError("not an address of a Ray cluster", file="--ray", value=address, expected=expected)
    try:
        socket.create_connection((host, int(port)), timeout=10.0).close()
    except OSError as error:
        problem = f"no Ray cluster there ({error.strerror or error})"
        raise InputError(problem, file="--ray", value=address, expected=expected) from None


def crew_at(ray: str | None, workers: int) -> Crew:
    """Return so many processes of this machine, or a crew on the Ray cluster at an address; errors as `RayCrew`."""
    return Processes(workers) if ray is None else RayCrew(ray, workers)
