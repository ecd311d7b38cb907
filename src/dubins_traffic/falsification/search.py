"""The search for the worst case: propose, run, judge afresh, keep one case of each kind of failure."""

from __future__ import annotations

import hashlib
import json
import os
import time
from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import InputError
from dubins_traffic.falsification import archive as archives
from dubins_traffic.falsification.archive import Archive, Found, coverage_page
from dubins_traffic.falsification.case import Case, Story, case_in, judge
from dubins_traffic.falsification.contract import (
    BLOCKED,
    CONTRACT,
    PROVOKED,
    TARGETS,
    check_lawful,
    check_long_enough,
)
from dubins_traffic.falsification.coverage import Cell, Counts, Row, coverage, possible
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.sampling import DURATION, Source, prepared
from dubins_traffic.falsification.strategies import Strategy, make
from dubins_traffic.falsification.trying import DONE, FORMULA, Runner, Tried, name_of, runner_of
from dubins_traffic.logic.formula import propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.parse import parse
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.scoring.margins import LIVENESS
from dubins_traffic.scoring.verdict import EGO_RULES
from dubins_traffic.trial.interrupts import WHOLE, heard_between_frames

if TYPE_CHECKING:
    from dubins_traffic.scoring.score import Score


ASKED: Final = "asked"
"""The name by which a problem carries the formula that a search asks for."""
LOOKED_AT: Final = 8
"""As many trials are looked at to see whether what is asked for can be broken."""


def targets_of(rules: Sequence[str], formula: str | None, *, least_score: bool) -> tuple[str, ...]:
    """Return what is asked for, by the names of margins (`trying.Tried`); the parameters are those of `falsify`."""
    unknown = [rule for rule in rules if rule not in TARGETS]
    if unknown:
        expected = f"one of {', '.join(TARGETS)}"
        raise InputError("no rule of the ego's", file="--rule", value=unknown[0], expected=expected)
    if least_score:
        return (DONE,)
    if formula is not None:
        return (f"{FORMULA} {ASKED}",)
    return tuple(rules) or EGO_RULES


def check_targets(targets: Sequence[str], source: Source) -> None:
    """Refuse what no trial of a source can break."""
    if not {LIVENESS, *CONTRACT, f"{FORMULA} {ASKED}"}.intersection(targets):
        return
    instances = source.draw(range(LOOKED_AT))
    for target in {LIVENESS, BLOCKED}.intersection(targets):
        check_long_enough(instances, target)
    if PROVOKED in targets:
        check_lawful(instances)
    problem = instances[0].problem
    for name, text in problem.formulas.items():
        formula = parse(text)
        if not Monitors({name: formula}, propositions(formula), problem.period).breakable:
            raise InputError(
                "no trial of any length can break it", file="--formula", value=text,
                expected="a bound, as in []<>[0,60] ego_t_1_1; --rule 1.goal asks for the goals",
            )  # fmt: skip


MOST: Final = 5
"""So many trials are kept."""


@dataclass(order=True, slots=True)
class _Kept:
    done: float
    number: int
    genome: Genome = field(compare=False)


class Least:
    """The `MOST` trials of a search in which the ego got least done while all others kept the assumption."""

    def __init__(self) -> None:
        self._kept: list[_Kept] = []

    def take(self, number: int, genome: Genome, tried: Tried) -> None:
        """Take what came of a trial."""
        if tried.discarded or tried.faulty:
            return
        insort(self._kept, _Kept(tried.margins[DONE], number, genome))
        del self._kept[MOST:]

    def cases(self, source: Source, crew: Runner) -> dict[str, Case]:
        """Return the trials as cases, by name, judged afresh; without those whose assumption does not hold."""
        cases: dict[str, Case] = {}
        for instance in source.build([kept_case.genome for kept_case in self._kept]):
            judged = judge(instance, crew.make, crew.name)
            verdict = judged.score.verdict
            if verdict is None or verdict.assumption_broken:
                continue
            told = replace(_story(judged.score, crew.name), tick=judged.record.instance.ticks)
            cases[f"{DONE}-{len(cases) + 1}"] = Case(judged.record.instance, told)
        return cases

    def state(self) -> Any:
        """Return what a search that is resumed needs, for JSON."""
        return [[kept_case.done, kept_case.number, kept_case.genome.to_json()] for kept_case in self._kept]

    def restore(self, state: Any) -> None:
        """Take over what `state` gave."""
        self._kept = [_Kept(done, number, Genome.from_json(document)) for done, number, document in state]


