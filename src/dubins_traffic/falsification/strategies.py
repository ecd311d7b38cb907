"""How a search proposes what to try next: at random, by evolution, by CMA-ES (extra ``falsify``), or as a user says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from dubins_traffic.errors import InputError, needs
from dubins_traffic.falsification.cube import Cube
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.falsification.plugged import Plugged
from dubins_traffic.falsification.sampling import Source, Stream
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.outside import is_place
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    import numpy as np

    from dubins_traffic.falsification.trying import Tried


FRESH: Final = 0.4
"""Share of proposals that are drawn at random."""
CROWDED: Final = 0.7
"""The same of a search for many things where there are no more crossings than cars. Everybody meets everybody there, so
a trial drawn anew comes as near to a breach as a child of another, and shows more that is new."""
ARRANGED: Final = 0.7
"""In so many of these some cars are brought to the ego (`sampling.Source.arranged`)."""
LINES: Final = {"one": 4, "many": 16}
"""Most lines of descent that are followed for each target, where there is one and where there are many."""
PATIENCE: Final = {"one": 64, "many": 16}
"""After so many children of which none came nearer a line of descent is given up."""
PRESSURE: Final = 2.0
"""The larger, the more often the best are taken as parents."""
IDLE: Final = 96
"""A target for which so many trials in a row brought nothing is followed only in a `SELDOM` share of its turns."""
SELDOM: Final = 0.25
CLOSER: Final = 0.98
"""A trial comes nearer to a breach if its margin is less than this share of its parent's."""
TURNS: Final = 4
"""At most one of so many trials is for rare situations, however few targets there are."""
RARE: Final = 48
"""Most situations for which the last trial in which they occurred is kept: the rarest."""


@dataclass(slots=True)
class Descent:
    """The best of the trials that descend from one that was drawn: its margin, genome, and how many children failed."""

    margin: float
    genome: Genome
    failed: int = 0

    def to_json(self) -> list[Any]:
        """Return it as JSON."""
        return [self.margin, self.genome.to_json(), self.failed]


