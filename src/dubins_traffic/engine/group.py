"""A group of trials that are stepped together: their tables, steps, forks and outcomes.

A fork has copies of the rows of its trials out of all tables. Tables hold one row per trial, with three exceptions:
goals and obstacles stand one trial after another, with offsets; the ego's path, for each car that follows it, stands
in the row that the car names. What no trial changes (roads, lanes of loops, scripts, stages) is shared by a group and
its forks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
import numpy.typing as npt

from dubins_traffic.agents.fleet import PAIRS, pack_agents
from dubins_traffic.agents.free import Free, free_tables
from dubins_traffic.agents.lawful import pack_drivers
from dubins_traffic.agents.tables import Agents, wider, workspace
from dubins_traffic.cars.clip_and_move import TOGETHER, rows
from dubins_traffic.cars.motion import enlarged
from dubins_traffic.cars.near import spacing
from dubins_traffic.cars.state import EGO, Contact, Event, Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.engine.batch_kernel import (
    STATUS,
    BreachPlace,
    ContactNote,
    Progress,
    TrialProgress,
    World,
    run_trials,
)
from dubins_traffic.errors import ControllerError, DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import is_quick
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.tables import KIND, scratch
from dubins_traffic.problem.kinds import FREE, KEEP_RULES, NUDGED, REMOTE
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.header import bare_name
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.routing.rounds import find_all, stages
from dubins_traffic.rules.breach_log import MOST, BreachLog, FoundBreach, RefereeParameters, RefereeTables
from dubins_traffic.rules.fault import with_fault_by
from dubins_traffic.rules.judged import distinct_problems
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, accused, breaches_of, order, pending_of, terms_of
from dubins_traffic.rules.tables import LabelTables, spread
from dubins_traffic.scoring.findings import Findings
from dubins_traffic.scoring.margins import EgoMargins, margin_rules
from dubins_traffic.scoring.metric import Maker
from dubins_traffic.scoring.own_metrics import OwnMetrics
from dubins_traffic.scoring.score import Score, score_of
from dubins_traffic.scoring.tally import Tally, new_tally, tally_margins
from dubins_traffic.shield.tables import Alone, ShieldTables
from dubins_traffic.simulators.embedded import Embedded, contact_of
from dubins_traffic.trial.buffer import FrameBuffer
from dubins_traffic.trial.endings import agent_fault, collision_detail
from dubins_traffic.trial.forking import reseeded

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

Table = TypeVar("Table", bound=Tables)
FRAMES = 16
"""Frames, each with all breaches that are possible, for which the breach log has rows."""
WORK = 500_000
"""About how many cars are moved, tick by tick, in one call of the kernel: so Ctrl-C waits some tenths of a second."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a trial: score, verdict, ending; `act_s` is the summary of its controller's latencies, if any."""

    instance: Instance
    ending: Ending
    score: Score
    act_s: Mapping[str, float] = field(default_factory=dict[str, float], compare=False)

    def __repr__(self) -> str:
        return f"<Outcome: {self.instance.title}, {self.score.summary}>"


