"""Flat observations: a frame as a vector of numbers from -1 to 1, in a car's own frame of reference.

The vector has these parts, one after another (`Layout`); docs/learning.md says what each number is:

- ``own``: speed and yaw rate, and the propositions of the car itself.
- ``lane``: where it is on its lane.
- ``crossing``: the next crossing.
- ``goal``: the goal that it seeks, and the way there.
- ``clocks``: for how long it has stood, waited for its turn and been left, and when it forfeits its turn.
- ``obstacles``: the nearest parts of obstacles that it sees, nearest first; zeros where there are fewer.
- ``cars``: the nearest other cars that it sees, nearest first, each with its propositions; zeros where there are fewer.
- ``laser``: ranges, where there is a laser.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Labels, Observation, State, put_observed
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.calls import bound
from dubins_traffic.learning.flat_kernel import write_flat
from dubins_traffic.learning.outlook import SIZE, new_outlook
from dubins_traffic.learning.seeking import look
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.propositions import NAMES

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

SHOWN = 5
"""Default number of other cars that are shown."""
_FLAGS = tuple(NAMES)[: SIZE.FLAGS]
_OWN = ("speed", "yaw_rate", *_FLAGS)
_LANE = ("on_lane", "offset", "heading_cos", "heading_sin", "progress", "to_end")
_CROSSING = ("x", "y", "roads", "crosses", "at", "is_goal")
_GOAL = ("sought", "bearing_cos", "bearing_sin", "distance", "route", "turn_cos", "turn_sin", "to_do")
_CLOCKS = ("standing", "waiting", "forfeit", "left")
_OBSTACLE = ("seen", "x", "y", "reach")
_CAR = (
    "seen",
    "x",
    "y",
    "heading_cos",
    "heading_sin",
    "speed",
    "yaw_rate",
    "same_lane",
    "same_crossing",
    *_FLAGS,
)


@dataclass(frozen=True)
class Layout:
    """What stands where in a flat observation.

    Parameters
    ----------
    cars : int
        Other cars that are shown, at most.
    rays : int
        Rays of the laser, 0 without one.
    """

    cars: int = SHOWN
    rays: int = 0

    @staticmethod
    def of(problem: Problem, cars: int = SHOWN) -> Layout:
        """Return the layout for a problem."""
        return Layout(cars, 0 if problem.laser is None else problem.laser.rays)

    @cached_property
    def parts(self) -> dict[str, slice]:
        """Where each part stands, by its name; without those that are empty."""
        sizes = {
            "own": SIZE.OWN,
            "lane": SIZE.LANE,
            "crossing": SIZE.CROSSING,
            "goal": SIZE.GOAL,
            "clocks": SIZE.CLOCKS,
            "obstacles": SIZE.OBSTACLE * SIZE.OBSTACLES,
            "cars": SIZE.CAR * self.cars,
            "laser": self.rays,
        }
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(ends[k], ends[k + 1]) for k, name in enumerate(sizes) if sizes[name]}

    @property
    def size(self) -> int:
        """Length of the vector, F."""
        return max(part.stop for part in self.parts.values())

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each number, as ``lane.offset`` or ``cars[0].speed``."""
        fixed = (
            ("own", _OWN),
            ("lane", _LANE),
            ("crossing", _CROSSING),
            ("goal", _GOAL),
            ("clocks", _CLOCKS),
        )
        names = [f"{part}.{name}" for part, parts in fixed for name in parts]
        names += [f"obstacles[{k}].{name}" for k in range(SIZE.OBSTACLES) for name in _OBSTACLE]
        names += [f"cars[{k}].{name}" for k in range(self.cars) for name in _CAR]
        return (*names, *(f"laser[{k}]" for k in range(self.rays)))


class FlatObserver:
    """Makes the flat observation of each tick from a controller's observations; the bits equal those in a batch.

    Call it exactly once per tick, since it keeps which goals have been visited.

    Parameters
    ----------
    problem : Problem
        The problem of the trial.
    cars : int
        Other cars that are shown, at most.

    Attributes
    ----------
    layout : Layout
        Names and places of the numbers.

    Examples
    --------
    >>> class Driver:                                               # doctest: +SKIP
    ...     def start(self, problem):
    ...         self.observe = FlatObserver(problem)
    ...     def act(self, observation):
    ...         return policy(self.observe(observation))
    """

    def __init__(self, problem: Problem, cars: int = SHOWN) -> None:
        self.layout = Layout.of(problem, cars)
        places = 1 + len(problem.e_agents)
        self._state, self._labels = State.zeros(1, places), Labels.zeros(1, places)
        roads = pack([problem.network], [problem.car.lane_width])
        around = self._state, self._labels, pack_cars([problem.car]), pack_obstacles([problem.obstacles])
        nets = np.zeros(1, dtype=np.int64)
        self._tables = new_outlook([problem], nets, roads, around, cars)
        self._tables.trial[0].sight2 = np.inf
        self._look, self._write = bound(look), bound(write_flat)

    def __call__(self, observation: Observation) -> npt.NDArray[np.float32]:
        """Return the vector of an observation, (F,)."""
        put_observed(self._state, self._labels, observation)
        if observation.scan is not None:
            self._tables.ranges[0] = observation.scan
        self._look(0, self._tables)
        out = np.empty(self.layout.size, dtype=np.float32)
        self._write(0, EGO, out, self._tables)
        return out

    @property
    def visits(self) -> int:
        """Number of visits of goals so far."""
        return self._tables.trial[0].visits
