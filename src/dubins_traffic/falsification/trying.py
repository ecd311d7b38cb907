"""Trials of a search: who runs them, together where that can be, and what the search needs to know of each."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from dubins_traffic.campaign.chunks import fitting
from dubins_traffic.campaign.ray_crew import check_address, crew_at
from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.controllers import named
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.engine.egos import Egos, Way, grouped
from dubins_traffic.errors import InputError, WorkerLostError
from dubins_traffic.falsification.contract import ContractMargins, contract_margins, spare
from dubins_traffic.falsification.coverage import Cell, Manoeuvre
from dubins_traffic.falsification.passages import Passages, find_passages
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.record.reader import Record, replay
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.runs.crew import Cancelled, Crew, carry_out
from dubins_traffic.scoring.margins import LIVENESS
from dubins_traffic.scoring.score import Score, score
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Ruling

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Ending


FORMULA: Final = "formula"
"""What a search calls a formula of the problem's own begins with this."""
DONE: Final = "score"
METRE: Final = 1e-4
"""What a metre counts beside a round."""
BROKEN: Final = -1e-9
"""A margin of what is broken is not above this."""
BOXES: Final = 8
"""So many trials of a controller in a box run at a time, each with a process of its own."""
MOST: Final = 256


@dataclass(frozen=True, slots=True)
class Tried:
    """What a search keeps of a trial."""

    discarded: bool
    """Whether the e-agents broke the assumption before the ego broke anything: then the trial says nothing of the
    ego.
    """
    faulty: bool
    """Whether it ended by a fault."""
    margins: dict[str, float]
    """How far the ego stayed from breaking each rule, by the rules' names, and of each formula of the problem's own
    ("formula NAME"), and in seconds the longest gap of a goal from its limit (`LIVENESS`); what nothing could break
    is left out; and those of the contract (`contract.Kept`). Negative: broken. `DONE`: what the ego got done,
    rounds, then the share of the goals visited, then metres.
    """
    cells: tuple[tuple[Cell, int], ...]
    """The first breach of each rule by the ego, and its frame, in order of time; of `LIVENESS` the last frame, and of
    the end, by its name, if the ego's controller brought it about; and the frames in which the contract was broken, of
    discarded trials too.
    """
    situations: tuple[int, ...] = ()
    """What it met with (`passages.Passages.situations`); empty where nobody asks for it."""
    fault: str = ""
    """The end of a faulty trial and the reason, ``END: REASON``."""
    exercised: tuple[int, ...] = ()
    """The numbers of the cells that it put to the test, each as often as it did; none if it ended by a fault, or
    where nobody asks for it.
    """

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, from which `from_json` makes an equal one."""
        cells = [[cell.rule, cell.manoeuvre, cell.degree, tick] for cell, tick in self.cells]
        return {name: getattr(self, name) for name in self.__slots__} | {"cells": cells}

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> Tried:
        """Return what the JSON object says."""
        cells = tuple(
            (Cell(rule, Manoeuvre(manoeuvre), degree), tick) for rule, manoeuvre, degree, tick in document["cells"]
        )
        numbers = {name: tuple(document[name]) for name in ("situations", "exercised")}
        values: dict[str, Any] = {**document, "cells": cells, **numbers}
        return Tried(**values)


class TrialRunner:
    """Runs the trials of a search.

    Parameters
    ----------
    controller : str, callable or Remote
        As `engine.batch.run_batch` takes it, or what drives trials elsewhere.
    cancelled : callable
        Is asked now and then whether to stop.

    Attributes
    ----------
    answer_s : float or None
        How long the controller took for an answer in the last trials in which it was asked, seconds; None before.
    """

    def __init__(self, controller: str | Maker | Remote, cancelled: Cancelled = lambda: False) -> None:
        self.cancelled = cancelled
        self.answer_s: float | None = None
        self._number = 0
        self._remote = controller if isinstance(controller, Remote) else None
        if isinstance(controller, Remote):
            return
        self._egos = Egos(controller, uncounted=True)
        self._is_shared = self._egos.shared is not None
        self._most = BOXES if named.SANDBOX.search(self._egos.name) else MOST

    def attempt(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances; yield what came of some, by their places in `instances`, as they end.

        What runs without asking anybody in Python runs together, and so does what one controller drives; else no more
        trials than `fitting` says. KeyboardInterrupt when it is cancelled.
        """
        places = {id(instance): k for k, instance in enumerate(instances)}
        ways = {Way.ALONE: list(instances)} if self._remote is not None else self._egos.ways(instances)
        for alike in grouped(ways.get(Way.COMPILED, ())):
            self.answer_s = 0.0
            yield self._together(alike, Way.COMPILED, places)
        for alike in grouped(ways.get(Way.ASKED, ())):
            first = 0
            while first < len(alike):
                some = alike[first : first + self._count(alike[first:])]
                yield self._together(some, Way.ASKED, places)
                first += len(some)
        for instance in ways[Way.ALONE]:
            self._check()
            yield {places[id(instance)]: self._alone(instance)}

    def _count(self, instances: Sequence[Instance]) -> int:
        """Return how many of some trials whose controllers are asked in every tick run together."""
        most = min(self._most, len(instances))
        if self._is_shared:
            return most
        return fitting(self.answer_s, max(instance.ticks for instance in instances), most)

    def _note(self, summaries: Iterable[Mapping[str, float]]) -> None:
        """Note how long the controller took for an answer in trials, by the summaries of their latencies.

        Trials in which it was never asked, since its start failed, tell nothing of that.
        """
        means = [summary["mean"] for summary in summaries if summary]
        if means:
            self.answer_s = sum(means) / len(means)

    def _check(self) -> None:
        if self.cancelled():
            raise KeyboardInterrupt

    def _together(self, instances: Sequence[Instance], way: Way, places: Mapping[int, int]) -> dict[int, Tried]:
        """Run trials that are stepped together; return what came of them, by the places of their instances."""
        numbers = range(self._number, self._number + len(instances))
        self._number = numbers.stop
        group = self._egos.group(instances, way, numbers=numbers)
        group.finish(self.cancelled)
        self._check()
        ego = group.world.tally.ego
        outcomes = group.fresh(self._egos.name)
        self._note(outcome.act_s for outcome in outcomes)
        frames = np.array([outcome.ending.ticks + 1 for outcome in outcomes])
        networks = [instance.problem.network for instance in group.instances]
        passages = find_passages(ego["lane"], ego["bits"], frames, networks)
        tried = [
            tried_of(outcome.score, outcome.ending, passages, b, outcome.instance) for b, outcome in enumerate(outcomes)
        ]
        whole = with_passages(tried, passages, group.instances[0])
        return {places[id(outcome.instance)]: came for outcome, came in zip(outcomes, whole, strict=True)}

    def _alone(self, instance: Instance) -> Tried:
        """Run a trial that can't be stepped with others."""
        if self._remote is not None:
            record = self._remote.drive(instance)
            scored, passages = judged_record(record)
            return _tried_alone(instance, scored, record.ending, passages)
        ego = EgoTrace()
        result = self._egos.alone(instance, sinks=[ego])
        self._note([result.wall.act_s])
        return _tried_alone(instance, result.score, result.ending, ego.passages())


