"""Runs many trials: draws, steps, judges and scores them; the results are those of trials run one by one."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.engine.egos import Egos, Way, ask, called, grouped, outcome_of
from dubins_traffic.engine.group import Outcome
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw, draw_many
from dubins_traffic.protocols import End
from dubins_traffic.runs.record_folder import check_folder, claim
from dubins_traffic.runs.record_folder import name as record_name
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.metric import Maker as MetricMaker
from dubins_traffic.scoring.metric import MetricSpec
from dubins_traffic.scoring.score import ScoreSheet
from dubins_traffic.scoring.verdict import Ruling
from dubins_traffic.viewer.notebook import Sheeted

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

ASKED = 16
"""Trials of a campaign's chunk that run at a time if a controller is asked in every tick."""
UNDER_WAY = 3
"""Groups that are submitted per thread: while the oldest is waited for, the others go on."""
LEAST = 4
"""Least size of the last groups: smaller ones would take longer to set up than to run."""
KEEP = "none, all, failures or sample:K"
"""What `keep` may be."""
Progress = Callable[[int], object]


@dataclass(frozen=True, slots=True, repr=False)
class Batch(Sheeted):
    """The scores and verdicts of the trials of a batch, by trial number; a score names its record if there is one."""

    outcomes: tuple[Outcome, ...]

    @property
    def sheet(self) -> ScoreSheet:
        """The scores."""
        return ScoreSheet(tuple(outcome.score for outcome in self.outcomes))


def run_batch(
    configuration: Configuration | str | os.PathLike[str],
    controller: str | Maker = COMPILED,
    *,
    trials: int | None = None,
    first: int = 0,
    seed: int = 0,
    batch: int = 64,
    threads: int = 1,
    keep: str = "none",
    records: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    append: bool = False,
    progress: Progress | None = None,
    ended: Callable[[Outcome], object] | None = None,
    metrics: Sequence[MetricSpec] = (),
) -> Batch:
    """Run trials of a configuration, `batch` at a time.

    Every score and verdict equals that of `run_trial` on the same instance, bit for bit, whatever `batch` and
    `threads`.

    Parameters
    ----------
    configuration : Configuration, path or name
        The configuration from which trials are drawn.
    controller : str or callable
        `rules` runs compiled. Others, by name, as ``module:Class`` or ``path/to/file.py:Class``, or as a callable that
        makes one, are asked every tick: one object for each trial, or one for all if it also has the methods
        `start_batch` and `act_batch` (`engine.controlled.BatchController`).
    trials, first : int
        Trials `first` to ``first + trials - 1``; by default as many as the configuration says, from 0.
    seed : int
        Seed of all random numbers.
    batch : int
        Most trials that are stepped together; when one ends another takes its place.
    threads : int
        Groups that run at the same time, if the controller is compiled.
    keep : str
        Of which trials a record is kept: ``none``, ``all``, ``failures`` (a rule broken and not excused, a fault, or in
        trials that are not judged a collision), or ``sample:K``: K of them, evenly spaced. These trials are run once
        more by themselves, since the same seed gives the same bytes; so a controller must do the same in the same
        trial.
    records : path
        Folder for the records, made if missing; one that holds records is refused, unless one of the following.
    overwrite : bool
        Whether to remove the records that the folder holds first.
    append : bool
        Whether to keep the records that the folder holds and make only the missing ones; they must be of the same
        controller and instances.
    progress : callable, optional
        Called with the number of ended trials each time one ends.
    ended : callable, optional
        Called with the outcome of each trial when it ends; trials may end in any order.
    metrics : sequence of str or callable
        Further metrics: names, ``module:Class``, ``path/to/file.py:Class``, or classes (docs/extending/metric.md). They
        are shown every frame, so that no trial runs for several ticks without Python.

    Raises
    ------
    InputError
        If an argument is wrong, or an instance can't be drawn.
    """
    if not isinstance(configuration, Configuration):
        configuration = load_config(configuration)
    count = configuration.number_trials if trials is None else trials
    for name, value in (("trials", count), ("batch", batch), ("threads", threads)):
        if value < 1:
            raise InputError("too few", field=name, value=value, expected="at least 1")
    kept, folder = chosen(keep, count), folder_of(keep, records)
    instances = draw_many(configuration, seed, range(first, first + count))
    makers = scores.makers(scores.with_share(metrics, [controller]))
    each = outcomes(instances, controller, batch=batch, threads=threads, metrics=makers)
    if folder is not None:
        drawn = partial(draw, configuration, seed)
        there = claim(folder, called(controller), drawn, overwrite=overwrite, append=append)
        each = _recorded(each, folder, there, lambda done: kept(done.instance.trial - first, done), controller, makers)
    outcomes_so_far: list[Outcome] = []
    for outcome in each:
        outcomes_so_far.append(outcome)
        if ended is not None:
            ended(outcome)
        if progress is not None:
            progress(len(outcomes_so_far))
    return in_order(outcomes_so_far)


def in_order(outcomes: Iterable[Outcome]) -> Batch:
    """Return outcomes as a Batch, sorted by trial number."""
    return Batch(tuple(sorted(outcomes, key=lambda outcome: outcome.instance.trial)))


