"""How Ctrl-C and SIGTERM are heard, so that they end a command with one line whenever they come."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from time import sleep
from types import FrameType
from typing import Any, NoReturn

SOON = 0.01
"""Seconds after which it comes again."""
_heard: dict[int, Any] = {}
"""Who heard the signals that have been heard once."""


@contextmanager
def heard_again() -> Generator[None]:
    """Let each Ctrl-C or SIGTERM that Python drops in the body come again, soon, without a word about it.

    Python drops whatever is raised in a destructor or in a callback of its imports. The program would go on as if
    nothing had been pressed, behind a traceback that nobody can do anything about.
    """
    before = sys.unraisablehook

    def hear(dropped: sys.UnraisableHookArgs) -> None:
        if not issubclass(dropped.exc_type, KeyboardInterrupt):
            before(dropped)
            return
        number = signal.SIGINT
        while True:
            try:
                number = next(iter(_heard), number)
                _as_if_unheard()
                _press_soon(number)
            except KeyboardInterrupt:
                continue  # it came in here: Python would drop it for good
            return

    sys.unraisablehook = hear
    try:
        yield
    finally:
        sys.unraisablehook = before


def interrupt(number: int, _frame: FrameType | None) -> NoReturn:
    """Hear a signal as Ctrl-C is heard; when it comes again it ends the process, whatever that is doing.

    So a controller that catches all that is raised can't keep a program from ending. What is finished is on the disk.
    """
    _heard[number] = signal.getsignal(number)
    signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt


def listen() -> None:
    """Hear Ctrl-C, unless whoever began this process ignores it, and SIGTERM."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)


def hear_no_more() -> None:
    """Ignore Ctrl-C and SIGTERM from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _as_if_unheard() -> None:
    """Let the next signal be heard as the first."""
    if threading.current_thread() is threading.main_thread():
        while _heard:
            signal.signal(*_heard.popitem())


def _press_soon(number: int) -> None:
    threading.Thread(target=_press, args=(number,), daemon=True).start()


def _press(number: int) -> None:
    sleep(SOON)
    main = threading.main_thread().ident
    if main is not None:
        signal.pthread_kill(main, number)
