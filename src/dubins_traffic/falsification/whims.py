"""The whims of e-agents of the kind `free`: tables that can be drawn, mutated and shrunk.

A table is an array (K, WHIMS) of what a car likes to do, one row after another, again and again; `agents.free` says
what of it a car does. Documents hold the rows as they are (`problem.kinds.Free`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from dubins_traffic.cars.body import Disc
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.kinds import FREE

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import EAgent, Instance, Problem


class _Column(NamedTuple):
    """The columns of a table."""

    SECONDS: int = 0
    """For how long."""
    SHARE: int = 1
    """Share of the law's command; -1: speed and yaw rate instead."""
    SPEED: int = 2
    """m/s."""
    YAW_RATE: int = 3
    """rad/s."""
    HOLD: int = 4
    """Share of E3's time for which the car holds at a line."""


COLUMN: Final = _Column()
WHIMS: Final = len(COLUMN)
ROWS: Final = 12
"""Most rows of a table that is drawn."""
SHORT, LONG = 0.2, 8.0
"""Seconds of a row."""
AS_THE_LAW: Final = 0.35
"""Share of the rows in which a car does as the law says; in a half of these slower."""
STANDS: Final = 0.25
"""Of the others, in which it stands."""
HOLDS: Final = 0.5
"""In which it holds at a line."""
STEP: Final = 0.2
"""Largest standard deviation by which `mutated` moves a number, as a share of its range."""


def searched(agent: EAgent) -> bool:
    """Tell whether what an e-agent likes to do is left open: it is free, and nothing is given."""
    return agent.kind == FREE and not agent.parameters["commands"] and not agent.parameters["whims"]


def drawn(dice: np.random.Generator, problem: Problem) -> Floats:
    """Return a table of one row to `ROWS`, for a car of a problem."""
    return np.stack([_row(dice, problem) for _ in range(1 + int(dice.integers(ROWS)))])


def _row(dice: np.random.Generator, problem: Problem) -> Floats:
    bounds, row = problem.car.bounds, np.zeros(WHIMS)
    row[COLUMN.SECONDS] = SHORT * (LONG / SHORT) ** dice.random()
    if dice.random() < AS_THE_LAW:
        row[COLUMN.SHARE] = 1.0 if dice.random() < 0.5 else dice.random()
    else:
        row[COLUMN.SHARE] = -1.0
        row[COLUMN.SPEED] = 0.0 if dice.random() < STANDS else bounds.speed * dice.uniform(-1.0, 1.0)
        if isinstance(problem.car.body, Disc) and dice.random() < 0.5:
            row[COLUMN.YAW_RATE] = bounds.yaw_rate * dice.uniform(-1.0, 1.0)
    row[COLUMN.HOLD] = dice.random() if dice.random() < HOLDS else 0.0
    return row


def mutated(dice: np.random.Generator, table: Floats, problem: Problem) -> Floats:
    """Return a table that differs in one row: a number of it moved, or drawn anew, added, or left out."""
    k, kind = int(dice.integers(len(table))), dice.random()
    if kind < 0.15 and len(table) < ROWS:
        return np.insert(table, k, _row(dice, problem), axis=0)
    if kind < 0.3 and len(table) > 1:
        return np.delete(table, k, axis=0)
    changed = table.copy()
    if kind < 0.5:
        changed[k] = _row(dice, problem)
        return changed
    bounds = problem.car.bounds
    least = np.array([SHORT, 0.0, -bounds.speed, -bounds.yaw_rate, 0.0])
    most = np.array([LONG, 1.0, bounds.speed, bounds.yaw_rate, 1.0])
    column = int(dice.choice(_movable(changed[k], problem)))
    moved = changed[k, column] + STEP * dice.random() * (most - least)[column] * dice.standard_normal()
    changed[k, column] = min(max(moved, least[column]), most[column])
    return changed


def _movable(row: Floats, problem: Problem) -> list[int]:
    """Return the columns that mean something in a row."""
    if row[COLUMN.SHARE] >= 0.0:
        return [COLUMN.SECONDS, COLUMN.SHARE, COLUMN.HOLD]
    turn = [COLUMN.YAW_RATE] if isinstance(problem.car.body, Disc) else []
    return [COLUMN.SECONDS, COLUMN.SPEED, COLUMN.HOLD, *turn]


def reductions(table: Floats) -> Iterator[Floats]:
    """Yield smaller tables: those without one row, then those in which one row is left to the law."""
    for k in range(len(table) if len(table) > 1 else 0):
        yield np.delete(table, k, axis=0)
    law = np.array([1.0, 0.0, 0.0, 0.0])
    for k in range(len(table)):
        if (table[k, 1:] != law).any():
            changed = table.copy()
            changed[k, 1:] = law
            yield changed


def with_whims(instance: Instance, tables: Mapping[int, Floats]) -> Instance:
    """Return an instance in which tables drive some free e-agents, by the numbers of the cars."""
    agents = list(instance.e_agents)
    for n, table in tables.items():
        agent = agents[n - 1]
        given = {**agent.parameters, "whims": table.tolist(), "repeat": True}
        agents[n - 1] = replace(agent, parameters=given)
    return replace(instance, e_agents=tuple(agents))


def table_of(agent: EAgent) -> Floats:
    """Return the table that drives a free e-agent; without one it has no rows."""
    return np.array(agent.parameters["whims"], dtype=np.float64).reshape(-1, WHIMS)
