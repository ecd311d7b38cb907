"""The time with which messages are stamped: the wall clock's, or simulated time that never stands still."""

from __future__ import annotations

from time import time

from dubins_traffic.protocols import View


class Stamps:
    """Time of a session, from one trial to the next, and while a world is only shown.

    Parameters
    ----------
    interval : float
        Seconds by which time goes on with each view of a world that stands still.
    clock : bool
        Whether stamps are simulated time; else the wall clock's.
    """

    def __init__(self, interval: float, *, clock: bool) -> None:
        self._interval, self._clock = interval, clock
        self._before = 0.0
        self._shown = 0.0

    def begin(self) -> None:
        """Go on with the time of a new trial."""
        self._before += self._shown
        self._shown = 0.0

    def see(self, view: View) -> None:
        """Take the time of a view that is about to be sent."""
        if view.running and view.time > 0.0:
            self._shown = max(self._shown, view.time)
        else:
            self._before += self._interval

    @property
    def simulated(self) -> float:
        """Simulated seconds since the session began."""
        return self._before + self._shown

    def now(self) -> float:
        """Return the stamp of what is sent now, seconds."""
        return self.simulated if self._clock else time()
