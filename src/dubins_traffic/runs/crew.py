"""The crew that runs errands beside this process: processes of this machine here, a Ray cluster in `ray_crew`.

`run`, campaigns, `evaluate` and searches hand it what they have to run, and `carry_out` sees to it that each errand is
done once, whatever becomes of the worker that had it.
"""

from __future__ import annotations

import os
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.runs.processes import deaf_to_interrupts, prepare_worker, spawning

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

Cancelled = Callable[[], bool]
"""Tells whether work is to end at once."""
ALONE = 2
"""An errand that was lost this often with nothing beside it is given up: it ends its process."""


def never() -> bool:
    """Tell that work is not to end: nobody cancels it."""
    return False


class Errand(Protocol):
    """Work that is pickled and sent to a worker, such as some trials of a campaign."""

    @property
    def number(self) -> int:
        """Its number, unique among all work under way."""
        ...

    def run(self, cancelled: Cancelled) -> Any:
        """Do the work and return what came of it, not None; call `cancelled` now and then, and raise if it is true."""
        ...


Work = TypeVar("Work", bound=Errand)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of an errand; None if it was lost with its worker."""

    errand: Any
    found: Any


class Crew(Protocol):
    """Runs errands, several at a time, and returns an outcome for every one, even if it was lost."""

    @property
    def capacity(self) -> int:
        """How many errands may be under way: enough that no worker waits for the next."""
        ...

    def submit(self, errand: Errand) -> None:
        """Take an errand to run."""
        ...

    def wait(self) -> Sequence[Outcome]:
        """Return the outcomes since the last call; wait for at least one if any errand is under way."""
        ...

    def close(self) -> None:
        """Interrupt the errands under way and free all resources."""
        ...


def carry_out(
    crew: Crew,
    errands: Iterator[Work],
    *,
    losses: int = 2,
    barren: int | None = None,
    apart: Callable[[Work], Iterable[Work]] = lambda errand: (errand,),
) -> Iterator[tuple[Work, Any]]:
    """Run errands and yield each once, with what came of it, in the order in which they are ready.

    At most the crew's capacity is under way. A lost errand is run again. One that is lost `losses` times is run at the
    end with nothing beside it, in its parts: what still ends its process, `ALONE` times, is yielded with None.

    Parameters
    ----------
    crew : Crew
        Who runs them.
    errands : iterator of Errand
        They are taken as there is room for them.
    losses : int
        So often an errand may be lost beside others.
    barren : int, optional
        After so many losses in a row without a result nothing is started any more; the rest is not yielded.
    apart : callable, optional
        The parts of an errand, to be run alone.
    """
    lost: Counter[int] = Counter()
    again, suspects = deque[Work](), deque[Work]()
    under_way = in_vain = 0
    while barren is None or in_vain < barren:
        while under_way < crew.capacity:
            errand = again.popleft() if again else next(errands, None)
            if errand is None:
                break
            crew.submit(errand)
            under_way += 1
        if not under_way:
            break
        outcomes = crew.wait()
        under_way -= len(outcomes)
        in_vain = 0 if any(outcome.found is not None for outcome in outcomes) else in_vain + 1
        for outcome in sorted(outcomes, key=lambda outcome: outcome.errand.number):
            if outcome.found is not None:
                yield outcome.errand, outcome.found
                continue
            lost[outcome.errand.number] += 1
            often = lost[outcome.errand.number] >= losses
            (suspects if often else again).append(outcome.errand)
    in_vain = 0
    for suspect in suspects:
        for errand in apart(suspect):
            if barren is not None and in_vain >= barren:
                return
            result = _alone(crew, errand)
            in_vain = in_vain + 1 if result is None else 0
            yield errand, result


def _alone(crew: Crew, errand: Errand) -> Any:
    for _ in range(ALONE):
        crew.submit(errand)
        (outcome,) = crew.wait()
        if outcome.found is not None:
            return outcome.found
    return None


class Processes:
    """A crew of `workers` processes, which end with this one, however it ends.

    When one of them dies, all are replaced, and the errands under way are lost.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._context = spawning()
        self._cancelled = self._context.Event()
        self._under_way: dict[Future[Any], Errand] = {}
        self._start()

    @property
    def capacity(self) -> int:
        """One errand in work and one in waiting for each process."""
        return 2 * self._workers

    def submit(self, errand: Errand) -> None:
        """Take an errand to run."""
        try:
            future = self._pool.submit(_run, errand)
        except BrokenProcessPool as error:
            future: Future[Any] = Future()
            future.set_exception(error)
        self._under_way[future] = errand

    def wait(self) -> Sequence[Outcome]:
        """Return outcomes; if a process has died, all errands that were under way are lost."""
        done, _ = wait(self._under_way, return_when=FIRST_COMPLETED)
        if any(isinstance(future.exception(), BrokenProcessPool) for future in done):
            done, _ = wait(self._under_way)
        outcomes: list[Outcome] = []
        broken = False
        for future in done:
            errand = self._under_way.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                broken = True
                outcomes.append(Outcome(errand, None))
            else:
                outcomes.append(Outcome(errand, future.result()))
        if broken:
            self._pool.shutdown()
            self._start()
        return outcomes

    def close(self) -> None:
        """Interrupt the errands under way, after at most one simulated second, and end the processes."""
        self._cancelled.set()
        self._pool.shutdown(cancel_futures=True)

    def _start(self) -> None:
        self._pool = ProcessPoolExecutor(
            self._workers,
            mp_context=self._context,
            initializer=_begin,
            initargs=(search_path(), self._cancelled),
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


def search_path() -> tuple[str, ...]:
    """Return where this process looks modules of controllers up; workers look there, too."""
    return (str(Path.cwd()), *sys.path)


def look_in(paths: Iterable[str]) -> None:
    """Let this process look modules up in further folders."""
    sys.path += [path for path in paths if path not in sys.path]


_cancelled: Event | None = None


def _begin(paths: Sequence[str], cancelled: Event) -> None:
    """Prepare a worker: Ctrl-C interrupts the parent alone, which sets `cancelled`."""
    global _cancelled  # noqa: PLW0603  # a worker's only state, set once
    _cancelled = cancelled
    look_in(paths)
    prepare_worker()


def _run(errand: Errand) -> Any:
    try:
        return errand.run(never if _cancelled is None else _cancelled.is_set)
    except KeyboardInterrupt:
        raise DubinsTrafficError("interrupted") from None
    except SystemExit as error:  # passed on, SystemExit would end the worker as if nothing had gone wrong
        raise DubinsTrafficError(f"a worker was told to end (status {error.code})") from error
