"""Forks of trials of a batch: copies of these trials' rows out of all tables.

Tables hold one row per trial, with three exceptions. Goals and obstacles stand one trial after another, with offsets.
The ego's path, for each car that follows it, stands in the row that the car names. What no trial changes (roads, lanes
of loops, scripts, stages) is shared by the batch and its forks.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from dubins_traffic.agents.free import Free
from dubins_traffic.agents.tables import Agents
from dubins_traffic.cars.clip_and_move import rows
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.engine.batch_kernel import BreachPlace, ContactNote, World
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.rules.breach_log import BreachLog, FoundBreach, RefereeParameters, RefereeTables
from dubins_traffic.rules.tables import LabelTables, spread
from dubins_traffic.scoring.tally import Tally
from dubins_traffic.shield.tables import Alone, ShieldTables

Table = TypeVar("Table", bound=Tables)


class Ragged(NamedTuple):
    """Rows that stand one trial after another: those of trial b are `off[b]` to ``off[b + 1] - 1``; `row` (R,)."""

    off: Ints
    row: Ints


def world_of(world: World, trials: Ints, seeds: npt.NDArray[np.uint64] | None, dt: float) -> World:
    """Return the tables of forks of some trials; a trial may be named more than once.

    The batch and its forks share nothing that changes.

    Parameters
    ----------
    world : World
        The tables of the batch, whose breaches and contacts have all been taken over.
    trials : (K,)
        Numbers of trials of the batch.
    seeds : (K,) uint64, optional
        Seed of each fork from here on; by default that of its trial.
    dt : float
        Seconds of a tick.
    """
    cars = rows_of(world.cars, trials)
    terms = spread(world.terms, trials)
    goals = _goals(terms)
    seed = {} if seeds is None else {"seed": seeds}
    progress, work = world.progress, world.work
    state, roads, beside = (
        rows_of(world.state, trials), world.roads, world.beside.replace(base=world.beside.base[trials]),
    )  # fmt: skip
    rules, labels, memory = (
        spread(world.rules, trials), rows_of(world.labels, trials), rows_of(world.memory, trials),
    )  # fmt: skip
    breach_log = _breach_log(world.breach_log, trials, goals)
    spacing = rows_of(world.spacing, trials, near=world.spacing.near.copy())
    return World(
        state=state,
        cars=cars,
        obstacles=_obstacles(world.obstacles, trials),
        rows=rows(cars, world.state.x.shape[1], dt),
        work=_copied(work).replace(partner=work.partner[trials], touching=work.touching[trials]),
        roads=roads,
        beside=beside,
        rules=rules,
        terms=terms,
        labels=labels,
        memory=memory,
        breach_log=breach_log,
        drivers=rows_of(
            world.drivers,
            trials,
            stage=world.drivers.stage,
            distance=world.drivers.distance,
            choice=world.drivers.choice,
            **seed,
        ),
        scratch=_copied(world.scratch),
        agents=_agents(world.agents, trials, seeds),
        space=_copied(world.space),
        tally=_tally(world.tally, trials),
        progress=rows_of(
            progress,
            trials,
            contact=table(ContactNote, len(progress.contact)),
            place=table(BreachPlace, len(progress.place)),
        ),
        spacing=spacing,
        free=_free(world.free, trials),
        labelling=LabelTables(state, roads, beside, rules, labels, memory),
        judging=RefereeTables(state, roads, beside, rules, terms, labels, memory, breach_log, spacing),
    )


def reseed(world: World, seeds: npt.NDArray[np.uint64]) -> None:
    """Let each trial draw from another seed from here on, (B,), with the bits of its fork that has this seed."""
    world.agents.team["seed"] = seeds
    world.drivers.seed[:] = seeds


def rows_of(table: Table, trials: Ints, **other: Any) -> Table:
    """Return a copy of a table with the rows `trials` of each array, except for the arrays given in `other`."""
    names = table.field_names
    own = [other[name] if name in other else array[trials] for name, array in zip(names, table, strict=True)]
    return type(table)(*own)


def ragged(off: Ints, trials: Ints) -> Ragged:
    """Return the offsets (K + 1,) and row numbers (R,) of `trials` in arrays whose offsets are `off` (B + 1,)."""
    first, count = off[trials], np.diff(off)[trials]
    ends = np.append(0, count.cumsum())
    rows: Ints = np.arange(ends[-1], dtype=np.int64) + np.repeat(first - ends[:-1], count)
    return Ragged(ends, rows)


def _copied(table: Table) -> Table:
    return type(table)(*(_copied(own) if isinstance(own, Tables) else own.copy() for own in table))


def _obstacles(table: ObstacleTable, trials: Ints) -> ObstacleTable:
    own = ragged(table.off, trials)
    return ObstacleTable(own.off, table.parts[own.row])


def _goals(terms: Rows[RefereeParameters]) -> Ints:
    """Return the rows of the forks' goals, one fork's after another's; set `goals_begin` and `goals_end` to match."""
    begin, end = terms["goals_begin"].copy(), terms["goals_end"].copy()
    ends = np.append(0, (end - begin).cumsum())
    terms["goals_begin"] = ends[:-1]
    terms["goals_end"] = ends[1:]
    rows: Ints = np.arange(ends[-1], dtype=np.int64) + np.repeat(begin - ends[:-1], end - begin)
    return rows


