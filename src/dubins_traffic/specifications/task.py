"""The task of a problem as formulas over named propositions (docs/rules.md#phi_sys, docs/rules.md#phi_env).

i stands for the name of a car, x and y for a lattice point. All mean what docs/rules.md says, at one frame:

====================================  =============================================================================
``i_t_x_y``                           at: the centre is in the disc, as the labels of 2016 say it
``visit_i_x_y``                       a visit begins: the centre comes into the disc, for the first time or from
                                      another one
``free_x_y``                          no e-agent is at the goal
``collision_i``                       i has touched a car or an obstacle since the frame before
``on_road_i`` ``left_i``              docs/rules.md#on-road, docs/rules.md#left
``overtaking_i`` ``hemmed_i``         docs/rules.md#overtaking, docs/rules.md#hemmed
``turned_i``                          the lane state flipped in this frame (docs/rules.md#lane-state)
``at_fault_i``                        docs/rules.md#at-fault
``enter_i_x_y`` ``clear_i_x_y``       i enters the crossing; no other car is in it
``stopped_i_x_y``                     i has stopped at the crossing
``ahead_i_x_y``                       i has stopped there, and somebody is before it in the order
``first_i_x_y``                       i has stopped there, and nobody is before it in the order
``renewed_i``                         i gets one more new ticket in one wait than E3 allows
``exit_i``                            the body meets a disc out of which some exit is free, and the time counts (E4)
``stays_i``                           it has done so for longer than it may, times that do not count left out (E4)
``overdue_i``                         its journey has taken longer than it may (E5)
``excess_i``                          i has broken E1 more often than the exceptions allow (only if there are any)
====================================  =============================================================================

Durations are the parameters of the problem. E6 is stated without its horizon, which only says how finite trials are
judged, and without its pause: where the ego itself holds a goal closed for ever, the formula assumes more than
docs/rules.md#E6. A problem without rules has the task of 2016: every goal again and again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dubins_traffic.logic.formula import (
    Formula,
    always,
    conj,
    disj,
    eventually,
    implies,
    negation,
    prop,
    propositions,
    yesterday,
)
from dubins_traffic.rules.judged import JudgedProblem
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.specifications.exports import Specification

Point = tuple[float, float]

_OF_ENVIRONMENT = ("overtaking", "hemmed", "clear", "ahead")
"""Propositions about the ego whose truth depends on the other cars."""


def task(problem: JudgedProblem, names: Sequence[str]) -> Specification:
    """Return the task: what is assumed of the e-agents, and what the ego must guarantee.

    Norm: docs/rules.md#phi_sys, docs/rules.md#phi_env.

    Parameters
    ----------
    problem : Problem
        The roads, the goals, and the parameters of the rules, which say what is assumed.
    names : sequence of str
        Names of the cars, the ego's first.

    Returns
    -------
    Specification
        The ego chooses where it is and what it does; what is up to others too, its order and clear crossings for
        instance, is an input.

    Raises
    ------
    FormulaError
        If a car has a name that propositions can't carry.
    """
    ego, *others = names
    goals = tuple(dict.fromkeys(problem.goals))
    if not problem.rules:
        return _specification((), [always(eventually(prop(_on(f"{ego}_t", goal)))) for goal in goals], ego)
    visits = [always(eventually(prop(_on(f"visit_{ego}", goal)))) for goal in goals]
    rules = RuleParameters.from_mapping(problem.rules)
    crossings = [
        point
        for point, degree in zip(problem.network.intersections, problem.network.degrees, strict=True)
        if degree >= rules.crossing_degree
    ]
    guarantees = [
        always(negation(prop(f"collision_{ego}"))),
        _stays_on_road(ego),
        *visits,
        *_rules_2_and_3(ego, crossings, rules),
    ]
    assumptions = [formula for name in others for formula in _assumed(name, crossings, rules)]
    if rules.assume_e6:
        assumptions += [always(eventually(prop(_on("free", goal)))) for goal in goals]
    return _specification(assumptions, guarantees, ego)


def _stays_on_road(name: str) -> Formula:
    """Return that a car stays on the road from its first frame there on."""
    on_road = prop(f"on_road_{name}")
    return always(implies(yesterday(on_road), on_road))


def _rules_2_and_3(name: str, crossings: Iterable[Point], rules: RuleParameters) -> list[Formula]:
    """Return rules 2 and 3 for a car."""
    left = prop(f"left_{name}")
    back = disj(negation(left), prop(f"hemmed_{name}"))
    formulas = [
        always(implies(left, prop(f"overtaking_{name}"))),
        always(implies(left, eventually(back, (0.0, rules.left_time)))),
        always(negation(prop(f"turned_{name}"))),
    ]
    for point in crossings:
        enter, stopped, ahead, clear = (
            prop(_on(f"{word}_{name}", point)) for word in ("enter", "stopped", "ahead", "clear")
        )
        formulas += [always(implies(enter, yesterday(condition))) for condition in (stopped, negation(ahead), clear)]
    return formulas


def _assumed(name: str, crossings: Sequence[Point], rules: RuleParameters) -> list[Formula]:
    """Return E1 to E5 for an e-agent, those that the problem assumes."""
    formulas: list[Formula] = []
    if rules.assume_e1 and rules.exceptions:
        formulas.append(always(negation(prop(f"excess_{name}"))))
    elif rules.assume_e1:
        formulas += [_stays_on_road(name), *_rules_2_and_3(name, crossings, rules)]
    if rules.assume_e2:
        formulas.append(always(negation(prop(f"at_fault_{name}"))))
    if rules.assume_e3:
        for point in crossings:
            goes = conj(prop(_on(f"first_{name}", point)), prop(_on(f"clear_{name}", point)))
            formulas.append(_no_longer(goes, rules.enter_time))
        formulas.append(always(negation(prop(f"renewed_{name}"))))
    if rules.assume_e4:
        formulas.append(_no_longer(prop(f"exit_{name}"), rules.exit_time))
        formulas.append(always(negation(prop(f"stays_{name}"))))
    if rules.assume_e5:
        formulas.append(always(negation(prop(f"overdue_{name}"))))
    return formulas


def _no_longer(state: Formula, seconds: float) -> Formula:
    return always(implies(state, eventually(negation(state), (0.0, seconds))))


def _on(stem: str, point: Point) -> str:
    return f"{stem}_{point[0]}_{point[1]}"


def _specification(assumptions: Sequence[Formula], guarantees: Sequence[Formula], ego: str) -> Specification:
    """Return the specification; what is guaranteed is the ego's to choose, unless it is up to the others."""
    used = [name for formula in (*assumptions, *guarantees) for name in propositions(formula)]
    owned = {name for formula in guarantees for name in propositions(formula)}
    others = tuple(f"{word}_{ego}" for word in _OF_ENVIRONMENT)
    outputs = {name for name in owned if not name.startswith(others)}
    return Specification(
        tuple(assumptions),
        tuple(guarantees),
        tuple(name for name in dict.fromkeys(used) if name not in outputs),
        tuple(name for name in dict.fromkeys(used) if name in outputs),
    )
