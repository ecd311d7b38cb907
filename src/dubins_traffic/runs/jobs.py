"""Runs many trials, in this process or in several; the results do not depend on processes or order."""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import current_thread, main_thread
from typing import TYPE_CHECKING

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import DubinsTrafficError, WorkerLostError
from dubins_traffic.files import locked
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.parent_watch import prepare_worker, spawning
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.simulators import registry as simulators

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    from dubins_traffic.cars.state import Frames
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.protocols import Ending

DEAF_TO = (signal.SIGINT, signal.SIGTERM)
"""Signals that are held back while workers are started."""
MOST_BARREN = 3
"""Number of crews of processes in a row that may end without a result before none is started again."""
MOST_NAMED = 10
"""Most trials that a message names."""


@dataclass(frozen=True, slots=True)
class Job:
    """One trial to run: an instance, or the configuration, seed and number to draw it from.

    Without `instance` it is drawn where the job runs, so that jobs are small to send to processes.
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
    metrics: tuple[str, ...] = ()

    def drawn(self) -> Instance:
        """Return the instance that it runs, drawn if it is not given."""
        if self.instance is not None:
            return self.instance
        if self.configuration is None:
            raise DubinsTrafficError("a job needs an instance or a configuration")
        return draw(self.configuration, self.seed, self.trial)

    def run(self, cancelled: Event | None = None) -> Result:
        """Run the job here; `cancelled` interrupts it after at most one simulated second."""
        instance = self.drawn()
        return run_trial(
            instance,
            controllers.made(partial(controllers.load, self.controller)),
            record=self.record,
            overwrite=self.overwrite,
            deadline=self.deadline,
            sinks=() if cancelled is None else (_Watch(cancelled),),
            simulator=simulators.load(instance.simulator, show=self.show),
            sketch=False,
            name=self.controller,
            metrics=self.metrics,
        )

    @property
    def called(self) -> str:
        """The job's name in messages."""
        return f"trial {self.trial}" if self.record is None else f"trial {self.trial} ({self.record.name})"


class _Watch:
    """A sink that interrupts its trial once `cancelled` is set."""

    def __init__(self, cancelled: Event) -> None:
        self._cancelled: Event | None = cancelled

    def begin(self, instance: Instance) -> None:
        """Do nothing."""

    def frames(self, frames: Frames) -> None:  # noqa: ARG002  # what they hold is no matter here
        """Raise KeyboardInterrupt, once, if `cancelled` is set; called for every simulated second."""
        if self._cancelled is not None and self._cancelled.is_set():
            self._cancelled = None
            raise KeyboardInterrupt

    def end(self, ending: Ending) -> None:
        """Do nothing."""


def run_trials(jobs: Sequence[Job], workers: int = 1) -> Iterator[Result]:
    """Run `jobs` and yield the result of each when it has ended.

    With one worker they run here, in order; with more, in that many processes. What a trial does never depends on
    where or when it ran. On Ctrl-C running trials end as interrupted, nothing new begins, and KeyboardInterrupt
    is raised after the results that were ready have been yielded.

    Raises
    ------
    WorkerLostError
        If processes ended in the middle of trials: the controller ended its process, or the process was killed. All
        other trials have been run then; the message names those without a result.
    InputError
        If a folder in which records are to be kept is in use by another process.
    """
    with ExitStack() as held:
        for folder in sorted({job.record.parent for job in jobs if job.record is not None}):
            held.enter_context(locked(folder))
        if workers > 1 and len(jobs) > 1:
            yield from _in_processes(jobs, workers)
            return
        for job in jobs:
            yield job.run()