def _breach_log(log: BreachLog, trials: Ints, goals: Ints) -> BreachLog:
    row, filled = table(FoundBreach, len(log.row)), np.zeros_like(log.filled)
    return rows_of(log, trials, goal=spread(log.goal, goals), look=log.look.copy(), row=row, filled=filled)


def _tally(tally: Tally, trials: Ints) -> Tally:
    goals = ragged(np.append(tally.trial["first_goal"], len(tally.goal)), trials)
    own = tally.trial[trials]
    own["first_goal"], own["last_goal"] = goals.off[:-1], goals.off[1:]
    names = "goal", "sample_done", "round_done", "early_done"
    return rows_of(tally, trials, trial=own, **{name: getattr(tally, name)[goals.row] for name in names})


def _free(free: Free, trials: Ints) -> Free:
    """Return the free cars of forks, each with a memory of its own."""
    row = free.row[trials]
    is_one = row >= 0
    own = row[is_one]
    row[is_one] = np.arange(len(own))
    own = own if len(own) else np.zeros(1, dtype=np.int64)
    shared = free.traffic.drivers
    drivers = rows_of(shared, own, stage=shared.stage, distance=shared.distance, choice=shared.choice)
    traffic = free.traffic.replace(
        state=rows_of(free.traffic.state, own),
        labels=rows_of(free.traffic.labels, own),
        obstacles=_obstacles(free.traffic.obstacles, own),
        drivers=drivers,
        scratch=_copied(free.traffic.scratch),
    )
    alone = free.shields.alone
    unseen = alone.traffic.replace(
        state=rows_of(alone.traffic.state, own),
        labels=rows_of(alone.traffic.labels, own),
        obstacles=traffic.obstacles,
        drivers=drivers.replace(
            car=alone.traffic.drivers.car[own],
            way=alone.traffic.drivers.way[own],
            command=alone.traffic.drivers.command[own],
        ),
        scratch=traffic.scratch,
    )
    beside = free.shields.obstacles.replace(base=free.shields.obstacles.base[own])
    shields = ShieldTables(free.shields.ego[own], beside, Alone(unseen, alone.commands[own]))
    return Free(row, free.car[own], free.whim, traffic, shields, free.commands[own])


def _agents(agents: Agents, trials: Ints, seeds: npt.NDArray[np.uint64] | None) -> Agents:
    """Return the e-agents of forks; each car that follows the ego or is nudged gets a memory of its own."""
    team, cars = agents.team[trials], agents.agent[trials]
    if seeds is not None:
        team["seed"] = seeds
    follows = cars["trail"] >= 0
    trail = cars["trail"][follows]
    cars["trail"][follows] = np.arange(len(trail))
    nudged = cars["recall"] >= 0
    recall = cars["recall"][nudged]
    cars["recall"][nudged] = np.arange(len(recall))
    return Agents(
        team,
        cars,
        agents.cycle,
        agents.script,
        agents.trail[trail],
        agents.point[trail],
        agents.recalled[recall],
    )