class Evolution:
    """Changes the choices of trials that came nearest to a breach of a rule, and of trials in rare situations.

    Trial n has turn n modulo the number of targets and one: each target has a turn, and rare situations have one.
    Trials that descend from the same one that was drawn are one line of descent (`Genome.root`); of each line the best
    is kept, of each target the `LINES` best lines. A line that gets no nearer for `PATIENCE` children is given up, so
    that others have their turn. Situations are what the ego met with on its way (`passages.Passages.situations`): of
    each that is rare its last trial is kept.
    """

    def __init__(self, source: Source, targets: Sequence[str]) -> None:
        self._source, self._targets = source, tuple(targets)
        count = "one" if len(self._targets) == 1 else "many"
        self._most_lines, self._patience = LINES[count], PATIENCE[count]
        self._lines: dict[str, dict[int, Descent]] = {target: {} for target in targets}
        self._given_up: dict[str, set[int]] = {target: set() for target in targets}
        self._worst: dict[str, int] = {}
        """The line of a target with the largest margin, where it is known."""
        self._idle = dict.fromkeys(targets, 0)
        self._fresh = CROWDED if len(targets) > 1 and _is_crowded(source) else FRESH
        self._often: dict[int, int] = {}
        self._rare: dict[int, Genome] = {}
        self._parents: dict[int, tuple[str, int]] = {}
        self._ranked: dict[str, list[int]] = {}
        self._rarest: list[int] = []

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return new genomes, and children of those kept."""
        self._parents.clear()
        self._rank_all()
        parents: dict[int, Genome] = {}
        for number in numbers:
            dice = self._source.dice(number, Stream.PARENTS)
            if dice.random() >= self._fresh:
                parent = self._parent(number, dice)
                if parent is not None:
                    parents[number] = parent
        kept = self._kept()
        self._source.forget({genome.base for genome in kept})
        self._source.draw([number for number in numbers if number not in parents])
        proposed: list[Genome] = []
        for number in numbers:
            parent, dice = parents.get(number), self._source.dice(number, Stream.CHANGES)
            if parent is None and dice.random() < ARRANGED:
                proposed.append(self._source.arranged(number, dice))
            elif parent is None:
                proposed.append(self._source.fresh(number))
            else:
                mate = kept[int(dice.integers(len(kept)))]
                proposed.append(self._source.varied(parent, mate, dice))
        return proposed

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Keep a trial for the targets to which it came near, and for the situations in it that are rare."""
        target, root = self._parents.get(number, ("", -1))
        if known:
            if target:
                self._give_up(target, root)
            return
        if tried.discarded or tried.faulty:
            return
        for situation in tried.situations:
            self._often[situation] = self._often.get(situation, 0) + 1
            self._rare[situation] = genome
        if len(self._rare) > 2 * RARE:
            rarest = sorted(self._rare, key=self._rank)[:RARE]
            self._rare = {situation: self._rare[situation] for situation in rarest}
        for each in self._targets:
            nearer = self._take(each, genome, tried.margins.get(each))
            self._idle[each] = 0 if nearer else self._idle[each] + (each == target)
            if each == target and not nearer and root in self._lines[each]:
                line = self._lines[each][root]
                line.failed += 1
                if line.failed >= self._patience:
                    self._give_up(each, root)

    def _rank(self, situation: int) -> tuple[int, int]:
        return self._often[situation], situation

    def _rank_all(self) -> None:
        """Put the lines of each target in order, the nearest first, and the situations, the rarest first."""
        self._ranked = {
            target: sorted(lines, key=lambda root: (lines[root].margin, root))  # used at once
            for target, lines in self._lines.items()
        }
        self._rarest = sorted(self._rare, key=self._rank)[:RARE]

    def _parent(self, number: int, dice: np.random.Generator) -> Genome | None:
        """Return whose child a trial is to be, None if it is to be drawn."""
        turn = number % max(len(self._targets) + 1, TURNS)
        if turn < TURNS - 1 or turn < len(self._targets):
            target = self._targets[turn % len(self._targets)]
            lines = self._lines[target]
            if lines and (self._idle[target] < IDLE or dice.random() < SELDOM):
                ranked = self._ranked[target]
                root = ranked[int(len(ranked) * dice.random() ** PRESSURE)]
                self._parents[number] = target, root
                return lines[root].genome
        ranked = self._rarest
        return self._rare[ranked[int(len(ranked) * dice.random() ** PRESSURE)]] if ranked else None

    def _kept(self) -> list[Genome]:
        lines = [line.genome for family in self._lines.values() for line in family.values()]
        return [*lines, *self._rare.values()]

    def _take(self, target: str, genome: Genome, margin: float | None) -> bool:
        """Keep a trial if it is the best of its line; tell whether it came nearer to a breach."""
        lines, root = self._lines[target], genome.root
        if margin is None or margin < 0.0 or root in self._given_up[target]:
            return False
        line = lines.get(root)
        if line is not None:
            nearer = margin < CLOSER * line.margin
            if margin <= line.margin:
                lines[root] = Descent(margin, genome, 0 if nearer else line.failed)
                self._worst.pop(target, None)
            return nearer
        if len(lines) == self._most_lines:
            worst = self._worst.get(target)
            if worst is None:
                worst = self._worst[target] = max(lines, key=lambda each: (lines[each].margin, each))
            if margin >= lines[worst].margin:
                return False
            del lines[worst]
        lines[root] = Descent(margin, genome)
        self._worst.pop(target, None)
        return True

    def _give_up(self, target: str, root: int) -> None:
        self._lines[target].pop(root, None)
        self._worst.pop(target, None)
        self._given_up[target].add(root)

    def state(self) -> Any:
        """Return all that is kept."""
        return {
            "lines": {
                target: {str(root): line.to_json() for root, line in family.items()}
                for target, family in self._lines.items()
            },
            "given_up": {target: sorted(roots) for target, roots in self._given_up.items()},
            "idle": self._idle,
            "often": sorted(self._often.items()),
            "rare": [[situation, genome.to_json()] for situation, genome in self._rare.items()],
        }

    def restore(self, state: Any) -> None:
        """Take over what was kept."""
        for target, written in state["lines"].items():
            self._lines[target] = {
                int(root): Descent(margin, Genome.from_json(genome), failed)
                for root, (margin, genome, failed) in written.items()
            }
        self._given_up = {target: set(roots) for target, roots in state["given_up"].items()}
        self._idle = dict(state["idle"])
        self._often = dict(state["often"])
        self._rare = {situation: Genome.from_json(genome) for situation, genome in state["rare"]}


def _is_crowded(source: Source) -> bool:
    """Tell whether a search is on a network with no more crossings than cars."""
    instance = source.draw([0])[0]
    least = RuleParameters.from_mapping(instance.problem.rules).crossing_degree
    return int((instance.problem.network.degrees >= least).sum()) <= len(instance.starts)


STEP: Final = 0.3
"""Standard deviation of the first proposals, in shares of the ranges."""
AWAY: Final = 1e6
"""Stands for the margin of a trial that could not come near the rule."""


