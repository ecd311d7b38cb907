"""Twelve mutants of the controller `rules`: each breaks one clause in a corner that random trials hardly ever meet.

A mutant sees the road as `rules` does, but for one thing that it gets wrong, and then does what the law says. It drives
all trials of a batch at once (`engine.controlled.BatchController`), through the compiled law.
"""

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
from dubins_traffic.policies.rules.room import MARGIN
from dubins_traffic.policies.rules.tables import Drivers, Traffic, scratch
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.table import pack_distinct
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.shield.tables import egos

Mask = npt.NDArray[np.bool_]
LINE = 0.03 + MARGIN
"""Metres by which the line is nearer, for a stop 3 cm inside the disc."""
STALE = 0.4
"""How old the places of others are for a mutant, seconds."""


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
        self.traffic = Traffic(
            State.zeros(len(problems), cars),
            Labels.zeros(len(problems), cars),
            roads,
            pack_obstacles([problem.obstacles for problem in problems]),
            self.drivers,
            scratch(cars, int(np.diff(roads.seg_off).max())),
        )
        self.commands = np.zeros((len(problems), cars, 2))
        lanes = max(network.lanes for network in networks)
        self.ends = np.full((len(problems), lanes + 1), -1)
        for row, network in zip(self.ends, networks, strict=True):
            row[: network.lanes] = [network.lane_ends(lane)[1] for lane in range(network.lanes)]
        self.tickets = np.full((len(problems), cars), -1)
        self.since = np.full(len(problems), -1)
        self.trail: list[tuple[Floats, Floats]] = []
        self.latched = np.zeros(len(problems), dtype=np.bool_)
        self.vehicle = np.array(self.drivers.vehicle)

    def drive(self, tick: int, rows: Ints, view: Seen) -> Floats:
        """Return what the law does in those of the trials that go on, (K, 2)."""
        order = np.argsort(~view.seen, axis=1, kind="stable")
        state, labels, width = self.traffic.state, self.traffic.labels, order.shape[1]
        for own, given in zip((*state[:6], *labels), (*view.state[:6], *view.labels), strict=True):
            own[rows, :width] = np.take_along_axis(given, order, axis=1)
        state.count[rows] = view.seen.sum(axis=1)
        self.drivers.active[:] = 0
        self.drivers.active[rows] = 1
        for k in rows.tolist():
            own = self.drivers.car[k, EGO]
            if own.last == own.first:
                self.drivers.active[k] = 0
            elif own.place < 0:
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
        block = Block(problems)
        self.prepare(block)
        for row, trial in enumerate(trials):
            self._places[trial] = block, row

    def act_batch(self, view: BatchView) -> Floats:
        """Drive on in all trials that run."""
        blocks: dict[int, list[int]] = {}
        for k, trial in enumerate(view.trial.tolist()):
            blocks.setdefault(id(self._places[trial][0]), []).append(k)
        answer = np.zeros((len(view.trial), 2))
        for own in blocks.values():
            block = self._places[int(view.trial[own[0]])][0]
            rows = np.array([self._places[int(view.trial[k])][1] for k in own])
            cars = block.commands.shape[1]
            arrays = [array[own][:, :cars].copy() for array in (*view.state[:6], *view.labels)]
            lane = np.where(view.seen[own][:, :cars], arrays[9], -1)
            seen = Seen(
                view.tick[own], State(*arrays[:6], count=view.state.count[own]), Labels(*arrays[6:]),
                view.seen[own][:, :cars].copy(), block.ends[rows[:, None], lane], rows, block,
            )  # fmt: skip
            self.see(seen)
            answer[own] = block.drive(int(seen.tick[0]), rows, seen)
        return answer

    def prepare(self, block: Block) -> None:
        """Change what the law is given of the cars; by default nothing."""

    def see(self, view: Seen) -> None:
        """Change what is seen; by default nothing."""


class Ticketed(Mutant):
    """A mutant with an order of arrival of its own, which follows from when it saw cars stop."""

    group = 0.1

    def see(self, view: Seen) -> None:
        stopped, known = view.has(FLAG.STOPPED), view.block.tickets[view.rows]
        known = np.where(stopped, np.where(known < 0, view.tick[:, None], known), -1)
        view.block.tickets[view.rows] = known
        ticks = np.array([self.group * view.block.problems[row].rate for row in view.rows.tolist()])[:, None]
        there = view.at_ego()
        tied = there & (np.abs(known - known[:, :1]) <= ticks)
        before = there & ~tied & (known < known[:, :1])
        goes = stopped[:, EGO] & tied.any(axis=1) & ~before.any(axis=1) & self.wins(view, tied)
        view.set(goes, FLAG.FIRST, FLAG.AHEAD)

    def wins(self, view: Seen, tied: Mask) -> Mask:
        """Tell whether the ego goes before all with whom it is tied, (K, N)."""
        raise NotImplementedError


