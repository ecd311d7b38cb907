"""What this machine can enforce, found by trying, and which mechanism enforces it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from typing import Final

from dubins_traffic.errors import shown
from dubins_traffic.sandbox import cgroups, launch, seccomp
from dubins_traffic.sandbox.layers import BOX, CLOCK, MEMORY, PROCESSES, RLIMITS, SECCOMP, Layers
from dubins_traffic.sandbox.limits import Limits

WAIT: Final = 60.0
"""Seconds within which a probe of a mechanism ends, on however busy a machine."""


@cache
def available_layers() -> Layers:
    """Return the layers that hold on this machine for this user."""
    why = _why_no_box()
    folders = cgroups.trees().folders
    absent = [
        name for name, tree in ((MEMORY, "memory"), (PROCESSES, "pids"), (CLOCK, "cpuacct")) if tree not in folders
    ]
    if seccomp.binding() is None:
        absent.append(SECCOMP)
    return Layers(why=why).without(*absent, *(BOX if why else ()))


def held(layers: Layers) -> Iterator[tuple[str, str]]:
    """Yield each limit and the mechanism that enforces it with these layers, "" for none."""
    box = "bubblewrap" if layers.boxes else ""
    group = f"cgroup v{cgroups.trees().version}"
    root = os.getuid() == 0
    user = "setpriv: a user of its own" if root else "user namespace"
    yield "files of the host", box and f"{box}: mount namespace, the system read-only"
    yield "processes of the host", box and f"{box}: pid namespace, a /proc of its own"
    yield "network, abstract sockets", box and f"{box}: network namespace"
    yield "shared memory, queues", box and f"{box}: ipc namespace"
    yield "environment", f"{box or 'this process'}: cleared"
    yield "privileges", box and f"{user}, no capabilities, no_new_privs, no user namespaces"
    yield "system calls", "seccomp: an allow-list, by libseccomp" if SECCOMP in layers else ""
    yield (
        "memory",
        f"{group}: memory" if MEMORY in layers else "RLIMIT_AS of each process, and their sum is watched",
    )
    yield (
        "buffers of pipes, sockets",
        f"{group}: memory" if MEMORY in layers else "their number is watched" if SECCOMP in layers else "",
    )
    yield "page tables, own files", f"{group}: memory" if MEMORY in layers else box and "watched, in that sum"
    yield (
        "all else in the kernel",
        f"{group}: memory"
        if MEMORY in layers
        else "not held: what its processes, threads and open files take, whose number is",
    )
    yield "processes", f"{group}: pids, and RLIMIT_NPROC" if PROCESSES in layers else box and "RLIMIT_NPROC"
    yield "processor time", f"{group}: its clock" if CLOCK in layers else "the clocks of its processes"
    yield "wall clock, lines, output", "this process"
    yield "its own files", f"{box}: a sized tmpfs, and RLIMIT_FSIZE" if box else "RLIMIT_FSIZE"
    yield "open files, core dumps", "RLIMIT_NOFILE, RLIMIT_CORE"
    yield "ends with its worker", f"{box}: PR_SET_PDEATHSIG, pid namespace" if box else ""


def _why_no_box() -> str:
    """Return why bubblewrap can't make a box here, "" if it can."""
    if shutil.which("bwrap") is None:
        return "it is not installed"
    command = launch.command_line(
        launch.Program(("/bin/true",)), Limits(), Layers().without(RLIMITS), doors=(), seccomp=-1
    )
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=WAIT, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return shown(str(error), 200)
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return "" if done.returncode == 0 else shown(lines[-1] if lines else f"status {done.returncode}", 200)
