"""Where a search takes its instances from: a configuration, and choices of what its e-agents do within the law."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents import choices
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
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
CAPRICIOUS: Final = ("rolls", "left", "blocks", "tailgates", "parks")
"""Parameters by which a car that keeps the law breaks it; one that has any of them stays as it is."""
STREAM: Final = 0xFA1
"""Apart from all other streams of random numbers that follow from the seed."""


def prepared(
    configuration: Configuration, duration: float | None, formulas: Mapping[str, str]
) -> Configuration:
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
    document: dict[str, Any] = {**configuration.to_document(), "version": 1, "end_on_collision": False}
    if configuration.network is not None:
        document["rnd"] = configuration.network.to_document()
    if not configuration.settings.rules:
        document["rules"] = True
    if duration is not None:
        document["duration"] = duration
    document["formulas"] = dict(formulas)
    return Configuration.from_document(document, configuration.file)


@dataclass(frozen=True, slots=True)
class Genome:
    """What an instance of a search is made of.

    Attributes
    ----------
    base : int
        Number of the trial whose network, goals and cars it has.
    starts : mapping of int to Pose
        Other starts of some of its cars, by the cars' numbers.
    tables : mapping of int to (K, 7) float64
        What each e-agent chooses (`agents.choices`), by the cars' numbers.
    """

    base: int
    starts: Mapping[int, Pose] = field(default_factory=dict[int, Pose])
    tables: Mapping[int, Floats] = field(default_factory=dict[int, Floats])

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, from which `from_json` makes an equal one."""
        return {
            "base": self.base,
            "starts": {str(car): list(pose) for car, pose in self.starts.items()},
            "tables": {str(car): [len(table), choices.to_rows(table)] for car, table in self.tables.items()},
        }

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> Genome:
        """Return the genome of a JSON object."""
        tables: dict[int, Floats] = {}
        for car, (legs, rows) in document["tables"].items():
            table = choices.empty(legs)
            known = choices.from_rows(rows)
            table[: len(known)] = known
            tables[int(car)] = table
        starts = {int(car): Pose(*pose) for car, pose in document["starts"].items()}
        return Genome(document["base"], starts, tables)


class Source:
    """Makes and changes the instances of a search.

    Parameters
    ----------
    configuration : Configuration
        What they are drawn from, `prepared`.
    seed : int
        What all follows from.
    """

    def __init__(self, configuration: Configuration, seed: int) -> None:
        self._configuration, self._seed = configuration, seed
        self._known: dict[int, Instance] = {}

    def dice(self, number: int) -> np.random.Generator:
        """Return the random numbers from which trial `number` of the search follows."""
        return np.random.default_rng([STREAM, self._seed, number])

    def draw(self, numbers: Sequence[int]) -> list[Instance]:
        """Return the instances of the configuration with some numbers."""
        missing = sorted({number for number in numbers if number not in self._known})
        for instance in draw_many(self._configuration, self._seed, missing):
            self._known[instance.trial] = freed(instance)
        return [self._known[number] for number in numbers]

    def forget(self, kept: set[int]) -> None:
        """Forget the instances that have none of the numbers `kept`."""
        self._known = {number: own for number, own in self._known.items() if number in kept}

    def fresh(self, number: int) -> Genome:
        """Return the genome of trial `number` of the configuration, with choices drawn for all cars that can choose."""
        instance = self.draw([number])[0]
        dice, legs = self.dice(number), _legs(instance)
        share = float(dice.uniform(0.05, 0.5))
        return Genome(number, {}, {car: choices.drawn(dice, legs, share) for car in free_cars(instance)})

    def varied(self, genome: Genome, dice: np.random.Generator) -> Genome:
        """Return a genome with one thing changed, or a few."""
        tables = dict(genome.tables)
        if not tables:
            return genome
        cars = sorted(tables)
        for _ in range(1 + int(dice.geometric(0.6))):
            car = cars[int(dice.integers(len(cars)))]
            tables[car] = choices.mutated(dice, tables[car])
        return replace(genome, tables=tables)

    def build(self, genomes: Sequence[Genome]) -> list[Instance]:
        """Return the instances of genomes."""
        bases = self.draw([genome.base for genome in genomes])
        return [_built(base, genome) for base, genome in zip(bases, genomes, strict=True)]


def freed(instance: Instance) -> Instance:
    """Return an instance whose e-agents may choose, those that keep the law; nothing is chosen yet."""
    agents = tuple([_freed(agent) for agent in instance.e_agents])
    return instance if agents == instance.e_agents else replace(instance, e_agents=agents)


def free_cars(instance: Instance) -> list[int]:
    """Return the numbers of the e-agents that may choose."""
    return [car for car, agent in enumerate(instance.e_agents, start=1) if agent.kind == CHOSEN]


def _freed(agent: EAgent) -> EAgent:
    if agent.kind != "lawful" or any(agent.parameters.get(name) for name in CAPRICIOUS):
        return agent
    shared = {name: agent.parameters[name] for name in ("goes", "cycle", "speed", "departs_after")}
    return EAgent(CHOSEN, agent.name, CHOSEN, parameters_of(CHOSEN, shared))


def _built(base: Instance, genome: Genome) -> Instance:
    if not genome.tables and not genome.starts:
        return base
    return choices.with_choices(base, genome.tables, genome.starts or None)


def _legs(instance: Instance) -> int:
    """Return how many lanes a car can see in a trial, about."""
    problem = instance.problem
    reach = problem.car.bounds.speed * instance.duration
    return min(MOST_LEGS, 2 + math.ceil(reach / float(problem.network.lengths.min())))
