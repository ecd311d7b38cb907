"""A problem: what a controller is given. An instance: a problem and what a controller is not given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf, sqrt
from typing import TYPE_CHECKING, Any, Self

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.read_only import read_only
from dubins_traffic.cars.state import Pose
from dubins_traffic.display import Pictured, count
from dubins_traffic.kernels.random import CUT
from dubins_traffic.problem.preconditions import check_curves

if TYPE_CHECKING:
    from dubins_traffic.problem.parts import Disturbances, Laser
    from dubins_traffic.roads.network import RoadNetwork

OUTSIDE = frozenset({"ros1-world", "ros2-world"})
"""Worlds outside, whose commands come late and whose poses are noisy of themselves: disturbances describe them."""
FREE = "free"
NUDGED = "nudged"
"""The kind of e-agent that does what another kind does, delayed and with noise."""


def _undisturbed() -> Disturbances:
    from dubins_traffic.problem.parts import Disturbances  # Pydantic, which no box is to load

    return Disturbances()


@dataclass(frozen=True, slots=True)
class EAgent:
    """An e-agent: `kind` is the name of its kind here (`wander`), `type` that in the document (`wander/wander`)."""

    kind: str
    name: str
    type: str
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def driver(self) -> EAgent:
        """The e-agent that decides this one's commands: itself, or of a nudged one the kind that it delays.

        Of a free one that is the law, at top speed: it gives way to it where it must.
        """
        if self.kind == FREE:
            return EAgent("lawful", self.name, self.type, {"goes": "wander", "speed": inf})
        if self.kind != NUDGED:
            return self
        return EAgent(self.parameters["kind"], self.name, self.type, self.parameters["parameters"])


@dataclass(frozen=True, slots=True)
class Problem(Pictured):
    """What a controller is given before a trial.

    `goals` are lattice points (x, y) of intersections; `goal_vertices` their numbers in `network.intersections`.
    `rules` holds the parameters of docs/rules.md by name, empty where the rules are not to be judged; `formulas` the
    texts of what is judged beside the task, by name. Neither can be changed. The ego's commands
    take effect `command_delay` ticks late, `command_loss` is the share of them that is lost, and `pose_noise` holds the
    standard deviations of the poses that its driver sees (m, rad): normal, cut at three of them (`Disturbances`).
    """

    network: RoadNetwork
    goals: tuple[tuple[float, float], ...]
    intersection_radius: float
    car: Car
    rate: float
    sensing_radius: float
    laser: Laser | None
    obstacles: tuple[Obstacle, ...]
    e_agents: tuple[str, ...]
    rules: Mapping[str, Any]
    formulas: Mapping[str, str] = field(default_factory=dict[str, str])
    command_delay: int = 0
    pose_noise: tuple[float, float] = (0.0, 0.0)
    command_loss: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "rules", read_only(self.rules))
        object.__setattr__(self, "formulas", read_only(self.formulas))

    def __deepcopy__(self, memo: object) -> Self:
        """Return this object itself, which is immutable."""
        return self

    def __repr__(self) -> str:
        return f"<Problem: {self.summary}>"

    @property
    def summary(self) -> str:
        """The problem in a few words."""
        parts = [self.network.summary, count(len(self.goals), "goal")]
        if self.e_agents:
            parts.append(count(len(self.e_agents), "e-agent"))
        if self.obstacles:
            parts.append(count(len(self.obstacles), "obstacle"))
        parts += ["rules"] * bool(self.rules) + ["formulas"] * bool(self.formulas)
        return ", ".join(parts)

    @property
    def goal_vertices(self) -> tuple[int, ...]:
        """Numbers of the goals' intersections."""
        return self.network.vertices(self.goals)

    @property
    def period(self) -> float:
        """Seconds of a tick, T = 1 / rate."""
        return 1.0 / self.rate

    @property
    def off_centre(self) -> float:
        """How far a centre may be from where it is seen, metres."""
        return sqrt(2.0) * (CUT * self.pose_noise[0])

    @property
    def blur(self) -> float:
        """How far any point of a car may be from where it is seen, metres."""
        return self.off_centre + self.car.body.reach * (CUT * self.pose_noise[1])

    @property
    def unsure(self) -> float:
        """How far any point of a driver's own car may be from where it expects it, metres.

        Where commands get lost it includes the way of one tick. More than one in a row are not reckoned with.
        """
        return self.blur + (self.car.bounds.speed * self.period if self.command_loss else 0.0)


def _disturbed(problem: Problem, by: Disturbances) -> Problem:
    """Return a problem with the delay, noise and loss of disturbances: itself if it has them."""
    told = (by.command_delay, (by.position_noise, by.heading_noise), by.command_loss)
    if (problem.command_delay, problem.pose_noise, problem.command_loss) == told:
        return problem
    return replace(problem, command_delay=told[0], pose_noise=told[1], command_loss=told[2])


@dataclass(frozen=True, slots=True)
class Instance(Pictured):
    """One instance: everything that, with a controller, decides a trial.

    `starts` holds one pose per car, the ego first, then `e_agents` in order. `duration` is in seconds. All random
    numbers of the trial follow from (`seed`, `trial`).
    """

    problem: Problem
    starts: tuple[Pose, ...]
    duration: float
    e_agents: tuple[EAgent, ...]
    seed: int
    trial: int
    disturbances: Disturbances = field(default_factory=_undisturbed)
    end_on_collision: bool = False
    simulator: str = "embedded"
    extra: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        problem = _disturbed(self.problem, self.disturbances)
        object.__setattr__(self, "problem", problem)
        if not problem.network.is_straight:
            check_curves(problem.network, problem.intersection_radius, problem.car, problem.rules)

    def __deepcopy__(self, memo: object) -> Self:
        """Return this object itself, which is immutable."""
        return self

    def __repr__(self) -> str:
        return f"<Instance: {self.title}, {self.duration:g} s; {self.problem.summary}>"

    @property
    def title(self) -> str:
        """The trial in words: ``trial 2 of seed 4``."""
        return f"trial {self.trial} of seed {self.seed}"

    @property
    def ticks(self) -> int:
        """Number of ticks K = round(duration * rate); the trial has K + 1 frames."""
        return round(self.duration * self.problem.rate)

    @property
    def added(self) -> Disturbances:
        """The disturbances that the trial adds to what its world does: a world outside has its own."""
        return _undisturbed() if self.simulator in OUTSIDE else self.disturbances

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cars, `ego` first."""
        return ("ego", *(agent.name for agent in self.e_agents))
