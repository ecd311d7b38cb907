"""What mutants of the controller `rules` are made of: the law, and a look at what it sees before it decides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Command, Labels, Observation, State, put_observed
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.engine.controlled import BatchView
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.policies.rules.fitness import check_fit
from dubins_traffic.policies.rules.policy import decide
from dubins_traffic.policies.rules.tables import Drivers, Traffic, scratch
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.shield.tables import egos

Mask = npt.NDArray[np.bool_]


class Seen(NamedTuple):
    """What a mutant sees of some trials at one tick, (K, N), its own to change: car 0 is the ego.

    `tick` (K,); `end` (K, N) is the intersection at the end of each car's lane, -1 without one; `rows` (K,) tell apart
    the trials over all of their ticks.
    """

    tick: Ints
    state: State
    labels: Labels
    seen: Mask
    end: Ints
    rows: Ints
    block: Block

    def has(self, flag: int) -> Mask:
        """Return which cars have a flag, (K, N)."""
        return (self.labels.bits & np.uint32(flag) != 0) & self.seen

    def at_ego(self) -> Mask:
        """Return which others have stopped at the crossing ahead of the ego, (K, N)."""
        there = self.has(FLAG.STOPPED) & (self.end == self.end[:, :1]) & (self.end >= 0)
        there[:, EGO] = False
        return there

    def set(self, which: Mask, on: int, off: int = 0) -> None:
        """Set and clear flags of the egos of some trials, (K,)."""
        own = self.labels.bits[:, EGO]
        own[which] = (own[which] | np.uint32(on)) & ~np.uint32(off)

    def bearings(self) -> tuple[Floats, Floats]:
        """Return distance (m) and bearing (rad, left positive) of every car as the ego sees it, (K, N)."""
        x, y, c, s = (array - 0.0 for array in (self.state.x, self.state.y, self.state.c, self.state.s))
        dx, dy = x - x[:, :1], y - y[:, :1]
        along, left = dx * c[:, :1] + dy * s[:, :1], dy * c[:, :1] - dx * s[:, :1]
        return np.hypot(dx, dy), np.arctan2(left, along)


class Block:
    """Trials that have begun together, the law's tables for their egos, and what a mutant remembers of them."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        for problem in problems:
            check_fit(problem, owes=False)
        cars = 1 + max(len(problem.e_agents) for problem in problems)
        self.problems = problems
        networks = [problem.network for problem in problems]
        roads, net = pack_distinct(networks, [problem.car.lane_width for problem in problems])
        self.drivers: Drivers = egos(problems, cars, net)
        bodies = pack_obstacles([problem.obstacles for problem in problems])
        self.traffic = Traffic(
            State.zeros(len(problems), cars),
            Labels.zeros(len(problems), cars),
            roads,
            bodies,
            self.drivers,
            scratch(cars, int(np.diff(roads.seg_off).max()), bodies),
        )
        self.commands = np.zeros((len(problems), cars, 2))
        lanes = max(network.lanes for network in networks)
        self.ends = np.full((len(problems), lanes + 1), -1)
        for row, network in zip(self.ends, networks, strict=True):
            row[: network.lanes] = [network.lane_ends(lane)[1] for lane in range(network.lanes)]
        self.tickets = np.full((len(problems), cars), -1)
        self.since = np.full(len(problems), -1)
        self.latched = np.zeros(len(problems), dtype=np.bool_)
        self.vehicle = np.array(self.drivers.vehicle)
        self.rates = np.array([problem.rate for problem in problems])
        self.reach = np.array([problem.car.body.reach for problem in problems])
        self.radius = np.array([problem.intersection_radius for problem in problems])
        most = max(len(network.points) for network in networks)
        self.points = np.zeros((len(problems), most, 2))
        for row, network in zip(self.points, networks, strict=True):
            row[: len(network.points)] = network.points

    def drive(self, tick: int, rows: Ints, view: Seen) -> Floats:
        """Return what the law does in those of the trials that go on, (K, 2)."""
        state, labels, width = self.traffic.state, self.traffic.labels, view.seen.shape[1]
        given: list[npt.NDArray[np.generic]] = [*view.state[:6], *view.labels]
        if not view.seen.all():
            order = np.argsort(~view.seen, axis=1, kind="stable")
            given = [np.take_along_axis(array, order, axis=1) for array in given]
        for own, array in zip((*state[:6], *labels), given, strict=True):
            own[rows, :width] = array
        state.count[rows] = view.seen.sum(axis=1)
        driver = self.drivers.car
        nowhere = driver["last"][rows, EGO] == driver["first"][rows, EGO]
        self.drivers.active[:] = 0
        self.drivers.active[rows] = ~nowhere
        for k in rows[~nowhere & (driver["place"][rows, EGO] < 0)].tolist():
            own = driver[k, EGO]
            lane, segment = int(labels.lane[k, EGO]), int(labels.segment[k, EGO])
            own.place = nearest_stage(self.drivers.distance, own.first, own.last, lane, segment)
        self.commands[:, EGO] = 0.0
        decide(tick, self.commands, self.traffic)
        return self.commands[rows, EGO]