def _in_processes(jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Run jobs in processes; jobs that were under way when a process died are run again, one at a time."""
    waiting, suspects, dead = deque(jobs), deque[Job](), list[Job]()
    barren = 0
    crew = _Crew(min(workers, len(jobs)))
    try:
        while (waiting or crew.under_way) and barren < MOST_BARREN:
            while waiting and len(crew.under_way) < 2 * workers:
                crew.submit(waiting.popleft())
            results, lost = crew.wait()
            yield from results
            suspects += lost
            barren = 0 if results else barren + len(lost[:1])
        barren = 0
        while suspects and barren < MOST_BARREN:
            # a record that exists already is one that this job began
            crew.submit(replace(suspects[0], overwrite=True))
            results, lost = crew.wait()
            yield from results
            dead += [suspects.popleft()] if lost else []
            if results:
                suspects.popleft()
            barren = 0 if results else barren + 1
    finally:
        crew.close()
    if dead:
        raise WorkerLostError(_lost_jobs_text(dead, len(waiting) + len(suspects)))


def _lost_jobs_text(dead: Sequence[Job], left: int) -> str:
    """Return the message about jobs whose processes ended in their middle; `left` other jobs were therefore not run."""
    named = ", ".join(job.called for job in dead[:MOST_NAMED])
    more = f" and {len(dead) - MOST_NAMED} more" if len(dead) > MOST_NAMED else ""
    rest = f"; {left} trials were not run" if left else ""
    return f"the process ended in the middle of {named}{more}, each time it was run{rest}"


class _Crew:
    """A pool of processes that run jobs. When one dies, all are replaced and the jobs under way are lost."""

    def __init__(self, workers: int) -> None:
        self.under_way: dict[Future[Result], Job] = {}
        self._workers = workers
        self._context = spawning()
        self._cancelled = self._context.Event()
        self._pool = self._new()

    def submit(self, job: Job) -> None:
        """Submit a job; if the processes have just died it is lost, and `wait` returns it as such."""
        try:
            with deaf_to_interrupts():
                future = self._pool.submit(_run, job)
        except BrokenProcessPool as error:
            future: Future[Result] = Future()
            future.set_exception(error)
        self.under_way[future] = job

    def wait(self) -> tuple[list[Result], list[Job]]:
        """Wait until there are results or losses; return the results, and the jobs that were lost with a process."""
        done, _ = wait(self.under_way, return_when=FIRST_COMPLETED)
        broken = any(isinstance(future.exception(), BrokenProcessPool) for future in done)
        if broken:
            done, _ = wait(self.under_way)
        results: list[Result] = []
        lost: list[Job] = []
        for future in done:
            job = self.under_way.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                lost.append(job)
            else:
                results.append(future.result())
        if broken:
            self._pool.shutdown()
            self._pool = self._new()
        return results, sorted(lost, key=lambda job: job.trial)

    def close(self) -> None:
        """Interrupt the jobs under way, after at most one simulated second, and end the processes."""
        self._cancelled.set()
        self._pool.shutdown(cancel_futures=True)

    def _new(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._workers, mp_context=self._context, initializer=_begin, initargs=(self._cancelled,)
        )


@contextmanager
def deaf_to_interrupts() -> Generator[None]:
    """Hold Ctrl-C and SIGTERM back while workers are started; what came is heard afterwards.

    Workers inherit this, so Ctrl-C reaches the parent alone; `prepare_worker` lets them hear SIGTERM again. Other
    threads of this process may take a signal in the meantime, so that holding it back in this one is not enough.
    """
    came: list[int] = []
    mine = DEAF_TO if current_thread() is main_thread() else ()
    handlers = {number: handler for number in mine if callable(handler := signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, _frame: came.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, DEAF_TO)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in came[:1]:
            handlers[signal.Signals(number)](number, None)


_cancelled: Event | None = None


def _begin(cancelled: Event) -> None:
    """Prepare a worker process: Ctrl-C interrupts the parent alone, which sets `cancelled`."""
    global _cancelled  # noqa: PLW0603  # a worker's only state, set once
    _cancelled = cancelled
    prepare_worker()


def _run(job: Job) -> Result:
    try:
        return job.run(_cancelled)
    except KeyboardInterrupt:
        raise DubinsTrafficError(f"trial {job.trial} was interrupted") from None
    except SystemExit as error:  # passed on, SystemExit would end the worker as if nothing had gone wrong
        raise DubinsTrafficError(f"{job.called} ended its process (status {error.code})") from error
