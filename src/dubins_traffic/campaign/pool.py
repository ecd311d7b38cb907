"""Runs a campaign's chunks in processes on this machine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Generic

from dubins_traffic.campaign.engines import Numbered, Outcome, Work
from dubins_traffic.campaign.worker import Surroundings, run_part
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.runs.jobs import deaf_to_interrupts
from dubins_traffic.runs.parent_watch import prepare_worker, spawning

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event


class Pool(Generic[Work]):
    """An engine of `workers` processes, which end with this one, however it ends."""

    def __init__(self, workers: int, around: Surroundings) -> None:
        self._workers = workers
        self._around = around
        self._context = spawning()
        self._cancelled = self._context.Event()
        self._under_way: dict[Future[bytes], Work] = {}
        self._start()

    @property
    def capacity(self) -> int:
        """One chunk in work and one in waiting for each process."""
        return 2 * self._workers

    def submit(self, chunk: Work) -> None:
        """Take a chunk to run."""
        try:
            future = self._pool.submit(_run, chunk)
        except BrokenProcessPool as error:
            future: Future[bytes] = Future()
            future.set_exception(error)
        self._under_way[future] = chunk

    def wait(self) -> Sequence[Outcome[Work]]:
        """Return outcomes; if a process has died, all chunks that were under way are lost."""
        done, _ = wait(self._under_way, return_when=FIRST_COMPLETED)
        if any(isinstance(future.exception(), BrokenProcessPool) for future in done):
            done, _ = wait(self._under_way)
        outcomes: list[Outcome[Work]] = []
        broken = False
        for future in done:
            chunk = self._under_way.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                broken = True
                outcomes.append(Outcome(chunk, None))
            else:
                outcomes.append(Outcome(chunk, future.result()))
        if broken:
            self._pool.shutdown()
            self._start()
        return outcomes

    def close(self) -> None:
        """Interrupt the chunks under way, after at most one simulated second, and end the processes."""
        self._cancelled.set()
        self._pool.shutdown(cancel_futures=True)

    def _start(self) -> None:
        self._pool = ProcessPoolExecutor(
            self._workers,
            mp_context=self._context,
            initializer=_begin,
            initargs=(self._around, self._cancelled),
        )
        try:
            with deaf_to_interrupts():
                started = [self._pool.submit(os.getpid) for _ in range(self._workers)]
            wait(started)
            for future in started:
                future.result()
        except BrokenProcessPool as error:
            raise DubinsTrafficError("worker processes end as soon as they begin") from error
        except KeyboardInterrupt:
            self._pool.shutdown(cancel_futures=True)  # each worker begins, and is told to end
            raise


_around = Surroundings(None, ())
_cancelled: Event | None = None


def _begin(around: Surroundings, cancelled: Event) -> None:
    """Prepare a worker."""
    global _around, _cancelled  # a worker's only state, set once
    _around, _cancelled = around, cancelled
    prepare_worker()


def _run(chunk: Numbered) -> bytes:
    try:
        return run_part(chunk, _around, _cancelled)
    except KeyboardInterrupt:
        raise DubinsTrafficError("interrupted") from None
    except SystemExit as error:  # passed on, SystemExit would end the worker as if nothing had gone wrong
        raise DubinsTrafficError(f"a worker was told to end (status {error.code})") from error
