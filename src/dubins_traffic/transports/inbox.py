"""What has arrived from remote drivers: the latest command of each car and nothing more, and how punctual it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from threading import Condition
from time import monotonic
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.protocols import End
from dubins_traffic.record.wall import summary

MOST_PLACES = 10_000


@dataclass(slots=True)
class Slot:
    """The latest command of one car, and what is counted of its peer.

    `tick` is the frame that it says it answers; `fresh` whether it came since the last frame was sent; `arrived` when,
    monotonic seconds, None before the first, and `began` when the first did. `gone_since` is set while a peer that
    was there is away. `peers` is how many there were at most at a time, 0 where the transport does not know.
    """

    speed: float = 0.0
    yaw_rate: float = 0.0
    tick: int | None = None
    fresh: bool = False
    arrived: float | None = None
    began: float | None = None
    gone_since: float | None = None
    fault: tuple[End, str] | None = None
    commands: int = 0
    reconnections: int = 0
    peers: int = 0
    window: float = 0.0
    in_window: int = 0


class Inbox:
    """A `protocols.Mailbox` of bounded memory: one slot a car.

    Parameters
    ----------
    flood : int
        Commands a second of one car above which its peer is at fault.
    """

    def __init__(self, flood: int) -> None:
        self.condition = Condition()
        self.warn: Callable[[str], None] = lambda _line: None
        """Called, with a line for people, when something is odd but nobody's fault."""
        self.paused = False
        self.unknown = 0
        self.returned = 0
        self._flood = flood
        self._slots: dict[str, Slot] = {}
        self._peers: dict[str, int] = {}
        self._stop: tuple[End, str] | None = None
        self._places: dict[str, Pose] = {}

    def expect(self, cars: Sequence[str]) -> None:
        """Begin a trial in which the commands of `cars` are wanted; peers that are there stay there."""
        with self.condition:
            self._slots = {car: Slot(peers=self._peers.get(car, 0)) for car in cars}
            self.unknown = 0
            if self._stop is not None and self._stop[0] is not End.TRANSPORT_LOST:
                self._stop = None

    def slot(self, car: str) -> Slot:
        """Return the slot of `car`; hold `condition` while reading more than one field."""
        return self._slots[car]

    @property
    def stopped(self) -> tuple[End, str] | None:
        """Why all is to end, if it is."""
        return self._stop

    def stale(self) -> None:
        """A frame is about to be sent: what is here does not answer it."""
        with self.condition:
            for slot in self._slots.values():
                slot.fresh = False

    def command(self, car: str, speed: float, yaw_rate: float, tick: int | None = None) -> None:
        """Keep a command in place of the one before."""
        now = monotonic()
        with self.condition:
            slot = self._slots.get(car)
            if slot is None:
                self.unknown += 1
                return
            slot.commands += 1
            if now - slot.window >= 1.0:
                slot.window, slot.in_window = now, 0
            slot.in_window += slot.fresh  # the first answer to a frame was asked for
            if slot.in_window > self._flood and slot.fault is None:
                slot.fault = (End.PEER_FLOOD, f"more than {self._flood} commands in a second")
            slot.speed, slot.yaw_rate, slot.tick = speed, yaw_rate, tick
            slot.fresh, slot.arrived = True, now
            slot.began = now if slot.began is None else slot.began
            self.condition.notify_all()

    def fault(self, car: str, end: End, detail: str) -> None:
        """Keep the first fault of a car's peer."""
        with self.condition:
            slot = self._slots.get(car)
            if slot is not None and slot.fault is None:
                slot.fault = (end, detail)
            self.condition.notify_all()

    def joined(self, car: str) -> None:
        """Count a peer in."""
        with self.condition:
            self._peers[car] = peers = self._peers.get(car, 0) + 1
            slot = self._slots.get(car)
            if slot is not None:
                slot.peers = max(slot.peers, peers)
            if slot is not None and slot.gone_since is not None:
                slot.gone_since = None
                slot.reconnections += 1
                self.returned += 1
            self.condition.notify_all()
        if slot is not None and peers > 1:
            self.warn(f"{peers} programs send commands for {car} at once: the latest command counts")

    def left(self, car: str) -> None:
        """Count a peer out."""
        with self.condition:
            peers = self._peers.pop(car, 0) - 1
            if peers > 0:
                self._peers[car] = peers
            slot = self._slots.get(car)
            if slot is not None and peers <= 0:
                slot.gone_since = monotonic()
            self.condition.notify_all()

    def stop(self, end: End, detail: str) -> None:
        """Keep the first reason to stop; a lost transport overrides it."""
        with self.condition:
            if self._stop is None or end is End.TRANSPORT_LOST:
                self._stop = (end, detail)
            self.condition.notify_all()

    def pause(self, paused: bool) -> None:
        """Keep it."""
        with self.condition:
            self.paused = paused
            self.condition.notify_all()

    def place(self, car: str, pose: Pose) -> None:
        """Keep where a car shall be, of the cars that there are."""
        with self.condition:
            if car in self._places or len(self._places) < MOST_PLACES:
                self._places[car] = pose
            self.condition.notify_all()

    def placed(self) -> dict[str, Pose]:
        """Return where cars shall be, once."""
        with self.condition:
            places, self._places = self._places, {}
        return places

    @property
    def news(self) -> bool:
        """Whether cars shall be placed."""
        return bool(self._places)

    def wake(self) -> None:
        """Let who waits look again."""
        with self.condition:
            self.condition.notify_all()


class Punctuality:
    """Counts late commands and measures answers and frames of one trial."""

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
