"""Many trials at once: drawn, run together, judged and scored, the same numbers as one by one."""

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

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.batch_records import chosen, folder_of
from dubins_traffic.engine.controlled import Maker, ask, grouped
from dubins_traffic.engine.group import Group, Outcome
from dubins_traffic.engine.sharing import can_share, fitness, undisturbed
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw, draw_many
from dubins_traffic.runs.record_folder import claim
from dubins_traffic.runs.record_folder import name as record_name
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.metric import Maker as MetricMaker
from dubins_traffic.scoring.metric import MetricSpec
from dubins_traffic.scoring.score import ScoreSheet
from dubins_traffic.viewer.notebook import Sheeted

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

ASKED = 16
"""So many trials of a campaign's chunk run at a time where a controller is asked in every tick."""
UNDER_WAY = 3
"""Groups under way for each thread: while the oldest is waited for, the others go on."""
LEAST = 4
"""Trials in the smallest of the last groups, which still hide what it costs to begin one."""
Progress = Callable[[int], object]


@dataclass(frozen=True, slots=True, repr=False)
class Batch(Sheeted):
    """What came of the trials of a batch, by their numbers; of trials that have a record their scores name it."""

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
        What to draw the trials from.
    controller : str or callable
        `rules` runs compiled. Others, by name, as ``module:Class`` or ``path/to/file.py:Class``, or as a callable that
        makes one, are asked every tick: one object for each trial, or one for all if it also has the methods
        `start_batch` and `act_batch` (`engine.controlled.BatchController`).
    trials, first : int
        Trials `first` to ``first + trials - 1``; by default as many as the configuration says, from 0.
    seed : int
        What all random numbers follow from.
    batch : int
        Trials that are stepped together; when one ends another takes its place.
    threads : int
        Batches that run at a time, where the controller is compiled.
    keep : str
        Of which trials a record is kept: ``none``, ``all``, ``failures`` (a rule broken and not excused, a fault, or in
        trials that are not judged a collision), or ``sample:K``: K of them, evenly spaced. These trials are run once
        more by themselves, since the same seed gives the same bytes; so a controller must do the same in the same
        trial.
    records : path
        Folder for the records, made if missing; one that holds records is refused, unless one of the following.
    overwrite : bool
        Whether records that the folder holds are removed before.
    append : bool
        Whether they stay, and are not made again; they must be of the same controller and instances.
    progress : callable, optional
        Told how many trials have ended, each time.
    ended : callable, optional
        Told what came of each trial as it ends, in whatever order they do.
    metrics : sequence of str or callable
        Further metrics: names, ``module:Class``, ``path/to/file.py:Class``, or classes (docs/extending/metric.md). They
        are shown every frame, so that no trial runs for several ticks without Python.

    Raises
    ------
    InputError
        If anything of this is wrong, or an instance can't be drawn.
    """
    if not isinstance(configuration, Configuration):
        configuration = load_config(configuration)
    count = configuration.number_trials if trials is None else trials
    for name, value in (("trials", count), ("batch", batch), ("threads", threads)):
        if value < 1:
            raise InputError("too few", field=name, value=value, expected="at least 1")
    kept, folder = chosen(keep, count), folder_of(keep, records)
    instances = draw_many(configuration, seed, range(first, first + count))
    makers = scores.makers(metrics)
    each = outcomes(instances, controller, batch=batch, threads=threads, metrics=makers)
    if folder is not None:
        own = partial(draw, configuration, seed)
        there = claim(folder, called(controller), own, overwrite=overwrite, append=append)
        each = _recorded(
            each, folder, there, lambda own: kept(own.instance.trial - first, own), controller, makers
        )
    found: list[Outcome] = []
    for outcome in each:
        found.append(outcome)
        if ended is not None:
            ended(outcome)
        if progress is not None:
            progress(len(found))
    return in_order(found)


def in_order(found: Iterable[Outcome]) -> Batch:
    """Return what came of some trials as a batch."""
    return Batch(tuple(sorted(found, key=lambda outcome: outcome.instance.trial)))


def called(controller: str | Maker) -> str:
    """Return what a controller is called that is given by name, or by what makes one."""
    return controller if isinstance(controller, str) else getattr(controller, "__name__", "controller")


def outcomes(
    instances: Iterable[Instance],
    controller: str | Maker = COMPILED,
    *,
    batch: int = 64,
    threads: int = 1,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials of instances, `batch` at a time, and yield what came of each as it ends.

    The parameters are those of `run_batch`. Instances are drawn from their iterator as they are needed. Trials that
    can't be stepped with others (another simulator, formulas of the user's) run by themselves.
    """
    name = called(controller)
    make = _maker(controller)
    make()
    source = iter(instances)
    if controller != COMPILED:
        yield from _apart(
            source, make, name, metrics, lambda rest: ask(rest, make, name, batch, metrics=metrics)
        )
        return
    cancelled = Event()
    waiting: deque[Future[list[Outcome]]] = deque()
    groups = _groups(source, batch, threads)
    with ThreadPoolExecutor(threads) as pool:
        try:
            while True:
                for taken in islice(groups, UNDER_WAY * threads - len(waiting)):
                    waiting.append(pool.submit(_compiled_or_alone, taken, cancelled, metrics))
                if not waiting:
                    return
                yield from waiting.popleft().result()
        finally:
            cancelled.set()


