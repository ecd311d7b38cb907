"""The columns of a verdict: the ruling, its excuse, and how often each rule was broken."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dubins_traffic.scoring.metric import Column, ScoreColumn, Value
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_NAME, EGO_RULES, Excuse, Verdict, assumption_of

if TYPE_CHECKING:
    from dubins_traffic.scoring.score import Score


def _of_verdict(value: Callable[[Verdict], Value]) -> Callable[[Score], Value]:
    """Return a function that takes a value from a score's verdict, None if there is no verdict."""
    return lambda score: None if score.verdict is None else value(score.verdict)


def _of_excuse(value: Callable[[Excuse], Value]) -> Callable[[Score], Value]:
    return _of_verdict(lambda verdict: None if verdict.excuse is None else value(verdict.excuse))


def _broken(rule: str) -> Callable[[Score], Value]:
    return _of_verdict(lambda verdict: sum(one.rule == rule for one in verdict.own_violations))


def _fallen(part: str) -> Callable[[Score], Value]:
    return _of_verdict(
        lambda verdict: sum(one.car != EGO_NAME and assumption_of(one.rule) == part for one in verdict.violations)
    )


COLUMNS = (
    ScoreColumn(Column("clean", "clean", "share", 1, "bool"), _of_verdict(lambda verdict: verdict.clean)),
    ScoreColumn(Column("verdict", kind="string"), _of_verdict(lambda verdict: verdict.verdict.value)),
    ScoreColumn(Column("near", kind="bool"), _of_verdict(lambda verdict: verdict.near)),
    ScoreColumn(
        Column("assumption_broken", "assumption broken by others", "share", kind="bool"),
        _of_verdict(lambda verdict: verdict.assumption_broken),
    ),
    ScoreColumn(Column("excuse", kind="string"), _of_excuse(lambda excuse: excuse.assumption)),
    ScoreColumn(Column("excuse_sensed", kind="bool"), _of_excuse(lambda excuse: excuse.sensed)),
    ScoreColumn(
        Column("breaches", "breaches of the ego", "", -1, "int32"),
        _of_verdict(lambda verdict: len(verdict.own_violations)),
    ),
    ScoreColumn(
        Column("breaches_of_others", "breaches of others", kind="int32"),
        _of_verdict(lambda verdict: len(verdict.violations) - len(verdict.own_violations)),
    ),
    *(ScoreColumn(Column(f"breaches.{rule}", kind="int32"), _broken(rule)) for rule in EGO_RULES),
    *(ScoreColumn(Column(f"breaches_of_others.{part}", kind="int32"), _fallen(part)) for part in ASSUMPTIONS),
)
