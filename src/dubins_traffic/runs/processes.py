"""Processes beside this one: how they are started, and that each ends: with its parent, whatever threads are left."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import connection
from multiprocessing.context import SpawnContext
from multiprocessing.util import Finalize
from threading import current_thread, main_thread
from time import monotonic
from typing import Final

from dubins_traffic.errors import DubinsTrafficError

PATIENCE: Final = 5.0
"""Seconds within which threads may come to their end after all else has."""
DEAF_TO: Final = (signal.SIGINT, signal.SIGTERM)
"""Signals that are held back while workers are started."""


def spawning() -> SpawnContext:
    """Return what starts processes that share locks with this one.

    Raises
    ------
    DubinsTrafficError
        If this machine has no locks that processes share.
    """
    context = multiprocessing.get_context("spawn")
    try:
        context.Lock()
    except OSError as error:
        raise DubinsTrafficError(
            f"no processes run beside this one, since they could share no lock ({error.strerror}): /dev/shm must be"
            " there and may be written; one process alone needs none"
        ) from None
    return context


def prepare_worker() -> None:
    """Let this process, which runs trials for another one, end with that one and whatever controllers leave behind.

    What controllers print goes to standard error.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    sys.stdout = sys.stderr
    Finalize(None, end_despite_threads, exitpriority=0)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the parent has ended and no one is left to take results, and end at once."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def deaf_to_interrupts() -> Generator[None]:
    """Hold Ctrl-C and SIGTERM back while workers are started; what came is heard afterwards.

    Workers inherit this, so Ctrl-C reaches the parent alone; `prepare_worker` lets them hear SIGTERM again. Other
    threads of this process may take a signal in the meantime, so that holding it back in this one is not enough.
    """
    came: list[int] = []
    mine = DEAF_TO if current_thread() is main_thread() else ()
    handlers = {number: handler for number in mine if callable(handler := signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, _frame: came.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, DEAF_TO)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in came[:1]:
            handlers[signal.Signals(number)](number, None)


def end_despite_threads(status: int = 0) -> None:
    """Let this process, which is about to end, end with `status` though threads go on that Python would wait for.

    They have `PATIENCE` seconds left; then a line on standard error names them, and they are ended with the process.
    """
    if _left():
        threading.Thread(target=_end, args=(status,), daemon=True).start()


def _left() -> list[threading.Thread]:
    main = threading.main_thread()
    return [each for each in threading.enumerate() if each is not main and not each.daemon]


def _end(status: int) -> None:
    until = monotonic() + PATIENCE
    for each in _left():
        each.join(max(0.0, until - monotonic()))
    left = _left()
    if not left:
        return
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    names = ", ".join(each.name for each in left[:3]) + (" and others" if len(left) > 3 else "")
    print(f"dubins-traffic: threads were left behind and are ended: {names}", file=sys.stderr, flush=True)
    os._exit(status)
