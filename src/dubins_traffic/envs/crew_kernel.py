"""A step of trials in which learners drive several cars: ticks, observations, breaches that count, rewards (compiled).

All that is made for egos serves each car from a row of its own, in which it stands in the ego's place
(`observations.viewpoints`). Car n of trial b has row ``b P + n``, where P is how many places for cars the tables of the
bank have; its results, in environment e, stand in row ``e N + n`` of N cars.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.cars.state import EGO
from dubins_traffic.engine.batch_kernel import STATUS, World, run_trials
from dubins_traffic.envs.about_ego import tell
from dubins_traffic.envs.blame import BlameTables, is_excused, part_that_counts
from dubins_traffic.envs.step_kernel import StepTables, count_early, count_tick, is_guilty, pay
from dubins_traffic.envs.terms import AT_FAULT, TERM
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare, jit_wide
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.learning.flat_kernel import sweep, write_flat
from dubins_traffic.learning.outlook import OutlookTables
from dubins_traffic.observations.viewpoints import ViewTables, show
from dubins_traffic.rules.breach_log import RULE

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@record
class Before:
    """What had been found when a tick began."""

    breaches: int
    """Rows of the breach log."""
    contacts: int
    """Contacts."""


class CrewTables(Tables):
    """Whose trials they are, what decides which breaches count, and what the cars of crews are paid for.

    Attributes
    ----------
    who : (K,)
        The cars that are looked at: the ego, then those that learners drive.
    views : ViewTables
        The trials as each car sees them.
    outlook : OutlookTables
        The same, as observations are made of them.
    blame : BlameTables
        Which breaches count.
    commands : (B, N, 2)
        Speed and yaw rate of every car, m/s and rad/s; those of learners are held.
    before : (1,) Before
        Scratch: what had been found when a tick began.
    lasting : (N, 3)
        Scratch: what had been counted of breaches that last then.
    weights : (2, T)
        The weight of each of `envs.terms.PAID` for the ego, and for e-agents.
    debts : (2, T)
        What a unit of each adds to the debt of the ego, and of an e-agent.
    told : (E N, F)
        What each car is told of the ego.
    first : (E,)
        The car whose breach was the first that counted, -1 so far.
    played : (B, K, N, 2)
        The commands of all cars in each tick, where they are kept.
    """

    who: Ints
    views: ViewTables
    outlook: OutlookTables
    blame: BlameTables
    commands: Floats
    before: Rows[Before]
    lasting: Floats
    weights: Floats
    debts: Floats
    told: npt.NDArray[np.float32]
    first: Ints
    played: Floats


@jit_wide
def step_crews(
    rows: Ints, envs: Ints, ticks: int, begins: bool, world: World, crew: CrewTables, steps: StepTables
) -> int:
    """Take some trials through ticks of a step; return how many of them have to be looked at.

    Those have ended, or stand still since there is no room for something. The step of the others goes on in another
    call with 0 ticks.

    Parameters
    ----------
    rows, envs : (K,)
        Trials of the bank, and the environment of each.
    ticks : int
        Ticks to go; 0 to go on with those of the call before, or only to begin.
    begins : bool
        Whether a step begins: then nothing is counted so far.
    world, crew, steps
        The tables of the bank's trials.
    """
    special = 0
    places: int = world.state.x.shape[1]
    for k in range(rows.shape[0]):
        b: int = rows[k]
        e: int = envs[k]
        ego: int = b * places
        stride = steps.stride[ego]
        if begins:
            _begin(b, e, places, crew, steps)
        if ticks > 0:
            stride.left = ticks
        if stride.left == 0 and not begins:
            continue
        steps.one[0] = b
        status = STATUS.RUNNING
        while stride.left > 0 and status == STATUS.RUNNING:
            status = _tick(b, e, world, crew, steps)
        steps.status[e] = status
        if status in (STATUS.ENDED, STATUS.COLLIDED, STATUS.FAULTY):
            stride.left = 0
        special += 0 if status == STATUS.RUNNING else 1
        _close(b, e, places, crew, steps)
    return special


@jit
def observe_crews(rows: Ints, envs: Ints, places: int, crew: CrewTables, steps: StepTables) -> None:
    """Write what the cars of the trials `rows` (K,) observe as observations of the environments `envs` (K,).

    `places` (count) is how many cars the tables of a trial have room for.
    """
    for k in range(rows.shape[0]):
        b: int = rows[k]
        e: int = envs[k]
        crew.first[e] = crew.blame.trial[b].first
        for i in range(crew.who.shape[0]):
            _observe(b, e, crew.who[i], places, crew, steps)


@jit_inline
def _of_env(e: int, steps: StepTables) -> int:
    """Return the first row of results of environment e."""
    first: int = e * (steps.flat.shape[0] // steps.status.shape[0])
    return first


@jit_inline
def _begin(b: int, e: int, places: int, crew: CrewTables, steps: StepTables) -> None:
    """Set all counts of a step to 0."""
    for i in range(crew.who.shape[0]):
        n: int = crew.who[i]
        row: int = b * places + n
        stride = steps.stride[row]
        stride.debt += stride.owed
        for j in range(steps.terms.shape[1]):
            steps.terms[_of_env(e, steps) + n, j] = 0.0


@jit_inline
def _tick(b: int, e: int, world: World, crew: CrewTables, steps: StepTables) -> int:
    """Step trial b by a tick and count its results; return its status, which says why it can't go on, if so."""
    places: int = world.state.x.shape[1]
    first: int = b * places
    place = _of_env(e, steps)
    before, views, outlook = crew.before[0], crew.views, crew.outlook
    before.breaches, before.contacts = world.breach_log.filled[0], world.work.found[0]
    tick = world.progress.trial[b].tick
    rounds, goals = world.tally.early[b].rounds, world.tally.early[b].goals
    run_trials(steps.one, 1, steps.scale[0].period, crew.commands, world)
    if world.progress.trial[b].tick == tick:
        return world.progress.trial[b].status
    if tick < crew.played.shape[1]:
        for n in range(places):
            crew.played[b, tick, n, 0] = crew.commands[b, n, 0]
            crew.played[b, tick, n, 1] = crew.commands[b, n, 1]
    steps.stride[first].left -= 1
    for i in range(crew.who.shape[0]):
        n: int = crew.who[i]
        for j in range(3):
            crew.lasting[n, j] = steps.terms[place + n, TERM.OFF_ROAD + j]
        show(b, n, first + n, views.state, views.labels, views.own_state, views.own_labels)
        count_tick(first + n, place + n, outlook, steps)
        sweep(first + n, tick + 1, outlook)
    count_early(place, first, rounds, goals, world.tally.early[b], outlook, steps)
    if world.breach_log.filled[0] > before.breaches or world.work.found[0] > before.contacts:
        _charge(b, e, world, crew, steps)
    for i in range(crew.who.shape[0]):
        n = crew.who[i]
        if is_excused(b, n, tick + 1, crew.blame):
            for j in range(3):
                steps.terms[place + n, TERM.OFF_ROAD + j] = crew.lasting[n, j]
    return world.progress.trial[b].status