class EgoTrace:
    """A sink that keeps the ego's lane states and flags."""

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        self._network = instance.problem.network
        self._lane: list[Any] = []
        self._bits: list[Any] = []

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._lane.append(frames.lane[:, EGO].copy())
        self._bits.append(frames.bits[:, EGO].copy())

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def passages(self) -> Passages:
        """Return the ego's way through the trial."""
        lane, bits = np.concatenate(self._lane)[None, :], np.concatenate(self._bits)[None, :]
        return find_passages(lane, bits, np.array([lane.shape[1]]), [self._network])


def judged_record(record: Record) -> tuple[Score, Passages]:
    """Return the score of a record, and the ego's way through its trial."""
    trace = EgoTrace()
    replay(record, [trace])
    return score(record), trace.passages()


def tried_of(score: Score, ending: Ending | None, passages: Passages, trial: int, instance: Instance) -> Tried:
    """Return what a search keeps of the trial of an instance that has been judged: number `trial` of `passages`."""
    verdict = score.verdict
    fault = str(ending) if ending is not None and ending.end in FAULTS else ""
    margins = {
        f"{FORMULA} {formula.name}": formula.robustness for formula in score.formulas if formula.robustness is not None
    }
    margins[DONE] = score.counted_rounds + score.goals_visited + METRE * score.driven.distance_m
    if verdict is None:
        return Tried(False, bool(fault), margins, (), fault=fault)
    margins |= {rule: value for rule, value in verdict.robustness.items() if value is not None}
    late = spare(instance.problem, verdict, ending)
    margins |= {} if late is None else {LIVENESS: late}
    breaches = [broken for broken in verdict.violations if broken.car == EGO_NAME and broken.rule in EGO_RULES]
    first = {broken.rule: broken.tick for broken in reversed(breaches)}
    for rule in first:
        margins[rule] = min(margins.get(rule, -0.0), BROKEN)
    assumption_broken = verdict.assumption_broken
    if not assumption_broken:
        rate = instance.problem.rate
        first |= {rule: round(time * rate) for rule, time in broken_formulas(score).items()}
        first |= {LIVENESS: ending.ticks} if ending is not None and late is not None and late < 0.0 else {}
    first |= {ending.end.value: ending.ticks} if ending is not None and ending.by_controller else {}
    discarded = verdict.verdict is Ruling.EXCUSED or (not breaches and assumption_broken)
    contract = ContractMargins() if fault else contract_margins(verdict, passages, trial, instance)
    margins |= contract.margins
    first = contract.frames if discarded else first | contract.frames
    ordered = sorted(first.items(), key=lambda item: (item[1], item[0]))
    cells = tuple((passages.cell(rule, trial, tick), tick) for rule, tick in ordered)
    return Tried(discarded, bool(fault), margins, cells, fault=fault)


def _tried_alone(instance: Instance, scored: Score, ending: Ending | None, passages: Passages) -> Tried:
    """Return what came of a trial that was run alone."""
    tried = tried_of(scored, ending, passages, 0, instance)
    return with_passages([tried], passages, instance)[0]


