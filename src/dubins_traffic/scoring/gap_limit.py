"""The longest gap between visits of a goal that the verdict `satisfied` allows (docs/rules.md#satisfied)."""

from __future__ import annotations

from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.duration import planned_ticks


def gap_limit(instance: Instance, rules: RuleParameters) -> float:
    """Return the longest gap between visits of a goal that `satisfied` allows, seconds (docs/rules.md#satisfied)."""
    planned = planned_ticks(instance) / instance.problem.rate
    return min(rounds_limit(instance.problem, rules), rules.gap_share * planned)


def rounds_limit(problem: Problem, rules: RuleParameters) -> float:
    """Return the part of `gap_limit` that does not depend on the duration, seconds; inf if there is no round."""
    from dubins_traffic.routing.rounds import round_time  # compiles; only where there is something to judge

    return rules.gap_rounds * round_time(problem)
