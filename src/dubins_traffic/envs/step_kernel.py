"""A step of environments: ticks, observation, terms of the reward (compiled).

The ticks are those of `engine.batch_kernel`; docs/semantics.md has their order, docs/design/088-envs.md what is
counted when.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.engine.batch_kernel import STATUS, World, run_trials
from dubins_traffic.envs.terms import AT_FAULT, TERM, worth
from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints, fetch
from dubins_traffic.kernels.compile import jit, jit_inline, jit_wide
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.learning.flat_kernel import sweep, within, write_flat
from dubins_traffic.learning.outlook import OutlookTables
from dubins_traffic.learning.seeking import look, metres_to_goal
from dubins_traffic.rules.breach_log import RULE
from dubins_traffic.rules.fault import blamed, in_breach
from dubins_traffic.rules.label_cache import growth_row
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.counts import RoundCount

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from dubins_traffic.problem.instance import Problem


@record
class Stride:
    """How far a trial is in the present step of its environment, and values of the last tick to compare with."""

    left: int
    """Ticks still to go in this step."""
    speed: float
    """The ego's in the frame before, m/s."""
    yaw_rate: float
    """The same, rad/s."""
    route: float
    """How far the ego had to go to the goal that it seeks, in the frame before, metres."""
    debt: float
    """What the ego's breaches before this step have added up to (`envs.terms.DEBTS`)."""
    owed: float
    """What those of this step add to it."""
    judged: int
    """1 if the rules are judged in the trial."""


def strides(problems: Sequence[Problem]) -> Rows[Stride]:
    """Return the strides of trials that have not begun."""
    stride = table(Stride, len(problems))
    stride["judged"] = [bool(problem.rules) for problem in problems]
    return stride


@record
class Scale:
    """How actions become commands, and how long a tick is."""

    period: float
    """Seconds of a tick."""
    pause: int
    """Ticks after which a step pauses for somebody who looks at every frame; 0: it does not."""
    waits: int
    """1 if a step waits before its first tick, too, for somebody who says what the egos do in each."""
    speed: float
    """Half of the range of speeds, m/s."""
    middle: float
    """Its middle, m/s."""
    yaw_rate: float
    """The top yaw rate, rad/s."""


class StepTables(Tables):
    """The environments of one bank of trials, and the results of a step of all environments.

    Attributes
    ----------
    stride : (B,) Stride
        Of each trial of the bank.
    scale : (1,) Scale
        What all have in common.
    asked : (E, 2)
        The action of each environment, shares of speed and yaw rate, -1 to 1.
    terms : (E, T)
        Terms of the reward, without weights.
    weighted : (E, T)
        The same, with weights.
    weights : (T,)
        Their weights.
    debts : (T,)
        What a unit of each adds to the debt.
    cost_of : (R,)
        The cost that each rule is (`envs.terms.costs_of_rules`).
    reward : (E,)
        The reward.
    status : (E,)
        Why the trial stands still (`engine.batch_kernel`), RUNNING if it does not.
    flat : (E, F)
        Flat observations.
    one : (1,)
        Scratch: a trial.
    """

    stride: Rows[Stride]
    scale: Rows[Scale]
    asked: Floats
    terms: Floats
    weighted: Floats
    weights: Floats
    debts: Floats
    cost_of: Ints
    reward: Floats
    status: Ints
    flat: npt.NDArray[np.float32] | Any
    one: Ints


_blamed = jit_inline(blamed)
_in_breach = jit_inline(in_breach)


@jit
def begin_trials(outlook: OutlookTables, steps: StepTables) -> None:
    """Prepare the first frame of every trial of a bank: goals visited, goals sought, the laser's scan."""
    for b in range(outlook.trial.shape[0]):
        look(b, outlook)
        sweep(b, 0, outlook)
        stride = steps.stride[b]
        stride.route = _route(b, outlook)
        stride.speed = outlook.state.speed[b, EGO]
        stride.yaw_rate = outlook.state.yaw_rate[b, EGO]


@jit
def observe_trials(rows: Ints, envs: Ints, outlook: OutlookTables, steps: StepTables) -> None:
    """Write the observations of the egos of the trials `rows` (K,) as those of the environments `envs` (K,)."""
    for k in range(rows.shape[0]):
        write_flat(rows[k], EGO, steps.flat[envs[k]], outlook)


