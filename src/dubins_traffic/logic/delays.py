"""Bounds that begin later, asked for again and again: delay lines beside the tables.

In ``G (a -> F[5,10] b)`` any number of requests may wait at once, which no clock can follow. But it says the same as
"five seconds after each a, b comes within five seconds", so the requests go through a delay line, and the table sees
them when their bounds begin. What is lost: where b can't come at all, *false* waits until the bounds begin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import record
from dubins_traffic.logic.formula import (
    FUTURE,
    Formula,
    Op,
    always,
    disj,
    implies,
    make,
    negation,
    prop,
    propositions,
    subformulas,
    ticks,
)
from dubins_traffic.logic.obligations import Table


@dataclass(frozen=True)
class Delayed:
    """A part of a conjunction whose requests are delayed.

    Attributes
    ----------
    request : Formula
        What is delayed: a formula without future operators.
    length : int
        By how many ticks, at least 1.
    strong : bool
        Whether a request that is still in the line speaks against the formula, should the word end.
    name : str
        The proposition that the request held `length` ticks ago.
    formula : Formula
        What is monitored.
    """

    request: Formula
    length: int
    strong: bool
    name: str
    formula: Formula


@record
class Requests:
    """What a delay line holds."""

    state: int
    """Of its table."""
    place: int
    """In its ring."""
    waiting: int
    """How many requests wait."""


@dataclass(frozen=True)
class Line:
    """The table that says whether a request holds: next state and value, (S, L), by state and letter."""

    names: tuple[str, ...]
    letter: Ints
    target: Ints
    value: Ints


def delayed(part: Formula, period: float) -> tuple[tuple[Formula, ...], Delayed] | None:
    """Return formulas and a delayed one whose conjunction is `part`, or None if it has not the form.

    The form is G of a disjunction or implication with F, G or U whose bounds begin later than now, and else nothing
    that speaks of the future.
    """
    if part.op is not Op.G or part.bounds is not None:
        return None
    body = part.args[0]
    items = (negation(body.args[0]), body.args[1]) if body.op is Op.IMPLIES else (body,)
    items = tuple(inner for item in items for inner in (item.args if item.op is Op.OR else (item,)))
    later = [item for item in items if any(inner.op in FUTURE for inner in subformulas(item))]
    if len(later) != 1 or later[0].op not in (Op.F, Op.G, Op.U) or later[0].bounds is None:
        return None
    low, high = (ticks(bound, period) for bound in later[0].bounds)
    if low == 0:
        return None
    rest = tuple(item for item in items if item is not later[0])
    span = 0.0, (high - low) * period
    name = "request"
    while name in propositions(part):
        name += "_"
    goal = make(later[0].op, later[0].args, bounds=span)
    formula = always(implies(prop(name), goal))
    late = Delayed(_not_any(rest), low, later[0].op is not Op.G, name, formula)
    if later[0].op is not Op.U:
        return (), late
    return (always(disj(*rest, always(later[0].args[0], (0.0, (low - 1) * period)))),), late


def _not_any(items: tuple[Formula, ...]) -> Formula:
    if len(items) == 1 and items[0].op is Op.NOT:
        return items[0].args[0]
    return negation(disj(*items))


def line(request: Formula, period: float) -> Line:
    """Return the table of a request.

    Raises
    ------
    FormulaError
        If it has too many propositions or combinations of them.
    """
    table = Table(period, 0)
    table.observe(request)
    letter, outcomes = table.letters()
    start = table.remembered()
    number = {start: 0}
    states = [start]
    target: list[list[int]] = []
    value: list[list[bool]] = []
    for memory in states:
        target.append([])
        value.append([])
        for tests in outcomes:
            known, after = table.letter(tests, memory)
            if after not in number:
                number[after] = len(states)
                states.append(after)
            target[-1].append(number[after])
            value[-1].append(table.outcome(request, tests, known.past))
    return Line(table.names, letter, np.array(target, dtype=np.int64), np.array(value, dtype=np.int64))
