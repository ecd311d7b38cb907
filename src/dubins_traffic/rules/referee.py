"""The referee: finds which rules of docs/rules.md are broken, by which car, when, since when and where.

It judges trials as they run, or recorded frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.near import unknown_spacing
from dubins_traffic.cars.state import EGO, NONE, Contact, Frames, State
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.arrays import Bits, Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import Grid, Rows
from dubins_traffic.rules.breach_log import (
    PENDING,
    RULE,
    RULES,
    BreachLog,
    EntryMargins,
    FoundBreach,
    JudgedCar,
    JudgedGoal,
    RefereeParameters,
    RefereeTables,
    pack_terms,
)
from dubins_traffic.rules.duties import find_ways
from dubins_traffic.rules.fault import with_fault
from dubins_traffic.rules.judged import JudgedInstance, JudgedProblem, distinct_problems
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee_kernel import judge_frame, judge_frames
from dubins_traffic.rules.tables import spread, ticks

_ROOMY = 64
"""Frames, each with all breaches that are possible, for which the log has rows when a block is judged."""


class Breach(NamedTuple):
    """A breach of `rule` (a name in `RULES`) by the car with index `car`, in frame `tick`.

    `since` is the frame in which what led to it began. (x, y) is the centre of the car in frame `tick`, or the point
    of a contact; `vertex` the intersection that it is about and `lane` the car's lane state (-1: none).

    Norm: docs/rules.md#breach.
    """

    rule: str
    car: int
    tick: int
    since: int
    x: float
    y: float
    vertex: int
    lane: int


@dataclass(frozen=True, slots=True)
class Pending:
    """Pending obligations after the last frame judged, by the rules' names.

    `ego` has the rules that the ego will break if nothing changes, `others` those that some e-agent will break.
    """

    ego: frozenset[str]
    others: frozenset[str]


NOTHING = Pending(frozenset(), frozenset())
"""No pending obligations, as before the first frame."""


class Referee:
    """Judges a batch of trials, tick by tick, or the frames of one trial, block by block; the same code does both.

    Trials whose problem carries no rules are skipped.

    Norm: docs/rules.md#poses.

    Parameters
    ----------
    instances : sequence of Instance
        One instance per trial of the batch.
    labeller : Labeller, optional
        The labeller of the same instances that labels every frame before it is judged. Without one the referee
        labels the frames itself, from poses alone.
    """

    def __init__(self, instances: Sequence[JudgedInstance], labeller: Labeller | None = None) -> None:
        problems = [instance.problem for instance in instances]
        self._own = labeller is None
        self._labeller = labeller or Labeller(instances)
        self._terms, self._goals = terms_of(problems)
        self._judged = [bool(problem.rules) for problem in problems]
        self._roads, self._obstacles, self._rules = self._labeller.tables
        self._state: State | None = None
        self._tables: RefereeTables | None = None

    def reset(self, state: State) -> Sequence[Sequence[Breach]]:
        """Judge frame 0; return the breaches of each trial, in order."""
        if self._own:
            self._labeller.reset(state)
        trials, cars = state.x.shape
        self._log = BreachLog.empty(trials, cars, self._goals)
        self._spacing = unknown_spacing(trials, cars)
        self._tables = None
        self._judge_frame = bound(judge_frame)
        self._judge(0, state)
        return self._collect(state, [()] * trials)

    def update(self, tick: int, state: State, contacts: Sequence[Sequence[Contact]]) -> Sequence[Sequence[Breach]]:
        """Judge frame `tick`, one after the last; return the breaches that begin in it, of each trial, in order.

        Parameters
        ----------
        tick, state
            The frame.
        contacts
            Those of the tick before it, of each trial; with `at_fault` filled in if a labeller has been given.
        """
        if self._own:
            contacts = self._labeller.update(tick, state, contacts)
        self._judge(tick, state)
        return self._collect(state, contacts)

    def judge(self, frames: Frames) -> tuple[list[Breach], tuple[Contact, ...]]:
        """Judge the next block of the only trial, whose first frame is frame 0.

        Returns
        -------
        breaches : list of Breach
            Those that begin in the block, in order.
        contacts : tuple of Contact
            Those of the block, with `at_fault` as found here.

        Raises
        ------
        ValueError
            If the referee judges a batch or was given a labeller, or frames have been left out.
        """
        if not self._own or len(self._judged) != 1:
            raise ValueError("judge() takes the frames of one trial, and only from a referee without a labeller")
        if not len(frames):
            return [], frames.contacts
        before, bits, breaches = self._block(frames)
        contacts = tuple(
            with_fault(contact, bits[row - 1] if row > 0 else before)
            for contact in frames.contacts
            for row in (contact.tick - frames.first,)
        )
        breaches += accused(contacts) if self._judged[0] else ()
        return sorted(breaches, key=order), contacts

    @property
    def pending(self) -> Sequence[Pending]:
        """The pending obligations of each trial."""
        return pending_of(np.arange(len(self._judged)), self._terms, self._log)

    @property
    def entries(self) -> Rows[EntryMargins]:
        """The least margins by which the ego of each trial has kept rule 3, (B,)."""
        return self._log.entry

    @property
    def may_leave(self) -> npt.NDArray[np.bool_]:
        """Which e-agents are, with their bodies, in a disc with a free exit in ticks that count (E4), (B, N)."""
        return self._log.car["exit_counts"] >= 0

    @property
    def stays(self) -> npt.NDArray[np.bool_]:
        """Which e-agents have been in a disc with a free exit for longer than they may (E4), (B, N)."""
        return self._log.car["exit_over"] != 0

    @property
    def overdue(self) -> npt.NDArray[np.bool_]:
        """Which e-agents are on a journey that has taken longer than it may (E5), (B, N)."""
        return self._log.car["journey_over"] != 0

    @property
    def clocks(self) -> Grid[JudgedCar]:
        """What is remembered of each car after the last frame, (B, N): it must not be changed."""
        return self._log.car

    @property
    def goals(self) -> Rows[JudgedGoal]:
        """What is remembered of the goals of all trials, one after the other: it must not be changed."""
        return self._log.goal

    def ways(self, state: State) -> npt.NDArray[np.bool_]:
        """Return which cars are in a lane with a free way ahead (E5), (B, N), in the last frame, that of `state`."""
        ways = np.zeros(state.x.shape, dtype=np.bool_)
        find_ways(self._tick, self.tables(state), ways)
        return ways

    def tables(self, state: State) -> RefereeTables:
        """Return the tables by which the last frame was judged, that of `state`; they must not be changed."""
        if self._tables is None or self._tables.state is not state:
            labeller = self._labeller
            self._tables = RefereeTables(
                state, self._roads, self._obstacles, self._rules, self._terms, labeller.labels, labeller.memory,
                self._log, self._spacing,
            )  # fmt: skip
        return self._tables

    def _judge(self, tick: int, state: State) -> None:
        self._tick = tick
        self._judge_frame(tick, self.tables(state))

    def _collect(self, state: State, contacts: Sequence[Sequence[Contact]]) -> Sequence[Sequence[Breach]]:
        if not self._log.filled[0] and not any(contacts):
            return [()] * len(self._judged)
        by_trial: dict[int, list[Breach]] = {}
        if self._log.filled[0]:
            rows = self._log.found()
            place = rows["trial"], rows["car"]
            for b, breach in zip(place[0].tolist(), breaches_of(rows, state.x[place], state.y[place]), strict=True):
                by_trial.setdefault(b, []).append(breach)
            self._log.filled[0] = 0
        for b, touched in enumerate(contacts):
            if touched and self._judged[b]:
                by_trial.setdefault(b, []).extend(accused(touched))
        breaches: list[Sequence[Breach]] = [()] * len(self._judged)
        for b, touched in by_trial.items():
            breaches[b] = sorted(touched, key=order)
        return breaches

    def _block(self, frames: Frames) -> tuple[Bits, Bits, list[Breach]]:
        """Label and judge a block; return the flags of the frame before it, of its frames, and the breaches."""
        cars = frames.x.shape[1]
        labeller = self._labeller
        if frames.first == 0:
            self._state = State.zeros(1, cars)
            self._log = BreachLog.empty(1, cars, self._goals, _ROOMY)
            self._spacing = unknown_spacing(1, cars)
            self._next = 0
            labeller.begin(1, cars)
            self._tables = None
        if self._state is None or frames.first != self._next:
            raise ValueError(f"frames must follow one another: got a block from frame {frames.first} on before frame 0")
        self._next += len(frames)
        poses, _ = frames.states
        before = labeller.labels.bits[0].copy()
        bits = np.zeros(frames.x.shape, dtype=np.uint32)
        breaches: list[Breach] = []
        room = self._log.room_of_a_frame
        labelling, judging = labeller.seeing(self._state), self.tables(self._state)
        done = 0
        while done < len(frames):
            done = judge_frames(frames.first, done, room, poses, bits, labelling, judging)
            rows = self._log.found()
            place = rows["tick"] - frames.first, rows["car"]
            breaches += breaches_of(rows, frames.x[place], frames.y[place])
            self._log.filled[0] = 0
        return before, bits, breaches


def terms_of(problems: Sequence[JudgedProblem]) -> tuple[Rows[RefereeParameters], Ints]:
    """Return the parameters by which trials of `problems` are judged, (B,), and the vertices of all goals, (G,)."""
    kinds, index = distinct_problems(problems)
    kind_terms = pack_terms(
        [RuleParameters.from_mapping(problem.rules) for problem in kinds],
        [bool(problem.rules) for problem in kinds],
        [problem.intersection_radius for problem in kinds],
        [problem.rate for problem in kinds],
        pack_cars([problem.car for problem in kinds]),
    )
    terms = spread(kind_terms, index)
    ends, goals = [0], list[int]()
    for problem in problems:
        goals += dict.fromkeys(problem.goal_vertices) if problem.rules else ()
        ends.append(len(goals))
    terms["journey_ticks"][:] = [
        _journey_ticks(problem, RuleParameters.from_mapping(problem.rules)) for problem in problems
    ]
    terms["goals_begin"][:] = ends[:-1]
    terms["goals_end"][:] = ends[1:]
    return terms, np.array(goals, dtype=np.int64)


def _journey_ticks(problem: JudgedProblem, given: RuleParameters) -> int:
    """Return the longest journey of an e-agent, ticks (docs/rules.md#E5)."""
    way = given.journey_lengths * float(problem.network.lengths.max())
    return ticks(given.rest_time + way / problem.car.bounds.speed, problem.rate)


def pending_of(trials: Ints, terms: Rows[RefereeParameters], breach_log: BreachLog) -> list[Pending]:
    """Return the pending obligations of some trials."""
    runs = np.stack([breach_log.car[clock][trials] >= 0 for _, clock in PENDING], axis=-1)
    goal: list[bool] = (breach_log.goal["since"] >= 0).tolist()
    begins, ends = terms["goals_begin"].tolist(), terms["goals_end"].tolist()
    taken = [any(goal[begins[b] : ends[b]]) for b in trials.tolist()]
    egos: list[list[bool]] = runs[:, EGO].tolist()
    others: list[list[bool]] = np.logical_or.reduce(runs[:, EGO + 1 :], axis=1).tolist()
    return [
        _pending(tuple(ego), tuple(other), goal_taken)
        for ego, other, goal_taken in zip(egos, others, taken, strict=True)
    ]


@cache
def _pending(ego: tuple[bool, ...], others: tuple[bool, ...], goal_taken: bool) -> Pending:
    """Return the pending obligations of cars of which these runs of `PENDING` go on; equal ones are shared."""
    return Pending(_named(ego), _named(others) | {"E6"} if goal_taken else _named(others))


def _named(runs: Sequence[bool]) -> frozenset[str]:
    return frozenset(rule for (rule, _), run in zip(PENDING, runs, strict=True) if run)


def breaches_of(rows: Rows[FoundBreach], x: Floats, y: Floats) -> list[Breach]:
    """Return rows of the log (K,) as breaches by cars whose centres are `x` (K,) and `y` (K,), metres."""
    numbers: list[int] = rows["rule"].tolist()
    car, tick, since, vertex, lane = (rows[name].tolist() for name in ("car", "tick", "since", "vertex", "lane"))
    fields = zip(numbers, car, tick, since, x.tolist(), y.tolist(), vertex, lane, strict=True)
    return [Breach(RULES[rule], *about) for rule, *about in fields]


def accused(contacts: Sequence[Contact]) -> list[Breach]:
    """Return the breaches of rule 1 and E2 that contacts are: any contact of the ego, any e-agent's fault.

    Norm: docs/rules.md#1.collision, docs/rules.md#E2.
    """
    breaches: list[Breach] = []
    for contact in contacts:
        place = (contact.tick, contact.tick, contact.x, contact.y, NONE, NONE)
        if EGO in (contact.car, contact.other):
            breaches.append(Breach(RULES[RULE.COLLISION], EGO, *place))
        for car, guilty in zip((contact.car, contact.other), contact.at_fault, strict=True):
            if guilty and car > EGO:
                breaches.append(Breach(RULES[RULE.FAULT], car, *place))
    return breaches


def order(breach: Breach) -> tuple[int, int, int]:
    """Return the key by which breaches are sorted: frame, rule, car."""
    return breach.tick, RULES.index(breach.rule), breach.car
