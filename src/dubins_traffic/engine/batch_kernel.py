"""The tick of a batch, compiled: drivers, motion, labels, referee and metrics of one trial after another.

A trial runs for many ticks before the next one is taken up, so that all it needs stays in the processor's nearest
memory. The order of events in a tick is that of `docs/semantics.md`.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.agents.kernel import decide_trial as decide_others
from dubins_traffic.agents.tables import Scene
from dubins_traffic.cars.motion import FULL, MOVED, Motion, step_trial
from dubins_traffic.cars.near import Spacing, keep_apart, lost
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_wide
from dubins_traffic.kernels.records import Rows as TableOf
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.policy import decide_trial as decide_lawful
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.rules.breach_log import MOST, BreachLog, RefereeParameters, RefereeTables
from dubins_traffic.rules.frame import label_trial
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.referee_kernel import judge_trial
from dubins_traffic.rules.tables import LabelTables, Memory, TrialRules
from dubins_traffic.scoring.tally import CLEARANCE, SEALED, SIGHT2, Tally, count_frame

RUNNING, ENDED, COLLIDED, FAULTY, NO_CONTACTS, NO_PAIRS, NO_SIGHT, NO_DOCKET = range(8)
"""Why a trial stands still: for nothing; its time is up; the ego collided; an e-agent asked for a command that is not
finite; there is no room for contacts, for pairs that may meet, for pairs that may see each other, for breaches."""

TICK, LAST, STATUS, DECIDED, LAWFUL, OTHERS, ENDS = range(7)
COURSE = 7
"""Columns of `Progress.ints`.

