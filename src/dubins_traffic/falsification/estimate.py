"""How often: the probability that an ego comes near to breaking a rule, or breaks it, with its confidence interval."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.campaign.report.statistics import (
    Interval,
    clopper_pearson,
    distributions,
    korn_graubard,
    wilson,
    worth,
)
from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.contract import TARGETS
from dubins_traffic.falsification.coverage import Counts
from dubins_traffic.falsification.sampling import STREAM, prepared
from dubins_traffic.falsification.splitting import Begin, Split, beginner, split
from dubins_traffic.falsification.trying import Runner, in_order, runner_of
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw_many

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


MONTE_CARLO: Final = "monte-carlo"
SPLITTING: Final = "splitting"
MOST_REPEATED: Final = 0.5


@dataclass(frozen=True, slots=True)
class Replicas:
    """What runs say together."""

    probability: float
    """The mean of their estimates."""
    interval: Interval
    """Its 95 % interval: Korn and Graubard's, from the spread of the estimates. If nothing was branched off, or no
    run got to the event, it is Clopper and Pearson's of the first trials of all runs, which are those of Monte
    Carlo. If most runs did not get there, it reaches around both, since the spread of few says little.
    """
    trials: int
    extinct: int
    """`trials`, `extinct`: how many trials ran; how many runs ended without the event."""
    repeated: float
    """The share of the branches that came to the same margin as their parents: nothing was left to chance for them."""
    worth: float | None
    """How many trials of Monte Carlo would have varied as much, p (1 - p) / variance; None if no run got there."""
    better: str
    """The method with the smaller variance from as many trials."""
    advice: tuple[str, ...] = ()
    """What a user should know of the runs, in sentences."""

    def to_json(self) -> dict[str, Any]:
        """Return what a JSON object of the estimate says beyond it."""
        return {
            "extinct": self.extinct, "repeated": self.repeated, "worth": self.worth, "better": self.better,
            "advice": list(self.advice),
        }  # fmt: skip


def combined(runs: Sequence[Split], particles: int) -> Replicas:
    """Return what at least two independent runs of so many particles say together."""
    probabilities = [run.probability for run in runs]
    mean = math.fsum(probabilities) / len(runs)
    trials, branches = sum(run.trials for run in runs), sum(run.branches for run in runs)
    extinct = sum(value == 0.0 for value in probabilities)
    counted = clopper_pearson(sum(run.counted for run in runs), len(runs) * particles)
    # Equal estimates show no spread, which says nothing of it: then Monte Carlo's trials have the word.
    flat = len(set(probabilities)) == 1
    interval = counted if branches == 0 or mean == 0.0 else (mean, mean) if flat else korn_graubard(probabilities)
    if 2 * extinct > len(runs) or flat:
        interval = min(interval[0], counted[0]), max(interval[1], counted[1])
    repeated = sum(run.repeated for run in runs) / branches if branches else 0.0
    equal = trials if branches == 0 or (flat and mean > 0.0) else worth(probabilities) if mean > 0.0 else None
    lost = equal is None or equal <= trials or 2 * extinct > len(runs)
    better = MONTE_CARLO if lost else SPLITTING
    replicas = Replicas(mean, interval, trials, extinct, repeated, equal, better)
    return replace(replicas, advice=_advice(replicas, len(runs), particles))


def _advice(replicas: Replicas, runs: int, particles: int) -> tuple[str, ...]:
    """Return what a user should know of runs, in sentences."""
    sentences: list[str] = []
    if replicas.extinct == runs:
        sentences.append(
            f"no run got there: that does not say that it can't happen, only that its probability is at most "
            f"{replicas.interval[1]:.2g} (95 %), by the first {runs * particles} trials"
        )
    elif replicas.extinct:
        wider = f"; the interval reaches around that of their first {runs * particles} trials"
        sentences.append(
            f"{replicas.extinct} of {runs} runs ended without the event{wider if 2 * replicas.extinct > runs else ''}"
        )
    if replicas.repeated > MOST_REPEATED:
        sentences.append(
            f"{replicas.repeated:.0%} of the trials that were branched off came to the margin of their parents: little "
            "is left to chance where they branch off"
        )
    if replicas.worth is None:
        bound = clopper_pearson(0, replicas.trials)[1]
        sentences.append(
            f"Monte Carlo is better here: {replicas.trials} trials without the event would bound it by {bound:.2g}"
        )
    elif replicas.better == MONTE_CARLO:
        sentences.append(
            f"Monte Carlo is better here: about {replicas.worth:.0f} trials of it vary as much as "
            f"these {replicas.trials}"
        )
    else:
        sentences.append(f"Monte Carlo would need about {replicas.worth:.0f} trials to vary as little")
    return tuple(sentences)


METHODS: Final = ("monte-carlo", "splitting")
RUNS: Final = 10
"""Independent runs of the splitting, from whose spread the interval follows."""
PARTICLES: Final = 200
BATCH: Final = 256
TOGETHER: Final = 2_000
"""About how many particles of several runs of the splitting are on their way at a time."""

Progress = Callable[[int], object]


@dataclass(frozen=True, slots=True)
class Probability:
    """The probability of an event."""

    method: str
    """``monte-carlo`` or ``splitting``."""
    event: str
    """What happens, in words."""
    probability: float
    """The estimate."""
    interval: Interval
    """Its 95 % interval: Clopper and Pearson's, or that of independent runs (`Replicas`)."""
    wilson: Interval | None
    """Wilson's interval, of Monte Carlo."""
    trials: int
    events: int | None
    discarded: int | None
    """`trials`, `events`, `discarded`: how many trials ran; of Monte Carlo, in how many the event happened, and how
    many were left out since the e-agents broke the assumption before the ego broke anything.
    """
    runs: tuple[float, ...] = ()
    """The estimates of the independent runs of splitting."""
    left_out: int = 0
    """Trials that ended by a fault before the event: they are no evidence, and all of Monte Carlo's figures are
    those of the others. If these are none, the probability is not a number.
    """
    fault: str = ""
    """How many trials ended by which fault, and why the first; empty if none did."""
    replicas: Replicas | None = None
    """What these runs say together, and whether Monte Carlo is better."""

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as a JSON object."""
        return {
            "method": self.method,
            "event": self.event,
            "probability": None if math.isnan(self.probability) else self.probability,
            "interval": list(self.interval),
            "wilson": None if self.wilson is None else list(self.wilson),
            "trials": self.trials,
            "events": self.events,
            "discarded": self.discarded,
            "runs": list(self.runs),
            "left_out": self.left_out,
            "fault": self.fault,
        } | ({} if self.replicas is None else self.replicas.to_json())


def estimate(
    configuration: Configuration | str | os.PathLike[str],
    controller: str | Maker = COMPILED,
    *,
    event: str = "1.collision",
    below: float = 0.0,
    method: str = "monte-carlo",
    trials: int | None = None,
    seed: int = 0,
    duration: float | None = None,
    particles: int = PARTICLES,
    runs: int = RUNS,
    workers: int = 1,
    progress: Progress | None = None,
) -> Probability:
    """Return the probability that the margin of a rule gets to `below` or less in a trial of a configuration.

    Parameters
    ----------
    configuration : Configuration, path or name
        What the trials are drawn from.
    controller : str or callable
        As `run_batch` takes it.
    event : str
        The rule, or ``1.goal``: the longest gap of a goal, seconds below its limit.
    below : float
        The margin (docs/scores.md); 0: the rule is broken.
    method : str
        ``monte-carlo``, or ``splitting`` for what is rare.
    trials : int, optional
        How many trials Monte Carlo runs; by default 10,000.
    seed : int
        What all follows from.
    duration : float, optional
        Seconds of a trial; by default as the configuration says.
    particles, runs : int
        Of the splitting: how many trials are on their way at a time, and how many independent runs there are.
    workers : int
        Processes that run the trials of Monte Carlo.
    progress : callable, optional
        Is told how many trials have run.

    Raises
    ------
    InputError
        If anything of this is wrong.
    MissingExtraError
        Without the extra `falsify`, which brings SciPy.
    """
    distributions("an estimate of a probability", "falsify")
    config = configuration if isinstance(configuration, Configuration) else load_config(configuration)
    if event not in TARGETS:
        expected = f"one of {', '.join(TARGETS)}"
        raise InputError("no rule of the ego's", file="--event", value=event, expected=expected)
    if method not in METHODS:
        raise InputError("no such method", file="--method", value=method, expected=f"one of {', '.join(METHODS)}")
    if not math.isfinite(below):
        raise InputError("not a margin", file="--below", value=below, expected="a finite number")
    config = prepared(config, duration, {})
    name = controller if isinstance(controller, str) else getattr(controller, "__name__", "controller")
    notify = progress or _silent
    if method == "splitting":
        begin = beginner(controller, event)
        return by_splitting(drawn(config, seed), begin, event, below, particles, runs, seed, notify)
    count = trials or 10_000
    with runner_of(controller, name, workers, None) as crew:
        return by_counting(draw_many(config, seed, range(count)), crew, event, below, notify)


def by_counting(
    instances: Iterable[Instance], crew: Runner, event: str, below: float, progress: Progress
) -> Probability:
    """Return what Monte Carlo gives on some trials; the parameters are those of `estimate`."""
    counts = Counts()
    happened = left_out = 0
    waiting: list[Instance] = []

    def run() -> None:
        nonlocal happened, left_out
        for number, tried in enumerate(in_order(crew.run(waiting)), counts.trials):
            met = not tried.discarded and tried.margins.get(event, np.inf) <= below
            happened += met
            left_out += tried.faulty and not met
            counts.discarded += tried.discarded and not tried.faulty
            counts.take_fault(number, tried.fault)
        counts.trials += len(waiting)
        waiting.clear()
        progress(counts.trials)

    for instance in instances:
        waiting.append(instance)
        if len(waiting) == BATCH:
            run()
    if waiting:
        run()
    known = counts.trials - left_out
    rest = (), left_out, counts.fault_notice()
    if not known:
        return Probability("monte-carlo", words(event, below), math.nan, (0.0, 1.0), None, counts.trials, 0, 0, *rest)
    return Probability(
        "monte-carlo", words(event, below), happened / known, clopper_pearson(happened, known),
        wilson(happened, known), counts.trials, happened, counts.discarded, *rest,
    )  # fmt: skip


def by_splitting(
    draw: Callable[[range], list[Instance]], begin: Begin, event: str, below: float, particles: int, runs: int,
    seed: int, progress: Progress,
) -> Probability:  # fmt: skip
    """Return what multilevel splitting gives; `draw` gives the instances of numbers, the rest is as of `estimate`."""
    for name, value, least in (("particles", particles, 10), ("runs", runs, 2)):
        if value < least:
            raise InputError("too few", field=name, value=value, expected=f"at least {least}")
    splits: list[Split] = []
    for first in range(0, runs, most := max(1, TOGETHER // particles)):
        some = range(first, min(first + most, runs))
        dice = [np.random.default_rng([STREAM, seed, run, 1]) for run in some]
        instances = draw(range(some.start * particles, some.stop * particles))
        before = sum(done.trials for done in splits)
        splits += split(instances, begin, below, dice, lambda done, before=before: progress(before + done))
    whole = combined(splits, particles)
    each = tuple(done.probability for done in splits)
    return Probability(
        "splitting", words(event, below), whole.probability, whole.interval, None, whole.trials, None, None, each,
        replicas=whole,
    )  # fmt: skip


def drawn(configuration: Configuration, seed: int) -> Callable[[range], list[Instance]]:
    """Return what draws the instances of numbers from a configuration, all of the longest duration that it allows."""

    def draw(numbers: range) -> list[Instance]:
        trials_drawn = list(draw_many(configuration, seed, numbers))
        longest = max(instance.duration for instance in trials_drawn)
        return [one if one.duration == longest else replace(one, duration=longest) for one in trials_drawn]

    return draw


def _silent(done: int) -> None:
    """Tell nobody."""


def words(event: str, below: float) -> str:
    """Return an event in words."""
    return f"{event} is broken" if below <= 0.0 else f"the margin of {event} gets to {below:g} or less"
