"""How punctual a trial with remote drivers was: what stands in the sidecar of its record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.record.wall import summary
from dubins_traffic.transports.inbox import Slot


class Punctuality:
    """Counts late commands and measures answers and frames of one trial.

    Parameters
    ----------
    cars : sequence of str
        Names of the remote cars.
    """

    def __init__(self, cars: Sequence[str]) -> None:
        self.late = dict.fromkeys(cars, 0)
        """Commands of each car that did not come within their tick."""
        self.answers: dict[str, list[float]] = {car: [] for car in cars}
        """Seconds from each frame to its answer."""
        self.behind: list[float] = []
        """Seconds by which frames were sent later than due."""
        self.slipped = 0.0
        """Seconds by which the trial was put off in all."""

    def slip(self, behind: float, tick: float) -> bool:
        """Note that a frame is `behind` seconds late; return whether it has slipped, by more than a `tick`."""
        self.behind.append(behind)
        if behind <= tick:
            return False
        self.slipped += behind
        return True

    def drivers(self, slots: Mapping[str, Slot]) -> Mapping[str, Any]:
        """Return what there is to say of each driver, by car."""
        return {
            car: {
                "commands": slot.commands,
                "late": self.late[car],
                "reconnections": slot.reconnections,
                "peers": slot.peers,
                "answer_s": summary(self.answers[car]),
            }
            for car, slot in slots.items()
        }

    def frames(self) -> Mapping[str, Any]:
        """Return what there is to say of the frames."""
        return {"frame_lateness_s": summary(self.behind), "slipped_s": self.slipped}
