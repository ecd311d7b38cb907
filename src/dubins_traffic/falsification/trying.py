"""Trials of a search: run together where that can be, and what the search needs to know of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import BatchController, Controlled, Maker, ask_all, check_clear, grouped
from dubins_traffic.engine.group import Group
from dubins_traffic.engine.sharing import can_share, fitness, undisturbed
from dubins_traffic.falsification.cells import CELLS, Cell
from dubins_traffic.falsification.passages import Passages, find_passages
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Ruling

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Ending
    from dubins_traffic.scoring.score import Score

FORMULA: Final = "formula"
"""What a search calls a formula of the problem's own begins with this."""
DONE: Final = "score"
METRE: Final = 1e-4
"""What a metre counts beside a round."""
BROKEN: Final = -1e-9
"""A margin of what is broken is not above this."""
Cancelled = Callable[[], bool]


@dataclass(frozen=True, slots=True)
class Tried:
    """What a search keeps of a trial.

    Attributes
    ----------
    discarded : bool
        Whether the e-agents broke the assumption before the ego broke anything: then the trial says nothing of the ego.
    faulty : bool
        Whether it ended by a fault.
    margins : dict
        How far the ego stayed from breaking each rule, by the rules' names, and of each formula of the problem's own
        ("formula NAME"); what nothing could break is left out. Negative: broken. `DONE`: what the ego got done, rounds,
        then the share of the goals visited, then metres.
    cells : tuple of (Cell, int)
        The first breach of each rule by the ego, and its frame, in order of time.
    """

    discarded: bool
    faulty: bool
    margins: dict[str, float]
    cells: tuple[tuple[Cell, int], ...]


@dataclass(slots=True)
class Findings:
    """What came of some trials, in their order, and how often each cell was put to the test, (CELLS,)."""

    tried: list[Tried]
    exercised: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))


class Laboratory:
    """Runs the trials of a search.

    Parameters
    ----------
    controller : str or callable
        As `engine.batch.run_batch` takes it.
    cancelled : callable
        Is asked now and then whether to stop.

    Raises
    ------
    InputError
        If there is no such controller.
    """

    def __init__(self, controller: str | Maker, cancelled: Cancelled = lambda: False) -> None:
        self._name = controller if isinstance(controller, str) else "controller"
        self._make = (lambda: controllers.load(controller)) if isinstance(controller, str) else controller
        self.cancelled = cancelled
        self._fit = fitness()
        made = controllers.made(self._make)
        self._asked = 0
        self._shared = made if isinstance(made, BatchController) else None

    def attempt(self, instances: Sequence[Instance]) -> Findings:
        """Run the trials of instances.

        Raises
        ------
        KeyboardInterrupt
            When it is cancelled.
        """
        found: dict[int, Tried] = {}
        whole = Findings([])
        together = [own for own in instances if can_share(own)]
        compiled = [own for own in together if self._name == COMPILED and self._fit(own) and undisturbed(own)]
        fast = set(map(id, compiled))
        for own in grouped(compiled):
            group = Group(own, keeps_rules=True)
            group.finish(self.cancelled)
            self._check()
            self._take(group, range(len(own)), found, whole)
        for own in grouped([own for own in together if id(own) not in fast]):
            self._ask(own, found, whole)
        shared = set(map(id, together))
        for own in instances:
            if id(own) not in shared:
                self._check()
                found[id(own)] = self._alone(own, whole)
        whole.tried = [found[id(own)] for own in instances]
        return whole

    def _check(self) -> None:
        if self.cancelled():
            raise KeyboardInterrupt

    def _ask(self, instances: Sequence[Instance], found: dict[int, Tried], whole: Findings) -> None:
        """Run trials whose controllers are asked in every tick."""
        shared = self._shared
        if shared is not None:
            check_clear(instances)
        numbers = range(self._asked, self._asked + len(instances))
        self._asked = numbers.stop
        seats = Controlled(instances, self._make, shared, numbers=numbers)
        while len(seats.group.active):
            self._check()
            if shared is None:
                seats.ask_each()
            else:
                ask_all([seats], shared)
            for _ in seats.step(self._name):
                continue
        self._take(seats.group, range(len(instances)), found, whole)

    def _take(self, group: Group, trials: Sequence[int], found: dict[int, Tried], whole: Findings) -> None:
        """Take over what came of a group whose trials have all ended."""
        ego = group.world.tally.ego
        outcomes = group.outcomes(trials, self._name)
        frames = np.array([outcome.ending.ticks + 1 for outcome in outcomes])
        networks = [own.problem.network for own in group.instances]
        passages = find_passages(ego["lane"], ego["bits"], frames, networks)
        whole.exercised += passages.exercised(_crossing_degree(group.instances[0]))
        rate = group.instances[0].problem.rate
        for b, outcome in enumerate(outcomes):
            found[id(outcome.instance)] = tried_of(outcome.score, outcome.ending, passages, b, rate)

    def _alone(self, instance: Instance, whole: Findings) -> Tried:
        """Run a trial that can't be stepped with others."""
        ego = EgoTrace()
        driver = controllers.made(self._make)
        result = run_trial(instance, driver, sinks=[ego], name=self._name, sketch=False)
        passages = ego.passages()
        whole.exercised += passages.exercised(_crossing_degree(instance))
        return tried_of(result.score, result.ending, passages, 0, instance.problem.rate)


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


def tried_of(score: Score, ending: Ending | None, passages: Passages, trial: int, rate: float) -> Tried:
    """Return what a search keeps of a trial that has been judged: number `trial` of `passages`, at `rate` Hz."""
    verdict = score.verdict
    faulty = ending is not None and ending.end in FAULTS
    margins = {f"{FORMULA} {own.name}": -1.0 if own.verdict == "false" else 1.0 for own in score.formulas}
    margins[DONE] = score.counted_rounds + score.goals_visited + METRE * score.driven.distance_m
    if verdict is None:
        return Tried(False, faulty, margins, ())
    margins |= {rule: value for rule, value in verdict.robustness.items() if value is not None}
    own = [broken for broken in verdict.violations if broken.car == EGO_NAME and broken.rule in EGO_RULES]
    first = {broken.rule: broken.tick for broken in reversed(own)}
    for rule in first:
        margins[rule] = min(margins.get(rule, -0.0), BROKEN)
    if not verdict.assumption_broken:
        first |= {rule: round(time * rate) for rule, time in broken_formulas(score).items()}
    discarded = verdict.verdict is Ruling.EXCUSED or (not own and verdict.assumption_broken)
    ordered = sorted(first.items(), key=lambda item: (item[1], item[0]))
    cells = () if discarded else tuple((passages.cell(rule, trial, tick), tick) for rule, tick in ordered)
    return Tried(discarded, faulty, margins, cells)


def broken_formulas(score: Score) -> dict[str, float]:
    """Return the seconds at which the problem's own formulas became false, by what a search calls them."""
    false = [own for own in score.formulas if own.verdict == "false"]
    return {f"{FORMULA} {own.name}": own.time for own in false if own.time is not None}


def _crossing_degree(instance: Instance) -> int:
    return RuleParameters.from_mapping(instance.problem.rules).crossing_degree
