"""A scripted driver for the page of `play`: a lane keeper looks on, and all it does is press keys in the browser."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event, Thread
from typing import Any

from selenium import webdriver

from dubins_traffic.cars.state import Contact, Labels, Observation, State
from dubins_traffic.controllers import registry
from dubins_traffic.live.feed import Feed
from dubins_traffic.problem.instance import Instance

KEEPER = f"{Path(__file__).resolve().parents[1] / 'examples' / 'lane_keeper.py'}:LaneKeeper"
UP, LEFT, RIGHT = ("ArrowUp", 38), ("ArrowLeft", 37), ("ArrowRight", 39)
SLOWLY = 0.8
"""Share of the lane keeper's speed at which keys are precise enough."""
DEAD = 0.35
"""Yaw rate, rad/s, below which no key is pressed."""


class Eyes:
    """A feed that also keeps what the ego sees; the driver looks at it."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self.seen: Observation | None = None
        self.new = Event()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._feed, name)

    def begin(self, instance: Instance) -> None:
        self._feed.begin(instance)

    def watch(
        self,
        tick: int,
        state: State,
        labels: Labels,
        contacts: Sequence[Contact],
        observe: Callable[[], Observation],
    ) -> None:
        self.seen = observe()
        self.new.set()
        self._feed.watch(tick, state, labels, contacts, observe)


class KeyDriver(Thread):
    """Drives by key presses until it is told to stop."""

    def __init__(self, browser: webdriver.Chrome, eyes: Eyes, instance: Instance) -> None:
        super().__init__(daemon=True)
        self._browser, self._eyes = browser, eyes
        self._keeper = registry.load(KEEPER)
        self._keeper.start(instance.problem)
        self._down: set[tuple[str, int]] = set()
        self.over = Event()

    def run(self) -> None:
        while not self.over.is_set():
            if not self._eyes.new.wait(0.5):
                self._nudge()
                continue
            self._eyes.new.clear()
            seen = self._eyes.seen
            assert seen is not None
            self._press(self._keys(seen))
        self._press(set())

    def _keys(self, seen: Observation) -> set[tuple[str, int]]:
        """The keys that bring speed and yaw rate nearest to those of the lane keeper."""
        command = self._keeper.act(seen)
        assert command is not None
        speed, yaw_rate = command
        keys = {UP} if SLOWLY * speed > seen.twist.speed + 0.02 else set()
        if yaw_rate > DEAD:
            keys.add(LEFT)
        elif yaw_rate < -DEAD:
            keys.add(RIGHT)
        return keys

    def _nudge(self) -> None:
        """Press a key for a moment: the clock starts with the first."""
        self._press({LEFT})
        self._press(set())

    def _press(self, keys: set[tuple[str, int]]) -> None:
        for kind, changed in (("keyUp", self._down - keys), ("keyDown", keys - self._down)):
            for name, number in changed:
                key = {"type": kind, "code": name, "key": name, "windowsVirtualKeyCode": number}
                self._browser.execute_cdp_cmd("Input.dispatchKeyEvent", key)
        self._down = keys
