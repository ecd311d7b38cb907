"""Adaptive multilevel splitting: the probability of a rare event from trials that go on where others came near it.

Particles are trials. The score of a particle is the least level that it has had, and levels look ahead: they are low
where the event is about to happen. At every step the particles of the highest scores are given up, and each is replaced
by a survivor that goes on from where it passed their score with another seed. The share of the particles in which the
event happened in the end, times the product of the shares that survived, estimates its probability.

With N particles, K_q of them given up at step q of Q, and Y the share of the last ones in which the event happened,

    (1)  p = (1 - K_1 / N) ... (1 - K_Q / N) Y

estimates the probability. Levels that are quantiles of the scores, and (1) for K_q the same at every step, are those of
F. Cérou, A. Guyader, *Adaptive multilevel splitting for rare event analysis*, Stochastic Analysis and Applications 25,
2007. That (1) has no bias, for any N, any level function and scores with ties, is the theorem of C.-E. Bréhier, M.
Gazeau, L. Goudenège, T. Lelièvre, M. Rousset, *Unbiasedness of some generalized adaptive multilevel splitting
algorithms*, Annals of Applied Probability 26, 2016, for trials in discrete time, on two conditions: with Z_q the level
of step q and S(k) the score up to checkpoint k,

    (2)  all particles of score S >= Z_q are given up, and none else;
    (3)  a survivor is branched off at the first checkpoint k with S(k) < Z_q.

It holds for the mean of any function of the path (their expectation (2)), here "the least margin is at most `below`".
So the levels decide on the variance only, and need not say when the event has happened. As in the splitting of fixed
effort (M. J. J. Garvels, *The splitting method in rare event simulation*, thesis, Twente, 2000) the number of particles
stays the same.

A particle that is replaced is run again from its beginning with the seeds of its ancestors, up to where it branches
off: the same bits as those of a fork there, at any number of checkpoints and without keeping them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

import numpy as np

from dubins_traffic.engine.controlled import Maker
from dubins_traffic.engine.egos import Egos, Way, can_share, grouped
from dubins_traffic.engine.group import Group
from dubins_traffic.errors import ControllerError, InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.record.sink import FAULTS

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


CHECKPOINTS: Final = 40
"""At so many times of a trial, about, its level is looked at, and a survivor can be branched off."""
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

    def levels(self) -> Floats:
        """Return how near each trial is to the event at its present frame, or was before, (B,): at most its margin."""
        ...

    def fork(self, trials: Sequence[int]) -> Company:
        """Return independent copies of some trials at their present frames."""
        ...

    def reseed(self, seeds: Sequence[int]) -> None:
        """Let each trial go on from another seed."""
        ...


Begin = Callable[[Sequence["Instance"]], Company]


@dataclass(frozen=True, slots=True)
class Particle:
    """A trial: which of the first particles it begins as, and from which checkpoint on it follows from which seed."""

    first: int
    seeds: tuple[tuple[int, int], ...]

    def branched(self, checkpoint: int, seed: int) -> Particle:
        """Return the particle that goes on from another seed at a checkpoint."""
        before = [drawn for drawn in self.seeds if drawn[0] < checkpoint]
        return Particle(self.first, (*before, (checkpoint, seed)))

    def seed_at(self, checkpoint: int) -> int:
        """Return the seed from which it follows after a checkpoint."""
        return [seed for first, seed in self.seeds if first <= checkpoint][-1]


class Paths(NamedTuple):
    """What came of particles: the least level up to each checkpoint, (B, checkpoints); the least margin, (B,)."""

    scores: Floats
    margins: Floats


@dataclass(frozen=True, slots=True)
class Split:
    """What one run of the algorithm gives."""

    probability: float
    """The estimate."""
    trials: int
    """How many trials it took."""
    counted: int
    """In how many of the first particles, which are independent trials, the event happened."""
    branches: int
    repeated: int
    """`branches`, `repeated`: how many particles were branched off; how many of them came to the margin of their
    parents, to the bit: nothing was left to chance where they branched off.
    """
    levels: tuple[float, ...]
    """The scores at which particles were given up."""


class Run:
    """One run of the algorithm on its way.

    Parameters
    ----------
    below : float
        The margin that is rare.
    dice : Generator
        Draws survivors and seeds.
    """

    def __init__(self, particles: list[Particle], paths: Paths, below: float, dice: np.random.Generator) -> None:
        self._particles, self._paths, self._below, self._dice = particles, paths, below, dice
        self._counted = int((paths.margins <= below).sum())
        self._most = max(1, round(GIVEN_UP * len(particles)))
        self._survived = 1.0
        self._branches = self._repeated = 0
        self._levels: list[float] = []
        self._lost = self._parents = np.empty(0, dtype=np.int64)
        self._children: list[Particle] = []

    def children(self) -> list[Particle]:
        """Give up the particles of the highest scores; return those that replace them, none when the run is over."""
        reached = self._paths.scores[:, -1]
        level = float(np.sort(reached)[-self._most])
        if self._survived == 0.0 or level <= self._below or len(self._levels) == MOST_STEPS:
            return []
        self._lost, kept = np.flatnonzero(reached >= level), np.flatnonzero(reached < level)
        self._levels.append(level)
        self._survived *= len(kept) / len(reached)
        if not len(kept):
            return []
        self._parents = kept[self._dice.integers(len(kept), size=len(self._lost))]
        parents: list[int] = self._parents.tolist()
        passed: list[int] = np.argmax(self._paths.scores[self._parents] < level, axis=1).tolist()
        seeds: list[int] = self._dice.integers(0, 1 << 63, size=len(self._lost)).tolist()
        drawn = zip(parents, passed, seeds, strict=True)
        self._children = [self._particles[parent].branched(point, seed) for parent, point, seed in drawn]
        return self._children

    def replace(self, followed: Paths) -> None:
        """Put the children in the places of what was given up; `followed` is what came of them."""
        self._branches += len(self._lost)
        self._repeated += int((followed.margins == self._paths.margins[self._parents]).sum())
        self._paths.scores[self._lost], self._paths.margins[self._lost] = followed
        for place, child in zip(self._lost.tolist(), self._children, strict=True):
            self._particles[place] = child

    def result(self) -> Split:
        """Return what the run gives."""
        happened = float(np.mean(self._paths.margins <= self._below))
        trials = len(self._particles) + self._branches
        return Split(
            self._survived * happened, trials, self._counted, self._branches, self._repeated,
            tuple(self._levels),
        )  # fmt: skip


def split(
    instances: Sequence[Instance],
    begin: Begin,
    below: float,
    dice: Sequence[np.random.Generator],
    progress: Callable[[int], object] = int,
) -> list[Split]:
    """Return independent estimates of the probability that a trial's least margin gets to `below` or less.

    The runs take their steps together, so that fewer and larger groups of trials are stepped.

    Parameters
    ----------
    instances : sequence of Instance
        The first particles of all runs, one run's after another's: independent draws of what a trial may be, of one
        duration.
    begin : callable
        Begins trials of instances.
    below : float
        The margin that is rare.
    dice : sequence of Generator
        For each run what draws its survivors and seeds.
    progress : callable
        Is told how many trials have run.
    """
    company, ticks, seeds = begin(instances), instances[0].ticks, [instance.seed for instance in instances]
    every, each = max(1, ticks // CHECKPOINTS), len(instances) // len(dice)
    first = [Particle(k, ((0, seed),)) for k, seed in enumerate(seeds)]
    paths = follow(first, company, seeds, every, ticks)
    runs: list[Run] = []
    for k, generator in enumerate(dice):
        mine = slice(k * each, (k + 1) * each)
        runs.append(Run(first[mine], Paths(paths.scores[mine], paths.margins[mine]), below, generator))
    done = len(first)
    going = [(run, branches) for run in runs if (branches := run.children())]
    while going:
        progress(done)
        children = [child for _, some in going for child in some]
        paths = follow(children, company, seeds, every, ticks)
        end = 0
        for run, some in going:
            begun, end = end, end + len(some)
            run.replace(Paths(paths.scores[begun:end], paths.margins[begun:end]))
        done += len(children)
        going = [(run, branches) for run, _ in going if (branches := run.children())]
    progress(done)
    return [run.result() for run in runs]


def follow(particles: Sequence[Particle], company: Company, seeds: Sequence[int], every: int, ticks: int) -> Paths:
    """Run particles from their first frames, in which the first particles (`company`, of `seeds`) stay.

    Checkpoint 0 is the first frame, and there is one every `every` ticks, the last at the end.
    """
    running = company.fork([particle.first for particle in particles])
    levels = [running.levels()]
    present = [seeds[particle.first] for particle in particles]
    done = checkpoint = 0
    while done < ticks:
        wanted = [particle.seed_at(checkpoint) for particle in particles]
        if wanted != present:
            running.reseed(wanted)
            present = wanted
        step = min(every, ticks - done)
        running.advance(step)
        done += step
        checkpoint += 1
        levels.append(running.levels())
    return Paths(np.minimum.accumulate(np.stack(levels, axis=1), axis=1), running.margins())


COLUMNS: Final = {"1.road": "road", "2.left": "line", "2.return": "back", "2.turn": "turn"}
ENTRIES: Final = {"3.stop": "stop", "3.order": "order", "3.clear": "clear"}
MEASURED: Final = ("1.collision", *COLUMNS, *ENTRIES)
"""The rules whose margins can be watched while a trial runs."""
AHEAD: Final = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Seconds by which a level looks ahead."""
HASTE: Final = 0.05
"""Metres by which a gap counts as wider for each second until then."""


