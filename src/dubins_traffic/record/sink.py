"""Sinks, which receive the frames of a trial, and the ends of trials.

`dubins_traffic.protocols` offers these names beside the other seams; take them from there in the rooms above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance


class End(StrEnum):
    """Why a trial ended.

    The `peer_` ends are of drivers in other processes: no command for too long, gone and not back, more messages than
    anyone needs, what is no message. `transport_lost`: what carried the messages has failed. `world_lost`: the
    poses of a world that is not simulated here were missing, late, frozen or jumped. Four ends are of controllers in a
    box (docs/sandbox.md): more processor time, memory or printed text than it may use, and a box that can't be made.
    """

    DURATION = "duration"
    COLLISION = "collision"
    GAVE_UP = "gave_up"
    CONTROLLER_FAULT = "controller_fault"
    AGENT_FAULT = "agent_fault"
    DEADLINE = "deadline"
    INTERRUPTED = "interrupted"
    RESET = "reset"
    PEER_SILENT = "peer_silent"
    PEER_LOST = "peer_lost"
    PEER_FLOOD = "peer_flood"
    PEER_GARBAGE = "peer_garbage"
    TRANSPORT_LOST = "transport_lost"
    WORLD_LOST = "world_lost"
    OUT_OF_TIME = "out_of_time"
    OUT_OF_MEMORY = "out_of_memory"
    OUTPUT_FLOOD = "output_flood"
    BOX_FAILED = "box_failed"


BY_CONTROLLER: Final = frozenset(
    {
        End.GAVE_UP,
        End.CONTROLLER_FAULT,
        End.DEADLINE,
        End.PEER_SILENT,
        End.PEER_LOST,
        End.PEER_FLOOD,
        End.PEER_GARBAGE,
        End.OUT_OF_TIME,
        End.OUT_OF_MEMORY,
        End.OUTPUT_FLOOD,
    }
)
"""Ends that the ego's controller has brought about: such a trial is never clean (docs/rules.md#clean)."""
FAULTS: Final = BY_CONTROLLER | {End.AGENT_FAULT, End.TRANSPORT_LOST, End.WORLD_LOST, End.BOX_FAILED}
"""Ends that no trial should have: those of `BY_CONTROLLER`, and faults of an e-agent, a transport, a world or a box."""


SHIELD: Final = "shield"
"""Kind of the events that note that a shield has stepped in."""
DECIDED: Final = "decided"
"""Kind of the events that note who made a decision: a strategy of another tool, or the rules in its place."""
BY_STRATEGY: Final = "strategy"
BY_RULES: Final = "rules"
"""Details of these events."""


@dataclass(frozen=True, slots=True)
class Ending:
    """The named end of a trial, after `ticks` ticks, and a line of detail for people."""

    end: End
    ticks: int
    detail: str = ""

    @property
    def by_controller(self) -> bool:
        """Whether the ego's controller ended the trial."""
        return self.end in BY_CONTROLLER

    def __str__(self) -> str:
        return f"{self.end}: {self.detail}".rstrip(": ")


class Sink(Protocol):
    """Receives a trial, in order, in blocks of at most one simulated second."""

    def begin(self, instance: Instance) -> None:
        """Begin a trial."""
        ...

    def frames(self, frames: Frames) -> None:
        """Take the next block of frames, with their contacts and events."""
        ...

    def end(self, ending: Ending) -> None:
        """Take the ending of the trial; nothing follows."""
        ...
