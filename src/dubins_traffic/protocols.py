"""The seams: what a simulator, a driver, a controller, a sink must be. No room above may ask for more.

The order of events in a tick is that of `docs/semantics.md`: sense, decide, clip, move, label, push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from dubins_traffic.cars.state import Command, Contact, Labels, Observation, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import End, Ending, Sink

__all__ = ["Capabilities", "Closes", "Controller", "Driver", "End", "Ending", "Simulator", "Sink"]


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a simulator can do: step many trials at once, give equal bytes for equal seeds, wait for commands."""

    batched: bool
    deterministic: bool
    lockstep: bool


class Simulator(Protocol):
    """Moves the cars. One conformance suite runs on every simulator."""

    @property
    def capabilities(self) -> Capabilities:
        """What this simulator can do."""
        ...

    def reset(self, instances: Sequence[Instance]) -> State:
        """Place the cars of a batch; the returned state is this simulator's own, updated in place by `step`."""
        ...

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip `commands` (B, N, 2: speed, yaw rate) in place, move for one tick, return each trial's contacts."""
        ...

    def close(self) -> None:
        """Free what the simulator holds."""
        ...


class Driver(Protocol):
    """Drives some of the cars of a batch (built-in e-agents; a controller made to fit)."""

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a batch whose first frame is `state`."""
        ...

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of this driver's cars for [t_k, t_k+1) into `commands` (B, N, 2)."""
        ...


class Controller(Protocol):
    """Drives the ego. A class without arguments that has these methods; `close` may be left out."""

    def start(self, problem: Problem) -> None:
        """Learn the problem; the wall-clock time of this call is the *time to begin*."""
        ...

    def act(self, observation: Observation) -> Command | tuple[float, float] | None:
        """Choose speed (m/s) and yaw rate (rad/s) for the coming tick. None gives up."""
        ...


@runtime_checkable
class Closes(Protocol):
    """A controller that wants to know that its trial is over."""

    def close(self) -> None:
        """Free what is held."""
        ...
