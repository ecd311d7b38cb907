"""What a search looks for beside the rules: both sides of the contract, and liveness.

The contract is not kept where the ego is kept waiting, or a car that keeps the law is provoked. Liveness is that no
goal stays unvisited for longer than ``gap_rounds`` free-flow rounds: of what ``satisfied`` allows that is the part that
does not depend on the duration, since cases are cut where they end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.errors import InputError
from dubins_traffic.problem.kinds import KEEP_RULES
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import replay
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.margins import LIVENESS, SURE
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Place, Violation, rounds_limit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dubins_traffic.falsification.passages import Passages
    from dubins_traffic.problem.instance import EAgent, Instance, Problem
    from dubins_traffic.protocols import Ending
    from dubins_traffic.record.reader import Record
    from dubins_traffic.scoring.verdict import Verdict


BLOCKED: Final = "blocked"
"""The ego visits no goal at all for longer than a gap may be, and nobody has broken anything."""
PROVOKED: Final = "provoked"
"""An e-agent that keeps the law breaks it, and nobody has broken anything before."""
CONTRACT: Final = (BLOCKED, PROVOKED)
CAPRICIOUS: Final = ("rolls", "left", "blocks", "tailgates", "parks")
"""Parameters by which a car that keeps the law breaks it."""


@dataclass(frozen=True, slots=True)
class ContractMargins:
    """What came of the contract in a trial."""

    margins: dict[str, float] = field(default_factory=dict[str, float])
    """Of `BLOCKED` by how many seconds the longest wait stayed below its limit, where the trial is longer than that;
    of `PROVOKED` 1 where no such car broke anything. Negative where it was not kept.
    """
    frames: dict[str, int] = field(default_factory=dict[str, int])
    """The frames in which it was broken."""


def limit_of(problem: Problem) -> float | None:
    """Return the longest gap that is none to look for, seconds; None if no round goes through all goals."""
    limit = rounds_limit(problem, RuleParameters.from_mapping(problem.rules))
    return limit if math.isfinite(limit) else None


def keeps_law(agent: EAgent) -> bool:
    """Tell whether an e-agent drives as the law says and chooses nothing of its own."""
    parameters: Mapping[str, Any] = agent.parameters
    return agent.kind in KEEP_RULES and not any(
        parameters.get(name) for name in (*CAPRICIOUS, "choices")
    )  # fmt: skip


def contract_margins(verdict: Verdict, passages: Passages, trial: int, instance: Instance) -> ContractMargins:
    """Return what came of the contract in number `trial` of `passages`, the trial of an instance, by its verdict."""
    contract = ContractMargins()
    provoked = provocation(verdict, instance)
    if provoked is not None or any(keeps_law(agent) for agent in instance.e_agents):
        contract.margins[PROVOKED] = 1.0 if provoked is None else -1.0
    if provoked is not None:
        contract.frames[PROVOKED] = provoked.tick
    wait = _longest_wait(verdict, passages, trial, instance)
    if wait is not None:
        spare, tick = wait
        contract.margins[BLOCKED] = spare
        if spare < 0.0:
            contract.frames[BLOCKED] = tick
    return contract


def provocation(verdict: Verdict, instance: Instance) -> Violation | None:
    """Return the breach of a car that keeps the law, if it is among the first of all and the ego's is not."""
    first = verdict.violations[0].tick if verdict.violations else -1
    at_first = [violation for violation in verdict.violations if violation.tick == first]
    lawful = {agent.name for agent in instance.e_agents if keeps_law(agent)}
    if any(violation.car == EGO_NAME for violation in at_first):
        return None
    return next((violation for violation in at_first if violation.car in lawful), None)


def _longest_wait(verdict: Verdict, passages: Passages, trial: int, instance: Instance) -> tuple[float, int] | None:
    """Return by how much the longest time without a visit stayed below its limit, s, and the frame in which it was up.

    None without a limit, and of a trial that is not longer. Time counts while nobody has broken anything.
    """
    limit, rate = limit_of(instance.problem), instance.problem.rate
    if limit is None or instance.duration <= limit:
        return None
    allowed = _ticks(limit, rate)
    last = min([max(violation.tick - 1, 0) for violation in verdict.violations], default=passages.last(trial))
    visits = passages.visits(trial, frozenset(instance.problem.goal_vertices))
    marks = [0, *(tick for tick in visits if 0 < tick <= last), last]
    gaps = np.diff(marks)
    longest = int(gaps.max())
    if longest <= allowed:
        return max(limit - longest / rate, SURE), last
    late = marks[int(np.argmax(gaps > allowed))] + allowed + 1
    return min(limit - longest / rate, -SURE), late


