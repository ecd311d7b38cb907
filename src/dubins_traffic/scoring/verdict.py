"""The verdict (docs/rules.md#verdicts): whether the ego kept the rules of the road, or others broke them before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.cars.state import EGO
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.rules import breach_log
from dubins_traffic.rules.clauses import clause
from dubins_traffic.rules.exceptions import Exceptions
from dubins_traffic.rules.parameters import EDITION, RuleParameters
from dubins_traffic.rules.tables import ticks
from dubins_traffic.scoring.collisions import Collision
from dubins_traffic.scoring.counts import planned_ticks
from dubins_traffic.scoring.formulas import Status
from dubins_traffic.scoring.goals import Visits

if TYPE_CHECKING:
    from dubins_traffic.rules.referee import Breach, Pending

EGO_NAME = "ego"
"""Name of the ego among the cars."""
EGO_RULES = tuple(rule for rule in breach_log.RULES if not rule.startswith("E"))
"""The rules of the ego that a finite run can break."""
HELD: Final[Status] = "presumably true"
PENDING: Final[Status] = "presumably false"
BROKEN: Final[Status] = "false"
"""Verdicts on formulas that no finite run can make true."""
ASSUMPTIONS = ("E1", "E2", "E3", "E4", "E5", "E6")
_SWITCHES = tuple((name, f"assume_{name.lower()}") for name in ASSUMPTIONS)


class Ruling(StrEnum):
    """The ruling on a trial (docs/rules.md#verdicts)."""

    SATISFIED = "satisfied"
    VIOLATED = "violated"
    EXCUSED = "excused"
    UNFINISHED = "unfinished"
    UNTOLD = "untold"


OF_SIMULATED = tuple(ruling for ruling in Ruling if ruling is not Ruling.UNTOLD)
"""The rulings on simulated trials: only those of worlds outside can be untold."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a rule was broken: a point in metres and, if it is about one, an intersection or a directed segment."""

    x: float
    y: float
    intersection: tuple[float, float] | None
    segment: tuple[float, float, float, float] | None

    def to_json(self) -> dict[str, Any]:
        """Return the place as a JSON object."""
        return {
            "x": self.x,
            "y": self.y,
            "intersection": None if self.intersection is None else list(self.intersection),
            "segment": None if self.segment is None else list(self.segment),
        }


@dataclass(frozen=True, slots=True)
class Violation:
    """A breach of `rule` by `car` (its name) at `time` seconds, frame `tick`; what led to it began at `since` s."""

    rule: str
    car: str
    time: float
    tick: int
    since: float
    where: Place

    @property
    def clause(self) -> str:
        """The clause of docs/rules.md that states the rule, as ``docs/rules.md#3.stop``."""
        return clause(self.rule)

    def to_json(self) -> dict[str, Any]:
        """Return the breach as a JSON object: rule, car, time, since, where."""
        return {
            "rule": self.rule,
            "car": self.car,
            "time": self.time,
            "since": self.since,
            "where": self.where.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Excuse:
    """What excuses the ego: the first breach of the assumption, and the part of it that was broken (`assumption`).

    `sensed` tells whether that car was within the sensing radius at some frame of the last `witness_time` before the
    ego's first breach.
    """

    assumption: str
    violation: Violation
    sensed: bool

    @property
    def clause(self) -> str:
        """The clause of docs/rules.md that states this part of the assumption, as ``docs/rules.md#E3``."""
        return clause(self.assumption)

    def to_json(self) -> dict[str, Any]:
        """Return the excuse as a JSON object."""
        return {"assumption": self.assumption, **self.violation.to_json(), "sensed": self.sensed}


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on one trial.

    Attributes
    ----------
    verdict : Ruling
        Satisfied, violated, excused or unfinished; of a world outside perhaps untold.
    clean : bool
        Whether the ego broke nothing in the whole planned duration, whatever others did.
    cut : bool
        Whether the ego had broken nothing when others or the user ended the trial: it is neither clean nor not.
    excuse : Excuse or None
        The excuse of an excused trial.
    near : bool or None
        Of an excused trial: whether before each breach of the ego, by at most `witness_time`, there was a breach by an
        e-agent within the sensing radius. It does not enter any ranking.
    violations : tuple of Violation
        Every breach of every car, in order of time.
    collisions : tuple of Collision
        The ego's, with the fault as found here.
    rounds : int
        Rounds of visits; `longest_gap_s` is the longest gap between visits of a goal and `gap_limit_s` the longest that
        `satisfied` allows (both None without goals).
    recurrent : bool
        Whether every goal was visited at least twice after frame 0.
    formulas : dict
        The verdict on each formula so far, in four values.
    robustness : dict
        Margins of rules 1 and 2, metres (`dubins_traffic.scoring.margins`).
    tolerance : float or None
        Of a world outside: how far any point of a car may be from where it was seen, metres.
    """

    verdict: Ruling
    clean: bool
    cut: bool
    excuse: Excuse | None
    near: bool | None
    violations: tuple[Violation, ...]
    collisions: tuple[Collision, ...]
    rounds: int
    longest_gap_s: float | None
    gap_limit_s: float | None
    recurrent: bool
    formulas: dict[str, Status]
    robustness: dict[str, float | None]
    tolerance: float | None = None

    @property
    def assumption_broken(self) -> bool:
        """Whether the e-agents broke a part of the assumption that the problem makes, before or after the ego."""
        return any(self.formulas.get(part) == BROKEN for part in ASSUMPTIONS)

    @property
    def own_violations(self) -> tuple[Violation, ...]:
        """The breaches of the ego, in order of time."""
        return tuple(violation for violation in self.violations if violation.car == EGO_NAME)

    def __repr__(self) -> str:
        violations = len(self.own_violations)
        others = len(self.violations) - violations
        return f"<Verdict: {self.verdict.value}, breaches: {violations} by the ego, {others} by others>"

    def asdict(self) -> dict[str, Any]:
        """Return the verdict as `to_json` does."""
        return self.to_json()

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as a JSON object."""
        return {
            "clean": self.clean,
            "cut": self.cut,
            "verdict": self.verdict.value,
            "near": self.near,
            "assumption_broken": self.assumption_broken,
            "excuse": None if self.excuse is None else self.excuse.to_json(),
            "violations": [violation.to_json() for violation in self.violations],
            "collisions": [collision.to_json() for collision in self.collisions],
            "rounds": self.rounds,
            "longest_gap_s": self.longest_gap_s,
            "gap_limit_s": self.gap_limit_s,
            "recurrent": self.recurrent,
            "formulas": dict(self.formulas),
            "robustness": dict(self.robustness),
            "edition": EDITION,
            **({} if self.tolerance is None else {"tolerance": self.tolerance}),
        }


def reach_verdict(
    instance: Instance, rules: RuleParameters, breaches: Sequence[Breach], collisions: tuple[Collision, ...],
    visits: Visits, visited_now: Sequence[bool], was_sensed: Callable[[int, int, int], bool],
    seen: Callable[[int, int], bool], running: Pending, margins: dict[str, float | None], *, whole: bool,
    end: str | None,
) -> Verdict:  # fmt: skip
    """Return the verdict on a trial.

    Norm: docs/rules.md#violated, docs/rules.md#excused, docs/rules.md#satisfied, docs/rules.md#unfinished.

    Parameters
    ----------
    instance, rules
        The instance that was run, and the parameters of its rules.
    breaches
        All breaches, in order.
    collisions, visits
        The ego's.
    visited_now
        For each goal, once, whether a visit of the ego's begins in the last frame.
    was_sensed
        Called with (car, first, last), where last is the frame of the ego's first breach; tells whether the car was
        within the sensing radius at a frame from first to last.
    seen
        Called with (car, tick) of a breach by an e-agent; tells whether the car was within the sensing radius then.
    running
        The pending obligations after the last frame.
    margins
        The margins of the ego, by rule.
    whole
        Whether the trial ran its whole planned duration.
    end
        How the trial ended; None while it runs, and for a record that was cut off.
    """
    rate = instance.problem.rate
    violations = tuple([violation_of(instance, breach) for breach in breaches])
    of_ego = [breach for breach in breaches if breach.car == EGO]
    fall = first_fall(breaches, rules, rate) if breaches else None
    gap = max([goal.longest_gap_s for goal in visits.goals], default=None)
    limit = gap_limit(instance, rules) if visits.goals else None
    excuse, near = None, None
    if not of_ego:
        done = whole and visits.recurrent and (gap is None or limit is None or gap <= limit)
        ruling = Ruling.SATISFIED if done else Ruling.UNFINISHED
    elif fall is None or fall[1].tick > of_ego[0].tick:
        ruling = Ruling.VIOLATED
    else:
        ruling = Ruling.EXCUSED
        back = ticks(rules.witness_time, rate)
        sensed = was_sensed(fall[1].car, max(0, of_ego[0].tick - back), of_ego[0].tick)
        excuse = Excuse(fall[0], violations[breaches.index(fall[1])], sensed)
        near = is_near(breaches, back, seen)
    return Verdict(
        ruling,
        clean := not of_ego and whole,
        was_cut(ruling, clean, end),
        excuse,
        near,
        violations,
        collisions,
        visits.rounds,
        gap,
        limit,
        visits.recurrent,
        _formulas(rules, rate, breaches, visits, visited_now, running),
        margins,
    )


def violation_of(instance: Instance, breach: Breach) -> Violation:
    """Return a breach with the names of the car and of the place."""
    network, rate = instance.problem.network, instance.problem.rate
    segment = None
    if breach.lane >= 0:
        x0, y0, x1, y1 = network.segments[breach.lane // 2]
        segment = (x1, y1, x0, y0) if breach.lane % 2 else (x0, y0, x1, y1)
    vertex = network.intersections[breach.vertex] if breach.vertex >= 0 else None
    place = Place(breach.x, breach.y, vertex, segment)
    name = instance.names[breach.car]
    return Violation(breach.rule, name, breach.tick / rate, breach.tick, breach.since / rate, place)


def _formulas(
    rules: RuleParameters,
    rate: float,
    breaches: Sequence[Breach],
    visits: Visits,
    visited_now: Sequence[bool],
    running: Pending,
) -> dict[str, Status]:
    """Return what can be said of each formula after the last frame, by name.

    Norm: docs/rules.md#liveness.
    """
    status: dict[str, Status] = dict.fromkeys(EGO_RULES, HELD)
    for rule in running.ego.intersection(EGO_RULES):
        status[rule] = PENDING
    for rule in {breach.rule for breach in breaches if breach.car == EGO}.intersection(EGO_RULES):
        status[rule] = BROKEN
    for goal, there in zip(visits.goals, visited_now, strict=True):
        x, y = goal.goal
        status[f"1.goal {x} {y}"] = HELD if there else PENDING
    pending = {assumption_of(rule) for rule in running.others}
    others = [breach for breach in breaches if breach.car != EGO]
    for assumption in assumed(rules):
        status[assumption] = PENDING if assumption in pending else HELD
    for assumption in {assumption_of(breach.rule) for breach in others}.intersection(status):
        of_it = [breach for breach in others if assumption_of(breach.rule) == assumption]
        if first_fall(of_it, rules, rate) is not None:
            status[assumption] = BROKEN
    return status


def assumption_of(rule: str) -> str:
    """Return the part of the assumption that an e-agent breaks with a rule: E1 for 1.road, 2, 3 (docs/rules.md#E1).

    Norm: docs/rules.md#E1.
    """
    return rule[:2] if rule.startswith("E") else "E1"


def assumed(rules: RuleParameters) -> tuple[str, ...]:
    """Return the parts of the assumption that a problem makes."""
    return tuple([name for name, switch in _SWITCHES if getattr(rules, switch)])


def first_fall(breaches: Sequence[Breach], rules: RuleParameters, rate: float) -> tuple[str, Breach] | None:
    """Return the part of the assumption that is broken first, with its breach; None if the assumption holds.

    Breaches of E1 that a car is allowed (`rules.exceptions`) don't count.
    """
    made = assumed(rules)
    exceptions = Exceptions(rules, rate)
    for breach in breaches:
        part = assumption_of(breach.rule)
        if breach.car == EGO or part not in made:
            continue
        if part == "E1" and not exceptions.exceeded(breach):
            continue
        return part, breach
    return None


def is_clean(verdict: Verdict | None, collisions: Sequence[Collision], *, whole: bool) -> bool:
    """Tell whether a trial is clean; if it is not judged, whether it ran `whole` and the ego touched nothing.

    Norm: docs/rules.md#clean.
    """
    return whole and not collisions if verdict is None else verdict.clean


def was_cut(verdict: str | None, clean: bool | None, end: str | None) -> bool:
    """Tell whether others or the user ended a judged trial before the ego broke anything.

    It is left out of shares of clean trials. Norm: docs/rules.md#cut.
    """
    return verdict == Ruling.UNFINISHED and not clean and end not in BY_CONTROLLER


def told_cut(count: int) -> str:
    """Return what is said beside a share of clean trials of the `count` trials that were cut."""
    return f", {count} cut" if count else ""


def is_near(breaches: Sequence[Breach], back: int, seen: Callable[[int, int], bool]) -> bool:
    """Tell whether each breach of the ego follows one of an e-agent that was near it.

    Norm: docs/rules.md#near.

    Parameters
    ----------
    breaches
        All breaches of a trial, in order of time.
    back
        Most ticks from the e-agent's breach to the ego's; the same frame counts.
    seen
        Called with (car, tick) of a breach by an e-agent; tells whether the car was within the sensing radius then.
    """
    last: int | None = None
    for tick, group in groupby(breaches, key=lambda breach: breach.tick):
        cars = {breach.car for breach in group}
        if any(car != EGO and seen(car, tick) for car in cars):
            last = tick
        if EGO in cars and (last is None or last < tick - back):
            return False
    return True


def gap_limit(instance: Instance, rules: RuleParameters) -> float:
    """Return the longest gap between visits of a goal that `satisfied` allows, seconds (docs/rules.md#satisfied)."""
    planned = planned_ticks(instance) / instance.problem.rate
    return min(rounds_limit(instance.problem, rules), rules.gap_share * planned)


def rounds_limit(problem: Problem, rules: RuleParameters) -> float:
    """Return the part of `gap_limit` that does not depend on the duration, seconds; inf if there is no round."""
    from dubins_traffic.routing.rounds import round_time  # compiles; only where there is something to judge

    return rules.gap_rounds * round_time(problem.network, problem.goal_vertices, problem.car.bounds.speed)
