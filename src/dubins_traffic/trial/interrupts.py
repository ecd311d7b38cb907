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

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class _Held(threading.local):
    """A `with` block that no signal interrupts inside `heard_between_frames`; a signal is handled when it ends."""

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
"""The `with` block in which a frame is made and handed to the sinks as a whole."""


@contextmanager
def heard_between_frames() -> Generator[None]:
    """Hold SIGINT and SIGTERM back while the process is within `WHOLE`; elsewhere in the body handle them at once.

    Only the main thread is ever interrupted. A signal without a handler in Python keeps its default action.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, _deferring(handler))
    try:
        yield
    finally:
        for number, handler in before.items():
            # Who has been heard once keeps its default action, so that the second ends a process in a later trial, too.
            if callable(handler) and signal.getsignal(number) is not signal.SIG_DFL:
                signal.signal(number, handler)


def _deferring(handler: Callable[[int, FrameType | None], object]) -> Callable[[int, FrameType | None], None]:
    """Return a handler that does as `handler`, but only after the process has left `WHOLE`."""

    def hear(number: int, frame: FrameType | None) -> None:
        if WHOLE.inside:
            WHOLE.came = lambda: handler(number, None)
        else:
            handler(number, frame)

    return hear
