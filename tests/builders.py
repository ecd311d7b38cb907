"""The processes that compile kernels beside others, as tests find them."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def builders(cache: Path) -> list[int]:
    """Return the builders that work for a cache."""
    found: list[int] = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            around = (folder / "environ").read_bytes().split(b"\0")
            ours = f"NUMBA_CACHE_DIR={cache}".encode() in around
            if ours and b"compiling.builder" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return found


def hurry(cache: Path) -> None:
    """Let the builders of a cache have a processor as others do: beside busy tests none is left for them.

    Where this user may not take back that a builder stands back, whoever waits for it gets another after a while.
    """
    for process in builders(cache):
        with suppress(ProcessLookupError, PermissionError):
            os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, process, 0)
            with suppress(OSError):
                Path(f"/proc/{process}/autogroup").write_text("0")  # its session stands back as well
