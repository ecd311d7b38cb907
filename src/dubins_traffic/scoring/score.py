"""The score of a trial: all its metrics, from one pass over its frames, live or from a record."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from dubins_traffic.cars.state import Frames
from dubins_traffic.controllers.registry import ran
from dubins_traffic.display import Pictured, Tabulated, count
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.header import bare_name
from dubins_traffic.record.reader import Record
from dubins_traffic.record.sink import BY_CONTROLLER, Ending
from dubins_traffic.record.wall import Wall
from dubins_traffic.scoring import registry
from dubins_traffic.scoring.blocks import joined
from dubins_traffic.scoring.collisions import Collision, collisions_of
from dubins_traffic.scoring.counts import early_rounds
from dubins_traffic.scoring.driving import Driven, driven_of
from dubins_traffic.scoring.findings import Findings
from dubins_traffic.scoring.formulas import FormulaVerdict, FormulaVerdicts
from dubins_traffic.scoring.goals import GoalVisits
from dubins_traffic.scoring.icra2016 import icra2016_of
from dubins_traffic.scoring.interventions import Interventions
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.metric import Measured, MetricSpec
from dubins_traffic.scoring.own_metrics import OwnMetrics
from dubins_traffic.scoring.paper import paper_score
from dubins_traffic.scoring.tracked import Tracked
from dubins_traffic.scoring.verdict import Ruling, Verdict, is_clean

_BLOCK = 512


@dataclass(frozen=True, slots=True)
class Score(Tabulated):
    """The score of one trial; one element of ``trials`` in ``run --json``.

    Attributes
    ----------
    trial, seed : int
        Number and seed of the trial.
    end : str or None
        Why the trial ended; None for a record that was cut off.
    controller, record : str or None
        Name of the ego's controller, beside which `to_json` says where it `ran`; path of the record.
    duration_s : float
        Simulated seconds up to the last frame.
    rounds : int
        Rounds counted by visits (`dubins_traffic.scoring.goals`); `goals_visited` is the share of the goals visited
        at least once, and `goals` tells visits and longest gap of each.
    counted_rounds : int
        The rounds by which controllers are ranked: `rounds` of a clean trial that ran its whole planned duration,
        else 0. Where the problem does not ask for the rules, a trial without a collision of the ego that its controller
        did not end is clean.
    rounds_before_breach : float
        The rounds by which controllers are ranked that have as many counted rounds: those of the visits after frame 0
        and up to the frame of the ego's first breach (a collision where the problem does not ask for the rules), with
        the share of the goals of the round begun; 0 if the controller ended the trial (docs/rules.md#before-breach).
    collisions : tuple of Collision
        Contacts of the ego, in order of time; `collisions_among_others` counts the rest.
    driven : Driven
        Distance, standing, time off the road, departures from the lane (`dubins_traffic.scoring.driving`).
    min_clearance_m : float or None
        Smallest gap to any other car or obstacle; None if there is none.
    time_to_begin_s : float or None
        Wall-clock seconds of the controller's `start`; None if not measured.
    verdict : Verdict or None
        The verdict by the rules of the road; None if the problem does not ask for them.
    formulas : tuple of FormulaVerdict
        The verdicts on the formulas that the problem carries beside its task.
    paper_score : float
        The score of the paper (`dubins_traffic.scoring.paper`).
    icra2016 : float or None
        The score of ICRA 2016 (`dubins_traffic.scoring.icra2016`); None where it is not defined.
    interventions : int
        Number of ticks in which a shield has stepped in (docs/shield.md).
    metrics : tuple of Measured
        The values of further metrics (docs/extending/metric.md).
    """

    trial: int
    seed: int
    end: str | None
    controller: str | None
    record: str | None
    duration_s: float
    rounds: int
    counted_rounds: int
    rounds_before_breach: float
    goals_visited: float
    goals: tuple[GoalVisits, ...]
    collisions: tuple[Collision, ...]
    collisions_among_others: int
    driven: Driven
    min_clearance_m: float | None
    time_to_begin_s: float | None
    verdict: Verdict | None
    formulas: tuple[FormulaVerdict, ...]
    paper_score: float
    icra2016: float | None
    interventions: int = 0
    metrics: tuple[Measured, ...] = ()

    def __repr__(self) -> str:
        return f"<Score: trial {self.trial} of seed {self.seed}, {self.summary}>"

    @property
    def summary(self) -> str:
        """The score in a few words: controller, end, verdict, rounds, collisions."""
        parts = [self.controller or "no controller named", f"end: {self.end or 'cut off'}"]
        if self.verdict is not None:
            parts.append(self.verdict.verdict.value)
        parts += [count(self.rounds, "round"), count(len(self.collisions), "collision")]
        return ", ".join(parts)

    @property
    def outcome(self) -> str:
        """The verdict in a word; the end if the trial is not judged, or its controller ended it before a breach."""
        return outcome(None if self.verdict is None else self.verdict.verdict, self.end)

    def asdict(self) -> dict[str, Any]:
        """Return the score as `to_json` does."""
        return self.to_json()

    def to_json(self) -> dict[str, Any]:
        """Return the score as a JSON object; the fields of `driven` stand beside the others."""
        document: dict[str, Any] = {}
        for name in self.__slots__:
            value = getattr(self, name)
            if name in ("collisions", "formulas"):
                document[name] = [part.to_json() for part in value]
            elif name == "controller":
                document |= {name: value, "ran": ran(value)}
            elif name == "goals":
                document[name] = [{**asdict(goal), "goal": list(goal.goal)} for goal in self.goals]
            elif name == "metrics":
                document |= {name: {part.column.name: part.value for part in value}} if value else {}
            elif name == "driven":
                document |= asdict(self.driven)
            elif name == "verdict":
                document[name] = None if self.verdict is None else self.verdict.to_json()
            else:
                document[name] = value
        return document


def score_of(findings: Findings, controller: str | None, time_to_begin: float | None) -> Score:
    """Return the score of a trial, whose ego `controller` drove, as far as its counts and its judge tell it."""
    instance, counts, ending, rate = findings.instance, findings.counts, findings.ending, findings.instance.problem.rate
    visits, driven = findings.visits, driven_of(counts, rate, findings.last)
    collisions, among_others = collisions_of(instance.names, findings.contacts)
    verdict = findings.verdict(visits, collisions)
    early, samples = findings.tally.early[findings.row], findings.tally.samples[findings.row]
    return Score(
        trial=instance.trial,
        seed=instance.seed,
        end=None if ending is None else ending.end.value,
        controller=None if controller is None else bare_name(controller),
        record=None,
        duration_s=max(0, findings.last) / rate,
        rounds=visits.rounds,
        counted_rounds=visits.rounds if is_clean(verdict, collisions, whole=findings.whole) else 0,
        rounds_before_breach=early_rounds(early, len(visits.goals), ending),
        goals_visited=visits.visited,
        goals=visits.goals,
        collisions=collisions,
        collisions_among_others=among_others,
        driven=driven,
        min_clearance_m=findings.gap,
        time_to_begin_s=time_to_begin,
        verdict=verdict,
        formulas=(),
        paper_score=paper_score(instance, collisions, visits.rounds, driven.off_road_s),
        icra2016=icra2016_of(instance, counts, samples.rounds, findings.last + 1),
    )


class Scorer:
    """A sink that computes all metrics of one trial.

    It collects frames into blocks of at least `_BLOCK` for the built-in metrics, which don't depend on how frames are
    cut. A copy of it goes on in a fork of its trial.

    Parameters
    ----------
    metrics : sequence of str or callable
        Further metrics, as `scoring.registry.load` takes them.
    """

    forks = True

    def __init__(self, metrics: Sequence[MetricSpec] = ()) -> None:
        self._own = OwnMetrics(registry.makers(metrics)) if metrics else None
        self._judging, self._tracked = Judging(), Tracked()
        self._formulas = FormulaVerdicts()
        self._interventions = Interventions()
        further = [] if self._own is None else [self._own]
        self._metrics = (self._judging, self._tracked, self._formulas, self._interventions, *further)

    def begin(self, instance: Instance) -> None:
        """Start all metrics."""
        self._count = 0
        self._shown = 0
        self._waiting: list[Frames] = []
        for metric in self._metrics:
            metric.begin(instance)

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._count += len(frames)
        self._waiting.append(frames)
        if self._count - self._shown >= _BLOCK:
            self._show()

    def end(self, ending: Ending) -> None:
        """End all metrics."""
        self._show()
        for metric in self._metrics:
            metric.end(ending)

    def result(
        self, *, controller: str | None = None, record: Path | str | None = None, wall: Wall | None = None
    ) -> Score:
        """Return the score up to the last frame.

        Parameters
        ----------
        controller : str, optional
            Name of the ego's controller; a path is left out, as in records.
        record : Path or str, optional
            Where the record is.
        wall : Wall, optional
            Wall-clock figures of the trial.
        """
        self._show()
        begin = None if wall is None else wall.time_to_begin_s
        findings = self._tracked.findings() or self._judging.findings()
        score = score_of(findings, controller, begin)
        verdict = self._tracked.told(score.verdict)
        if verdict is not None and verdict.verdict is Ruling.UNTOLD:
            score = replace(score, counted_rounds=0, rounds_before_breach=0.0)
        return replace(
            score,
            verdict=verdict,
            record=None if record is None else str(record),
            formulas=self._formulas.result(),
            interventions=self._interventions.result(),
            metrics=() if self._own is None else self._own.result(),
        )

    def _show(self) -> None:
        if self._waiting:
            block = joined(self._waiting)
            self._waiting = []
            self._shown = self._count
            for metric in self._metrics:
                metric.frames(block)


@dataclass(frozen=True, slots=True)
class ScoreSheet(Pictured, Tabulated):
    """The scores of several trials, in their order."""

    trials: tuple[Score, ...]

    def __repr__(self) -> str:
        return f"<ScoreSheet: {self.summary}>"

    @property
    def summary(self) -> str:
        """The scores in a few words: their number, and the number of each verdict, or, unjudged, of each end."""
        outcomes = Counter(trial.outcome for trial in self.trials)
        return ", ".join([count(len(self.trials), "trial"), *(f"{n} {name}" for name, n in sorted(outcomes.items()))])

    def asdict(self) -> dict[str, Any]:
        """Return the scores as `to_json` does."""
        return self.to_json()

    @property
    def ended_by_controller(self) -> int:
        """Number of trials that the controller ended (`record.sink.BY_CONTROLLER`); none of them is clean."""
        return sum(score.end in BY_CONTROLLER for score in self.trials)

    @property
    def cut(self) -> int:
        """Number of trials that others or the user ended before the ego broke anything: neither clean nor not."""
        return sum(score.verdict is not None and score.verdict.cut for score in self.trials)

    @property
    def counted_rounds_sum(self) -> int:
        """Sum of the rounds of all clean trials that ran their whole durations."""
        return sum(score.counted_rounds for score in self.trials)

    @property
    def paper_sum(self) -> float:
        """The final score of the paper: the sum over trials, correctly rounded."""
        return math.fsum(score.paper_score for score in self.trials)

    @property
    def icra2016_sum(self) -> float | None:
        """The final score of ICRA 2016: the sum over trials, correctly rounded; None if a trial has no such score."""
        scores = [score.icra2016 for score in self.trials if score.icra2016 is not None]
        return math.fsum(scores) if len(scores) == len(self.trials) else None

    @property
    def assumption_broken(self) -> tuple[int, int]:
        """Number of judged trials in which the e-agents broke the assumption, and of all judged trials."""
        broken = [score.verdict.assumption_broken for score in self.trials if score.verdict is not None]
        return sum(broken), len(broken)

    def to_json(self) -> dict[str, Any]:
        """Return what ``run --json`` and ``score --json`` print."""
        return {
            "trials": [score.to_json() for score in self.trials],
            "ended_by_controller": self.ended_by_controller,
            "cut": self.cut,
            "counted_rounds_sum": self.counted_rounds_sum,
            "paper_sum": self.paper_sum,
            "icra2016_sum": self.icra2016_sum,
        }


def outcome(verdict: str | None, end: str | None) -> str:
    """Return what became of a trial in a word, as `Score.outcome`."""
    if verdict is None or (verdict == Ruling.UNFINISHED and end in BY_CONTROLLER):
        return str(end or "cut off")
    return str(verdict)


def score(record: Record, metrics: Sequence[MetricSpec] = ()) -> Score:
    """Return the score of a record, which may be cut off; it equals that of a `Scorer` that saw the trial.

    `metrics` are further metrics, as for `Scorer`.
    """
    scorer = Scorer(metrics)
    scorer.begin(record.instance)
    scorer.frames(record.frames)
    if record.ending is not None:
        scorer.end(record.ending)
    return scorer.result(controller=record.controller, record=record.file, wall=record.wall)
