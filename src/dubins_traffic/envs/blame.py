"""Whose breaches count among several learners: the side that breaks its part first pays (compiled).

The rules are an agreement: the e-agents keep E1 to E6, and the ego then keeps rules 1 to 3 (docs/rules.md). Within a
frame the e-agents move first, as in a verdict.

- A breach by an e-agent counts if the problem assumes the part of E1 to E6 that it breaks, if it is beyond the
  exceptions that are allowed, and if no breach by the ego has counted in an earlier frame.
- A breach by the ego counts if no breach by an e-agent has counted, up to and including its frame.

All others are excused. With a window only what has counted in so many seconds before excuses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.terms import PARTS
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import INFINITE, Ints
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.tables import ticks
from dubins_traffic.scoring.verdict import EGO_RULES, assumed, assumption_of

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

WINDOW: Final = "window"
EXCUSED_FOR: Final = 1.0
"""Seconds for which a breach excuses the other side where `WINDOW` is asked for: it may have brought about so much."""


@record
class Blame:
    """What is known of the breaches of one trial that have counted."""

    window: float
    """Ticks for which what has counted of one side's excuses the other; infinite: for the rest of the trial."""
    exception_ticks: int
    """The window over which exceptions are counted."""
    last_of_ego: float = -np.inf
    """Tick of the last of the ego's; -inf before the first."""
    last_of_others: float = -np.inf
    """Tick of the last of the e-agents'."""
    first: int = -1
    """The car whose breach was the first that counted, -1 so far."""


class BlameTables(Tables):
    """What decides for the breaches of some trials, as they come, which count.

    Attributes
    ----------
    trial : (B,) Blame
        Of each trial.
    part : (R, 2)
        The number, in `envs.terms.PARTS`, of the part that each rule is of, by an e-agent and by the ego; -1 if it is
        of none, or not assumed.
    excepted : (R,)
        The number of each rule for which exceptions are counted: 1 to 3, else 0.
    recent : (B, N, X + 1)
        Frames of the last breaches of E1 of each car, as many as are allowed and one; -1: none.
    recent_rule : (B, N, X + 1)
        Which of the rules 1 to 3 they were of.
    """

    trial: Rows[Blame]
    part: Ints
    excepted: Ints
    recent: Ints
    recent_rule: Ints


def blame_tables(problems: Sequence[Problem], cars: int, excuses: bool | str | float) -> BlameTables:
    """Return the tables of trials of one configuration before their first frames.

    Parameters
    ----------
    problems
        One a trial.
    cars
        Places for cars in a trial.
    excuses
        Whether what has counted of one side's excuses the other for the rest of the trial; or the window, seconds;
        `WINDOW` is one of `EXCUSED_FOR`. False: each side answers for all that it breaks.

    Raises
    ------
    InputError
        If `excuses` is none of these.
    """
    rules, rate = RuleParameters.from_mapping(problems[0].rules), problems[0].rate
    made, trial = assumed(rules), table(Blame, len(problems))
    trial["window"] = _seconds_excused(excuses) * rate
    trial["exception_ticks"] = within = ticks(rules.exception_time, rate)
    part: Ints = np.full((len(RULES), 2), -1)
    excepted: Ints = np.zeros(len(RULES), dtype=np.int64)
    for k, rule in enumerate(RULES):
        if assumption_of(rule) in made:
            part[k, 0] = PARTS.index(assumption_of(rule))
        if rule in EGO_RULES:
            part[k, 1] = PARTS.index(rule)
        if not rule.startswith("E"):
            excepted[k] = int(rule[0])
    most = min(rules.exceptions, 3 * within)  # more breaches than that do not fit into the window
    recent: Ints = np.full((len(problems), cars, most + 1), -1)
    return BlameTables(trial, part, excepted, recent, np.zeros_like(recent))


def _seconds_excused(excuses: bool | str | float) -> float:
    """Return for how many seconds what one side breaks excuses the other."""
    if excuses == WINDOW:
        return EXCUSED_FOR
    if isinstance(excuses, bool):
        return math.inf if excuses else 0.0
    if isinstance(excuses, str) or not excuses >= 0.0:
        raise InputError("no excuses", field="excuses", value=excuses, expected=f"True, False, {WINDOW} or seconds")
    return excuses


@jit
def charge_first(trials: Ints, cars: Ints, rules: Ints, tables: BlameTables) -> None:
    """Note who is to blame for breaches in the first frames of some `trials` (K,), in the order in which they come.

    `cars` (K,) and `rules` (K,) say whose they are, and of what rule.
    """
    for k in range(trials.shape[0]):
        part_that_counts(trials[k], cars[k], rules[k], 0, tables)


@jit
def part_that_counts(b: int, n: int, rule: int, tick: int, tables: BlameTables) -> int:
    """Return the part that car n of trial b has broken in frame `tick` by a breach of `rule` (code) that counts, or -1.

    Breaches come in the order of time; of one frame those of e-agents first, by rule, then by car.
    """
    trial = tables.trial[b]
    part = tables.part[rule, 1 if n == EGO else 0]
    if n != EGO and tables.excepted[rule] > 0:
        exceeds = _exceeds(b, n, tick, tables.excepted[rule], tables)
        if not exceeds:
            return -1
    if part < 0 or is_excused(b, n, tick, tables):
        return -1
    if n == EGO:
        trial.last_of_ego = tick
    else:
        trial.last_of_others = tick
    if trial.first < 0:
        trial.first = n
    return part


@jit_inline
def is_excused(b: int, n: int, tick: int, tables: BlameTables) -> bool:
    """Tell whether nothing that car n of trial b breaks in frame `tick` counts."""
    trial = tables.trial[b]
    since = tick - (trial.last_of_others if n == EGO else trial.last_of_ego)
    soon = trial.window > 0.0 and since <= trial.window and since < INFINITE
    return soon and since >= (0 if n == EGO else 1)


@jit
def _exceeds(b: int, n: int, tick: int, rule: int, tables: BlameTables) -> bool:
    """Count a breach of E1 in frame `tick`; tell whether its car has made more than it is allowed.

    What one car does against one of the rules 1 to 3, `rule` (code), in one frame counts once
    (docs/rules.md#exceptions).
    """
    recent, rules = tables.recent[b, n], tables.recent_rule[b, n]
    last = recent.shape[0] - 1
    is_new = True
    for k in range(last + 1):
        is_new = is_new and (recent[k] != tick or rules[k] != rule)
    if is_new:
        for k in range(last):
            recent[k], rules[k] = recent[k + 1], rules[k + 1]
        recent[last], rules[last] = tick, rule
    return recent[0] >= 0 and tick - recent[0] < tables.trial[b].exception_ticks
