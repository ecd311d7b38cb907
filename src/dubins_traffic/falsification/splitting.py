"""Adaptive multilevel splitting: the probability of a rare event from trials that go on where others came near it.

Particles are trials. The level of a particle is the least margin that it has had; at every step those of the largest
margins are given up, and each is replaced by a survivor that goes on from where it passed their level with another
seed.
The product of the shares that survived estimates the probability, without bias (C.-E. Bréhier, M. Gazeau, L.
Goudenège, T. Lelièvre, M. Rousset, Annals of Applied Probability 26, 2016, for processes in discrete time).

A particle that is replaced is run again from its beginning with the seeds of its ancestors, up to where it branches
off: the same bits as those of a fork there, at any number of checkpoints and without keeping them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

CHECKPOINTS: Final = 40
"""At so many times of a trial, about, a survivor can be branched off."""
GIVEN_UP: Final = 0.2
"""Share of the particles that is replaced at each step, at least."""
MOST_STEPS: Final = 1_000


class Company(Protocol):
    """Trials under way, of which each can go on from another seed."""

    def advance(self, ticks: int) -> None:
        """Take all trials some ticks farther."""
        ...

    def margins(self) -> Floats:
        """Return the least margin that each trial has had, (B,)."""
        ...

    def reseeded(self, seeds: Sequence[int]) -> Company:
        """Return forks of all trials that go on from these seeds."""
        ...


Begin = Callable[[Sequence["Instance"]], Company]


@dataclass(frozen=True, slots=True)
class Particle:
    """A trial: the instance, and from which checkpoint on it follows from which seed, in order, the first from 0."""

    instance: Instance
    seeds: tuple[tuple[int, int], ...]

    def branched(self, checkpoint: int, seed: int) -> Particle:
        """Return the particle that goes on from another seed at a checkpoint."""
        before = [own for own in self.seeds if own[0] < checkpoint]
        return Particle(self.instance, (*before, (checkpoint, seed)))

    def seed_at(self, checkpoint: int) -> int:
        """Return the seed from which it follows after a checkpoint."""
        return [seed for first, seed in self.seeds if first <= checkpoint][-1]


@dataclass(frozen=True, slots=True)
class Split:
    """What one run of the algorithm gives: the estimate, how many trials it took, the margins passed."""

    probability: float
    trials: int
    levels: tuple[float, ...]


def split(
    instances: Sequence[Instance], begin: Begin, below: float, ticks: int, dice: np.random.Generator
) -> Split:
    """Return an estimate of the probability that a trial's least margin gets to `below` or less.

    Parameters
    ----------
    instances : sequence of Instance
        The first particles, independent draws of what a trial may be.
    begin : callable
        Begins trials of instances.
    below : float
        The margin that is rare.
    ticks : int
        Ticks of a trial.
    dice : Generator
        Draws survivors and seeds.
    """
    every = max(1, ticks // CHECKPOINTS)
    particles = [Particle(own, ((0, own.seed),)) for own in instances]
    paths = follow(particles, begin, every, ticks)
    count, most = len(particles), max(1, round(GIVEN_UP * len(particles)))
    probability, trials = 1.0, count
    levels: list[float] = []
    for _ in range(MOST_STEPS):
        reached = paths[:, -1]
        level = float(np.sort(reached)[-most])
        if level <= below:
            break
        lost = np.flatnonzero(reached >= level)
        kept = np.flatnonzero(reached < level)
        levels.append(level)
        probability *= len(kept) / count
        if not len(kept):
            break
        _replace(particles, paths, lost, kept, level, (begin, every, ticks), dice)
        trials += len(lost)
    return Split(probability * float(np.mean(paths[:, -1] <= below)), trials, tuple(levels))


def _replace(
    particles: list[Particle],
    paths: Floats,
    lost: Ints,
    kept: Ints,
    level: float,
    how: tuple[Begin, int, int],
    dice: np.random.Generator,
) -> None:
    """Let survivors that are drawn go on in the place of what is lost."""
    parents: list[int] = kept[dice.integers(len(kept), size=len(lost))].tolist()
    seeds: list[int] = dice.integers(0, 1 << 63, size=len(lost)).tolist()
    children: list[Particle] = []
    for parent, seed in zip(parents, seeds, strict=True):
        checkpoint = int(np.flatnonzero(paths[parent] < level)[0])
        children.append(particles[parent].branched(checkpoint, seed))
    paths[lost] = follow(children, *how)
    for place, child in zip(lost.tolist(), children, strict=True):
        particles[place] = child


def follow(particles: Sequence[Particle], begin: Begin, every: int, ticks: int) -> Floats:
    """Run particles; return the least margin that each has had at every checkpoint, (B, checkpoints).

    Checkpoint 0 is the first frame, and there is one every `every` ticks, the last at the end.
    """
    company = begin([own.instance for own in particles])
    found = [company.margins()]
    present = [own.instance.seed for own in particles]
    done = checkpoint = 0
    while done < ticks:
        wanted = [own.seed_at(checkpoint) for own in particles]
        if wanted != present:
            company, present = company.reseeded(wanted), wanted
        step = min(every, ticks - done)
        company.advance(step)
        done += step
        checkpoint += 1
        found.append(company.margins())
    return np.stack(found, axis=1)