@jit_rare
def _charge(b: int, e: int, world: World, crew: CrewTables, steps: StepTables) -> None:
    """Count the breaches and collisions of a tick as far as they count.

    The e-agents' come first, then the ego's; of each side they go by rule, then by car.
    """
    for rule in range(crew.blame.part.shape[0]):
        for n in range(1, world.state.count[b]):
            _blame(b, e, n, rule, world, crew, steps)
    for rule in range(crew.blame.part.shape[0]):
        _blame(b, e, EGO, rule, world, crew, steps)


@jit_inline
def _blame(b: int, e: int, n: int, rule: int, world: World, crew: CrewTables, steps: StepTables) -> None:
    """Count what car n of trial b has broken of a `rule` (code) in a tick."""
    log, work, before = world.breach_log, world.work, crew.before[0]
    row, tick = _of_env(e, steps) + n, world.progress.trial[b].tick
    for k in range(before.breaches, log.filled[0]):
        if log.row[k].car == n and log.row[k].rule == rule:
            part = part_that_counts(b, n, rule, tick, crew.blame)
            if part >= 0:
                steps.terms[row, TERM.BREACHES + part] += 1.0
    if rule != (RULE.COLLISION if n == EGO else RULE.FAULT):
        return
    for k in range(before.contacts, work.found[0]):
        if n not in (work.contact[k].car, work.contact[k].other):
            continue
        guilty = is_guilty(k, n, world)
        if n == EGO or guilty:
            part = part_that_counts(b, n, rule, tick, crew.blame)
            if part >= 0:
                steps.terms[row, TERM.BREACHES + part] += 1.0
                steps.terms[row, TERM.BREACHES + AT_FAULT] += 1.0 if n == EGO and guilty else 0.0


@jit_inline
def _close(b: int, e: int, places: int, crew: CrewTables, steps: StepTables) -> None:
    """Compute the rewards of a step, and observe."""
    place, spoiled, violated = _of_env(e, steps), 0.0, 0.0
    for j in range(TERM.PROGRESS + 1):
        spoiled -= crew.weights[0, j] * steps.terms[place, j]
    for j in range(AT_FAULT):
        violated += steps.terms[place, TERM.BREACHES + j]
    crew.first[e] = crew.blame.trial[b].first
    for i in range(crew.who.shape[0]):
        n: int = crew.who[i]
        side = 0 if n == EGO else 1
        if n != EGO:
            steps.terms[place + n, TERM.SPOILED] = spoiled
            steps.terms[place + n, TERM.VIOLATED] = violated
        pay(b * places + n, place + n, crew.weights[side], crew.debts[side], steps)
        _observe(b, e, n, places, crew, steps)


@jit_inline
def _observe(b: int, e: int, n: int, places: int, crew: CrewTables, steps: StepTables) -> None:
    """Write what car n of trial b observes in environment e."""
    row, out = b * places + n, _of_env(e, steps) + n
    write_flat(row, EGO, steps.flat[out], crew.outlook)
    tell(row, b * places, 0 if n == EGO else 1, crew.told[out], crew.outlook, steps)