def with_passages(tried: Sequence[Tried], passages: Passages, instance: Instance) -> list[Tried]:
    """Return trials with what they met with and put to the test; they are in the order of `passages`.

    `instance` is that of one of them; its rules are those of all.
    """
    degree = RuleParameters.from_mapping(instance.problem.rules).crossing_degree
    met, tested = passages.situations(len(tried)), passages.exercised(len(tried), degree)
    return [
        replace(each, situations=met[b], exercised=() if each.faulty else tested[b]) for b, each in enumerate(tried)
    ]


def in_order(parts: Iterable[Mapping[int, Tried]]) -> list[Tried]:
    """Return what came of trials in the order of their instances, of which `parts` have some each."""
    by_place = {k: each for part in parts for k, each in part.items()}
    return [by_place[k] for k in range(len(by_place))]


def broken_formulas(score: Score) -> dict[str, float]:
    """Return the seconds at which the problem's own formulas became false, by what a search calls them."""
    false = [formula for formula in score.formulas if formula.verdict == "false"]
    return {f"{FORMULA} {formula.name}": formula.time for formula in false if formula.time is not None}


MOST_IN_CHUNK: Final = 32
"""Most trials that a worker is handed at a time."""


class Runner(Protocol):
    """Runs the trials of a search."""

    make: Maker | Remote
    """Makes the controller, or drives trials elsewhere."""
    name: str
    """What records and cases call it."""

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances; yield what came of some, by their places in `instances`, as they end.

        What comes of them does not depend on who runs them.
        """
        ...


class LocalRunner:
    """Runs all trials in this process."""

    def __init__(self, controller: str | Maker | Remote, name: str) -> None:
        self.make = driver_of(controller)
        self.name = name
        self._runner = TrialRunner(controller)

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances, and yield what came of some as soon as they have ended."""
        return self._runner.attempt(instances)


@dataclass(frozen=True, slots=True)
class TrialChunk:
    """Some trials of a search, for a worker; `first` is the place of the first among those that are run."""

    number: int
    controller: str
    first: int
    instances: tuple[Instance, ...]

    def run(self, cancelled: Cancelled) -> tuple[list[Tried], float | None]:
        """Run the trials; return what came of them, and how long their controller takes for an answer."""
        if self.controller not in _runners:
            _runners[self.controller] = TrialRunner(self.controller)
        runner = _runners[self.controller]
        runner.cancelled = cancelled
        return in_order(runner.attempt(self.instances)), runner.answer_s


_runners: dict[str, TrialRunner] = {}


class PoolRunner:
    """Hands chunks of trials to workers."""

    def __init__(self, controller: str, workers: Crew) -> None:
        controllers.load(controller)
        self.make: Maker | Remote = maker(controller)
        self.name = controller
        self._workers = workers
        self._number = 0
        self._answer_s: float | None = None

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances, some at a time; a chunk whose worker ends is run again, a few times."""
        for chunk, answer in carry_out(self._workers, self._chunks(instances)):
            if answer is None:
                raise WorkerLostError(f"workers end in the middle of trials: {self.name} may end its process")
            tried: list[Tried] = answer[0]
            self._answer_s = answer[1]
            yield dict(enumerate(tried, chunk.first))

    def _chunks(self, instances: Sequence[Instance]) -> Iterator[TrialChunk]:
        """Yield chunks of the trials of instances, of what their controller does in about a second."""
        first = 0
        while first < len(instances):
            rest = instances[first : first + MOST_IN_CHUNK]
            some = rest[: fitting(self._answer_s, max(instance.ticks for instance in rest), len(rest))]
            yield TrialChunk(self._number, self.name, first, tuple(some))
            self._number += 1
            first += len(some)


def maker(controller: str | Maker) -> Maker:
    """Return what makes a controller that is given by name, or by what makes it."""
    return (lambda: controllers.load(controller)) if isinstance(controller, str) else controller


def driver_of(controller: str | Maker | Remote) -> Maker | Remote:
    """Return what makes a controller, or what drives trials elsewhere."""
    return controller if isinstance(controller, Remote) else maker(controller)


def name_of(controller: str | Maker | Remote) -> str:
    """Return what records and cases call a controller."""
    if isinstance(controller, str):
        return controller
    return controller.name if isinstance(controller, Remote) else getattr(controller, "__name__", "controller")


@contextlib.contextmanager
def runner_of(controller: str | Maker | Remote, name: str, workers: int, ray: str | None) -> Generator[Runner]:
    """Yield who runs the trials of a search with a controller: `workers` processes, or a Ray cluster at an address."""
    if workers == 1 and ray is None:
        yield LocalRunner(controller, name)
        return
    if not isinstance(controller, str):
        expected = "a controller given by name, not one elsewhere"
        raise InputError("can't be made by other processes", field="controller", value=name, expected=expected)
    if ray is not None:
        check_address(ray)
    with contextlib.closing(crew_at(ray, workers)) as crew:
        yield PoolRunner(controller, crew)
