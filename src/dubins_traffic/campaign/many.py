"""Many trials, in this process or in several, with the same results in any order."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.campaign.single import Result, run_trial
from dubins_traffic.campaign.warm import companion
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.simulators import registry as simulators

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    from dubins_traffic.cars.state import Frames
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.protocols import Ending


@dataclass(frozen=True, slots=True)
class Job:
    """One trial to run: an instance, or the configuration, seed and number to draw it from.

    `instance` is drawn where the job runs, so that jobs are small to send.
    """

    trial: int
    seed: int
    controller: str
    configuration: Configuration | None = None
    instance: Instance | None = None
    record: Path | None = None
    overwrite: bool = False
    deadline: float | None = None
    show: bool = False

    def run(self, cancelled: Event | None = None) -> Result:
        """Run the job here; `cancelled` interrupts it after at most one simulated second."""
        instance = self.instance
        if instance is None:
            if self.configuration is None:
                raise DubinsTrafficError("a job needs an instance or a configuration")
            instance = draw(self.configuration, self.seed, self.trial)
        return run_trial(
            instance,
            self.controller,
            record=self.record,
            overwrite=self.overwrite,
            deadline=self.deadline,
            sinks=() if cancelled is None else (_Watch(cancelled),),
            simulator=simulators.load(instance.simulator, show=self.show),
            sketch=False,
        )


class _Watch:
    """A sink that interrupts its trial when the campaign has been interrupted."""

    def __init__(self, cancelled: Event) -> None:
        self._cancelled: Event | None = cancelled

    def begin(self, instance: Instance) -> None:
        """Nothing has run yet."""

    def frames(self, frames: Frames) -> None:  # noqa: ARG002  # what they hold is no matter here
        """Look once a simulated second, and interrupt once."""
        if self._cancelled is not None and self._cancelled.is_set():
            self._cancelled = None
            raise KeyboardInterrupt

    def end(self, ending: Ending) -> None:
        """Nothing is left to interrupt."""


def run_trials(jobs: Sequence[Job], workers: int = 1) -> Iterator[Result]:
    """Run `jobs` and yield their results as they come.

    With one worker they run here, in order; with more, in that many processes. What a trial does never depends on
    where or when it ran. On Ctrl-C running trials end as interrupted, nothing new begins, and KeyboardInterrupt
    is raised after the results that were ready have been yielded.
    """
    if workers <= 1 or len(jobs) <= 1:
        with companion():
            for job in jobs:
                yield job.run()
        return
    context = multiprocessing.get_context("spawn")
    cancelled = context.Event()
    with ProcessPoolExecutor(
        min(workers, len(jobs)), mp_context=context, initializer=_begin, initargs=(cancelled,)
    ) as pool:
        with deaf_to_interrupts():
            pending = {pool.submit(_run, job) for job in jobs}
        try:
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        except BaseException:
            cancelled.set()
            _drop(pending)
            raise


@contextmanager
def deaf_to_interrupts() -> Generator[None]:
    """Hold Ctrl-C back until workers have been started; they inherit this and never hear it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _drop(pending: set[Future[Result]]) -> None:
    for future in pending:
        future.cancel()


_cancelled: Event | None = None


def _begin(cancelled: Event) -> None:
    """Prepare a worker: the parent alone hears Ctrl-C and passes it on."""
    global _cancelled  # noqa: PLW0603  # a worker's only state, set once
    _cancelled = cancelled


def _run(job: Job) -> Result:
    try:
        return job.run(_cancelled)
    except KeyboardInterrupt:
        raise DubinsTrafficError(f"trial {job.trial} was interrupted") from None
