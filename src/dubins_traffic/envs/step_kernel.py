"""A step of environments, compiled: ticks, observation, terms of the reward.

The ticks are those of `engine.batch_kernel`; docs/semantics.md has their order, docs/design/088-envs.md what is
counted when.
"""

from __future__ import annotations

from dubins_traffic.cars.state import EGO
from dubins_traffic.engine.batch_kernel import COLLIDED, ENDED, FAULTY, RUNNING, World, run_trials
from dubins_traffic.envs.tables import StepTables
from dubins_traffic.envs.terms import AT_FAULT, BREACHES, COMFORT, PROGRESS, ROUNDS, TIME, VISITS
from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_wide
from dubins_traffic.observations.flat_kernel import sweep, write_flat
from dubins_traffic.observations.outlook import OutlookTables
from dubins_traffic.observations.seeking import metres_to_goal, seek
from dubins_traffic.rules.breach_log import COLLISION
from dubins_traffic.rules.propositions import BREACH3, LEFT, OVERTAKING


@jit
def begin_trials(outlook: OutlookTables, steps: StepTables) -> None:
    """Look at the first frame of every trial of a bank: what is visited there, what is sought, what the laser meets."""
    for b in range(outlook.trial.shape[0]):
        seek(b, outlook)
        sweep(b, 0, outlook)
        own = steps.stride[b]
        own.route = _route(b, outlook)
        own.speed = outlook.state.speed[b, EGO]
        own.yaw_rate = outlook.state.yaw_rate[b, EGO]


@jit
def observe_trials(rows: Ints, envs: Ints, outlook: OutlookTables, steps: StepTables) -> None:
    """Write what the egos of the trials `rows` (K,) observe as that of the environments `envs` (K,)."""
    for k in range(rows.shape[0]):
        write_flat(rows[k], EGO, steps.flat[envs[k]], outlook)


@jit_wide
def step_trials(
    rows: Ints,
    envs: Ints,
    dt: float,
    commands: Floats,
    world: World,
    outlook: OutlookTables,
    steps: StepTables,
) -> int:
    """Take some trials through the ticks that are left of their step; return how many have to be looked at.

    These have ended, or stand still since there is no room for something; the step of the latter goes on in the next
    call.

    Parameters
    ----------
    rows, envs : (K,)
        Trials of the bank, and the environment of each.
    dt : float
        Seconds of a tick.
    commands : (B, N, 2)
        Speed and yaw rate of every car, m/s and rad/s; those of the egos are written here.
    world, outlook, steps
        The tables of the bank's trials.
    """
    special = 0
    for k in range(rows.shape[0]):
        b: int = rows[k]
        e: int = envs[k]
        own = steps.stride[b]
        if own.left == 0:
            continue
        commands[b, EGO, 0] = steps.asked[e, 0]
        commands[b, EGO, 1] = steps.asked[e, 1]
        steps.one[0] = b
        status = RUNNING
        while own.left > 0 and status == RUNNING:
            breaches, contacts = world.breach_log.filled[0], world.work.found[0]
            tick = world.progress.trial[b].tick
            run_trials(steps.one, 1, dt, commands, world)
            status = world.progress.trial[b].status
            if world.progress.trial[b].tick > tick:
                own.left -= 1
                count_tick(b, e, dt, outlook, steps)
                _charge(e, breaches, contacts, world, steps)
                sweep(b, tick + 1, outlook)
        steps.status[e] = status
        if status in (ENDED, COLLIDED, FAULTY):
            own.left = 0
        special += 0 if status == RUNNING else 1
        _close(b, e, outlook, steps)
    return special


@jit_inline
def _close(b: int, e: int, outlook: OutlookTables, steps: StepTables) -> None:
    """Sum up the reward of a step, and observe."""
    total = 0.0
    for j in range(steps.weights.shape[0]):
        total += steps.weights[j] * steps.terms[e, j]
    steps.reward[e] = total
    write_flat(b, EGO, steps.flat[e], outlook)


@jit_inline
def count_tick(b: int, e: int, dt: float, outlook: OutlookTables, steps: StepTables) -> None:
    """Count what a tick of `dt` (s) has brought, but breaches and collisions.

    `b` and `e` (row) are the trial's, and that of its terms.
    """
    own, seen = steps.stride[b], outlook.trial[b]
    rounds, sought = seen.rounds, seen.target
    left = INFINITE
    if sought >= 0:
        there = outlook.labels.at[b, EGO] == outlook.goal[sought].vertex
        fresh = outlook.goal[sought].fresh != 0
        left = 0.0 if there and fresh else metres_to_goal(b, EGO, sought, outlook)
    if own.route < INFINITE and left < INFINITE:
        steps.terms[e, PROGRESS] += own.route - left
    steps.terms[e, VISITS] += seek(b, outlook)
    steps.terms[e, ROUNDS] += seen.rounds - rounds
    own.route = _route(b, outlook)
    speed, yaw_rate = outlook.state.speed[b, EGO], outlook.state.yaw_rate[b, EGO]
    faster, turned = (speed - own.speed) / seen.speed, (yaw_rate - own.yaw_rate) / seen.yaw_rate
    steps.terms[e, COMFORT] += faster * faster + turned * turned
    own.speed, own.yaw_rate = speed, yaw_rate
    steps.terms[e, TIME] += dt


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
        if log.row[k].car == EGO:
            steps.terms[e, BREACHES + log.row[k].rule] += 1.0
    for k in range(contacts, work.found[0]):
        if work.contact[k].car == EGO or work.contact[k].other == EGO:
            steps.terms[e, BREACHES + COLLISION] += 1.0
            steps.terms[e, BREACHES + AT_FAULT] += 1.0 if _guilty(k, world) else 0.0


@jit
def _guilty(k: int, world: World) -> bool:
    """Tell whether the ego is at fault in contact k, as `rules.fault.with_fault_by` does."""
    contact, note = world.work.contact[k], world.progress.contact[k]
    if contact.other < 0:
        return contact.moved != 0
    first = contact.moved != 0 and contact.closing > 0.0
    second = contact.other_moved != 0 and contact.other_closing > 0.0
    first_breaks = first and _in_breach(note.bits)
    second_breaks = second and _in_breach(note.other_bits)
    if first_breaks or second_breaks:
        return first_breaks if contact.car == EGO else second_breaks
    return first if contact.car == EGO else second


@jit_inline
def _in_breach(bits: int) -> bool:
    return bits & (LEFT | OVERTAKING) == LEFT or bits & BREACH3 != 0
