"""Where a search takes its instances from: a configuration, and choices of what its e-agents do within the law."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents import choices
from dubins_traffic.falsification import moves, whims
from dubins_traffic.falsification.contract import CAPRICIOUS
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw_many
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import parameters_of

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

CHOSEN: Final = "chosen"
"""The kind of e-agents that choose within the law (`agents.choices`)."""
DURATION: Final = 15.0
"""Seconds of a trial of a search, unless it is told otherwise."""
MOST_LEGS: Final = 12
ONE: Final = 0.6
"""Share of the trials that differ from their parent in one change only."""
STREAM: Final = 0xFA1
"""Apart from all other streams of random numbers that follow from the seed."""

WORD: Final = 0xFFFFFFFF
"""The largest number of 32 bits."""


class Stream(IntEnum):
    """What the random numbers of a trial of a search decide; what one stream decides says nothing of another."""

    CHOICES = 0
    """What the e-agents of a trial that is drawn choose."""
    CHANGES = 1
    """In what a child differs from its parent, and which cars are brought to the ego."""
    PARENTS = 2
    """Whether a trial is drawn or a child, and whose."""


def prepared(configuration: Configuration, duration: float | None, formulas: Mapping[str, str]) -> Configuration:
    """Return a configuration for a search: judged by the rules, of trials that collisions don't end.

    Parameters
    ----------
    configuration : Configuration
        What the user gave.
    duration : float or None
        Seconds of a trial; None: as the configuration says.
    formulas : mapping
        What is judged beside the task, by name.
    """
    document: dict[str, Any] = {**configuration.inlined(), "version": 1, "end_on_collision": False}
    if not configuration.settings.rules:
        document["rules"] = True
    if duration is not None:
        document["duration"] = duration
    document["formulas"] = dict(formulas)
    return Configuration.from_document(document, configuration.file)


class Source:
    """Makes and changes the instances of a search.

    Parameters
    ----------
    configuration : Configuration
        What they are drawn from, `prepared`.
    seed : int
        What all follows from.
    frees : bool
        Whether e-agents of the kind `lawful` that break nothing are to choose (`CHOSEN`).

    Attributes
    ----------
    seed : int
        As given.
    movable : tuple of int
        The numbers of the cars whose starts the configuration leaves to chance; 0 is the ego.
    """

    def __init__(self, configuration: Configuration, seed: int, *, frees: bool = True) -> None:
        self._configuration, self.seed, self._frees = configuration, seed, frees
        self._words = [STREAM, seed & WORD, seed >> 32] if seed > WORD else [STREAM, seed]
        self.movable = moves.movable(configuration)
        self._known: dict[int, Instance] = {}
        self._freed: tuple[tuple[EAgent, ...], tuple[EAgent, ...]] = (), ()
        """The e-agents of the last instance that was drawn, and what became of them."""

    def dice(self, number: int, stream: Stream) -> np.random.Generator:
        """Return the random numbers from which trial `number` of the search follows, of one of its streams."""
        words = [*self._words, number, stream] if stream else [*self._words, number]
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence(np.array(words, dtype=np.uint32))))

    def draw(self, numbers: Sequence[int]) -> list[Instance]:
        """Return the instances of the configuration with some numbers."""
        missing = sorted({number for number in numbers if number not in self._known})
        if missing:
            for instance in draw_many(self._configuration, self.seed, missing):
                self._known[instance.trial] = self._free(instance)
        return [self._known[number] for number in numbers]

    def _base(self, number: int) -> Instance:
        """Return the instance of the configuration with a number."""
        return self._known.get(number) or self.draw([number])[0]

    def _free(self, instance: Instance) -> Instance:
        """Return an instance whose e-agents may choose; those of several instances are often the same objects."""
        if not self._frees:
            return instance
        if instance.e_agents is not self._freed[0]:
            self._freed = instance.e_agents, tuple([_freed(agent) for agent in instance.e_agents])
        before, agents = self._freed
        return instance if agents == before else replace(instance, e_agents=agents)

    def forget(self, kept: set[int]) -> None:
        """Forget the instances that have none of the numbers `kept`."""
        self._known = {number: instance for number, instance in self._known.items() if number in kept}

    def fresh(self, number: int) -> Genome:
        """Return the genome of trial `number` of the configuration, with choices drawn for all cars that can choose.

        So are the whims of those that are free.
        """
        instance = self._base(number)
        dice, legs = self.dice(number, Stream.CHOICES), _legs(instance)
        share = float(dice.uniform(0.05, 0.5))
        tables = {car: choices.drawn(dice, legs, share) for car in free_cars(instance)}
        liked = {
            car: whims.drawn(dice, instance.problem)
            for car, agent in enumerate(instance.e_agents, start=1)
            if whims.searched(agent)
        }
        return Genome(number, number, {}, tables, liked)

    def varied(self, genome: Genome, mate: Genome, dice: np.random.Generator) -> Genome:
        """Return a genome with one thing changed, or a few; some are taken from another one, `mate`."""
        other = mate, self._base(mate.base)
        for _ in range(int(dice.geometric(ONE))):
            base = self._base(genome.base)
            genome = moves.changed(genome, base, other, self.movable, dice)
        return genome

    def arranged(self, number: int, dice: np.random.Generator) -> Genome:
        """Return the genome that `fresh` draws, with some of the cars brought to where they meet the ego soon."""
        genome = self.fresh(number)
        for _ in range(1 + int(dice.integers(len(self.movable) + 1))):
            genome = moves.joined(genome, self._base(number), self.movable, dice)
        return genome

    def build(self, genomes: Sequence[Genome]) -> list[Instance]:
        """Return the instances of genomes."""
        bases = self.draw([genome.base for genome in genomes])
        return [_built(base, genome) for base, genome in zip(bases, genomes, strict=True)]


def free_cars(instance: Instance) -> list[int]:
    """Return the numbers of the e-agents that may choose."""
    return [car for car, agent in enumerate(instance.e_agents, start=1) if agent.kind == CHOSEN]


def _freed(agent: EAgent) -> EAgent:
    if agent.kind != "lawful" or any(agent.parameters.get(name) for name in CAPRICIOUS):
        return agent
    shared = {name: agent.parameters[name] for name in ("goes", "cycle", "speed", "departs_after")}
    return EAgent(CHOSEN, agent.name, CHOSEN, parameters_of(CHOSEN, shared))


def _built(base: Instance, genome: Genome) -> Instance:
    """Return the instance of a genome, one of its own even where it changes nothing: trials are told apart by it."""
    if genome.tables or genome.starts:
        base = choices.with_choices(base, genome.tables, genome.starts or None)
    return whims.with_whims(base, genome.whims) if genome.whims else replace(base)


def _legs(instance: Instance) -> int:
    """Return how many lanes a car can see in a trial, about."""
    problem = instance.problem
    reach = problem.car.bounds.speed * instance.duration
    return min(MOST_LEGS, 2 + math.ceil(reach / float(problem.network.lengths.min())))
