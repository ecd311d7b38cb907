"""What must be known of a trial to label and to judge it, and which trials have most of it in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeVar

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Ints, distinct
from dubins_traffic.roads.network import RoadNetwork


class Judged(Protocol):
    """What labeller and referee ask of a problem (`problem.instance.Problem`)."""

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
    """What labeller and referee ask of an instance (`problem.instance.Instance`)."""

    @property
    def problem(self) -> Judged:
        """What is judged."""
        ...

    @property
    def starts(self) -> Sequence[Pose]:
        """One pose per car."""
        ...


JudgedT = TypeVar("JudgedT", bound=Judged)


def kinds_of(problems: Sequence[JudgedT]) -> tuple[list[JudgedT], Ints]:
    """Return problems that stand for all others, and which of them stands for each (B,).

    The others differ from them in the roads, the goals and the obstacles at most.
    """
    first, index = distinct(
        [
            (id(own.rules), id(own.car), own.intersection_radius, own.rate, own.sensing_radius)
            for own in problems
        ]
    )
    return [problems[k] for k in first], index
