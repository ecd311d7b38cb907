"""The processes that compile kernels in the background, as tests find them."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def companions(cache: Path) -> list[int]:
    """Return the companions that work for a cache."""
    found: list[int] = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            around = (folder / "environ").read_bytes().split(b"\0")
            ours = f"NUMBA_CACHE_DIR={cache}".encode() in around
            if ours and b"kernels.companion" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return found


def hurry(cache: Path) -> None:
    """Let the companions of a cache have a processor as others do, if this user may: beside busy tests none is left."""
    for process in companions(cache):
        with suppress(OSError):
            os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, process, 0)
            Path(f"/proc/{process}/autogroup").write_text("0")  # its session stands back as well
