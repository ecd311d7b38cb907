"""The verdict on a trial of a world outside, whose poses are known to a tolerance only (docs/rules.md#told)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.body import Body, Disc, Rectangle
from dubins_traffic.cars.state import Contact, Frames, Labels, State
from dubins_traffic.cars.touching import Touching
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.problem.instance import OUTSIDE, Instance, Problem
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.tables import ticks
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.verdict import Ruling, Verdict

if TYPE_CHECKING:
    from dubins_traffic.rules.referee import Breach
    from dubins_traffic.scoring.findings import Findings

AGAIN = 1.0
"""A body that meets a disc again within this has not left it, seconds: noise at its edge looks so."""
LEAST = 0.1
"""At least this share is left of a length that is moved."""
FOR, MEASURED, AGAINST = -1.0, 0.0, 1.0
"""By which share of the tolerance bodies are taken to be larger than they are."""


class Tracked:
    """A sink that judges a trial of a world outside three times: as measured, for the cars, and against them."""

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        tracked = instance.simulator in OUTSIDE and bool(instance.problem.rules)
        self._three = [_Judged(instance, by) for by in (MEASURED, FOR, AGAINST) if tracked]
        self._tolerance = instance.problem.blur

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        for tracked in self._three:
            tracked.frames(frames)

    def end(self, ending: Ending) -> None:
        """Keep the ending."""
        for tracked in self._three:
            tracked.end(ending)

    def findings(self) -> Findings | None:
        """Return what has been found up to the last frame as measured, None if poses are exact."""
        return self._three[0].findings() if self._three else None

    def told(self, exact: Verdict | None) -> Verdict | None:
        """Return the verdict of `findings` if all three judgements agree, else that it can't be told.

        Norm: docs/rules.md#told.
        """
        if exact is None or not self._three:
            return exact
        verdict = replace(exact, tolerance=self._tolerance)
        results = [tracked.result() for tracked in self._three[1:]]
        if all(verdict_there is not None and verdict_there.verdict is verdict.verdict for verdict_there in results):
            return verdict
        return replace(verdict, verdict=Ruling.UNTOLD, clean=False, cut=True, excuse=None)


class _Judged(Judging):
    """Judges frames whose labels and contacts follow anew from poses, with bodies and limits moved by a tolerance."""

    def __init__(self, instance: Instance, by: float) -> None:
        instance = moved(instance, by)
        problem = instance.problem
        self.begin(instance)
        self._state = State.zeros(1, len(instance.names))
        self._labeller = Labeller([instance])
        self._touching = Touching(problem.car, problem.obstacles, problem.period)
        self._again = ticks(AGAIN, problem.rate)
        self._met: Ints = np.full((len(instance.names), len(problem.network.intersections)), -self._again - 1)

    def _check(self, problem: Problem) -> None:
        """Check nothing: the instance has been checked as it is."""

    def _judged(self, frames: Frames) -> tuple[list[Breach], Sequence[Contact]]:
        """Label a block of frames anew, and judge it; entries into a disc that a body has hardly left are none."""
        columns = {name: np.empty_like(getattr(frames, name)) for name in Labels.field_names}
        contacts: list[Contact] = []
        entered: set[tuple[int, int, int]] = set()
        for f in range(len(frames)):
            tick = frames.first + f
            for name in State.field_names[:6]:
                getattr(self._state, name)[0] = getattr(frames, name)[f]
            touching = self._touching.update(tick, self._state)
            if tick == 0:
                labels = self._labeller.reset(self._state)
            else:
                contacts += self._labeller.update(tick, self._state, [touching])[0]
                labels = self._labeller.labels
            for name, column in columns.items():
                column[f] = getattr(labels, name)[0]
            for car, vertex in enumerate(labels.crosses[0].tolist()):
                if vertex >= 0:
                    if tick - self._met[car, vertex] <= self._again:
                        entered.add((car, vertex, tick))
                    self._met[car, vertex] = tick
        breaches, judged = super()._judged(replace(frames, **columns, contacts=tuple(contacts)))
        return [breach for breach in breaches if not _is_again(breach, entered)], judged


def _is_again(breach: Breach, entered: set[tuple[int, int, int]]) -> bool:
    """Tell whether a breach of rule 3 is of a body that has hardly left the disc."""
    return breach.rule.startswith("3.") and (breach.car, breach.vertex, breach.tick) in entered


def moved(instance: Instance, by: float) -> Instance:
    """Return an instance with bodies, roads and limits moved by a share of its tolerance, against the cars if `by` > 0.

    A car that stands is `still` whatever the noise, in any case.
    """
    problem = instance.problem
    rules = RuleParameters.from_mapping(problem.rules)
    point = by * problem.blur
    usual = {"approach_distance": rules.approach_distance, "queue_distance": rules.queue_distance}
    usual["turn_back"] = rules.turn_back
    near = {name: max(value - 2.0 * point, LEAST * value) for name, value in usual.items()}
    still = rules.still_speed + 2.0 * problem.off_centre / rules.stop_time
    limits = {**rules.to_mapping(), **near, "still_speed": still}
    car = replace(problem.car, body=_grown(problem.car.body, point), w=problem.car.w - 0.5 * point)
    return replace(instance, problem=replace(problem, car=car, rules=limits))


def _grown(body: Body, by: float) -> Body:
    """Return a body whose edge is farther out by so many metres."""
    if isinstance(body, Disc):
        return Disc(max(body.radius + by, LEAST * body.radius))
    long, wide = (max(size + 2.0 * by, LEAST * size) for size in (body.length, body.width))
    return Rectangle(long, wide)
