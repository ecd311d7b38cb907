"""The choices of e-agents of the kind `chosen`: tables that can be drawn, mutated and shrunk.

A table is an array (K, CHOICES) with a row for each of the first K legs of a car and the columns `CHOICE`. NaN leaves a
choice to the law, so with a table of NaN the car drives like one of the kind `lawful`. Documents hold only the numbers,
as rows of `problem.kinds.Choice`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.policies.rules.abilities import LONGEST_WAY, through_speed
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem


class _Choice(NamedTuple):
    """What may be chosen for a leg, columns of a table: the fields of `policies.rules.tables.Leg`."""

    EXIT: int = 0
    """The exit at its end, counted counter-clockwise from the way back, which is 0; only crossings have a choice."""
    SPEED: int = 1
    """Share of the largest speed at which the car drives outside discs."""
    PAUSE: int = 2
    """Seconds for which it pauses in its lane, before it comes near to the crossing."""
    PAUSE_AT: int = 3
    """Share of the lane after which it does."""
    HOLD: int = 4
    """Seconds of its own turn for which it holds at the line of the crossing."""
    DWELL: int = 5
    """Seconds for which it stands in the disc at the end of the lane."""
    GAP: int = 6
    """Metres kept behind what is ahead in its lane."""


CHOICE: Final = _Choice()
CHOICES: Final = len(CHOICE)
NAMES: Final = tuple(name.lower() for name in CHOICE._fields)
"""The keys of a row in a document, in the order of the columns."""
EXIT: Final = NAMES[CHOICE.EXIT]
EXITS: Final = 4
BOUNDS: Final = np.array(
    [(0.0, EXITS - 1.0), (0.15, 1.0), (0.0, 30.0), (0.0, 1.0), (0.0, 8.0), (0.0, 1.0), (0.06, 0.8)]
)
"""Least and greatest value of each column in tables that are drawn; `cut` adds the limits of a problem."""
LOW, SPAN = BOUNDS[:, 0].copy(), BOUNDS[:, 1] - BOUNDS[:, 0]
LEAST_GAP, MOST_GAP = float(BOUNDS[CHOICE.GAP, 0]), float(BOUNDS[CHOICE.GAP, 1])
"""Gaps that the law can keep, metres."""
SLOWEST = 2.4
"""Least speed that can be chosen, in units of the speed below which a car lingers."""
SHARE = 0.8
"""Largest share of the time allowed by E3 to E5 that can be chosen."""
STEP = 0.3
"""Largest standard deviation by which `mutated` moves a number, as a share of its range; the least is 0.01."""


def empty(legs: int) -> Floats:
    """Return a table of `legs` rows in which nothing is chosen."""
    return np.full((legs, CHOICES), np.nan)


def from_rows(rows: Sequence[Mapping[str, Any]]) -> Floats:
    """Return the table of the rows of a document."""
    table = empty(1 + max((row["at"] for row in rows), default=-1))
    for row in rows:
        for column, name in enumerate(NAMES):
            value = row.get(name)
            if value is not None:
                table[row["at"], column] = value
    return table


def to_rows(table: Floats) -> list[dict[str, Any]]:
    """Return the rows of a document with what a table chooses; legs for which nothing is chosen are left out."""
    rows: list[dict[str, Any]] = []
    numbers: list[list[float]] = table.tolist()
    for leg, values in enumerate(numbers):
        row = {name: value for name, value in zip(NAMES, values, strict=True) if isfinite(value)}
        if row:
            if EXIT in row:
                row[EXIT] = int(row[EXIT])
            rows.append({"at": leg, **row})
    return rows


def drawn(dice: np.random.Generator, legs: int, share: float = 0.3) -> Floats:
    """Return a table of `legs` rows of which each number is chosen with probability `share`, uniform in `BOUNDS`."""
    table = dice.random((legs, CHOICES))
    table *= SPAN
    table += LOW
    table[:, CHOICE.EXIT] = dice.integers(0, EXITS, legs)
    table[dice.random((legs, CHOICES)) >= share] = np.nan
    return table


def mutated(dice: np.random.Generator, table: Floats) -> Floats:
    """Return a table that differs in one number: moved a little, chosen anew, or left to the law."""
    changed = table.copy()
    leg, column = int(dice.integers(len(changed))), int(dice.integers(CHOICES))
    chosen = np.isfinite(changed).ravel().nonzero()[0]
    move = dice.random()
    if len(chosen) and move < 0.7:
        leg, column = divmod(int(chosen[dice.integers(len(chosen))]), CHOICES)
    low, high = BOUNDS[column].tolist()
    value = float(changed[leg, column])
    if isfinite(value) and move < 0.2:
        changed[leg, column] = np.nan
    elif column == CHOICE.EXIT:
        changed[leg, column] = dice.integers(0, EXITS)
    elif isfinite(value) and move < 0.5:
        far = STEP * 10.0 ** (-2.0 * dice.random()) * (high - low)
        moved = value + far * dice.standard_normal()
        changed[leg, column] = min(max(moved, low), high)
    else:
        changed[leg, column] = low + (high - low) * dice.random()
    return changed


def reductions(table: Floats) -> Iterator[Floats]:
    """Yield smaller tables: first those without the choices of one leg, then those without one number."""
    chosen = np.isfinite(table)
    for leg in np.flatnonzero(chosen.sum(axis=1) > 1).tolist():
        changed = table.copy()
        changed[leg] = np.nan
        yield changed
    for leg, column in np.argwhere(chosen).tolist():
        changed = table.copy()
        changed[leg, column] = np.nan
        yield changed


def cut(table: Floats, speed: float, problem: Problem) -> Floats:
    """Return a table with its numbers clipped to what E3 to E5 allow in a problem.

    Parameters
    ----------
    table : (K, CHOICES)
        What is chosen; its speeds are shares of the largest.
    speed
        At which the car drives where nothing is chosen, m/s.
    problem
        Whose rules and car decide.

    Returns
    -------
    (K, CHOICES)
        The same with speeds in m/s.
    """
    rules = RuleParameters.from_mapping(problem.rules)
    fastest = problem.car.bounds.speed
    short = table.copy()
    crawl = SLOWEST * rules.linger_distance / max(rules.linger_time, problem.period)
    slowest = min(max(crawl, fastest / max(rules.journey_lengths, 1.0)), fastest)
    short[:, CHOICE.SPEED] = np.clip(short[:, CHOICE.SPEED] * fastest, slowest, fastest)
    hold = rules.enter_time if rules.tickets > 0 else min(rules.enter_time, rules.forfeit_time)
    short[:, CHOICE.HOLD] = np.clip(short[:, CHOICE.HOLD], 0.0, SHARE * hold)
    rest = SHARE * rules.rest_time - rules.journey_start_time
    short[:, CHOICE.PAUSE] = np.clip(short[:, CHOICE.PAUSE], 0.0, max(rest, 0.0))
    through = np.where(np.isfinite(short[:, CHOICE.SPEED]), short[:, CHOICE.SPEED], speed)
    through = np.minimum(np.maximum(through, through_speed(problem)), fastest)
    longest = LONGEST_WAY * (problem.intersection_radius + problem.car.body.reach)
    spare = np.maximum(SHARE * (rules.exit_time - longest / through), 0.0)
    short[:, CHOICE.DWELL] = np.clip(short[:, CHOICE.DWELL], 0.0, spare)
    short[:, CHOICE.GAP] = np.clip(short[:, CHOICE.GAP], LEAST_GAP, MOST_GAP)
    return short


def with_choices(
    instance: Instance, tables: Mapping[int, Floats], starts: Mapping[int, Pose] | None = None
) -> Instance:
    """Return an instance in which `tables` drive some e-agents, which may also begin at other `starts`.

    Both are by the numbers of the cars (1 is the first e-agent). An e-agent of the kind `chosen` keeps its other
    parameters; any other is changed to that kind.
    """
    agents, poses = list(instance.e_agents), list(instance.starts)
    for n, table in tables.items():
        agent = agents[n - 1]
        known = agent.parameters if agent.kind == "chosen" else parameters_of("chosen", {})
        agents[n - 1] = EAgent("chosen", agent.name, "chosen", {**known, "choices": to_rows(table)})
    for n, pose in (starts or {}).items():
        poses[n] = pose
    return replace(instance, e_agents=tuple(agents), starts=tuple(poses))


def table_of(agent: EAgent) -> Floats:
    """Return the table that drives an e-agent of the kind `chosen`."""
    return from_rows(agent.parameters["choices"])
