"""Starts processes beside this one, and ends each when its parent has ended, however that has happened."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from multiprocessing import connection
from multiprocessing.context import SpawnContext
from multiprocessing.util import Finalize

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.runs.left_threads import end_despite_threads


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
