"""What labeller, referee and vocabulary read of problems and instances, and which problems are alike in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeVar

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Ints, distinct
from dubins_traffic.roads.network import RoadNetwork


class JudgedProblem(Protocol):
    """What this room reads of a problem (`problem.instance.Problem`)."""

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
        """What all cars are."""
        ...

    @property
    def rate(self) -> float:
        """Control rate, Hz."""
        ...

    @property
    def sensing_radius(self) -> float:
        """Sensing radius, metres."""
        ...

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """The static obstacles."""
        ...

    @property
    def goals(self) -> Sequence[tuple[float, float]]:
        """Lattice points of the goals."""
        ...

    @property
    def goal_vertices(self) -> Sequence[int]:
        """Numbers of the goals' intersections."""
        ...

    @property
    def rules(self) -> Mapping[str, Any]:
        """The parameters of the rules by name; empty if the problem is not judged by them."""
        ...


class JudgedInstance(Protocol):
    """What this room reads of an instance (`problem.instance.Instance`)."""

    @property
    def problem(self) -> JudgedProblem:
        """The problem."""
        ...

    @property
    def starts(self) -> Sequence[Pose]:
        """The start of each car, the ego's first."""
        ...

    @property
    def names(self) -> Sequence[str]:
        """The name of each car, the ego's first."""
        ...


ProblemT = TypeVar("ProblemT", bound=JudgedProblem)


def distinct_problems(problems: Sequence[ProblemT]) -> tuple[list[ProblemT], Ints]:
    """Return problems of which no two are alike but for roads, goals and obstacles, and for each the like one, (B,).

    What follows from rules, car, radii and rate alone need be computed once for each problem that is returned.
    """
    first, index = distinct(
        [
            (
                id(problem.rules),
                id(problem.car),
                problem.intersection_radius,
                problem.rate,
                problem.sensing_radius,
            )
            for problem in problems
        ]
    )
    return [problems[k] for k in first], index
