"""A session whose cars are in a world outside: its options, and what is measured before its first trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import OUTSIDE, Instance
from dubins_traffic.runs.plan import check_simulator
from dubins_traffic.sessions.plan import Pace, SessionPlan, moved_by
from dubins_traffic.transports.external import ExternalWorld, Wire
from dubins_traffic.transports.tracked import LOSS, Measured


@dataclass(frozen=True, slots=True)
class Outside:
    """What a session was told of what moves its cars.

    Attributes
    ----------
    world : str
        The simulator's name that means a world outside.
    simulator : str, optional
        What moves the cars, whatever the source says.
    poses : str, optional
        Of such a world: the topic of each car's pose, ``{}`` in place of its name.
    delay, noise : float, optional
        Of such a world: how late commands take effect, seconds, and how far poses are off at most, metres; by default
        both are measured before the first trial.
    loss : float, optional
        Of such a world: the share of commands that may get lost; cars that reckon with any keep a larger margin.
    """

    world: str
    simulator: str | None
    poses: str | None
    delay: float | None
    noise: float | None
    loss: float | None

    def __bool__(self) -> bool:
        """Tell whether the cars are in a world outside."""
        return self.simulator == self.world

    def planned(self, plan: SessionPlan, pace: Pace, *, clock: bool, elsewhere: bool) -> SessionPlan:
        """Return the plan with this simulator; InputError if options don't go together.

        clock : whether `/clock` is published. elsewhere : whether another process is the maestro.
        """
        options = {"--poses": self.poses, "--delay": self.delay, "--noise": self.noise, "--loss": self.loss}
        for option, value in options.items():
            if value is not None and not self:
                expected = f"--simulator {self.world}"
                raise InputError("is of another world", file=option, value=value, expected=expected)
        if self.poses is not None and "{}" not in self.poses:
            expected = "such as /{}/pose"
            raise InputError("not a topic for every car", file="--poses", value=self.poses, expected=expected)
        if self and (pace.lockstep or clock or pace.factor != 1.0):
            expected = "neither --lockstep nor --clock nor --factor"
            raise InputError("a world outside has its own time", file="--simulator", expected=expected)
        if elsewhere and (pace.lockstep or pace.factor != 1.0):
            expected = "neither --lockstep nor --factor"
            raise InputError("another maestro has its own time", file="--maestro-elsewhere", expected=expected)
        if elsewhere and plan.append:
            expected = "--overwrite, or another folder: the other maestro tells other problems"
            raise InputError("both at once", file="--maestro-elsewhere, --append", expected=expected)
        if self.simulator is None:
            return plan
        if not self:
            if self.simulator in OUTSIDE:
                expected = f"{self.world} over this transport"
                raise InputError(
                    "a world of another transport",
                    file="--simulator",
                    value=self.simulator,
                    expected=expected,
                )
            check_simulator("--simulator", self.simulator)
        return replace(plan, supply=partial(moved_by, plan.supply, self.simulator))

    def made(self, wire: Wire, plan: SessionPlan) -> tuple[ExternalWorld, Callable[[Instance], Instance]]:
        """Return the world, and what describes its disturbances: it is measured before the first trial."""
        world = ExternalWorld(wire, ego=plan.controller is None, say=plan.say)
        known: list[Measured] = []

        def described(instance: Instance) -> Instance:
            problem, is_first = instance.problem, not known
            if is_first:
                measured = world.measure(instance, turn=self.delay is None)
                known.append(measured if self.delay is None else replace(measured, delay=self.delay))
            declared = known[0].disturbances(problem, self.noise, LOSS if self.loss is None else self.loss)
            if is_first:
                plan.say(known[0].told(problem, declared))
            return replace(instance, disturbances=declared)

        return world, described
