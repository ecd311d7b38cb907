"""Runs many trials, in this process or in several; the results do not depend on processes or order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import DubinsTrafficError, WorkerLostError
from dubins_traffic.files import locked
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.crew import Cancelled, Processes, carry_out
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.simulators import registry as simulators

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Frames
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.protocols import Ending, Watcher

MOST_BARREN = 3
"""Number of times in a row that processes may end without a result before none is started again."""
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

    def run(self, cancelled: Cancelled | None = None, watchers: Sequence[Watcher] = ()) -> Result:
        """Run the job here, shown to `watchers`; `cancelled` interrupts it after at most one simulated second."""
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
            watchers=watchers,
        )

    @property
    def called(self) -> str:
        """The job's name in messages."""
        return f"trial {self.trial}" if self.record is None else f"trial {self.trial} ({self.record.name})"


class _Watch:
    """A sink that interrupts its trial once it is cancelled."""

    def __init__(self, cancelled: Cancelled) -> None:
        self._cancelled: Cancelled | None = cancelled

    def begin(self, instance: Instance) -> None:
        """Do nothing."""

    def frames(self, frames: Frames) -> None:  # noqa: ARG002  # what they hold is no matter here
        """Raise KeyboardInterrupt, once, if it is cancelled; called for every simulated second."""
        if self._cancelled is not None and self._cancelled():
            self._cancelled = None
            raise KeyboardInterrupt

    def end(self, ending: Ending) -> None:
        """Do nothing."""


def run_trials(jobs: Sequence[Job], workers: int = 1, watchers: Sequence[Watcher] = ()) -> Iterator[Result]:
    """Run `jobs` and yield the result of each when it has ended.

    With one worker they run here, in order; with more, in that many processes. What a trial does never depends on
    where or when it ran. Trials that are shown to `watchers` run here, too. On Ctrl-C running trials end as
    interrupted, nothing new begins, and KeyboardInterrupt is raised after the results that were ready have been
    yielded.

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
        if workers > 1 and len(jobs) > 1 and not watchers:
            yield from _in_processes(jobs, workers)
            return
        for job in jobs:
            yield job.run(watchers=watchers)


def _in_processes(jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Run jobs in processes; jobs that were under way when a process died are run again, one at a time."""
    errands = (_Errand(number, job) for number, job in enumerate(jobs))
    dead: list[Job] = []
    ran = 0
    with closing(Processes(min(workers, len(jobs)))) as crew:
        for errand, result in carry_out(crew, errands, losses=1, barren=MOST_BARREN, apart=_begun):
            if result is None:
                dead.append(errand.job)
            else:
                ran += 1
                yield result
    if ran < len(jobs):
        raise WorkerLostError(_lost_jobs_text(dead, len(jobs) - ran - len(dead)))


@dataclass(frozen=True, slots=True)
class _Errand:
    number: int
    job: Job

    def run(self, cancelled: Cancelled) -> Result:
        try:
            return self.job.run(cancelled)
        except SystemExit as error:  # passed on, it would end the worker as if nothing had gone wrong
            raise DubinsTrafficError(f"{self.job.called} ended its process (status {error.code})") from error


def _begun(errand: _Errand) -> tuple[_Errand]:
    """Return a lost errand to be run again: a record that exists already is one that it began."""
    return (_Errand(errand.number, replace(errand.job, overwrite=True)),)


def _lost_jobs_text(dead: Sequence[Job], left: int) -> str:
    """Return the message about jobs whose processes ended in their middle; `left` other jobs were therefore not run."""
    named = ", ".join(job.called for job in dead[:MOST_NAMED])
    more = f" and {len(dead) - MOST_NAMED} more" if len(dead) > MOST_NAMED else ""
    rest = f"; {left} trials were not run" if left else ""
    return f"the process ended in the middle of {named}{more}, each time it was run{rest}"