@jit_wide
def step_trials(
    rows: Ints,
    envs: Ints,
    ticks: int,
    commands: Floats,
    world: World,
    outlook: OutlookTables,
    steps: StepTables,
) -> int:
    """Take some trials through a step; return how many of them have to be looked at, -1 if an action is not finite.

    Those have ended, pause, or stand still since there is no room for something. The step of the others goes on in
    another call with 0 ticks.

    Parameters
    ----------
    rows, envs : (K,)
        Trials of the bank, and the environment of each.
    ticks : int
        Ticks of the step that begins; 0 to go on with one.
    commands : (B, N, 2)
        Speed and yaw rate of every car, m/s and rad/s; those of the egos are written here.
    world, outlook, steps
        The tables of the bank's trials.
    """
    special = 0
    if ticks > 0 and not _begin(rows, envs, ticks, commands, steps):
        return -1
    for k in range(rows.shape[0]):
        b: int = rows[k]
        stride = steps.stride[b]
        if stride.left == 0:
            continue
        steps.one[0] = b
        if k + 1 < rows.shape[0]:
            _fetch(rows[k + 1], world)
        status = STATUS.RUNNING
        pause = stride.left - steps.scale[0].pause if steps.scale[0].pause > 0 else 0
        if ticks > 0 and steps.scale[0].waits != 0:
            pause = stride.left
        while stride.left > max(pause, 0) and status == STATUS.RUNNING:
            status = _tick(b, envs[k], commands, world, outlook, steps)
        steps.status[envs[k]] = status
        if status in (STATUS.ENDED, STATUS.COLLIDED, STATUS.FAULTY):
            stride.left = 0
        special += 0 if status == STATUS.RUNNING and stride.left == 0 else 1
        _close(b, envs[k], outlook, steps)
    return special


@jit_inline
def _fetch(b: int, world: World) -> None:
    """Have the processor bring what a tick of trial b reads, while it works at another one."""
    memory, drivers, state, labels = world.memory, world.drivers, world.state, world.labels
    tick, rules = world.progress.trial[b].tick + 1, world.rules[b]
    fetch(state.x, (b,))
    fetch(state.y, (b,))
    fetch(state.c, (b,))
    fetch(state.s, (b,))
    fetch(memory.kept, (b,))
    fetch(memory.growth, (b, growth_row(tick, rules)))
    fetch(memory.trail_x, (b, tick % memory.trail_x.shape[1]))
    fetch(memory.trail_y, (b, tick % memory.trail_x.shape[1]))
    then = (tick + memory.trail_x.shape[1] - rules.stand_ticks) % memory.trail_x.shape[1]
    fetch(memory.trail_x, (b, then))
    fetch(memory.trail_y, (b, then))
    fetch(memory.car, (b,))
    fetch(labels.bits, (b,))
    fetch(labels.lane, (b,))
    fetch(labels.crosses, (b,))
    fetch(drivers.command, (b,))
    fetch(drivers.way, (b,))
    fetch(drivers.car, (b,))
    fetch(world.breach_log.car, (b,))
    fetch(world.tally.trial, (b,))
    fetch(world.rules, (b,))
    fetch(drivers.vehicle, (b,))


@jit_inline
def _begin(rows: Ints, envs: Ints, ticks: int, commands: Floats, steps: StepTables) -> bool:
    """Begin a step: write the commands of the actions, and set all counts to 0; False if an action is not finite."""
    for e in range(steps.asked.shape[0]):
        both = steps.asked[e, 0] + steps.asked[e, 1]
        if both - both != 0.0:
            return False
    scale = steps.scale[0]
    for k in range(rows.shape[0]):
        b: int = rows[k]
        e: int = envs[k]
        commands[b, EGO, 0] = within(steps.asked[e, 0]) * scale.speed + scale.middle
        commands[b, EGO, 1] = within(steps.asked[e, 1]) * scale.yaw_rate
        stride = steps.stride[b]
        stride.left = ticks
        stride.debt += stride.owed
        for j in range(steps.terms.shape[1]):
            steps.terms[e, j] = 0.0
    return True


@jit_inline
def _tick(b: int, e: int, commands: Floats, world: World, outlook: OutlookTables, steps: StepTables) -> int:
    """Step trial b by a tick and count its results; return its status, which says why it can't go on, if so."""
    period = steps.scale[0].period
    breaches, contacts = world.breach_log.filled[0], world.work.found[0]
    tick, rounds, goals = (
        world.progress.trial[b].tick,
        world.tally.early[b].rounds,
        world.tally.early[b].goals,
    )
    run_trials(steps.one, 1, period, commands, world)
    if world.progress.trial[b].tick > tick:
        steps.stride[b].left -= 1
        count_tick(b, e, outlook, steps)
        count_early(e, b, rounds, goals, world.tally.early[b], outlook, steps)
        _charge(e, breaches, contacts, world, steps)
        sweep(b, tick + 1, outlook)
    return world.progress.trial[b].status


@jit_inline
def _close(b: int, e: int, outlook: OutlookTables, steps: StepTables) -> None:
    """Compute the reward of a step, and observe."""
    pay(b, e, steps.weights, steps.debts, steps)
    write_flat(b, EGO, steps.flat[e], outlook)


@jit_inline
def pay(row: int, e: int, weights: Floats, debts: Floats, steps: StepTables) -> None:
    """Compute the reward of the car in a `row` (row) for a step, from its terms in row `e` (row).

    `weights` (T,) and `debts` (T,) are those of each term.
    """
    stride, total, owed = steps.stride[row], 0.0, 0.0
    share = worth(stride.debt)
    for j in range(weights.shape[0]):
        weighted = weights[j] * steps.terms[e, j] * (share if j <= TERM.PROGRESS else 1.0)
        steps.weighted[e, j] = weighted
        total += weighted
        owed += debts[j] * steps.terms[e, j]
    stride.owed = owed
    steps.reward[e] = total


