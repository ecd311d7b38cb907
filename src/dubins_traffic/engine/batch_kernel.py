"""Steps the trials of a batch (compiled): drivers, motion, labels, referee and metrics, trial after trial.

A trial runs for many ticks before the next one is taken up, so that all it needs stays in the processor's nearest
memory. The order of events in a tick is that of `docs/semantics.md`.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.agents.free import Free, decide_free
from dubins_traffic.agents.kernel import decide_trial as decide_others
from dubins_traffic.agents.nudge import nudge_trial
from dubins_traffic.agents.tables import Scene
from dubins_traffic.cars.motion import OUTCOME, Motion, step_trial
from dubins_traffic.cars.near import refresh_spacing, spacing_loss
from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare, jit_wide
from dubins_traffic.kernels.records import Rows as TableOf
from dubins_traffic.kernels.records import record
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.policy import decide_trial as decide_lawful
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.rules.breach_log import MOST, BreachLog, RefereeParameters, RefereeTables
from dubins_traffic.rules.frame import label_trial
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.referee_kernel import judge_trial
from dubins_traffic.rules.tables import LabelTables, Memory, TrialRules
from dubins_traffic.scoring.tally import Counted, count_frame


class _Status(NamedTuple):
    """Whether a trial goes on, or why it waits for its group: values of `TrialProgress.status`."""

    RUNNING: int = 0
    """The trial goes on."""
    ENDED: int = 1
    """Its duration is over."""
    COLLIDED: int = 2
    """The ego collided."""
    FAULTY: int = 3
    """An e-agent asked for a command that is not finite."""
    NO_CONTACTS: int = 4
    """The buffer of contacts is full."""
    NO_PAIRS: int = 5
    """The buffer of pairs that may meet is too small."""
    NO_SIGHT: int = 6
    """The buffer of pairs that may see each other is too small."""
    NO_BREACHES: int = 7
    """The breach log is full."""


STATUS: Final = _Status()


@record
class TrialProgress:
    """How far a trial has come."""

    tick: int = -1
    """The present frame, -1 before the first."""
    last: int
    """The last one."""
    status: int
    """`STATUS`: why it stands still, if it does."""
    decided: int
    """1 if the commands for the next tick are chosen already."""
    lawful: int
    """1 if the law drives some of its cars."""
    others: int
    """1 if other built-in drivers drive some of its cars."""
    free: int
    """1 if some of its e-agents are free."""
    nudged: int
    """1 if some of its e-agents are nudged."""
    ends: int
    """1 if a collision of the ego ends it."""
    sight2: float
    """Square of the radius within which an ego that the law drives sees others, metres squared."""


@record
class ContactNote:
    """Tick and flags of a contact, beside the `cars.motion.Meeting`."""

    tick: int
    """The frame in which its tick ends."""
    bits: int
    """Flags of the car in the frame before."""
    other_bits: int
    """Flags of the other car then, 0 of an obstacle."""
    sensed: int
    """1 if the car is within the ego's sensing radius."""
    other_sensed: int
    """1 if the other is."""


@record
class BreachPlace:
    """Where the car of a breach was in its frame."""

    x: float
    y: float
    """Its centre, metres."""
    sensed: int
    """1 if it was within the ego's sensing radius."""


class Progress(Tables):
    """How far the trials of a batch have come, and notes on the contacts and breaches found.

    `trial` (B,); `contact` (C,), one for each contact; `place` (K,), one for each breach.
    """

    trial: TableOf[TrialProgress]
    contact: TableOf[ContactNote]
    place: TableOf[BreachPlace]


class World(Scene, Traffic, Motion, Counted):
    """All tables of a batch."""

    beside: ObstacleLanes
    rules: TableOf[TrialRules]
    terms: TableOf[RefereeParameters]
    memory: Memory
    breach_log: BreachLog
    progress: Progress
    free: Free
    labelling: LabelTables
    judging: RefereeTables
    """The same tables, as labels and referee take them."""


@jit_wide
def run_trials(active: Ints, most: int, dt: float, commands: Floats, world: World) -> None:
    """Step each of the trials `active` for up to `most` ticks, or until it ends or a buffer is too small.

    Parameters
    ----------
    active : (K,)
        Numbers of the trials.
    most : int
        Most ticks for each trial.
    dt : float
        Seconds of a tick.
    commands : (B, N, 2)
        Speed, m/s, and yaw rate, rad/s, of every car; those of cars without a built-in driver are held.
    world : World
        The tables of the batch, each with a row for each trial.
    """
    for k in range(active.shape[0]):
        b: int = active[k]
        trial = world.progress.trial[b]
        trial.status = STATUS.RUNNING
        for _ in range(most):
            if trial.status != STATUS.RUNNING:
                break
            _advance(b, dt, commands, trial, world)