def breach_of(target: str, tick: int, verdict: Verdict, record: Record) -> Violation:
    """Return a breach of the contract, in a frame of a record, as one of the car that is concerned."""
    frames = record.frames
    if target == PROVOKED:
        provoked = provocation(verdict, record.instance)
        if provoked is not None:
            return Violation(target, provoked.car, provoked.time, provoked.tick, provoked.since, provoked.where)
    x, y = float(frames.x[tick, EGO]), float(frames.y[tick, EGO])
    since = tick - 1 - _ticks(limit_of(record.instance.problem) or 0.0, frames.rate)
    return Violation(
        target, EGO_NAME, tick / frames.rate, tick, since / frames.rate, Place(x, y, None, None)
    )  # fmt: skip


def _ticks(limit: float, rate: float) -> int:
    """Return how many ticks a time without a visit may have."""
    return math.floor(limit * rate + 1e-9)


def sentence_of(verdict: Verdict | None, breach: Violation) -> str:
    """Return who did what when in a trial in which the contract was broken."""
    when = f"At {breach.time:.2f} s"
    if breach.rule == BLOCKED:
        return f"{when} the ego had visited no goal since {breach.since:.2f} s, though nobody had broken a rule."
    broken = (
        [] if verdict is None else [o.rule for o in verdict.violations if o.tick == breach.tick and o.car == breach.car]
    )
    return f"{when} {breach.car}, which keeps the law, broke {' and '.join(broken)}, though the ego had broken nothing."


def check_lawful(instances: Sequence[Instance]) -> None:
    """Refuse trials in which no e-agent keeps the law."""
    if not any(keeps_law(agent) for instance in instances for agent in instance.e_agents):
        raise InputError(
            "has no e-agents that keep the law", file="--rule", value=PROVOKED,
            expected="e-agents of the kind lawful or nemesis",
        )  # fmt: skip


TARGETS: Final = (*EGO_RULES, LIVENESS, *CONTRACT)
"""What can be asked for by name: the rules, the goals, and the contract."""


@dataclass(frozen=True, slots=True)
class Overdue:
    """A goal that had not been visited since frame `since`, and for too long at frame `tick`."""

    goal: tuple[float, float]
    since: int
    tick: int


def spare(problem: Problem, verdict: Verdict, ending: Ending | None) -> float | None:
    """Return by how many seconds the longest gap of a goal stayed below its limit; negative exactly if it did not.

    None without goals, and of a trial that did not run its whole duration: what would have come is not known.
    """
    limit, gap = limit_of(problem), verdict.longest_gap_s
    if limit is None or gap is None or ending is None or ending.end is not End.DURATION:
        return None
    return min(limit - gap, -SURE) if gap > limit else max(limit - gap, SURE)


def first_overdue(record: Record, limit: float) -> Overdue | None:
    """Return the first goal of a trial that was not visited for more than `limit` seconds, None if there is none."""
    judging = Judging()
    replay(record, [judging])
    rate, final = record.frames.rate, len(record.frames) - 1
    allowed = int(limit * rate)
    while (allowed + 1) / rate <= limit:
        allowed += 1
    over: list[tuple[int, int, int]] = []
    goals = tuple(dict.fromkeys(record.instance.problem.goals))
    for goal in range(len(goals)):
        ticks = [0, *(tick for tick, which in judging.visits if which == goal), final]
        over += [(since + allowed + 1, goal, since) for since, tick in pairwise(ticks) if tick - since > allowed]
    if not over:
        return None
    tick, goal, since = min(over)
    return Overdue(goals[goal], since, tick)


def check_long_enough(instances: Sequence[Instance], target: str) -> None:
    """Refuse trials none of which lasts as long as a gap may; `target` is what is asked for."""
    limits = [limit_of(instance.problem) for instance in instances]
    least = min([limit for limit in limits if limit is not None], default=None)
    if least is None:
        raise InputError("has no goals that can be visited", file="--rule", value=target)
    longest = max(instance.duration for instance in instances)
    if longest <= least:
        raise InputError(
            "no gap between visits can be over its limit in trials so short", file="--duration", value=longest,
            expected=f"more than {least:.1f} s, or a smaller gap_rounds among the rules",
        )  # fmt: skip
