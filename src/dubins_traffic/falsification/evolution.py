"""A search that changes what came near to a breach, and what met with something that hardly ever happens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.falsification.genome import Genome
from dubins_traffic.falsification.sampling import Source, Stream

if TYPE_CHECKING:
    import numpy as np

    from dubins_traffic.falsification.trying import Tried

FRESH: Final = 0.4
"""Share of proposals that are drawn at random."""
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
class Line:
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
        self._lines: dict[str, dict[int, Line]] = {target: {} for target in targets}
        self._given_up: dict[str, set[int]] = {target: set() for target in targets}
        self._worst: dict[str, int] = {}
        """The line of a target with the largest margin, where it is known."""
        self._idle = dict.fromkeys(targets, 0)
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
            if dice.random() >= FRESH:
                parent = self._parent(number, dice)
                if parent is not None:
                    parents[number] = parent
        kept = self._kept()
        self._source.forget({genome.base for genome in kept})
        self._source.draw([number for number in numbers if number not in parents])
        found: list[Genome] = []
        for number in numbers:
            parent, dice = parents.get(number), self._source.dice(number, Stream.CHANGES)
            if parent is None and dice.random() < ARRANGED:
                found.append(self._source.arranged(number, dice))
            elif parent is None:
                found.append(self._source.fresh(number))
            else:
                mate = kept[int(dice.integers(len(kept)))]
                found.append(self._source.varied(parent, mate, dice))
        return found

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
        for own in self._targets:
            nearer = self._take(own, genome, tried.margins.get(own))
            self._idle[own] = 0 if nearer else self._idle[own] + (own == target)
            if own == target and not nearer and root in self._lines[own]:
                line = self._lines[own][root]
                line.failed += 1
                if line.failed >= self._patience:
                    self._give_up(own, root)

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
        lines = [line.genome for own in self._lines.values() for line in own.values()]
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
                lines[root] = Line(margin, genome, 0 if nearer else line.failed)
                self._worst.pop(target, None)
            return nearer
        if len(lines) == self._most_lines:
            worst = self._worst.get(target)
            if worst is None:
                worst = self._worst[target] = max(lines, key=lambda own: (lines[own].margin, own))
            if margin >= lines[worst].margin:
                return False
            del lines[worst]
        lines[root] = Line(margin, genome)
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
                target: {str(root): line.to_json() for root, line in own.items()}
                for target, own in self._lines.items()
            },
            "given_up": {target: sorted(own) for target, own in self._given_up.items()},
            "idle": self._idle,
            "often": sorted(self._often.items()),
            "rare": [[situation, genome.to_json()] for situation, genome in self._rare.items()],
        }

    def restore(self, state: Any) -> None:
        """Take over what was kept."""
        for target, own in state["lines"].items():
            self._lines[target] = {
                int(root): Line(margin, Genome.from_json(genome), failed)
                for root, (margin, genome, failed) in own.items()
            }
        self._given_up = {target: set(own) for target, own in state["given_up"].items()}
        self._idle = dict(state["idle"])
        self._often = dict(state["often"])
        self._rare = {situation: Genome.from_json(genome) for situation, genome in state["rare"]}