def _maker(controller: str | Maker) -> Maker:
    return partial(controllers.load, controller) if isinstance(controller, str) else controller


def _groups(source: Iterator[Instance], batch: int, threads: int) -> Iterator[list[Instance]]:
    """Cut instances into groups of `batch`; several threads get smaller ones in the end, to end together."""
    ahead: deque[Instance] = deque()
    while True:
        ahead.extend(islice(source, batch * (threads + 1) - len(ahead)))
        if not ahead:
            return
        last = threads > 1 and len(ahead) <= batch * threads
        count = max(LEAST, -(-len(ahead) // (2 * threads))) if last else batch
        yield [ahead.popleft() for _ in range(min(count, batch, len(ahead)))]


def run_together(
    instances: Sequence[Instance],
    controller: str,
    cancelled: Callable[[], bool],
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run the trials of those instances that can be stepped together, and yield what came of each.

    Raises
    ------
    KeyboardInterrupt
        When `cancelled`, which is asked every now and then.
    """
    fit = fitness()
    able = [own for own in instances if can_share(own) and (controller != COMPILED or fit(own))]
    if controller == COMPILED:
        yield from _compiled(able, cancelled, metrics)
    else:
        yield from ask(able, partial(controllers.load, controller), controller, ASKED, cancelled, metrics)
    if cancelled():
        raise KeyboardInterrupt


def _compiled_or_alone(
    instances: Sequence[Instance], cancelled: Event, metrics: Sequence[MetricMaker]
) -> list[Outcome]:
    """Run the trials of instances whose egos keep the rules."""
    fit = fitness()
    able = [can_share(instance) and fit(instance) for instance in instances]
    alone = [own for own, shares in zip(instances, able, strict=True) if not shares]
    together = [own for own, shares in zip(instances, able, strict=True) if shares]
    return [
        *(_alone(own, _maker(COMPILED), COMPILED, metrics) for own in alone),
        *_compiled(together, cancelled.is_set, metrics),
    ]


def _compiled(
    instances: Sequence[Instance], cancelled: Callable[[], bool], metrics: Sequence[MetricMaker]
) -> Iterator[Outcome]:
    for own in grouped([instance for instance in instances if undisturbed(instance)]):
        group = Group(own, keeps_rules=True, metrics=metrics)
        group.finish(cancelled)
        if not cancelled():
            yield from group.outcomes(range(len(own)), COMPILED)
    asked = [instance for instance in instances if not undisturbed(instance)]
    if asked:
        make = partial(controllers.load, COMPILED)
        yield from ask(asked, make, COMPILED, len(asked), cancelled, metrics)


def _apart(
    source: Iterator[Instance],
    make: Maker,
    name: str,
    metrics: Sequence[MetricMaker],
    run: Callable[[Iterator[Instance]], Iterator[Outcome]],
) -> Iterator[Outcome]:
    """Run the trials that can't be stepped with others, and hand on the rest."""
    done: list[Outcome] = []

    def rest() -> Iterator[Instance]:
        for instance in source:
            if can_share(instance):
                yield instance
            else:
                done.append(_alone(instance, make, name, metrics))

    for outcome in run(rest()):
        while done:
            yield done.pop(0)
        yield outcome
    yield from done


def _alone(instance: Instance, make: Maker, name: str, metrics: Sequence[MetricMaker]) -> Outcome:
    result = run_trial(instance, controllers.made(make), name=name, metrics=metrics)
    return Outcome(instance, result.ending, result.score)


def _recorded(
    each: Iterable[Outcome],
    folder: Path,
    there: Container[str],
    is_kept: Callable[[Outcome], bool],
    controller: str | Maker,
    metrics: Sequence[MetricMaker],
) -> Iterator[Outcome]:
    """Run the trials that are kept once more for their records, but those whose records are `there`."""
    with locked(folder):
        for outcome in each:
            record = folder / record_name(outcome.instance.trial)
            if not is_kept(outcome):
                yield outcome
            elif record.name in there:
                yield replace(outcome, score=replace(outcome.score, record=str(record)))
            else:
                driver = controllers.made(_maker(controller))
                result = run_trial(
                    outcome.instance, driver, record=record, overwrite=record.exists(),
                    name=called(controller), metrics=metrics,
                )  # fmt: skip
                yield replace(outcome, ending=result.ending, score=result.score)
