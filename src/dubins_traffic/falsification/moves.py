"""Small changes of what a search tries: of one choice, of where a car starts, of what one car does, of the goals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dubins_traffic.agents import choices, whims
from dubins_traffic.cars.state import EGO, Pose
from dubins_traffic.falsification.meetings import joined
from dubins_traffic.falsification.standing import far_off, span_of, started, starts_of

if TYPE_CHECKING:
    import numpy as np

    from dubins_traffic.falsification.genome import Genome
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.instance import Instance

OWN_CHOICE, OWN_START, JOINED, OTHERS_CAR = 0.55, 0.8, 0.9, 0.96
"""Up to which share of all changes a choice is changed, a start shifted, a car brought to the ego, a whole car taken
from elsewhere; of the rest the goals."""


def movable(configuration: Configuration) -> tuple[int, ...]:
    """Return the numbers of the cars whose starts a configuration leaves to chance; 0 is the ego."""
    ego = [EGO] if configuration.settings.ego.start == "drawn" else []
    drawn = [n for n, plan in enumerate(configuration.agents, start=1) if plan.start is None]
    return (*ego, *drawn)


def changed(
    genome: Genome, base: Instance, mate: tuple[Genome, Instance], cars: tuple[int, ...], dice: np.random.Generator
) -> Genome:  # fmt: skip
    """Return a genome with one thing changed; the same where the change that was drawn can't be made.

    Parameters
    ----------
    genome, base
        What is changed, and the instance of the number `genome.base`.
    mate
        The same of another, from which a car or the goals may be taken if it is on the same roads.
    cars
        The cars whose starts may be changed.
    dice
        What the change follows from.
    """
    kind = dice.random()
    other, others = mate
    alike = others.problem.network is base.problem.network and others.e_agents == base.e_agents
    chooses = bool(genome.choosing)
    if not cars and chooses:
        return _choosing(genome, base, dice)
    if OWN_CHOICE <= kind < OWN_START or not chooses:
        return _shifted(genome, base, cars, dice)
    if OWN_START <= kind < JOINED:
        return joined(genome, base, cars, dice)
    if kind < OWN_CHOICE or not alike:
        return _choosing(genome, base, dice)
    if kind < OTHERS_CAR:
        return _with_car(genome, base, other, others, cars, dice)
    starts = starts_of(genome, base)
    return replace(genome, base=other.base, starts={n: starts[n] for n in cars})


def _choosing(genome: Genome, base: Instance, dice: np.random.Generator) -> Genome:
    """Return a genome of which one choice of one car is changed, or one of its whims."""
    cars = genome.choosing
    car = cars[int(dice.integers(len(cars)))]
    if car in genome.whims:
        changed_whims = whims.mutated(dice, genome.whims[car], base.problem)
        return replace(genome, whims={**genome.whims, car: changed_whims})
    return replace(genome, tables={**genome.tables, car: choices.mutated(dice, genome.tables[car])})


def _shifted(genome: Genome, base: Instance, cars: tuple[int, ...], dice: np.random.Generator) -> Genome:
    """Return a genome of which one car starts elsewhere in its lane, as far from others as cars are drawn."""
    if not cars:
        return genome
    car = cars[int(dice.integers(len(cars)))]
    far = far_off(dice)
    starts = starts_of(genome, base)
    span = span_of(base, starts[car])
    if span is None:
        return genome
    back, ahead = span
    far = min(max(far, back), ahead)
    x, y, c, s = starts[car]
    starts[car] = Pose(x + far * c, y + far * s, c, s)
    return started(genome, base, starts, {car: starts[car]})


def _with_car(
    genome: Genome, base: Instance, other: Genome, others: Instance, cars: tuple[int, ...], dice: np.random.Generator
) -> Genome:  # fmt: skip
    """Return a genome of which one car starts where it does in another one, and chooses the same."""
    shared = sorted(set(genome.choosing) & set(other.choosing) & set(cars))
    if not shared:
        return genome
    car = shared[int(dice.integers(len(shared)))]
    starts = starts_of(genome, base)
    starts[car] = starts_of(other, others)[car]
    taken = (
        replace(genome, whims={**genome.whims, car: other.whims[car]})
        if car in genome.whims
        else replace(genome, tables={**genome.tables, car: other.tables[car]})
    )
    found = started(taken, base, starts, {car: starts[car]})
    return genome if found is taken else found