class TieByIndex(Ticketed):
    """Of those who arrive together it goes first, whoever is on its right."""

    def wins(self, view: Seen, tied: Mask) -> Mask:
        return tied.any(axis=1)


class TieByLeft(Ticketed):
    """Of those who arrive together it lets the left go first, and goes before the right."""

    def wins(self, view: Seen, tied: Mask) -> Mask:
        _, bearing = view.bearings()
        return ~(tied & (bearing > 0.15)).any(axis=1)


class WideGroup(Ticketed):
    """It takes those for arrived together who came within 0.6 s."""

    group = 0.6

    def wins(self, view: Seen, tied: Mask) -> Mask:
        _, bearing = view.bearings()
        return ~(tied & (bearing < -0.15)).any(axis=1)


class ForgetsForfeit(Mutant):
    """Who was first at a crossing stays so, it thinks, though it has lost its place."""

    def see(self, view: Seen) -> None:
        stopped, first = view.has(FLAG.STOPPED)[:, EGO], view.has(FLAG.FIRST)[:, EGO]
        latched = stopped & (first | view.block.latched[view.rows])
        view.block.latched[view.rows] = latched
        view.set(latched, FLAG.FIRST, FLAG.AHEAD)


class StopsLate(Mutant):
    """It stops 3 cm inside the disc where others have stopped already."""

    def see(self, view: Seen) -> None:
        late = view.at_ego().any(axis=1)
        usual = view.block.vehicle["disc"]
        view.block.drivers.vehicle["disc"][:] = usual
        rows = view.rows[late]
        view.block.drivers.vehicle["disc"][rows] = usual[rows] - LINE


class BlindSector(Mutant):
    """It does not see who is in a sector of 50 degrees on its right."""

    low, high = -1.75, -0.87

    def see(self, view: Seen) -> None:
        _, bearing = view.bearings()
        blind = view.seen & (bearing > self.low) & (bearing < self.high)
        blind[:, EGO] = False
        within = view.labels.crosses == view.end[:, :1]
        inside = within & view.seen & (view.end[:, :1] >= 0)
        inside[:, EGO] = False
        clear = (inside & blind).any(axis=1) & ~(inside & ~blind).any(axis=1)
        view.set(clear, FLAG.CLEAR)
        view.seen[blind] = False


class ClearEarly(Mutant):
    """It takes a crossing for clear one frame before the last car leaves it."""

    def see(self, view: Seen) -> None:
        inside = (view.labels.crosses == view.end[:, :1]) & view.seen & (view.end[:, :1] >= 0)
        inside[:, EGO] = False
        vertex = np.maximum(view.end[:, EGO], 0)
        problems = [view.block.problems[row] for row in view.rows.tolist()]
        points = np.array([own.network.points[v] for own, v in zip(problems, vertex.tolist(), strict=True)])
        edge = np.array([own.intersection_radius + own.car.body.reach for own in problems])
        far = view.state.speed * np.array([own.period for own in problems])[:, None]
        x = view.state.x + far * view.state.c - points[:, :1]
        y = view.state.y + far * view.state.s - points[:, 1:]
        leaves = np.hypot(x, y) >= edge[:, None]
        view.set(inside.any(axis=1) & ~(inside & ~leaves).any(axis=1), FLAG.CLEAR)


class LeftLong(Mutant):
    """It does not come back before it has been on the left for 12 s, where there is a car to pass."""

    def see(self, view: Seen) -> None:
        left = view.has(FLAG.LEFT)[:, EGO]
        since = view.block.since
        since[view.rows] = np.where(left, np.where(since[view.rows] < 0, view.tick, since[view.rows]), -1)
        rates = np.array([view.block.problems[row].rate for row in view.rows.tolist()])
        waits = left & (view.tick - since[view.rows] < 12.0 * rates)
        view.block.latched[view.rows] = waits

    def act_batch(self, view: BatchView) -> Floats:
        answer = super().act_batch(view)
        for k, trial in enumerate(view.trial.tolist()):
            block, row = self._places[trial]
            near = block.latched[row] and view.tick[k] - block.since[row] > block.problems[row].rate
            answer[k] = 0.0 if near else answer[k]
        return answer


