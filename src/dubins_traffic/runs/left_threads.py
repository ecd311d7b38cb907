"""Threads that a controller has begun and left behind: no process waits for them for ever."""

from __future__ import annotations

import os
import sys
import threading
from time import monotonic
from typing import Final

PATIENCE: Final = 5.0
"""Seconds within which threads may come to their end after all else has."""


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
