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
        self._missed = dict.fromkeys(cars, 0)
        """Ticks for which each car has had no command by now."""
        self._longest = dict.fromkeys(cars, 0)
        """The most such ticks between two of its commands."""

    def answered(self, car: str, seconds: float) -> None:
        """Note that a command of `car` came so long after its frame."""
        if self.answers[car]:
            self._longest[car] = max(self._longest[car], self._missed[car])
        self._missed[car] = 0
        self.answers[car].append(max(0.0, seconds))

    def missed(self, car: str) -> None:
        """Note that no command of `car` came within a tick."""
        self.late[car] += 1
        self._missed[car] += 1

    def fades(self, car: str) -> bool:
        """Tell whether `car` has been without a command for longer than ever between two of its commands.

        Who has sent one command at most has no habit from which to tell.
        """
        return len(self.answers[car]) > 1 and self._missed[car] > self._longest[car]

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