class ReturnsEarly(Mutant):
    """While it passes it does not mind whom it passes, and comes back into him."""

    def see(self, view: Seen) -> None:
        away, bearing = view.bearings()
        beside = (bearing < -0.2) & (bearing > -2.9) & (away < 1.2) & view.has(FLAG.LEFT)[:, :1]
        beside[:, EGO] = False
        view.seen[beside] = False
        for row in view.rows[view.has(FLAG.LEFT)[:, EGO]].tolist():
            view.block.drivers.car[row, EGO].aside = 0.0


class StopsShort(Mutant):
    """It thinks that it has stopped 0.2 s before it has, where others come to the crossing, too."""

    def see(self, view: Seen) -> None:
        still = view.has(FLAG.APPROACH)[:, EGO] & (np.abs(view.state.speed[:, EGO]) < 1e-3)
        since = view.block.since
        since[view.rows] = np.where(still, np.where(since[view.rows] < 0, view.tick, since[view.rows]), -1)
        rates = np.array([view.block.problems[row].rate for row in view.rows.tolist()])
        others = (view.end == view.end[:, :1]) & view.has(FLAG.APPROACH) & (view.end >= 0)
        soon = still & (view.tick - since[view.rows] >= 0.3 * rates) & (others.sum(axis=1) > 1)
        soon &= ~view.at_ego().any(axis=1)
        view.set(soon & ~view.has(FLAG.STOPPED)[:, EGO], FLAG.STOPPED | FLAG.FIRST)


class PassesQueue(Mutant):
    """It passes who waits at a crossing, as if he stood there."""

    def see(self, view: Seen) -> None:
        away, bearing = view.bearings()
        waits = (
            view.has(FLAG.EXCUSED) & (view.labels.lane == view.labels.lane[:, :1]) & (np.abs(bearing) < 0.5)
        )
        waits &= (away < 1.4) & (view.labels.lane[:, :1] >= 0)
        waits[:, EGO] = False
        view.labels.bits[waits] |= np.uint32(FLAG.STANDS)
        view.labels.bits[waits] &= ~np.uint32(FLAG.EXCUSED | FLAG.APPROACH)
        view.set(waits.any(axis=1), FLAG.BLOCKED | FLAG.OVERTAKING)


class StalePlaces(Mutant):
    """It sees the others where they were 0.4 s ago."""

    def see(self, view: Seen) -> None:
        block = view.block
        places = np.full(block.tickets.shape, np.nan), np.full(block.tickets.shape, np.nan)
        for own, given in zip(places, (view.state.x, view.state.y), strict=True):
            own[view.rows] = np.where(view.seen, given, np.nan)
        block.trail.append(places)
        if len(block.trail) > STALE * block.problems[0].rate:
            before = block.trail.pop(0)
            for given, own in zip((view.state.x, view.state.y), before, strict=True):
                known = np.isfinite(own[view.rows])
                known[:, EGO] = False
                given[known] = own[view.rows][known]


class Planted(NamedTuple):
    """A mutant, and the rules that it breaks: the first it is made for."""

    kind: type[Mutant]
    rules: tuple[str, ...]


MUTANTS: dict[str, Planted] = {
    "tie_by_index": Planted(TieByIndex, ("3.order",)),
    "tie_by_left": Planted(TieByLeft, ("3.order",)),
    "wide_group": Planted(WideGroup, ("3.order",)),
    "forgets_forfeit": Planted(ForgetsForfeit, ("3.order",)),
    "stops_late": Planted(StopsLate, ("3.stop",)),
    "stops_short": Planted(StopsShort, ("3.stop",)),
    "blind_sector": Planted(BlindSector, ("3.clear", "1.collision")),
    "clear_early": Planted(ClearEarly, ("3.clear",)),
    "left_long": Planted(LeftLong, ("2.return",)),
    "passes_queue": Planted(PassesQueue, ("2.left",)),
    "returns_early": Planted(ReturnsEarly, ("1.collision", "2.left")),
    "stale_places": Planted(StalePlaces, ("1.collision",)),
}
"""The mutants by name."""
