"""The processes that compile kernels in the background, as tests find them."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from time import sleep


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
    """Let the companions of a cache have a processor as others do: beside busy tests none is left for them.

    Where this user may not take back that a companion stands back, one that does not stand back goes on in its place.
    """
    for process in companions(cache):
        try:
            os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, process, 0)
        except PermissionError:
            replace(process, cache)
            continue
        except ProcessLookupError:
            continue
        with suppress(OSError):
            Path(f"/proc/{process}/autogroup").write_text("0")  # its session stands back as well


def replace(process: int, cache: Path) -> None:
    """End a companion, and begin another that does not stand back; what the first was at is still asked for."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    while process in companions(cache):
        sleep(0.01)
    around = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "DUBINS_TRAFFIC_KERNELS": "auto"}
    words = [sys.executable, "-m", "dubins_traffic.kernels.companion"]
    os.spawnve(os.P_NOWAIT, words[0], words, around)
