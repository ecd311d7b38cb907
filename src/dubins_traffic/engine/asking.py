"""Runs many trials whose controllers are Python objects: asks each for its command in every tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.controllers import blame
from dubins_traffic.engine.controlled import BatchController, BatchView, Controlled, Maker, grouped
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.scoring.metric import Maker as MetricMaker

if TYPE_CHECKING:
    from dubins_traffic.engine.group import Outcome
    from dubins_traffic.problem.instance import Instance


def ask(
    instances: Iterable[Instance],
    make: Maker,
    controller: str,
    batch: int,
    cancelled: Callable[[], bool] = lambda: False,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials, `batch` at a time, and yield the outcome of each when it ends; another trial then takes its place.

    It calls `cancelled` in every tick and raises KeyboardInterrupt if that returns true.

    Parameters
    ----------
    instances
        One for each trial.
    make
        Makes the controller: one for each trial, or one for all if it is a `BatchController`.
    controller
        Name of the controller, for the outcomes.
    batch
        Most trials that run at a time.
    metrics
        Each makes a further metric for a trial.
    """
    made = make()
    shared = made if isinstance(made, BatchController) else None
    waiting = iter(instances)
    seats: list[Controlled] = []
    while True:
        if cancelled():
            raise KeyboardInterrupt
        free = batch - sum(len(own.group.active) for own in seats)
        taken = list(islice(waiting, free)) if 8 * free >= batch else []
        for own in grouped(taken):
            if shared is not None:
                check_clear(own)
            seats.append(Controlled(own, make, shared, metrics))
        if not seats:
            return
        if shared is None:
            for own in seats:
                own.ask_each()
        else:
            ask_all(seats, shared)
        for own in seats:
            yield from own.step(controller)
        seats = [own for own in seats if len(own.group.active)]


def ask_all(seats: Sequence[Controlled], controller: BatchController) -> None:
    """Ask one controller for the commands of all egos."""
    seats = [own for own in seats if len(own.group.active)]
    if not seats:
        return
    places = max(own.group.state.x.shape[1] for own in seats)
    views = [own.view(places) for own in seats]
    whole = BatchView(
        np.concatenate([view.trial for view in views]),
        np.concatenate([view.tick for view in views]),
        State(*_joined([view.state for view in views])),
        Labels(*_joined([view.labels for view in views])),
        np.concatenate([view.seen for view in views]),
    )
    try:
        answer = np.array(controller.act_batch(whole), dtype=np.float64)  # a copy: it may keep its own
        if answer.shape != (len(whole.trial), 2):
            raise TypeError(f"act_batch returned {answer.shape}, not {(len(whole.trial), 2)}")
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        blame.show(error)
        for own in seats:
            own.fail(error)
        return
    row = 0
    for own, view in zip(seats, views, strict=True):
        own.take_all(view.tick, answer[row : row + len(view.tick)])
        row += len(view.tick)


def _joined(tables: Sequence[Tables]) -> list[Any]:
    """Return, for each column, the arrays of several tables concatenated."""
    return [np.concatenate(arrays) for arrays in zip(*tables, strict=True)]


def check_clear(instances: Sequence[Instance]) -> None:
    """Refuse instances with noise in observations: a BatchController is shown the true poses."""
    for instance in instances:
        noise = instance.disturbances
        if noise.position_noise > 0.0 or noise.heading_noise > 0.0:
            raise InputError(
                "a controller with start_batch and act_batch is shown poses without noise",
                field="disturbances",
                value=noise,
                expected="no noise, or a controller with start and act",
            )
