"""Letters: what monitors distinguish of valuations of propositions, and which parts of a formula need time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.logic.formula import FUTURE, PAST, Formula, FormulaError, Op, subformulas

MAX_LETTERS: Final = 256
"""Most outcomes of the tests of one monitor."""


class Letter(NamedTuple):
    """What is known at a position: outcomes of tests, values of past operators, clocks that have run out."""

    tests: tuple[bool, ...]
    past: tuple[bool, ...]
    expired: int


def timed_parts(formula: Formula) -> frozenset[Formula]:
    """Return the parts of a formula in which a temporal operator stands.

    Raises
    ------
    FormulaError
        If a past operator ranges over a future one.
    """
    timed: set[Formula] = set()
    future: set[Formula] = set()
    for part in subformulas(formula):
        if part.op in FUTURE or any(arg in future for arg in part.args):
            future.add(part)
            if part.op in PAST:
                raise FormulaError(
                    "a past operator ranges over a future one",
                    value=str(part),
                    expected="the past of the past",
                )
        if part.op in PAST or part in future or any(arg in timed for arg in part.args):
            timed.add(part)
    return frozenset(timed)


def letters_of(
    names: Sequence[str], tests: Sequence[Formula]
) -> tuple[npt.NDArray[np.int64], list[tuple[bool, ...]]]:
    """Return the letter of each valuation of the propositions `names`, and the outcomes of `tests` for each letter.

    Bit number i of a valuation is the value of proposition number i.

    Raises
    ------
    FormulaError
        If there are more than `MAX_LETTERS` letters.
    """
    count = 1 << len(names)
    numbers = np.arange(count)
    known = {name: (numbers >> place & 1).astype(bool) for place, name in enumerate(names)}
    if not tests:
        return np.zeros(count, dtype=np.int64), [()]
    rows = np.stack([valued(test, known, count) for test in tests], axis=1)
    distinct, letter = np.unique(rows, axis=0, return_inverse=True)
    if len(distinct) > MAX_LETTERS:
        raise FormulaError(
            "too many combinations of conditions in one part",
            value=len(distinct),
            expected=f"at most {MAX_LETTERS}",
        )
    return letter.reshape(-1).astype(np.int64), [tuple(map(bool, row)) for row in distinct.tolist()]


def valued(formula: Formula, known: Mapping[str, npt.NDArray[np.bool_]], count: int) -> npt.NDArray[np.bool_]:
    """Return the values of a formula without temporal operators under `count` valuations."""
    if formula.op is Op.PROP:
        return known[formula.name]
    if formula.op in (Op.TRUE, Op.FALSE):
        return np.full(count, formula.op is Op.TRUE)
    values = [valued(arg, known, count) for arg in formula.args]
    if formula.op is Op.NOT:
        return ~values[0]
    if formula.op is Op.IMPLIES:
        return ~values[0] | values[1]
    if formula.op is Op.IFF:
        return values[0] == values[1]
    join = np.logical_and if formula.op is Op.AND else np.logical_or
    return np.asarray(join.reduce(values), dtype=np.bool_)