@jit_inline
def _advance(b: int, dt: float, commands: Floats, progress: TrialProgress, world: World) -> None:
    """Step trial b to its next frame, or set `progress.status` to the reason why it can't be stepped."""
    tick = progress.tick
    if world.breach_log.filled[0] + _room(b, world) > world.breach_log.row.shape[0]:
        progress.status = STATUS.NO_BREACHES
        return
    ego_hit = False
    if tick >= 0:
        _decide(b, tick, commands, progress, world)
        if progress.status != STATUS.RUNNING:
            return
        before = world.work.found[0]
        least = world.spacing.least[b] - spacing_loss(world.spacing, b, tick)
        moved = step_trial(b, dt, least, commands, world)
        if moved != OUTCOME.MOVED:
            progress.status = STATUS.NO_CONTACTS if moved == OUTCOME.FULL else STATUS.NO_PAIRS
            return
        progress.decided = 0
        if world.work.found[0] > before:
            ego_hit = _note_contacts(b, tick + 1, before, world)
    progress.tick = tick + 1
    refresh_spacing(world.state, b, tick + 1, world.spacing)
    label_trial(b, tick + 1, world.labelling)
    _observe(b, tick + 1, world)
    if ego_hit:
        world.tally.trial[b].sealed = 1
    if tick + 1 >= progress.last:
        progress.status = STATUS.ENDED
    elif ego_hit and progress.ends != 0:
        progress.status = STATUS.COLLIDED


@jit_inline
def _room(b: int, world: World) -> int:
    """Return the most breaches that a frame of trial b can begin."""
    terms = world.terms[b]
    return MOST * world.state.count[b] + terms.goals_end - terms.goals_begin


@jit_inline
def _decide(b: int, tick: int, commands: Floats, progress: TrialProgress, world: World) -> None:
    if progress.decided != 0:
        return
    if progress.others != 0:
        if not decide_others(b, tick, world, commands):
            progress.status = STATUS.NO_SIGHT
            return
        if not _are_finite(b, commands):
            progress.status = STATUS.FAULTY
    if progress.lawful != 0:
        spacing = world.spacing
        decide_lawful(
            b, tick, progress.sight2, spacing.apart[b], spacing_loss(spacing, b, tick), world, commands
        )  # fmt: skip
    if progress.free != 0:
        decide_free(b, tick, commands, world.drivers, world.judging, world.free)
    if progress.nudged != 0:
        nudge_trial(b, tick, commands, world.agents)
    progress.decided = 1


@jit_inline
def _are_finite(b: int, commands: Floats) -> bool:
    """Tell whether all commands of trial b are finite; the law's always are."""
    finite = True
    for n in range(commands.shape[1]):
        speed, yaw_rate = commands[b, n, 0], commands[b, n, 1]
        finite &= (speed - speed == 0.0) & (yaw_rate - yaw_rate == 0.0)
    return finite


@jit_rare
def _note_contacts(b: int, tick: int, first: int, world: World) -> bool:
    """Note tick and flags of the contacts from row `first` on; tell whether one of them is the ego's."""
    ego_hit = False
    for k in range(first, world.work.found[0]):
        car = world.work.contact[k].car
        other = world.work.contact[k].other
        note = world.progress.contact[k]
        note.tick = tick
        note.bits = int(np.int64(world.labels.bits[b, car]))
        note.other_bits = int(np.int64(world.labels.bits[b, other])) if other >= 0 else 0
        note.sensed = _is_sensed(b, car, world)
        note.other_sensed = _is_sensed(b, other, world) if other >= 0 else 0
        if EGO in (car, other):
            ego_hit = True
            world.tally.trial[b].clearance = 0.0
    return ego_hit


@jit
def _is_sensed(b: int, n: int, world: World) -> int:
    """Return 1 if car n is within the ego's sensing radius, else 0."""
    dx = world.state.x[b, n] - world.state.x[b, EGO]
    dy = world.state.y[b, n] - world.state.y[b, EGO]
    return 1 if within_sight(dx, dy, world.tally.trial[b].sight2) else 0


@jit_inline
def _observe(b: int, tick: int, world: World) -> None:
    """Judge frame `tick`, which has been labelled, and add it to the metrics."""
    breach_log, tally = world.breach_log, world.tally
    count_frame(b, tick, world)
    if world.terms[b].judged == 0:
        return
    first = breach_log.filled[0]
    judge_trial(b, tick, world.judging)
    for k in range(first, breach_log.filled[0]):
        n = breach_log.row[k].car
        place = world.progress.place[k]
        place.x, place.y = world.state.x[b, n], world.state.y[b, n]
        place.sensed = _is_sensed(b, n, world)
        if n == EGO:
            tally.trial[b].sealed = 1