class Cma:
    """Proposes tables for one drawn trial by CMA-ES; a generation is about one target, the next about the next.

    It begins anew, with another drawn trial, where it has converged or found a failure.

    Source: N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772. MissingExtraError without the extra
    `falsify`.
    """

    def __init__(self, source: Source, targets: Sequence[str]) -> None:
        with needs("--strategy cma", "falsify"):
            self._cma: Any = import_module("cma")
        self._source, self._targets = source, tuple(targets)
        self._climbs: dict[str, _Climb] = {}
        self._past: list[tuple[int, int, list[float | None]]] = []
        self._numbers: list[int] = []
        self._values: list[float | None] = []

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return the next proposals for one target."""
        self._numbers, self._values = list(numbers), []
        target = self._target()
        if target not in self._climbs:
            self._climbs[target] = _Climb(self._cma, self._source, numbers[0])
        self._source.forget({climb.base for climb in self._climbs.values()})
        return self._climbs[target].ask(len(numbers))

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:  # noqa: ARG002  # as all strategies
        """Learn what came of a proposal; after the last one of a generation the target's proposals move."""
        margin = None if tried.discarded or tried.faulty else tried.margins.get(self._target(), AWAY)
        self._hear(margin if margin is None or np.isfinite(margin) else AWAY)

    def state(self) -> Any:
        """Return all that was told, from which `restore` goes the same way again."""
        return [[first, count, values] for first, count, values in self._past]

    def restore(self, state: Any) -> None:
        """Go the way again that led to a state."""
        for first, count, values in state:
            self.propose(range(first, first + count))
            for value in values:
                self._hear(value)

    def _hear(self, value: float | None) -> None:
        self._values.append(value)
        if len(self._values) < len(self._numbers):
            return
        self._past.append((self._numbers[0], len(self._numbers), self._values))
        target = self._past_target()
        if self._climbs[target].tell(self._values):
            del self._climbs[target]

    def _target(self) -> str:
        return self._targets[len(self._past) % len(self._targets)]

    def _past_target(self) -> str:
        return self._targets[(len(self._past) - 1) % len(self._targets)]


class _Climb:
    """One run of CMA-ES, on the tables of the cars of the drawn trial `base`."""

    def __init__(self, cma: Any, source: Source, base: int) -> None:
        self.base, self._cube = base, Cube(source, base)
        dice = source.dice(base, Stream.CHOICES)

        def normal(*shape: int) -> Floats:
            return dice.standard_normal(shape)

        options = {"bounds": [0.0, 1.0], "verbose": -9, "seed": np.nan, "randn": normal}
        self._strategy = cma.CMAEvolutionStrategy(max(2, self._cube.size) * [0.5], STEP, options)
        self._asked: list[Floats] = []

    def ask(self, count: int) -> list[Genome]:
        """Return proposals."""
        self._asked = self._strategy.ask(count)
        return [self._cube.genome(np.asarray(point)) for point in self._asked]

    def tell(self, values: Sequence[float | None]) -> bool:
        """Move to where the values are least; tell whether it is over."""
        known = [AWAY if value is None else value for value in values]
        if min(known) < 0.0 or len(known) < self._strategy.popsize:
            return min(known) < 0.0
        self._strategy.tell(self._asked, known)
        return bool(self._strategy.stop())


class Strategy(Protocol):
    """Proposes genomes, and is told what came of them."""

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return the genomes of the trials with these numbers, which follow one another."""
        ...

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Learn what came of a trial; `known`: the ego broke a rule, in a way that the archive has already."""
        ...

    def state(self) -> Any:
        """Return what a search that is resumed needs to go on as if it had never stopped, for JSON."""
        ...

    def restore(self, state: Any) -> None:
        """Take over what `state` gave."""
        ...


class Uniform:
    """Draws every trial anew."""

    def __init__(self, source: Source, targets: Sequence[str]) -> None:  # noqa: ARG002  # as all strategies
        self._source = source

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return new genomes."""
        self._source.forget(set())
        self._source.draw(numbers)
        return [self._source.fresh(number) for number in numbers]

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Nothing is learnt."""

    def state(self) -> Any:
        """Return nothing."""
        return None

    def restore(self, state: Any) -> None:
        """Nothing is to be restored."""


STRATEGIES: Final[Mapping[str, Callable[[Source, Sequence[str]], Strategy]]] = {
    "uniform": Uniform,
    "evolution": Evolution,
    "cma": Cma,
}


def make(name: str, source: Source, targets: Sequence[str]) -> Strategy:
    """Return the strategy that a name stands for, or the class of a user's own at a place."""
    if is_place(name):
        return Plugged(name, source, targets)
    if name not in STRATEGIES:
        expected = f"one of {', '.join(STRATEGIES)}, module:Class or path/to/file.py:Class"
        raise InputError("no such strategy", file="--strategy", value=name, expected=expected)
    return STRATEGIES[name](source, targets)
