"""How Ctrl-C and SIGTERM are heard, so that they end a command with one line whenever they come."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from time import sleep
from types import FrameType
from typing import NoReturn

SOON = 0.01
"""Seconds after which it comes again."""


@contextmanager
def heard_again() -> Generator[None]:
    """Let each Ctrl-C that Python drops in the body come again, soon, without a word about it.

    Python drops whatever is raised in a destructor or in a callback of its imports. The program would go on as if
    nothing had been pressed, behind a traceback that nobody can do anything about.
    """
    before = sys.unraisablehook

    def hear(dropped: sys.UnraisableHookArgs) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            threading.Thread(target=_press, daemon=True).start()
        else:
            before(dropped)

    sys.unraisablehook = hear
    try:
        yield
    finally:
        sys.unraisablehook = before


def interrupt(number: int, _frame: FrameType | None) -> NoReturn:
    """Hear a signal as Ctrl-C is heard; when it comes again it does what it does to programs that don't listen."""
    signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt


def hear_no_more() -> None:
    """Ignore Ctrl-C and SIGTERM from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _press() -> None:
    sleep(SOON)
    main = threading.main_thread().ident
    if main is not None:
        signal.pthread_kill(main, signal.SIGINT)
