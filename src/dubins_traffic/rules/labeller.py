"""Labels the frames of a batch of trials, tick by tick, and finds who is at fault in their collisions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubins_traffic.cars.state import NONE, Contact, Labels, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import Rows
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.fault import with_fault
from dubins_traffic.rules.frame import label_frame
from dubins_traffic.rules.judged import JudgedInstance, JudgedProblem, distinct_problems
from dubins_traffic.rules.obstacles import ObstacleLanes, place_obstacles
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import LabelTables, Memory, TrialRules, pack_rules, spread

SLACK = 1e-9
"""Tolerance for rounding where lengths of roads are compared, metres."""


class Labeller:
    """Computes the propositions of docs/rules.md for every car of a batch, one compiled call per tick.

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
        What is kept from frame to frame: tickets, forfeits, greatest progress, trails.

    Notes
    -----
    Entries against rule 3 count as breaches only where the problem carries rules and rules 2 and 3 are defined on
    its roads; all else is computed everywhere (docs/design/010-propositions.md).
    """

    def __init__(self, instances: Sequence[JudgedInstance]) -> None:
        problems = [instance.problem for instance in instances]
        networks = [problem.network for problem in problems]
        self._roads, nets = pack_distinct(networks, [problem.car.lane_width for problem in problems])
        kinds, index = distinct_problems(problems)
        parameters = [RuleParameters.from_mapping(problem.rules) for problem in kinds]
        rules = pack_rules(
            parameters,
            [problem.intersection_radius for problem in kinds],
            [problem.rate for problem in kinds],
            pack_cars([problem.car for problem in kinds]),
        )
        self._rules = spread(rules, index)
        self._rules["net"][:] = nets
        self._rules["judged3"][:] = _judged3(problems, parameters, index)
        obstacles = pack_obstacles([problem.obstacles for problem in problems])
        self._obstacles = place_obstacles(obstacles, self._roads, nets)
        self._heads = max(2 * len(network.segments) + len(network.points) for network in networks)
        self._tick = -1
        self._tables: LabelTables | None = None

    def reset(self, state: State) -> Labels:
        """Label frame 0; the returned labels are the labeller's own, updated in place by `update`."""
        self.begin(*state.x.shape)
        self._tick = 0
        self._label(state)
        return self.labels

    def begin(self, trials: int, cars: int) -> None:
        """Reset labels and memory to those before the first frame of `trials` x `cars` cars."""
        depth = int(max(self._rules["stop_ticks"].max(), self._rules["stand_ticks"].max())) + 1
        linger = max(1, int(self._rules["linger_ticks"].max()))
        self.memory = Memory.empty(trials, cars, depth, self._heads, linger)
        self.labels = Labels.zeros(trials, cars)
        self._tables = None
        self._look = bound(label_frame)
        self._tick = -1

    def update(self, tick: int, state: State, contacts: Sequence[Sequence[Contact]]) -> Sequence[Sequence[Contact]]:
        """Label frame `tick`, the next one, and return `contacts`, those of the tick that led to it, with `at_fault`.

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
            judged = [tuple(with_fault(contact, bits[b]) for contact in touched) for b, touched in enumerate(contacts)]
        self._tick = tick
        self._label(state)
        return judged

    @property
    def tables(self) -> tuple[RoadTable, ObstacleLanes, Rows[TrialRules]]:
        """The roads, obstacles and rules of the batch, as the kernels of this room read them."""
        return self._roads, self._obstacles, self._rules

    @property
    def progress(self) -> Floats:
        """s: progress of the centres along their lane states, metres, (B, N); 0 without lane state."""
        return self.memory.car["progress"]

    @property
    def lateral(self) -> Floats:
        """l: lateral offset of the centres, left positive, metres, (B, N); 0 without lane state."""
        return self.memory.car["lateral"]

    @property
    def reach(self) -> Floats:
        """Largest lateral coordinate of the bodies, metres, (B, N); 0 without lane state."""
        return self.memory.car["reach"]

    @property
    def tickets(self) -> Ints:
        """Ticks of the cars' tickets, (B, N); -1 for a car that has not stopped at a crossing."""
        return np.where(self.labels.bits & FLAG.STOPPED, self.memory.car["ticket"], NONE)

    @property
    def forfeits(self) -> Ints:
        """New tickets of the cars in their present wait, (B, N)."""
        return np.where(self.labels.bits & FLAG.STOPPED, self.memory.car["forfeits"], 0)

    @property
    def places(self) -> Ints:
        """Places of the cars in the order of the crossing ahead, 0 first, (B, N); -1 without a ticket."""
        return self.memory.car["rank"]

    def seeing(self, state: State) -> LabelTables:
        """Return the tables that `label_frame` takes, for a batch in this state."""
        if self._tables is None or self._tables.state is not state:
            self._tables = LabelTables(state, *self.tables, self.labels, self.memory)
        return self._tables

    def _label(self, state: State) -> None:
        self._look(self._tick, self.seeing(state))


def _judged3(problems: Sequence[JudgedProblem], parameters: Sequence[RuleParameters], index: Ints) -> list[bool]:
    """Tell for each problem whether it asks for the rules and rule 3 is defined on its roads (docs/rules.md#room)."""
    known: dict[tuple[int, int], bool] = {}
    judged: list[bool] = []
    kinds: list[int] = index.tolist()
    for problem, kind in zip(problems, kinds, strict=True):
        key = kind, id(problem.network)
        if key not in known:
            known[key] = bool(problem.rules) and _defined3(problem, parameters[kind])
        judged.append(known[key])
    return judged


def _defined3(problem: JudgedProblem, parameters: RuleParameters) -> bool:
    """Tell whether rule 3 is defined on the roads of a problem."""
    radius, reach = problem.intersection_radius, problem.car.body.reach
    if problem.sensing_radius < 2.0 * (radius + reach + parameters.sensing_slack) - SLACK:
        return False
    return not clearance_faults(problem.network, radius, reach, problem.car.w, parameters.segment_slack)
