"""What an instance of a search is made of, and small changes of it: starts, cars, what they choose, goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import floor, hypot
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from dubins_traffic.agents import choices
from dubins_traffic.agents.choices import CHOICE
from dubins_traffic.cars.state import EGO, Pose
from dubins_traffic.falsification import whims
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.starts import Ground, areas_of, gap_radius

if TYPE_CHECKING:
    import numpy as np

    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.instance import Instance


@dataclass(frozen=True, slots=True)
class Genome:
    """What an instance of a search is made of."""

    base: int
    """Number of the trial of the configuration whose network, goals and cars it has."""
    root: int
    """Number of the trial of the search that was drawn and from which this one descends."""
    starts: Mapping[int, Pose] = field(default_factory=dict[int, Pose])
    """Other starts of some of its cars, by the cars' numbers."""
    tables: Mapping[int, Floats] = field(default_factory=dict[int, Floats])
    """Shape (K, 7) each. What each e-agent chooses (`agents.choices`), by the cars' numbers."""
    whims: Mapping[int, Floats] = field(default_factory=dict[int, Floats])
    """Shape (K, 5) each. What each free e-agent likes to do (`falsification.whims`), by the cars' numbers."""

    @property
    def choosing(self) -> list[int]:
        """The numbers of the cars of which something is chosen, in order."""
        return sorted({*self.tables, *self.whims})

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, from which `from_json` makes an equal one."""
        whims = {str(car): table.tolist() for car, table in self.whims.items()}
        return {
            "base": self.base,
            "root": self.root,
            "starts": {str(car): list(pose) for car, pose in self.starts.items()},
            "tables": {str(car): [len(table), choices.to_rows(table)] for car, table in self.tables.items()},
        } | ({"whims": whims} if whims else {})

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> Genome:
        """Return the genome of a JSON object."""
        tables: dict[int, Floats] = {}
        for car, (legs, rows) in document["tables"].items():
            table = choices.empty(legs)
            known = choices.from_rows(rows)
            table[: len(known)] = known
            tables[int(car)] = table
        starts = {int(car): Pose(*pose) for car, pose in document["starts"].items()}
        whims = {int(car): np.array(rows) for car, rows in document.get("whims", {}).items()}
        return Genome(document["base"], document["root"], starts, tables, whims)


SHIFT: Final = 1.5
"""Metres by which a start is shifted at most, standard deviation; the least is a hundredth of it."""
SQUARE: Final = 4.0
"""Metres; places are looked for in squares of this side."""
ON_LANE: Final = 1e-6
"""Metres that a start may lie beside the middle of its lane."""


class StartLane(NamedTuple):
    """Where cars may start: start (x, y) and direction (c, s) of a lane's middle, from which to which metre, and its
    number.
    """

    x: float
    y: float
    c: float
    s: float
    low: float
    high: float
    lane: int


class LaneStarts(NamedTuple):
    """All places where cars may start, lane by lane.

    `first` and `last` are the numbers of the first and the last place of each lane that has any; `ends` the
    intersections at its beginning and end; `near` the places that are near to each square of side `SQUARE`.
    """

    places: list[StartLane]
    near: dict[tuple[int, int], list[int]]
    first: dict[int, int]
    last: dict[int, int]
    ends: dict[int, tuple[int, int]]


def far_off(dice: np.random.Generator) -> float:
    """Return metres by which to shift something: small ones as often as large ones."""
    return SHIFT * 10.0 ** (-2.0 * dice.random()) * float(dice.standard_normal())


def starts_of(genome: Genome, base: Instance) -> list[Pose]:
    """Return where the cars of a genome start."""
    return [genome.starts.get(n, pose) for n, pose in enumerate(base.starts)]


def started(genome: Genome, base: Instance, starts: list[Pose], moved: Mapping[int, Pose]) -> Genome:
    """Return a genome with other starts; the same if one that is moved would be too near to another car."""
    apart = gap_radius(base.problem.car)
    for car, start in moved.items():
        for n, pose in enumerate(starts):
            if n != car and hypot(pose.x - start.x, pose.y - start.y) < apart:
                return genome
    return Genome(genome.base, genome.root, {**genome.starts, **moved}, genome.tables, genome.whims)


def span_of(base: Instance, pose: Pose) -> tuple[float, float] | None:
    """Return how many metres back (negative) and ahead a start may be shifted in its lane; None for nowhere."""
    lots = lots_of(base)
    spot = spot_of(lots, pose)
    if spot is None:
        return None
    k, along = spot
    lot = lots.places[k]
    return min(lot.low - along, 0.0), max(lot.high - along, 0.0)


def spot_of(lots: LaneStarts, pose: Pose) -> tuple[int, float] | None:
    """Return in which of the places where cars may start a start is, and after how many metres of its lane."""
    places = lots.places
    for k in lots.near.get(_square(pose.x, pose.y), ()):
        x, y, c, s, low, high, _ = places[k]
        if c * pose.c + s * pose.s > 1.0 - ON_LANE:
            dx, dy = pose.x - x, pose.y - y
            along = dx * c + dy * s
            if abs(dy * c - dx * s) < ON_LANE and low - ON_LANE < along < high + ON_LANE:
                return k, along
    return None


def pose_at(lots: LaneStarts, place: int, along: float) -> Pose:
    """Return the pose in a place where cars may start that is nearest to some metres of its lane."""
    x, y, c, s, low, high, _ = lots.places[place]
    far = min(max(along, low), high)
    return Pose(x + far * c, y + far * s, c, s)


def lots_of(base: Instance) -> LaneStarts:
    """Return where cars may start on the roads of an instance; kept with the network."""
    problem = base.problem
    key = _FREE, problem.car, problem.intersection_radius, problem.obstacles
    lots = problem.network.known.get(key)
    if lots is None:
        ground = Ground(problem.network, problem.car, problem.intersection_radius, problem.obstacles)
        lines, free = areas_of(ground).outside.tables()
        columns = np.column_stack((lines[free.lane], free.low, free.high)).tolist()
        places = [
            StartLane(x, y, c, s, low, high, lane)
            for (x, y, c, s, low, high), lane in zip(columns, free.lane.tolist(), strict=True)
        ]
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        for k, lot in enumerate(places):
            first.setdefault(lot.lane, k)
            last[lot.lane] = k
        ends = {lane: problem.network.lane_ends(lane) for lane in first}
        lots = problem.network.known[key] = LaneStarts(places, _near(places), first, last, ends)
    return lots  # pyright: ignore[reportReturnType]  # what stands under our own key


def _square(x: float, y: float) -> tuple[int, int]:
    return floor(x / SQUARE), floor(y / SQUARE)


def _near(places: list[StartLane]) -> dict[tuple[int, int], list[int]]:
    """Return the numbers of the places, ascending, that have a part in or beside each square."""
    near: dict[tuple[int, int], list[int]] = {}
    for k, (x, y, c, s, low, high, _) in enumerate(places):
        steps = 1 + floor((high - low) / SQUARE)
        met = {_square(x + far * c, y + far * s) for far in np.linspace(low, high, 1 + steps).tolist()}
        for i, j in {(i + di, j + dj) for i, j in met for di in (-1, 0, 1) for dj in (-1, 0, 1)}:
            near.setdefault((i, j), []).append(k)
    return near


_FREE = "falsify starts"


COMES, LEAVES, LEADS = 0.55, 0.7, 0.9
"""Up to which share of the cars brought to the ego they come to its crossing, are behind it, or are ahead of the ego;
the others are in the lane beside."""
PAUSES: Final = 0.7
"""Share of the cars ahead of the ego, or behind its crossing, that pause there."""


def joined(genome: Genome, base: Instance, cars: tuple[int, ...], dice: np.random.Generator) -> Genome:
    """Return a genome of which one e-agent starts where it meets the ego soon; the same where that can't be.

    It starts on another arm of the intersection to which the ego drives first, about as far away; on a road that leads
    away from there; ahead of the ego in its lane; or in the lane beside. One that is in the ego's way may pause.

    Parameters
    ----------
    genome, base
        What is changed, and the instance of the number `genome.base`.
    cars
        The cars whose starts may be changed.
    dice
        What the change follows from.
    """
    others = [car for car in cars if car != EGO and _is_free(base, car)]
    if not others:
        return genome
    car = others[int(dice.integers(len(others)))]
    lots = lots_of(base)
    kind, near = dice.random(), far_off(dice)
    place = _place(genome, base, lots, kind, near, dice)
    if place is None:
        return genome
    starts = starts_of(genome, base)
    starts[car] = pose_at(lots, *place)
    if COMES <= kind < LEADS and car in genome.tables and dice.random() < PAUSES:
        table = genome.tables[car].copy()
        low, high = choices.BOUNDS[CHOICE.PAUSE].tolist()
        table[0, CHOICE.PAUSE], table[0, CHOICE.PAUSE_AT] = low + (high - low) * dice.random(), 0.0
        genome = replace(genome, tables={**genome.tables, car: table})
    return started(genome, base, starts, {car: starts[car]})


def _is_free(base: Instance, car: int) -> bool:
    """Tell whether a car may be on any lane."""
    return base.e_agents[car - 1].driver.parameters.get("goes") != "loop"


def _place(
    genome: Genome, base: Instance, lots: LaneStarts, kind: float, near: float, dice: np.random.Generator
) -> tuple[int, float] | None:
    """Return the place where cars may start in which one meets the ego, and metres of its lane; None for none."""
    spot = spot_of(lots, genome.starts.get(EGO, base.starts[EGO]))
    if spot is None:
        return None
    (places, _, first, last, ends), (lot, along) = lots, spot
    lane = places[lot].lane
    vertex = ends[lane][1]
    if kind < LEAVES:
        end = 1 if kind < COMES else 0
        arms = [other for other in ends if other // 2 != lane // 2 and ends[other][end] == vertex]
        if not arms:
            return None
        arm = arms[int(dice.integers(len(arms)))]
        if kind < COMES:
            return last[arm], places[last[arm]].high - places[lot].high + along + near
        return first[arm], places[first[arm]].low + abs(near)
    if kind < LEADS:
        return lot, along + gap_radius(base.problem.car) + abs(near)
    beside = last.get(lane ^ 1)
    if beside is None:
        return None
    low, high = places[beside].low, places[beside].high
    return beside, low + (high - low) * dice.random()


OWN_CHOICE, OWN_START, JOINED, OTHERS_CAR = 0.55, 0.8, 0.9, 0.96
"""Up to which share of all changes a choice is changed, a start shifted, a car brought to the ego, a whole car taken
from elsewhere; of the rest the goals."""


def movable(configuration: Configuration) -> tuple[int, ...]:
    """Return the numbers of the cars whose starts a configuration leaves to chance; 0 is the ego."""
    ego = [EGO] if configuration.settings.ego.start == "drawn" else []
    drawn = [n for n, plan in enumerate(configuration.agents, start=1) if plan.start is None]
    return (*ego, *drawn)


def changed(
    genome: Genome, base: Instance, mate: tuple[Genome, Instance], cars: tuple[int, ...], dice: np.random.Generator
) -> Genome:  # fmt: skip
    """Return a genome with one thing changed; the same where the change that was drawn can't be made.

    Parameters
    ----------
    genome, base
        What is changed, and the instance of the number `genome.base`.
    mate
        The same of another, from which a car or the goals may be taken if it is on the same roads.
    cars
        The cars whose starts may be changed.
    dice
        What the change follows from.
    """
    kind = dice.random()
    other, others = mate
    alike = others.problem.network is base.problem.network and others.e_agents == base.e_agents
    chooses = bool(genome.choosing)
    if not cars and chooses:
        return _choosing(genome, base, dice)
    if OWN_CHOICE <= kind < OWN_START or not chooses:
        return _shifted(genome, base, cars, dice)
    if OWN_START <= kind < JOINED:
        return joined(genome, base, cars, dice)
    if kind < OWN_CHOICE or not alike:
        return _choosing(genome, base, dice)
    if kind < OTHERS_CAR:
        return _with_car(genome, base, other, others, cars, dice)
    starts = starts_of(genome, base)
    return replace(genome, base=other.base, starts={n: starts[n] for n in cars})


def _choosing(genome: Genome, base: Instance, dice: np.random.Generator) -> Genome:
    """Return a genome of which one choice of one car is changed, or one of its whims."""
    cars = genome.choosing
    car = cars[int(dice.integers(len(cars)))]
    if car in genome.whims:
        changed_whims = whims.mutated(dice, genome.whims[car], base.problem)
        return replace(genome, whims={**genome.whims, car: changed_whims})
    return replace(genome, tables={**genome.tables, car: choices.mutated(dice, genome.tables[car])})


def _shifted(genome: Genome, base: Instance, cars: tuple[int, ...], dice: np.random.Generator) -> Genome:
    """Return a genome of which one car starts elsewhere in its lane, as far from others as cars are drawn."""
    if not cars:
        return genome
    car = cars[int(dice.integers(len(cars)))]
    far = far_off(dice)
    starts = starts_of(genome, base)
    span = span_of(base, starts[car])
    if span is None:
        return genome
    back, ahead = span
    far = min(max(far, back), ahead)
    x, y, c, s = starts[car]
    starts[car] = Pose(x + far * c, y + far * s, c, s)
    return started(genome, base, starts, {car: starts[car]})


def _with_car(
    genome: Genome, base: Instance, other: Genome, others: Instance, cars: tuple[int, ...], dice: np.random.Generator
) -> Genome:  # fmt: skip
    """Return a genome of which one car starts where it does in another one, and chooses the same."""
    shared = sorted(set(genome.choosing) & set(other.choosing) & set(cars))
    if not shared:
        return genome
    car = shared[int(dice.integers(len(shared)))]
    starts = starts_of(genome, base)
    starts[car] = starts_of(other, others)[car]
    taken = (
        replace(genome, whims={**genome.whims, car: other.whims[car]})
        if car in genome.whims
        else replace(genome, tables={**genome.tables, car: other.tables[car]})
    )
    moved = started(taken, base, starts, {car: starts[car]})
    return genome if moved is taken else moved
