"""Ctrl-C is heard between two frames, never while a frame is made and handed to the sinks.

Otherwise some sinks would have a frame and others not: records without the last frame, metrics with a gap.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Final

_HEARD: Final = (signal.SIGINT, signal.SIGTERM)


class _Held(threading.local):
    """A body that no signal interrupts while `heard_between_frames` is in force; what came is heard at its end."""

    inside = 0
    came: Callable[[], object] | None = None

    def __enter__(self) -> None:
        self.inside += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.inside -= 1
        if self.came is not None and not self.inside:
            came, self.came = self.came, None
            came()


WHOLE: Final = _Held()
"""Within this, a frame is made and handed on as a whole."""


@contextmanager
def heard_between_frames() -> Generator[None]:
    """Hold back, in the body, what interrupts this process while it is `WHOLE`; elsewhere it is heard at once.

    Threads but the main one are never interrupted, and a signal that nobody handles in Python is left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _HEARD}
    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, _patient(handler))
    try:
        yield
    finally:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, handler)


def _patient(handler: Callable[[int, FrameType | None], object]) -> Callable[[int, FrameType | None], None]:
    def hear(number: int, frame: FrameType | None) -> None:
        if WHOLE.inside:
            WHOLE.came = lambda: handler(number, None)
        else:
            handler(number, frame)

    return hear