@jit_inline
def count_early(
    e: int, row: int, rounds: int, goals: int, early: RoundCount, outlook: OutlookTables, steps: StepTables
) -> None:
    """Count what a tick has added to the rounds before the ego's first breach, as a term.

    Parameters
    ----------
    e : int
        The row of the term.
    row : int
        The ego's row of `outlook`.
    rounds, goals : int
        Number of rounds, and of goals in the next one, before that tick; `early` has those of now.
    """
    if early.goals != goals or early.rounds != rounds:
        each = 1.0 / max(1, outlook.trial[row].last_goal - outlook.trial[row].first_goal)
        steps.terms[e, TERM.EARLY] += (early.rounds - rounds) + (early.goals - goals) * each


@jit_inline
def count_tick(b: int, e: int, outlook: OutlookTables, steps: StepTables) -> None:
    """Count what a tick has brought, but breaches and collisions; `b` and `e` (row): the trial's, and of its terms."""
    stride, seen = steps.stride[b], outlook.trial[b]
    rounds, sought = seen.rounds, seen.target
    left = INFINITE
    there = False
    if sought >= 0:
        goal = outlook.goal[sought]
        there = outlook.labels.at[b, EGO] == goal.vertex and goal.fresh != 0
        left = 0.0 if there else metres_to_goal(b, EGO, sought, outlook)
    if stride.route < INFINITE and left < INFINITE:
        steps.terms[e, TERM.PROGRESS] += stride.route - left
    visited = look(b, outlook)
    steps.terms[e, TERM.VISITS] += visited
    steps.terms[e, TERM.ROUNDS] += seen.rounds - rounds
    stride.route = _route(b, outlook) if visited != 0 or seen.target != sought else left
    speed, yaw_rate = outlook.state.speed[b, EGO], outlook.state.yaw_rate[b, EGO]
    faster, turned = (speed - stride.speed) / seen.speed, (yaw_rate - stride.yaw_rate) / seen.yaw_rate
    steps.terms[e, TERM.COMFORT] += faster * faster + turned * turned
    stride.speed, stride.yaw_rate = speed, yaw_rate
    steps.terms[e, TERM.TIME] += steps.scale[0].period
    if stride.judged != 0:
        _count_breaches_that_last(e, np.int64(outlook.labels.bits[b, EGO]), steps)


@jit_inline
def _count_breaches_that_last(e: int, bits: Any, steps: StepTables) -> None:
    """Count a tick that ends off the road, over the line without overtaking, in a disc entered against rule 3."""
    if bits & (FLAG.ON_ROAD | FLAG.LEFT | FLAG.BREACH3) == FLAG.ON_ROAD:
        return
    period = steps.scale[0].period
    steps.terms[e, TERM.OFF_ROAD] += period if bits & FLAG.ON_ROAD == 0 else 0.0
    steps.terms[e, TERM.LEFT] += period if bits & (FLAG.LEFT | FLAG.OVERTAKING) == FLAG.LEFT else 0.0
    steps.terms[e, TERM.CROSSING] += period if bits & FLAG.BREACH3 != 0 else 0.0


@jit_inline
def _route(b: int, outlook: OutlookTables) -> float:
    """Return how far the ego has to go to the goal that it seeks, metres; inf without one."""
    target = outlook.trial[b].target
    return metres_to_goal(b, EGO, target, outlook) if target >= 0 else INFINITE


@jit_inline
def _charge(e: int, breaches: int, contacts: int, world: World, steps: StepTables) -> None:
    """Count the ego's breaches and collisions among those found from the given rows on."""
    log, work = world.breach_log, world.work
    for k in range(breaches, log.filled[0]):
        cost = steps.cost_of[log.row[k].rule]
        if log.row[k].car == EGO and cost >= 0:
            steps.terms[e, TERM.BREACHES + cost] += 1.0
    for k in range(contacts, work.found[0]):
        if work.contact[k].car == EGO or work.contact[k].other == EGO:
            steps.terms[e, TERM.BREACHES + steps.cost_of[RULE.COLLISION]] += 1.0
            steps.terms[e, TERM.BREACHES + AT_FAULT] += 1.0 if is_guilty(k, EGO, world) else 0.0


@jit
def is_guilty(k: int, n: int, world: World) -> bool:
    """Tell whether car `n` (index) is at fault in its contact `k` (index) of those found in `world` (trials).

    It does as `rules.fault.with_fault_by`.
    """
    contact, note = world.work.contact[k], world.progress.contact[k]
    if contact.other < 0:
        return contact.moved != 0
    first = contact.moved != 0 and contact.closing > 0.0
    second = contact.other_moved != 0 and contact.other_closing > 0.0
    guilty, other_guilty = _blamed(first, second, _in_breach(note.bits), _in_breach(note.other_bits))
    return guilty if contact.car == n else other_guilty