def _story(score: Score, name: str) -> Story:
    done = f"{score.counted_rounds} counted rounds, {score.goals_visited:.0%} of the goals"
    told = f"In {score.duration_s:g} s the ego got done {done} and {score.driven.distance_m:.1f} m."
    return Story(DONE, "driving", 0, name, score.duration_s, 0, told)


GENERATION: Final = 128
"""Most trials that are proposed at a time, whoever runs them, unless a search is told otherwise."""
SMALL: Final = 32
SHARE: Final = 8
"""A generation is no more than one of so many parts of the trials before it, or `SMALL`."""
TRIALS: Final = 10_000
SAVE: Final = 20.0
"""Seconds after which a search writes down where it goes on."""

Progress = Callable[["Search"], object]


class Search:
    """A search under way.

    Parameters
    ----------
    archive : Archive
        Its folder.
    settings : JSON
        What tells it from others.
    source : Source
        Where the instances come from.
    strategy : Strategy
        What is tried next.
    targets : sequence of str
        The rules, and formulas, that are asked for.
    crew : Runner
        Who runs the trials.
    progress : callable, optional
        Is told of it whenever trials are finished.
    most : int
        How many trials are proposed at a time.

    Attributes
    ----------
    finished : int
        How many trials are finished: those that are counted, and of the generation under way those that are kept.
    found_in : dict of str to int
        For each case, by the name of its cell, the number of the trial in which it was found, from 0.
    """

    def __init__(
        self,
        archive: Archive,
        settings: Any,
        source: Source,
        strategy: Strategy,
        targets: Sequence[str],
        crew: Runner,
        progress: Progress | None = None,
        most: int = GENERATION,
    ) -> None:
        self.archive, self.counts, self.most = archive, Counts(), most
        self._settings, self._source, self._strategy = settings, source, strategy
        self._targets, self._crew, self._progress = tuple(targets), crew, progress
        self._expected: set[int] = set()
        self.found_in: dict[str, int] = {}
        self._least = Least()
        state = archive.state()
        if state is not None:
            self._restore(state)
        self.finished = self.counts.trials

    def generation(self, most: int) -> bool:
        """Try the next trials, at most `most`; whatever interrupts it, they are taken over whole or not at all.

        It returns whether there were any: False where the strategy proposes nothing any more.
        """
        first = self.counts.trials
        size = min(self.most, max(SMALL, first // SHARE // SMALL * SMALL))
        numbers = range(first, first + min(size, most))
        genomes = self._strategy.propose(numbers)
        numbers = numbers[: len(genomes)]
        instances = self._source.build(genomes)
        tried = self._tried(numbers, genomes, instances)
        fresh, unconfirmed = self._judged(numbers, instances, tried)
        with WHOLE:
            self._take_all(numbers, genomes, instances, tried)
            self.counts.unconfirmed += unconfirmed
            for cell, (number, case) in fresh.items():
                self.archive.keep(cell, case)
                self.found_in[cell] = number
            self.archive.journal.taken()
        self._tell()
        return bool(genomes)

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(self)

    def _tried(self, numbers: range, genomes: Sequence[Genome], instances: Sequence[Instance]) -> list[Tried]:
        """Return what comes of trials; those that are in the journal are not run again, the others go there."""
        journal = self.archive.journal
        count = len(numbers)
        known = map(journal.known, numbers, genomes)
        tried = {k: kept for k, kept in enumerate(known) if kept is not None}
        left = [k for k in range(count) if k not in tried]
        self.finished = self.counts.trials + len(tried)
        for part in self._crew.run([instances[k] for k in left]):
            with WHOLE:
                came = {left[k]: result for k, result in part.items()}
                journal.keep((numbers[k], genomes[k], result) for k, result in came.items())
                tried |= came
                self.finished += len(part)
            if len(tried) < count:
                self._tell()
        return [tried[k] for k in range(count)]

    def _take_all(
        self, numbers: range, genomes: Sequence[Genome], instances: Sequence[Instance], tried: Sequence[Tried]
    ) -> None:
        """Count the trials of a generation, and tell the strategy of them."""
        places = {id(instance.problem.network): instance for instance in instances}
        self._expected.update(cell.number for cell in possible(places.values()))
        for number, genome, outcome in zip(numbers, genomes, tried, strict=True):
            self._least.take(number, genome, outcome)
            self.counts.take_fault(number, outcome.fault)
            self._strategy.tell(number, genome, outcome, self._count(outcome))
        self.counts.trials += len(numbers)

    def _count(self, tried: Tried) -> bool:
        """Count a trial; tell whether it broke a rule."""
        counts, wanted = self.counts, self._wanted(tried)
        counts.discarded += tried.discarded
        broken = any(cell.rule in self._targets for cell in wanted)
        counts.violated += broken
        np.add.at(counts.exercised, np.array(tried.exercised, dtype=np.int64), 1)
        for cell in wanted:
            if cell.number >= 0:
                counts.broken[cell.number] += 1
        return broken

    def _wanted(self, tried: Tried) -> list[Cell]:
        """Return what a trial shows of what is asked for, and of ends that the ego's controller brought about."""
        return [cell for cell, _ in tried.cells if cell.rule in self._targets or cell.rule in BY_CONTROLLER]

    def _judged(
        self, numbers: range, instances: Sequence[Instance], tried: Sequence[Tried]
    ) -> tuple[dict[str, tuple[int, Case]], int]:
        """Judge the failures of new kinds afresh; return those that stand with their trials, and how many don't."""
        fresh: dict[str, tuple[int, Case]] = {}
        unconfirmed = 0
        for number, instance, outcome in zip(numbers, instances, tried, strict=True):
            for cell in self._wanted(outcome):
                if cell.name in self.archive.cases or cell.name in fresh:
                    continue
                case = case_in(instance, cell, self._crew.make, self._crew.name)
                if case is None:
                    unconfirmed += 1
                else:
                    fresh[cell.name] = number, case
        return fresh, unconfirmed

    def result(self) -> Found:
        """Return what has been found so far."""
        counts = self.counts
        return Found(
            self.archive.folder, dict(sorted(self.archive.cases.items())), counts.trials, counts.discarded,
            counts.faulty, counts.violated, self.coverage(), counts.fault_notice(),
        )  # fmt: skip

    def coverage(self) -> list[Row]:
        """Return which rule, manoeuvre and crossing have been put to the test."""
        expected = [Cell.of(number) for number in self._expected]
        rows = coverage(expected, self.counts.exercised, self.counts.broken)
        asked = set(self._targets).intersection(EGO_RULES) or EGO_RULES
        return [row for row in rows if row.cell.rule in asked]

    def save(self) -> None:
        """Write down what has been found, and where the search goes on."""
        if DONE in self._targets:
            for name, case in self._least.cases(self._source, self._crew).items():
                self.archive.keep(name, case)
        covered = self.coverage()
        rows = [row.to_json() for row in covered]
        cases = {name: case.story.sentence for name, case in sorted(self.archive.cases.items())}
        numbers = dict(sorted(self.found_in.items()))
        report = {
            "settings": self._settings, **self.counts.to_json(), "cases": cases, "found_in": numbers, "coverage": rows,
        }  # fmt: skip
        self.archive.write(archives.REPORT, report)
        counts = self.counts.to_json()
        page = coverage_page(self._settings, counts, covered, self.archive.cases, self.found_in)
        self.archive.tell(page)
        state = {
            "settings": self._settings,
            "counts": self.counts.to_json(),
            "exercised": self.counts.exercised.tolist(),
            "broken": self.counts.broken.tolist(),
            "expected": sorted(self._expected),
            "found_in": numbers,
            "strategy": self._strategy.state(),
            "least": self._least.state() if DONE in self._targets else [],
        }
        self.archive.remember(state)
        self.archive.journal.settle(self.counts.trials)

    def _restore(self, state: Any) -> None:
        self.counts = Counts(**state["counts"])
        self.counts.exercised += np.array(state["exercised"], dtype=np.int64)
        self.counts.broken += np.array(state["broken"], dtype=np.int64)
        self._expected = set(state["expected"])
        self.found_in = dict(state["found_in"])
        self._strategy.restore(state["strategy"])
        self._least.restore(state["least"])
        self.archive.forget_but(self.found_in)


def falsify(
    configuration: Configuration | str | os.PathLike[str],
    controller: str | Maker | Remote = COMPILED,
    folder: str | os.PathLike[str] = "falsified",
    *,
    rules: Sequence[str] = (),
    formula: str | None = None,
    least_score: bool = False,
    trials: int | None = None,
    seconds: float | None = None,
    seed: int = 0,
    strategy: str = "evolution",
    duration: float | None = DURATION,
    workers: int = 1,
    ray: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    most: int = GENERATION,
) -> Found:
    """Search for trials in which an ego breaks the rules while all others keep the assumption.

    The e-agents of the kind `lawful` choose what the law leaves free to them (kind `chosen`): exits, speeds, when to
    go. The search looks for choices with which the ego breaks a rule; each failure is cut to its breach, written as an
    instance and a record, judged afresh, and kept if it stands: one for each rule,
    manoeuvre and degree of the crossing.

    Parameters
    ----------
    configuration : Configuration, path or name
        What the instances are drawn from.
    controller : str, callable or Remote
        As `run_batch` takes it, or a program elsewhere (`falsification.remote.Remote`).
    folder : path
        What is found is kept here; made if missing.
    rules : sequence of str
        The rules that are asked for, such as ``3.clear``; by default all that a trial of any length can break.
        ``1.goal`` asks for goals that are not visited for longer than ``gap_rounds`` free-flow rounds, ``blocked`` for
        no visit at all for so long before anybody has broken a rule, ``provoked`` for a first breach by a lawful car.
    formula : str, optional
        A formula of one's own that is asked for instead, one that a finite trial can break.
    least_score : bool
        Whether the trials in which the ego gets least done are looked for instead.
    trials : int, optional
        How many trials are run; by default 10,000, or as many as `seconds` allow.
    seconds : float, optional
        After so many seconds the search ends, with the generation that it is in.
    seed : int
        What all follows from: the same seed and number of trials give the same files, byte for byte.
    strategy : str
        ``evolution``, ``uniform``, or ``cma``, which needs the extra `falsify`; or a class of one's own
        (`plugged.Sampler`), ``module:Class`` or ``path/to/file.py:Class``.
    duration : float or None
        Seconds of a trial; None: as the configuration says.
    workers : int
        Processes that run the trials; more than one need a controller given by name.
    ray : str, optional
        Run on a Ray cluster instead: its address, or ``local`` for one of `workers` processors on this machine.
    resume : bool
        Whether to go on with what has been begun in `folder`.
    progress : callable, optional
        Is told whenever trials are finished: of a slow controller's one by one (`Search.finished`).
    most : int
        How many trials are proposed at a time. A controller in Python is asked in all of them together, so more are
        quicker; what is found in them guides the search only afterwards.

    Raises
    ------
    InputError
        If anything of this is wrong, or the folder holds something else.
    KeyboardInterrupt
        On Ctrl-C; what has been found is kept, and no trial that is finished is run again by `resume`.
    """
    if most < 1:
        raise InputError("not so many trials", file="falsify", field="most", value=most, expected="at least 1")
    if seconds is not None and not seconds >= 0.0:
        raise InputError("not a time", file="--seconds", value=seconds, expected="a number >= 0")
    own = configuration if isinstance(configuration, Configuration) else load_config(configuration)
    targets = targets_of(rules, formula, least_score=least_score)
    own = prepared(own, duration, {} if formula is None else {ASKED: formula})
    name = name_of(controller)
    if trials is None and seconds is None:
        trials = TRIALS
    settings = {
        "configuration": hashlib.sha256(json.dumps(own.to_document(), sort_keys=True).encode()).hexdigest(),
        "controller": name, "targets": list(targets), "seed": seed, "strategy": strategy,
    } | ({} if most == GENERATION else {"most": most})  # fmt: skip
    source = Source(own, seed, frees=PROVOKED not in targets)
    check_targets(targets, source)
    proposing = make(strategy, source, targets)
    with (
        archives.opened(Path(folder), settings, resume=resume) as archive,
        runner_of(controller, name, workers, ray) as crew,
        heard_between_frames(),
    ):
        search = Search(archive, settings, source, proposing, targets, crew, progress, most)
        if archive.state() is None:
            search.save()
        try:
            _run(search, trials, seconds)
        finally:
            search.save()
        return search.result()


def _run(search: Search, trials: int | None, seconds: float | None) -> None:
    """Run generations until there have been enough trials, or time is up."""
    began = saved = time.monotonic()
    while (trials is None or search.counts.trials < trials) and (seconds is None or time.monotonic() - began < seconds):
        if not search.generation(search.most if trials is None else trials - search.counts.trials):
            return
        if time.monotonic() - saved > SAVE:
            search.save()
            saved = time.monotonic()
