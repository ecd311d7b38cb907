"""A maestro that is not ours: it says which problem is to be solved, and when the trial is over."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock


class ForeignMaestro:
    """What another maestro tells, from any thread: problems, and the ends of trials.

    A problem is told once and taken once; an empty text ends the trial that runs, and takes back a problem that nobody
    has taken.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._told: str | None = None
        self._text = ""
        self._over = True
        self.news: Callable[[], None] = lambda: None
        """Called when a problem has been told, or a trial is over."""

    def tell(self, text: str) -> None:
        """Take what the maestro has published; what it publishes twice counts once."""
        with self._lock:
            if text == self._text:
                return
            self._text = text
            self._told, self._over = (text, False) if text else (None, True)
        self.news()

    @property
    def asks(self) -> bool:
        """Whether there is a problem that nobody has taken."""
        return self._told is not None

    @property
    def over(self) -> bool:
        """Whether no trial runs, for the maestro."""
        return self._over

    def take(self) -> str | None:
        """Return the problem that has been told, once."""
        with self._lock:
            told, self._told = self._told, None
        return told
