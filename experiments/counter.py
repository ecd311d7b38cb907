"""Counterstrategies on the road: how long a team of `counter` e-agents keeps an ego from a goal.

Each trial is 300 s on a grid with goals at two opposite corners, under an assumption that is too weak. Bars: the ego
visits some goal no more once 100 s are over, keeps its rules, and the e-agents break nothing that is assumed of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from benchmarks.table import Row

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial

SECONDS: Final = 300.0
SETTLED: Final = 100.0
SEEDS: Final = range(5)
CONTROLLERS: Final = ("rules", "synthesized")


@dataclass(frozen=True, slots=True)
class Case:
    """A grid, how many e-agents, which of E1 to E6 are assumed of them, and which of these fall with what is not.

    On the road E5 bounds a whole journey, ticks in discs and at the head of a queue among them: who stays in a disc for
    ever, which is what a missing E4 allows, or first at a clear crossing, as a missing E3 does, breaks E5 in the end.
    """

    rows: int
    columns: int
    cars: int
    assumed: tuple[str, ...]
    falls_too: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        return f"{self.rows}x{self.columns}, {self.cars} e-agents, {','.join(self.assumed)}"


CASES: Final = (
    Case(3, 4, 1, ("E2", "E6")),
    Case(3, 4, 1, ("E1", "E2", "E3", "E5", "E6"), frozenset({"E5"})),
    Case(3, 4, 2, ("E1", "E2", "E4", "E5", "E6"), frozenset({"E5"})),
)
"""Lost with the rules' crossings: fairness alone; without E4; without E3."""


def instance(case: Case, seed: int, seconds: float = SECONDS) -> Instance:
    """Return a trial of a case."""
    rules = {f"assume_e{k}": int(f"E{k}" in case.assumed) for k in range(1, 7)}
    document: dict[str, Any] = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": case.rows, "columns": case.columns}},
        "e-agents": [{"type": "counter", "name": f"car{k}"} for k in range(case.cars)],
        "number_trials": 1,
        "duration": seconds,
        "rules": rules,
        "number_goals_bounds": [2, 2],
    }
    drawn = draw(load_config(document), seed, 0)
    corners = ((0, 0), (case.columns - 1, case.rows - 1))
    return replace(drawn, problem=replace(drawn.problem, goals=corners))


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: rules that the ego broke, parts of the assumption that others broke, longest time without a goal."""

    own: tuple[str, ...]
    others: frozenset[str]
    gap: float


def drive(case: Case, controller: str, seed: int, seconds: float = SECONDS) -> Drive:
    """Run a controller against the team."""
    score = run_trial(instance(case, seed, seconds), controller).score
    verdict = score.verdict
    assert verdict is not None
    return Drive(
        tuple(one.rule for one in verdict.violations if one.car == "ego"),
        frozenset(part(one.rule) for one in verdict.violations if one.car != "ego"),
        max(goal.longest_gap_s for goal in score.goals),
    )


def part(rule: str) -> str:
    """Return which of E1 to E6 an e-agent breaks by breaking a rule."""
    return rule[:2] if rule.startswith("E") else "E1"


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    rows: list[Row] = []
    for case in CASES:
        for controller in CONTROLLERS:
            found = [drive(case, controller, seed) for seed in SEEDS]
            least = min(one.gap for one in found)
            kept = set(case.assumed) - case.falls_too
            fair = all(not one.own and one.others.isdisjoint(kept) for one in found)
            rows.append(
                Row(
                    f"{case.name}; {controller}: least time without a goal",
                    f"{least:.0f} s, {'nothing' if fair else 'something'} assumed or owed broken",
                    f">= {SECONDS - SETTLED:g} s of {SECONDS:g} s, nothing",
                    fair and least >= SECONDS - SETTLED,
                )
            )
    return rows