class MeasuredGroup:
    """A group of trials and the least margin of one rule that each has had.

    Parameters
    ----------
    rule : str
        One of `MEASURED`.
    """

    def __init__(self, group: Group, rule: str) -> None:
        self.group, self.rule = group, rule

    def margins(self) -> Floats:
        """Return the least margin of each trial up to its present frame, (B,); infinite where nothing was near."""
        world = self.group.world
        if self.rule == "1.collision":
            return np.maximum(world.tally.trial["clearance"], 0.0)
        if self.rule in ENTRIES:
            entries: Any = world.breach_log.entry[ENTRIES[self.rule]]
            return entries * (1.0 if self.rule == "3.clear" else self.group.instances[0].problem.period)
        margins: Any = self.group.margins(np.arange(len(self.group.instances)))[COLUMNS[self.rule]]
        return margins.copy()

    def levels(self) -> Floats:
        """Return how near each trial is to a breach, or was, (B,): its margin, of `1.collision` the one to come too."""
        margins = self.margins()
        return margins if self.rule != "1.collision" else np.minimum(margins, coming(self.group))

    def advance(self, ticks: int) -> None:
        """Take all trials some ticks farther.

        ControllerError if one of them ends by a fault: then there is no estimate.
        """
        self.group.drive(ticks)
        for instance, ending in zip(self.group.instances, self.group.endings, strict=True):
            if ending is not None and ending.end in FAULTS:
                raise ControllerError(ending.end.value, f"{instance.title} ended by a fault ({ending})")

    def fork(self, trials: Sequence[int]) -> MeasuredGroup:
        """Return independent copies of some trials, each with a copy of its controller."""
        return MeasuredGroup(self.group.fork(trials), self.rule)

    def reseed(self, seeds: Sequence[int]) -> None:
        """Let each trial go on from another seed."""
        self.group = self.group.reseeded(seeds)