class Group:
    """Trials of one control rate that are stepped together.

    Parameters
    ----------
    instances : sequence of Instance
        One for each trial; with the embedded simulator, without formulas of the user's and without remote cars.
    keeps_rules : bool
        Whether the compiled controller `rules` drives the egos; otherwise `commands` holds their commands.
    metrics : sequence of callable
        Each makes a further metric; they see every frame, so trials are then stepped tick by tick.

    Attributes
    ----------
    state, labels : State, Labels
        The present frame of each trial, (B, N).
    commands : (B, N, 2)
        Speed, m/s, and yaw rate, rad/s, of each car; those of the egos may be written between ticks.
    endings : list of Ending or None
        How each trial has ended, None while it runs.
    contacts, breaches : list of list
        Those of each trial up to its present frame.
    """

    def __init__(self, instances: Sequence[Instance], *, keeps_rules: bool, metrics: Sequence[Maker] = ()) -> None:
        self.instances = tuple(instances)
        self._rate = instances[0].problem.rate
        problems = [instance.problem for instance in instances]
        simulator = Embedded()
        self.state: State = simulator.reset(instances, TOGETHER if keeps_rules else 1)
        trials, places = self.state.x.shape
        labeller = Labeller(instances)
        labeller.begin(trials, places)
        roads, beside, rules = labeller.tables
        net = rules["net"].copy()
        _, obstacles, cars, rows, work = simulator.motion
        terms, goals = terms_of(problems)
        breach_log = BreachLog.empty(trials, places, goals)
        most = MOST * places + int((terms["goals_end"] - terms["goals_begin"]).max())
        breach_log = breach_log.replace(row=table(FoundBreach, FRAMES * most))
        sought = [(problem.network, problem.goal_vertices) for problem in problems if keeps_rules]
        find_all(sought)
        rounds = [stages(network, goals) for network, goals in sought]
        segments = int(np.diff(roads.seg_off).max())
        apart = spacing(trials, places, rows.far - cars.reach)
        labelling = labeller.seeing(self.state)
        judging = RefereeTables(
            self.state, roads, beside, rules, terms, labeller.labels, labeller.memory, breach_log, apart
        )
        self._world = World(
            state=self.state, cars=cars, obstacles=obstacles, rows=rows, work=work, roads=roads, beside=beside,
            rules=rules, terms=terms, labels=labeller.labels, memory=labeller.memory, breach_log=breach_log,
            drivers=pack_drivers(instances, places, net, rounds), scratch=scratch(places, segments, obstacles),
            agents=pack_agents(instances, places, net), space=workspace(places, PAIRS, 2 * segments),
            tally=new_tally(instances, net, places), progress=self._progress(len(work.contact), len(breach_log.row)),
            spacing=apart, labelling=labelling, judging=judging, free=free_tables(instances, places, roads, net),
        )  # fmt: skip
        self._note_rules()
        self.labels: Labels = labeller.labels
        self.commands: Floats = np.zeros((trials, places, 2))
        self.endings: list[Ending | None] = [None] * trials
        self._going = np.ones(trials, dtype=bool)
        self._told = np.zeros(trials, dtype=bool)
        self.contacts: list[list[Contact]] = [[] for _ in instances]
        self.breaches: list[list[Breach]] = [[] for _ in instances]
        self._seen: list[set[tuple[int, int]]] = [set() for _ in instances]
        sinks = [[OwnMetrics(metrics)] for _ in instances]
        self._buffer = FrameBuffer(instances, sinks) if metrics else None
        self._take = bound(run_trials)
        self._run(self.active, 1)
        self._aim()

    def _note_rules(self) -> None:
        """Set the parameters of the rules and of the margins."""
        kinds, index = distinct_problems([instance.problem for instance in self.instances])
        rules = [RuleParameters.from_mapping(kind.rules) for kind in kinds]
        self._margins = margin_rules(rules, [kind.period for kind in kinds], index)
        numbers: list[int] = index.tolist()
        self._rules = [rules[k] for k in numbers]

    def fork(self, trials: Sequence[int], seeds: Sequence[int] | None = None) -> Self:
        """Return a group of independent copies of some trials at their present frames.

        Parameters
        ----------
        trials : sequence of int
            Numbers of trials of this group that have not ended. A trial may be named several times.
        seeds : sequence of int, optional
            Seed of each fork from here on; by default that of its trial, and then the outcomes of a fork and of its
            trial are equal, bit for bit.

        Raises
        ------
        DubinsTrafficError
            If one of the trials has ended.
        """
        ended = [b for b in trials if not self._going[b]]
        if ended:
            raise DubinsTrafficError(f"trial {ended[0]} of the group has ended and can't be forked")
        taken = np.array(trials, dtype=np.int64)
        drawn = None if seeds is None else np.array(seeds, dtype=np.uint64)
        twin = copy(self)
        twin.instances = tuple(
            self.instances[b] if seeds is None else replace(self.instances[b], seed=seeds[k])
            for k, b in enumerate(trials)
        )
        twin._world = _forked(self._world, taken, drawn, 1.0 / self._rate)
        twin.state, twin.labels = twin._world.state, twin._world.labels
        twin.commands = self.commands[taken]
        twin.endings = [None] * len(trials)
        twin._going, twin._told = np.ones(len(trials), dtype=bool), np.zeros(len(trials), dtype=bool)
        twin.contacts = [list(self.contacts[b]) for b in trials]
        twin.breaches = [list(self.breaches[b]) for b in trials]
        twin._seen = [set(self._seen[b]) for b in trials]
        twin._take = bound(run_trials)
        twin._buffer = None if self._buffer is None else self._buffer.fork(trials, twin.instances)
        twin._note_rules()
        if twin._buffer is not None and seeds is not None:
            for k, seed in enumerate(seeds):
                if seed != self.instances[trials[k]].seed:
                    twin._buffer.note(reseeded(int(twin.ticks[k]), seed), k)
        return twin

    def reseeded(self, seeds: Sequence[int]) -> Self:
        """Return the group, each of whose trials draws from another seed from here on, with the bits of such a fork.

        What names the trials still has their first seeds.
        """
        self._world.agents.team["seed"] = self._world.drivers.seed[:] = np.array(seeds, dtype=np.uint64)
        return self

    @property
    def ticks(self) -> Ints:
        """The present frame of each trial, (B,)."""
        return self._world.progress.trial["tick"]

    @property
    def world(self) -> World:
        """All tables of the group."""
        return self._world

    def of_trial(self, b: int) -> tuple[State, Labels]:
        """Return views of the state and labels of trial b, (1, N), as of a batch of one."""
        cars = len(self.instances[b].starts)
        reals: list[Any] = [array[b : b + 1, :cars] for array in self.state[:6]]
        whole: list[Any] = [array[b : b + 1, :cars] for array in self.labels]
        return State(*reals, count=self.state.count[b : b + 1]), Labels(*whole)

    @property
    def active(self) -> Ints:
        """The trials that have not ended."""
        return np.flatnonzero(self._going)

    def decide(self) -> None:
        """Write the commands of egos that others than the kernel drive; here whoever owns the group does that."""

    def drive(self, ticks: int) -> None:
        """Take each trial that has not ended up to `ticks` ticks farther, with the commands that are decided on."""
        self.advance(ticks)

    def advance(self, most: int = 1) -> None:
        """Step each trial that has not ended by up to `most` ticks."""
        if len(active := self.active):
            self._run(active, most)

    def finish(self, cancelled: Callable[[], bool] = lambda: False) -> None:
        """Run all trials to their ends, in calls of about `WORK` moves of cars; stop between calls when `cancelled`.

        Interpreted, a call does a hundredth of that; between two calls kernels may be replaced by compiled ones.
        """
        while len(active := self.active) and not cancelled():
            work = WORK if is_quick(run_trials) else WORK // 100
            self._run(active, max(1, work // (len(active) * self.state.x.shape[1])))

    def end(self, b: int, end: End, detail: str = "") -> None:
        """End trial b for a reason that its ego's driver gave."""
        self.endings[b] = Ending(end, int(self.ticks[b]), detail)
        if end is not End.DURATION:
            self.note(b, end.value, detail)
        self._going[b] = False

    def fail(self, b: int, error: ControllerError) -> None:
        """End trial b by a fault of its ego's driver."""
        self.end(b, End(error.reason), error.detail)

    def note(self, b: int, kind: str, detail: str) -> None:
        """Hand an event of the ego, at the present tick of trial b, to its metrics."""
        if self._buffer is not None:
            self._buffer.note(Event(int(self.ticks[b]), kind, EGO, detail), b)

    def fresh(self, controller: str) -> list[Outcome]:
        """Return the outcomes of the trials that have ended since the last call."""
        ended = np.flatnonzero(~self._told & ~self._going)
        self._told[ended] = True
        return self.outcomes(ended.tolist(), controller)

    def outcomes(self, trials: Sequence[int], controller: str) -> list[Outcome]:
        """Return the outcomes of trials that have ended."""
        if not trials:
            return []
        world, name = self._world, bare_name(controller)
        rows, endings = np.array(trials), [ending for b in trials if (ending := self.endings[b]) is not None]
        judged = [own for b in trials if (own := self.instances[b].problem).rules]
        find_all([(problem.network, problem.goal_vertices) for problem in judged])
        margins = self.margins(rows)
        ended: list[Outcome] = []
        pending = pending_of(rows, world.terms, world.breach_log)
        for b, ending, hanging in zip(trials, endings, pending, strict=True):
            instance, contacts, breaches = self.instances[b], self.contacts[b], self.breaches[b]
            if instance.problem.rules and (breaches or contacts):
                breaches = sorted([*breaches, *accused(contacts)], key=order)
            findings = Findings(
                instance, self._rules[b], ending, ending.ticks, world.tally, b, contacts, breaches, self._seen[b],
                hanging, margins[b], world.breach_log.entry[b],
            )  # fmt: skip
            score = score_of(findings, name, self._time_to_begin(b))
            if self._buffer is not None:
                self._buffer.end(ending, b)
                own = [sink for sink in self._buffer.sinks(b) if isinstance(sink, OwnMetrics)]
                score = replace(score, metrics=own[0].result())
            ended.append(Outcome(self.instances[b], ending, score))
        return ended

    def _time_to_begin(self, _b: int) -> float | None:
        """Return how long the driver of trial b took to begin, seconds, if that was measured."""
        return None

    def margins(self, trials: Ints) -> Rows[EgoMargins]:
        """Return the margins of rules 1 and 2 up to the present frames of `trials`, (B,); others' are infinite."""
        world = self._world
        return tally_margins(trials, self.ticks[trials] + 1, world.tally, self._margins, world.roads, world.cars)

    def _progress(self, contacts: int, breaches: int) -> Progress:
        trial = table(TrialProgress, len(self.instances))
        trial["last"] = [max(1, instance.ticks) for instance in self.instances]
        trial["ends"] = [instance.end_on_collision for instance in self.instances]
        fleets, whose = distinct([id(instance.e_agents) for instance in self.instances])
        kinds = [{agent.driver.kind for agent in self.instances[b].e_agents} for b in fleets]
        nudged = [any(agent.kind == NUDGED for agent in self.instances[b].e_agents) for b in fleets]
        trial["nudged"] = np.array(nudged)[whose]
        free = [any(agent.kind == FREE for agent in self.instances[b].e_agents) for b in fleets]
        trial["free"] = np.array(free)[whose]
        trial["others"] = np.array([not kind <= KEEP_RULES | {REMOTE} for kind in kinds])[whose]
        trial["sight2"] = np.square([instance.problem.sensing_radius for instance in self.instances])
        return Progress(trial, table(ContactNote, contacts), table(BreachPlace, breaches))

    def _aim(self) -> None:
        """Set the first goal of the egos that keep the rules: the nearest to their start."""
        world = self._world
        drivers, labels = world.drivers, world.labels
        world.progress.trial["lawful"] = drivers.active
        kind, first, last, place = (drivers.car[name][:, EGO] for name in ("kind", "first", "last", "place"))
        for b in np.flatnonzero(kind == KIND.ROUND).tolist():
            lane, segment = int(labels.lane[b, EGO]), int(labels.segment[b, EGO])
            place[b] = nearest_stage(drivers.distance, int(first[b]), int(last[b]), lane, segment)

    def _run(self, active: Ints, most: int) -> None:
        """Step trials by up to `most` ticks; tick by tick if there are metrics that see every frame."""
        if self._buffer is None:
            self._carry(active, most)
            return
        for _ in range(most):
            active = active[self._going[active]]
            before = self.ticks[active].copy()
            self._carry(active, 1)
            moved = active[self.ticks[active] > before]
            self._buffer.push(self.state, self.labels, self.commands, moved)

    def _carry(self, active: Ints, most: int) -> None:
        goal = self.ticks[active] + most
        while len(active):
            left = int((goal - self.ticks[active]).max())
            self._take(active, left, 1.0 / self._rate, self.commands, self._world)
            self.settle(active)
            going = self._going[active] & (self.ticks[active] < goal)
            active, goal = active[going], goal[going]

    def settle(self, trials: Ints) -> None:
        """Take over what a call of the kernel by others has found in `trials`: contacts, breaches and endings."""
        self._drain()
        self._mind(trials)

    def _mind(self, active: Ints) -> None:
        """Enlarge the buffers that were too small, and set the endings of trials that have ended."""
        status = self._world.progress.trial["status"][active]
        if (status == STATUS.NO_PAIRS).any():
            self._world = self._world.replace(work=enlarged(self._world.work))
        if (status == STATUS.NO_SIGHT).any():
            self._world = self._world.replace(space=wider(self._world.space))
        for b, why in zip(map(int, active), status.tolist(), strict=True):
            if why == STATUS.ENDED:
                self.end(b, End.DURATION)
            elif why == STATUS.FAULTY:
                self.end(b, End.AGENT_FAULT, agent_fault(self.instances[b], self.commands[b]))
            elif why == STATUS.COLLIDED:
                tick = int(self.ticks[b])
                mine = [
                    contact
                    for contact in self.contacts[b]
                    if contact.tick == tick and EGO in (contact.car, contact.other)
                ]
                self.end(b, End.COLLISION, collision_detail(self.instances[b], mine[0]))

    def _drain(self) -> None:
        """Move the contacts and breaches found out of their buffers into `contacts` and `breaches`."""
        world = self._world
        for k, row in enumerate(world.work.meetings()):
            note = world.progress.contact[k]
            b, contact = row.b, contact_of(row, note.tick, self._rate)
            contact = with_fault_by(contact, note.bits, note.other_bits)
            self.contacts[b].append(contact)
            if self._buffer is not None:
                self._buffer.touch([contact], b)
            pair = ((contact.car, note.sensed), (contact.other, note.other_sensed))
            self._seen[b].update((car, note.tick) for car, is_seen in pair if is_seen)
        world.work.found[0] = 0
        if not world.breach_log.filled[0]:
            return
        rows = world.breach_log.found()
        place = world.progress.place[: len(rows)]
        trials: list[int] = rows["trial"].tolist()
        breaches, seen = breaches_of(rows, place["x"], place["y"]), place["sensed"].tolist()
        for b, breach, sensed in zip(trials, breaches, seen, strict=True):
            self.breaches[b].append(breach)
            if sensed:
                self._seen[b].add((breach.car, breach.tick))
        world.breach_log.filled[0] = 0


def _forked(world: World, trials: Ints, seeds: npt.NDArray[np.uint64] | None, dt: float) -> World:
    """Return the tables of forks of some trials (K,), which share nothing that changes with those of the group.

    Breaches and contacts of the group have all been taken over. `seeds` (K,), if given, are those of the forks from
    here on; `dt` is a tick, seconds.
    """
    cars = _rows_of(world.cars, trials)
    terms = spread(world.terms, trials)
    goals = _goals(terms)
    seed = {} if seeds is None else {"seed": seeds}
    progress, work = world.progress, world.work
    state, roads, beside = (
        _rows_of(world.state, trials), world.roads, world.beside.replace(base=world.beside.base[trials]),
    )  # fmt: skip
    rules, labels, memory = (
        spread(world.rules, trials), _rows_of(world.labels, trials), _rows_of(world.memory, trials),
    )  # fmt: skip
    breach_log = _breach_log(world.breach_log, trials, goals)
    spacing = _rows_of(world.spacing, trials, near=world.spacing.near.copy())
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
        drivers=_rows_of(
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
        progress=_rows_of(
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


def _rows_of(table: Table, trials: Ints, **other: Any) -> Table:
    """Return a copy of a table with the rows `trials` of each array, except for the arrays given in `other`."""
    names = table.field_names
    columns = [other[name] if name in other else array[trials] for name, array in zip(names, table, strict=True)]
    return type(table)(*columns)


def _gathered(begin: Ints, count: Ints) -> tuple[Ints, Ints]:
    """Return offsets (K + 1,) and row numbers (R,) of `count` rows from `begin` on each, one after another, (K,)."""
    ends = np.append(0, count.cumsum())
    rows: Ints = np.arange(ends[-1], dtype=np.int64) + np.repeat(begin - ends[:-1], count)
    return ends, rows


def _copied(table: Table) -> Table:
    return type(table)(*(_copied(part) if isinstance(part, Tables) else part.copy() for part in table))


def _obstacles(table: ObstacleTable, trials: Ints) -> ObstacleTable:
    ends, rows = _gathered(table.off[trials], np.diff(table.off)[trials])
    return ObstacleTable(ends, table.parts[rows])


def _goals(terms: Rows[RefereeParameters]) -> Ints:
    """Return the rows of the forks' goals, one fork's after another's; set `goals_begin` and `goals_end` to match."""
    begin, end = terms["goals_begin"].copy(), terms["goals_end"].copy()
    ends, rows = _gathered(begin, end - begin)
    terms["goals_begin"], terms["goals_end"] = ends[:-1], ends[1:]
    return rows


def _breach_log(log: BreachLog, trials: Ints, goals: Ints) -> BreachLog:
    row, filled = table(FoundBreach, len(log.row)), np.zeros_like(log.filled)
    return _rows_of(log, trials, goal=spread(log.goal, goals), look=log.look.copy(), row=row, filled=filled)


def _tally(tally: Tally, trials: Ints) -> Tally:
    off = np.append(tally.trial["first_goal"], len(tally.goal))
    ends, goals = _gathered(off[trials], np.diff(off)[trials])
    trial = tally.trial[trials]
    trial["first_goal"], trial["last_goal"] = ends[:-1], ends[1:]
    names = "goal", "sample_done", "round_done", "early_done"
    return _rows_of(tally, trials, trial=trial, **{name: getattr(tally, name)[goals] for name in names})


def _free(free: Free, trials: Ints) -> Free:
    """Return the free cars of forks, each with a memory of its own."""
    row = free.row[trials]
    is_one = row >= 0
    own = row[is_one]
    row[is_one] = np.arange(len(own))
    own = own if len(own) else np.zeros(1, dtype=np.int64)
    shared = free.traffic.drivers
    drivers = _rows_of(shared, own, stage=shared.stage, distance=shared.distance, choice=shared.choice)
    traffic = free.traffic.replace(
        state=_rows_of(free.traffic.state, own),
        labels=_rows_of(free.traffic.labels, own),
        obstacles=_obstacles(free.traffic.obstacles, own),
        drivers=drivers,
        scratch=_copied(free.traffic.scratch),
    )
    alone = free.shields.alone
    unseen = alone.traffic.replace(
        state=_rows_of(alone.traffic.state, own),
        labels=_rows_of(alone.traffic.labels, own),
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
        team, cars, agents.cycle, agents.script, agents.trail[trail], agents.point[trail], agents.recalled[recall]
    )  # fmt: skip