def outcomes(
    instances: Iterable[Instance],
    controller: str | Maker = COMPILED,
    *,
    batch: int = 64,
    threads: int = 1,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials of instances, `batch` at a time, and yield the outcome of each when it ends.

    The parameters are those of `run_batch`. Instances are taken from their iterator when they are needed. Trials that
    can't be batched (another simulator, formulas of the user's) run by themselves.
    """
    egos = Egos(controller)
    egos.make()
    if not egos.is_compiled:
        yield from ask(instances, egos, batch, metrics=metrics)
        return
    cancelled = Event()
    waiting: deque[Future[list[Outcome]]] = deque()
    groups = _groups(iter(instances), batch, threads)
    with ThreadPoolExecutor(threads) as pool:
        try:
            while True:
                for taken in islice(groups, UNDER_WAY * threads - len(waiting)):
                    waiting.append(pool.submit(_run, taken, egos, cancelled, metrics))
                if not waiting:
                    return
                yield from waiting.popleft().result()
        finally:
            cancelled.set()


def _groups(source: Iterator[Instance], batch: int, threads: int) -> Iterator[list[Instance]]:
    """Yield instances in groups of `batch`; with several threads the last ones are smaller, to end together."""
    ahead: deque[Instance] = deque()
    while True:
        ahead.extend(islice(source, batch * (threads + 1) - len(ahead)))
        if not ahead:
            return
        last = threads > 1 and len(ahead) <= batch * threads
        count = max(LEAST, -(-len(ahead) // (2 * threads))) if last else batch
        yield [ahead.popleft() for _ in range(min(count, batch, len(ahead)))]


def _run(instances: Sequence[Instance], egos: Egos, cancelled: Event, metrics: Sequence[MetricMaker]) -> list[Outcome]:
    return list(run_together(instances, egos, cancelled.is_set, metrics, alone=True))


def run_together(
    instances: Sequence[Instance],
    egos: Egos,
    cancelled: Callable[[], bool],
    metrics: Sequence[MetricMaker] = (),
    *,
    alone: bool = False,
) -> Iterator[Outcome]:
    """Run trials of instances, as many as possible stepped together, and yield the outcome of each.

    The others run by themselves if `alone`; else they are left out.

    Raises
    ------
    KeyboardInterrupt
        When `cancelled`, which is called now and then, returns true.
    """
    ways = egos.ways(instances)
    if alone:
        yield from (outcome_of(egos.alone(instance, metrics=metrics)) for instance in ways[Way.ALONE])
    for some in grouped(ways[Way.COMPILED]):
        group = egos.group(some, Way.COMPILED, metrics)
        group.finish(cancelled)
        if not cancelled():
            yield from group.fresh(egos.name)
    most = len(ways[Way.ASKED]) if egos.is_compiled else ASKED
    yield from ask(ways[Way.ASKED], egos, most, cancelled, metrics)


def _recorded(
    each: Iterable[Outcome],
    folder: Path,
    there: Container[str],
    is_kept: Callable[[Outcome], bool],
    controller: str | Maker,
    metrics: Sequence[MetricMaker],
) -> Iterator[Outcome]:
    """Yield outcomes; run each trial whose record is to be kept once more for it, unless its record is `there`."""
    place, egos = folder.absolute(), Egos(controller)  # controllers may go to other folders
    with locked(folder):
        for outcome in each:
            record = place / record_name(outcome.instance.trial)
            told = str(folder / record.name)
            if not is_kept(outcome):
                yield outcome
            elif record.name in there:
                yield replace(outcome, score=replace(outcome.score, record=told))
            else:
                result = egos.alone(outcome.instance, record=record, overwrite=record.exists(), metrics=metrics)
                yield replace(outcome, ending=result.ending, score=replace(result.score, record=told))


def chosen(keep: str, count: int) -> Callable[[int, Outcome], bool]:
    """Return a function that tells, from a trial's place among `count` and its outcome, whether its record is kept."""
    kind, colon, number = keep.partition(":")
    if kind == "sample" and colon and number.isdigit() and int(number) > 0:
        wanted = min(int(number), count)
        sample = {k * count // wanted for k in range(wanted)}
        return lambda place, _outcome: place in sample
    if keep not in ("none", "all", "failures"):
        raise InputError("unknown choice of trials to record", file="--keep", value=keep, expected=KEEP)
    if keep == "failures":
        return lambda _place, outcome: failed(outcome)
    return lambda _place, _outcome: keep == "all"


def failed(outcome: Outcome) -> bool:
    """Tell whether a trial has failed: a rule broken and not excused, a fault, or, if it is not judged, a collision."""
    if outcome.ending.end not in (End.DURATION, End.COLLISION):
        return True
    verdict = outcome.score.verdict
    return bool(outcome.score.collisions) if verdict is None else verdict.verdict is Ruling.VIOLATED


def folder_of(keep: str, records: str | os.PathLike[str] | None) -> Path | None:
    """Return the folder for records, made if missing, or None if none are kept.

    InputError if `keep` asks for records without a folder, a folder is given without `keep`, or it can't be made.
    """
    if keep == "none" or records is None:
        if (keep == "none") != (records is None):
            raise InputError(
                "records are kept in a folder",
                file="--keep, --records",
                value=(keep, records),
                expected="both, or neither",
            )
        return None
    return check_folder(records)