def coming(group: Group) -> Floats:
    """Return the clearance to come of each trial's ego, (B,): infinite where it is alone.

    It is the least, over the next `AHEAD` seconds at present speeds and headings, of the gap between the discs around
    the ego and another car, and of `HASTE` metres for each second until then: what is far off counts as less near.
    """
    state, reach = group.state, group.world.cars.reach
    x, y = (array[:, 1:] - array[:, :1] for array in (state.x, state.y))
    vx, vy = (velocity[:, 1:] - velocity[:, :1] for velocity in (state.speed * state.c, state.speed * state.s))
    places: int = state.x.shape[1]
    absent = np.arange(1, places) >= state.count[:, None]
    least = np.full(len(x), np.inf)
    for later in AHEAD:
        dx, dy = x + later * vx, y + later * vy
        gap = np.sqrt(dx * dx + dy * dy) - 2.0 * reach[:, None]
        gap[absent] = np.inf
        least = np.minimum(least, np.maximum(gap, 0.0).min(axis=1, initial=np.inf) + HASTE * later)
    return least


def beginner(controller: str | Maker, rule: str) -> Begin:
    """Return what begins trials of instances whose egos a controller drives."""
    if rule not in MEASURED:
        expected = f"one of {', '.join(MEASURED)}"
        raise InputError("has no margin that can be watched", file="--event", value=rule, expected=expected)
    egos = Egos(controller, apart=True)

    def begin(instances: Sequence[Instance]) -> MeasuredGroup:
        ways = egos.ways(instances)
        if not all(map(can_share, instances)) or len(grouped(instances)) != 1:
            raise InputError(
                "trials that can't be stepped together", field="e-agents", value=instances[0].problem.e_agents,
                expected="the embedded simulator, no formulas, no cars of one's own or elsewhere, disturbances of the "
                "ego alone, one control rate",
            )  # fmt: skip
        way = Way.COMPILED if len(ways[Way.COMPILED]) == len(instances) else Way.ASKED
        return MeasuredGroup(egos.group(instances, way), rule)

    return begin