class Mutant:
    """The controller `rules`, as long as `see` changes nothing."""

    def start(self, problem: Problem) -> None:
        """Begin a trial by itself."""
        self.start_batch([0], [problem])

    def act(self, observation: Observation) -> Command:
        """Drive on in a trial by itself."""
        block = self._places[0][0]
        cars = block.commands.shape[1]
        state, labels = State.zeros(1, cars), Labels.zeros(1, cars)
        put_observed(state, labels, observation)
        there = [EGO, *(car.index for car in observation.others)]
        seen = np.zeros((1, cars), dtype=np.bool_)
        for array in (*state[:6], *labels):
            array[0, there] = array[0, : len(there)].copy()
        seen[0, there] = True
        labels.lane[~seen] = -1
        view = BatchView(np.array([0]), np.array([observation.tick]), state, labels, seen)
        speed, yaw_rate = self.act_batch(view)[0].tolist()
        return Command(speed, yaw_rate)

    def start_batch(self, trials: Sequence[int], problems: Sequence[Problem]) -> None:
        """Begin some trials together."""
        if not hasattr(self, "_places"):
            self._places: dict[int, tuple[Block, int]] = {}
            self._parts: list[tuple[Block, Ints, Ints]] = []
        self._running = np.zeros(0, dtype=np.int64)
        block = Block(problems)
        self.prepare(block)
        for row, trial in enumerate(trials):
            self._places[trial] = block, row

    def act_batch(self, view: BatchView) -> Floats:
        """Drive on in all trials that run."""
        if not np.array_equal(view.trial, self._running):
            self._sort(view.trial)
        answer = np.zeros((len(view.trial), 2))
        for block, own, rows in self._parts:
            cars = block.commands.shape[1]
            arrays = [array[own, :cars] for array in (*view.state[:6], *view.labels, view.seen)]
            lane = np.where(arrays[11], arrays[9], -1)
            seen = Seen(
                view.tick[own], State(*arrays[:6], count=view.state.count[own]), Labels(*arrays[6:11]), arrays[11],
                block.ends[rows[:, None], lane], rows, block,
            )  # fmt: skip
            self.see(seen)
            answer[own] = self.driven(seen, block.drive(int(seen.tick[0]), rows, seen))
        return answer

    def _sort(self, trials: Ints) -> None:
        """Note which of the trials that run belong to which block, and forget those that have ended."""
        self._running = trials.copy()
        running = trials.tolist()
        self._places = {trial: self._places[trial] for trial in running}
        parts: dict[int, list[int]] = {}
        for k, trial in enumerate(running):
            parts.setdefault(id(self._places[trial][0]), []).append(k)
        self._parts = []
        for own in parts.values():
            places = [self._places[running[k]] for k in own]
            self._parts.append((places[0][0], np.array(own), np.array([row for _, row in places])))

    def prepare(self, block: Block) -> None:
        """Change what the law is given of the cars; by default nothing."""

    def see(self, view: Seen) -> None:
        """Change what is seen; by default nothing."""

    def driven(self, view: Seen, answer: Floats) -> Floats:
        """Return what is done in place of what the law does, (K, 2); by default the same."""
        del view
        return answer