TICK: the present frame, -1 before the first. LAST: the last one. STATUS: as above. DECIDED: 1 if the commands for
the next tick are chosen already. LAWFUL, OTHERS: whether the law drives some of its cars, and whether other built-in
drivers do. ENDS: whether a collision of the ego ends it.
"""


class Progress(Tables):
    """The trials of a batch on their way, and what is noted beside the contacts and breaches found.

    `ints` (B, COURSE). `sight2` (B,): square of the radius within which an ego that the law drives sees others.
    `contact` (C, 5): tick, the flags of both cars in the frame before, and whether each is within the ego's sensing
    radius, of each contact. `place` (K, 2): where the car of each breach was.
    """

    ints: Ints
    sight2: Floats
    contact: Ints
    place: Floats


class World(Scene, Traffic, Motion):
    """All tables of a batch."""

    beside: ObstacleLanes
    rules: TableOf[TrialRules]
    terms: TableOf[RefereeParameters]
    memory: Memory
    breach_log: BreachLog
    tally: Tally
    progress: Progress
    spacing: Spacing
    labelling: LabelTables
    judging: RefereeTables
    """The same tables, as labels and referee take them."""


@jit_wide
def run_trials(active: Ints, most: int, dt: float, commands: Floats, world: World) -> None:
    """Run each of the trials `active` for up to `most` ticks, as far as it goes.

    Parameters
    ----------
    active : (K,)
        Trials.
    most : int
        Ticks.
    dt : float
        Seconds of a tick.
    commands : (B, N, 2)
        Speed and yaw rate of every car; those of cars that no built-in driver drives are held.
    world
        The tables of the batch.
    """
    for k in range(active.shape[0]):
        b = active[k]
        own = world.progress.ints[b]
        own[STATUS] = RUNNING
        for _ in range(most):
            if own[STATUS] != RUNNING:
                break
            _advance(b, dt, commands, own, world)


@jit_inline
def _advance(b: int, dt: float, commands: Floats, own: Ints, world: World) -> None:
    """Take trial b from its present frame to the next one, or say why not in `own[STATUS]`."""
    tick = own[TICK]
    if world.breach_log.filled[0] + _room(b, world) > world.breach_log.row.shape[0]:
        own[STATUS] = NO_DOCKET
        return
    ego_hit = False
    if tick >= 0:
        _decide(b, tick, commands, own, world)
        if own[STATUS] != RUNNING:
            return
        before = world.work.found[0]
        least = world.spacing.least[b] - lost(world.spacing, b, tick)
        moved = step_trial(b, dt, least, commands, world)
        if moved != MOVED:
            own[STATUS] = NO_CONTACTS if moved == FULL else NO_PAIRS
            return
        own[DECIDED] = 0
        if world.work.found[0] > before:
            ego_hit = _note_contacts(b, tick + 1, before, world)
    own[TICK] = tick + 1
    keep_apart(world.state, b, tick + 1, world.spacing)
    label_trial(b, tick + 1, world.labelling)
    _observe(b, tick + 1, world)
    if ego_hit:
        world.tally.ints[b, SEALED] = 1
    if tick + 1 >= own[LAST]:
        own[STATUS] = ENDED
    elif ego_hit and own[ENDS] != 0:
        own[STATUS] = COLLIDED


@jit_inline
def _room(b: int, world: World) -> int:
    """Return the most breaches that a frame of trial b can begin."""
    own = world.terms[b]
    return MOST * world.state.count[b] + own.goals_end - own.goals_begin


@jit_inline
def _decide(b: int, tick: int, commands: Floats, own: Ints, world: World) -> None:
    if own[DECIDED] != 0:
        return
    if own[OTHERS] != 0 and not decide_others(b, tick, world, commands):
        own[STATUS] = NO_SIGHT
        return
    if own[LAWFUL] != 0:
        spacing = world.spacing
        decide_lawful(
            b, tick, world.progress.sight2[b], spacing.apart[b], lost(spacing, b, tick), world, commands
        )  # fmt: skip
    finite = True
    for n in range(commands.shape[1]):
        speed, yaw_rate = commands[b, n, 0], commands[b, n, 1]
        finite &= (speed - speed == 0.0) & (yaw_rate - yaw_rate == 0.0)
    if not finite:
        own[STATUS] = FAULTY
    own[DECIDED] = 1


@jit
def _note_contacts(b: int, tick: int, first: int, world: World) -> bool:
    """Note tick and flags of the contacts found from row `first` on; tell whether one is the ego's."""
    ego_hit = False
    for k in range(first, world.work.found[0]):
        car = world.work.contact[k].car
        other = world.work.contact[k].other
        note = world.progress.contact[k]
        note[0] = tick
        note[1] = np.int64(world.labels.bits[b, car])
        note[2] = np.int64(world.labels.bits[b, other]) if other >= 0 else 0
        note[3] = _is_sensed(b, car, world)
        note[4] = _is_sensed(b, other, world) if other >= 0 else 0
        if EGO in (car, other):
            ego_hit = True
            world.tally.floats[b, CLEARANCE] = 0.0
    return ego_hit


@jit
def _is_sensed(b: int, n: int, world: World) -> int:
    """Return 1 if car n is within the ego's sensing radius, else 0."""
    dx = world.state.x[b, n] - world.state.x[b, EGO]
    dy = world.state.y[b, n] - world.state.y[b, EGO]
    return 1 if dx * dx + dy * dy <= world.tally.floats[b, SIGHT2] else 0


@jit_inline
def _observe(b: int, tick: int, world: World) -> None:
    """Judge and count a frame that has been labelled."""
    breach_log, tally = world.breach_log, world.tally
    count_frame(
        b, tick, world.state, world.labels, world.roads, world.cars, world.obstacles, world.spacing, tally
    )
    if world.terms[b].judged == 0:
        return
    first = breach_log.filled[0]
    judge_trial(b, tick, world.judging)
    for k in range(first, breach_log.filled[0]):
        n = breach_log.row[k].car
        world.progress.place[k, 0] = world.state.x[b, n]
        world.progress.place[k, 1] = world.state.y[b, n]
        if n == EGO:
            tally.ints[b, SEALED] = 1
