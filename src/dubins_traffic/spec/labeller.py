"""Labels the frames of a batch of trials, tick by tick, and says who is at fault in their collisions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import NONE, Contact, Labels, Pose, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.table import RoadTable, pack_distinct
from dubins_traffic.spec.fault import with_fault
from dubins_traffic.spec.frame import label_frame
from dubins_traffic.spec.obstacles import ObstacleLanes, place_obstacles
from dubins_traffic.spec.parameters import RuleParameters
from dubins_traffic.spec.propositions import STOPPED
from dubins_traffic.spec.tables import (
    FORFEITS,
    LATERAL,
    PROGRESS,
    RANK,
    REACH,
    STAND_TICKS,
    STOP_TICKS,
    TICKET,
    Memory,
    RuleTable,
    pack_rules,
)

SLACK = 1e-9
"""Metres by which rounding may fall short of a demand on the roads."""


class Judged(Protocol):
    """What the labeller asks of a problem (`problem.instance.Problem`)."""

    @property
    def network(self) -> RoadNetwork:
        """The roads."""
        ...

    @property
    def intersection_radius(self) -> float:
        """R, metres."""
        ...

    @property
    def car(self) -> Car:
        """The car that all drive."""
        ...

    @property
    def rate(self) -> float:
        """Control rate, Hz."""
        ...

    @property
    def sensing_radius(self) -> float:
        """Metres."""
        ...

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """Static obstacles."""
        ...

    @property
    def rules(self) -> Mapping[str, Any]:
        """Parameters by name; empty if not judged."""
        ...


class Posed(Protocol):
    """What the labeller asks of an instance (`problem.instance.Instance`)."""

    @property
    def problem(self) -> Judged:
        """What is judged."""
        ...

    @property
    def starts(self) -> Sequence[Pose]:
        """One pose per car."""
        ...


class Labeller:
    """Computes the propositions of RULES for every car of a batch, one compiled call per tick.

    Parameters
    ----------
    instances : sequence of Instance
        One instance per trial of the batch. Instances that share a network object and a lane width share its
        table.

    Attributes
    ----------
    labels : Labels
        The propositions of the present frame, (B, N), updated in place.
    memory : Memory
        All that is remembered from frame to frame: tickets, forfeits, greatest progress, trails.

    Notes
    -----
    Entries against rule 3 count as breaches only where the problem carries rules and rules 2 and 3 are defined on
    its roads; all else is computed everywhere (docs/design/010-propositions.md).
    """

    def __init__(self, instances: Sequence[Posed]) -> None:
        problems = [instance.problem for instance in instances]
        networks = [problem.network for problem in problems]
        cars = pack_cars([problem.car for problem in problems])
        self._roads, nets = pack_distinct(networks, [problem.car.lane_width for problem in problems])
        self._rules = pack_rules(
            [RuleParameters.from_mapping(problem.rules) for problem in problems],
            [problem.intersection_radius for problem in problems],
            [problem.rate for problem in problems],
            nets.tolist(),
            _judged3(problems),
            cars,
        )
        obstacles = pack_obstacles([problem.obstacles for problem in problems])
        self._obstacles = place_obstacles(obstacles, self._roads, nets)
        self._heads = max(2 * len(network.segments) + len(network.points) for network in networks)
        self._tick = -1

    def reset(self, state: State) -> Labels:
        """Label frame 0; the returned labels are the labeller's own, updated in place by `update`."""
        self.begin(*state.x.shape)
        self._tick = 0
        self._label(state)
        return self.labels

    def begin(self, trials: int, cars: int) -> None:
        """Forget everything: labels and memory are as before the first frame of `trials` x `cars` cars."""
        depth = int(self._rules.whole[:, [STOP_TICKS, STAND_TICKS]].max()) + 1
        self.memory = Memory.empty(trials, cars, depth, self._heads)
        self.labels = Labels.zeros(trials, cars)
        self._arrays = (*self._roads, *self._obstacles, *self._rules, *self.labels, *self.memory)
        self._tick = -1

    def update(
        self, tick: int, state: State, contacts: Sequence[Sequence[Contact]]
    ) -> Sequence[Sequence[Contact]]:
        """Label frame `tick`, one after the last, and return the contacts of the tick before it with `at_fault`.

        Raises
        ------
        ValueError
            If a frame has been left out: the propositions depend on every frame.
        """
        if tick != self._tick + 1:
            raise ValueError(f"frame {self._tick + 1} must follow, got {tick}")
        judged: Sequence[Sequence[Contact]] = contacts
        if any(contacts):
            bits = self.labels.bits
            judged = [
                tuple(with_fault(contact, bits[b]) for contact in own) for b, own in enumerate(contacts)
            ]
        self._tick = tick
        self._label(state)
        return judged

    @property
    def tables(self) -> tuple[RoadTable, ObstacleLanes, RuleTable]:
        """The roads, obstacles and rules of the batch, as the kernels of this room read them."""
        return self._roads, self._obstacles, self._rules

    @property
    def progress(self) -> Floats:
        """s: progress of the centres along their lane states, metres, (B, N); 0 without lane state."""
        return self.memory.measure[:, :, PROGRESS]

    @property
    def lateral(self) -> Floats:
        """l: lateral offset of the centres, left positive, metres, (B, N); 0 without lane state."""
        return self.memory.measure[:, :, LATERAL]

    @property
    def reach(self) -> Floats:
        """Largest lateral coordinate of the bodies, metres, (B, N); 0 without lane state."""
        return self.memory.measure[:, :, REACH]

    @property
    def tickets(self) -> Ints:
        """Ticks of the cars' tickets, (B, N); -1 for a car that has not stopped at a crossing."""
        return np.where(self.labels.bits & STOPPED, self.memory.mark[:, :, TICKET], NONE)

    @property
    def forfeits(self) -> Ints:
        """New tickets of the cars in their present wait, (B, N)."""
        return np.where(self.labels.bits & STOPPED, self.memory.mark[:, :, FORFEITS], 0)

    @property
    def places(self) -> Ints:
        """Places of the cars in the order of the crossing ahead, 0 first, (B, N); -1 without a ticket."""
        return self.memory.mark[:, :, RANK]

    def _label(self, state: State) -> None:
        label_frame(self._tick, *state, *self._arrays)


def _judged3(problems: Sequence[Judged]) -> list[bool]:
    """Tell of each problem whether it asks for the rules and rule 3 is defined there (RULES, *Ground*)."""
    known: dict[tuple[int, float, float, float, float], bool] = {}
    judged: list[bool] = []
    for problem in problems:
        if not problem.rules:
            judged.append(False)
            continue
        parameters = RuleParameters.from_mapping(problem.rules)
        radius, reach = problem.intersection_radius, problem.car.body.reach
        key = (id(problem.network), radius, reach, problem.car.w, parameters.segment_slack)
        if key not in known:
            known[key] = not clearance_faults(problem.network, *key[1:])
        sees = problem.sensing_radius >= 2.0 * (radius + reach + parameters.sensing_slack) - SLACK
        judged.append(known[key] and sees)
    return judged
